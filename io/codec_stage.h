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

/// Largest level: no error needs more bits.
inline constexpr int level_max = 4500;

/// Candidate whose level candidate j inherits.
constexpr unsigned inherited(unsigned j, int step) {
  const int k = static_cast<int>(j) + step;
  const int last = static_cast<int>(candidates) - 1;
  return static_cast<unsigned>(k < 0 ? 0 : k > last ? last : k);
}

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
  float* past(unsigned age) const {
    return past_.get() + (newest_ + age) % past_residuals * stride_;
  }
  unsigned level(unsigned candidate, std::size_t value) const {
    return level_of(candidate)[value];
  }
  /// Other weights leave other residuals: the level of candidate j becomes that of candidate
  /// j + step, or of the nearest there is, plus shifts[j].
  void rebase_levels(int step, const std::array<std::int16_t, candidates>& shifts);

 private:
  std::uint16_t* level_of(unsigned candidate) const { return level_.get() + candidate * stride_; }

  std::size_t values_ = 0;
  std::size_t stride_ = 0;
  unsigned newest_ = 0;
  std::unique_ptr<float[]> past_;
  std::unique_ptr<std::uint16_t[]> level_;
};

}  // namespace varve::io::codec
