// The second stage of prediction: what the extrapolation left over is itself predicted, value by
// value, by the candidate that did best for that value lately. Particles in smooth flow thereby get
// a higher order than those in rough flow, and the running error tells how long a residual to
// expect.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/codec_kernels.h"

namespace varve::io::codec {

/// Memory of the second stage for one field, component-major as in Track.
class Stage {
 public:
  /// Forgets everything; the next frame finds zeros for `values` values.
  void reset(std::size_t values);
  std::size_t values() const { return values_; }
  /// Follows a change of particles as Track::remap does; new ones start with zeros.
  void remap(std::span<const std::uint64_t> sources, std::uint32_t components);
  /// Values from `first` on. The incoming residuals replace the oldest.
  StageBlock block(std::size_t first) const;
  /// All blocks of a frame were learnt.
  void end_frame() { newest_ = (newest_ + past_residuals - 1) % past_residuals; }
  /// Lowest level of all candidates of a value.
  unsigned level(std::size_t value) const;

 private:
  float* past(unsigned age) const {
    return past_.get() + (newest_ + age) % past_residuals * stride_;
  }
  std::uint16_t* level_of(unsigned candidate) const { return level_.get() + candidate * stride_; }

  std::size_t values_ = 0;
  std::size_t stride_ = 0;
  unsigned newest_ = 0;
  std::unique_ptr<float[]> past_;
  std::unique_ptr<std::uint16_t[]> level_;
};

}  // namespace varve::io::codec
