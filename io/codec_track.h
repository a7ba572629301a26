// What encoder and decoder remember of one field: its newest values and the differences between the
// frames before, component by component. Both sides keep exactly the same numbers.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/codec_extrapolate.h"
#include "io/codec_image.h"
#include "io/codec_kernels.h"

namespace varve::io::codec {

/// Old index of a particle that did not exist before.
inline constexpr std::uint64_t no_source = ~std::uint64_t{0};

/// Frames are particle-major (x0 y0 x1 y1 ...), the memory is component-major (x0 x1 ... y0 y1
/// ...): value v = component * count + particle.
template <class T>
class Track {
 public:
  using U = ImageOf<T>;

  explicit Track(std::uint32_t components) : components_(components) {}
  std::uint64_t count() const { return count_; }
  std::uint32_t components() const { return components_; }
  std::size_t values() const { return newest_.size(); }
  /// Differences known: the highest order of prediction.
  unsigned depth() const { return depth_; }
  /// Bits of the newest values, component-major.
  std::span<const U> newest() const { return newest_; }

  /// The differences between two consecutive frames, newest first; age < depth().
  const T* difference(unsigned age) const { return planes_[(head_ + age) % order_max].data; }

  /// The frame becomes all that is known.
  void restart(std::span<const std::byte> frame, std::uint64_t count);
  /// Follows a change of particles: new particle i was sources[i], or is new (no_source) and then
  /// has zeros for its past.
  void remap(std::span<const std::uint64_t> sources);
  /// Images predicted for values [first, first + n), all of one component; n <= block_values.
  void predict(const Weights& weights, std::size_t first, std::size_t n, U* image) const;
  /// What these weights would have left over `age` frames ago (0: at the newest one), in units in
  /// the last place; zeros where the history does not reach that far. Floating types only.
  void look_back(const Weights& weights, unsigned age, std::size_t first, std::size_t n,
                 float* residual) const;
  /// Bits of values [first, first + n) of a frame, all of one component.
  void gather(std::span<const std::byte> frame, std::size_t first, std::size_t n, U* bits) const;
  /// Writes them into a frame.
  void scatter(const U* bits, std::size_t first, std::size_t n, std::span<std::byte> frame) const;

  /// Calls work(first, n) for blocks that cover all values and lie within one component each.
  template <class Work>
  void for_blocks(Work&& work) const {
    for (std::size_t component = 0; component < components_; ++component) {
      for (std::size_t at = 0; at < count_; at += block_values) {
        work(component * count_ + at, std::min<std::size_t>(block_values, count_ - at));
      }
    }
  }

  /// Between begin_frame and end_frame, every value of the new frame is handed over once, in
  /// blocks, each after its last prediction: the new differences overwrite the oldest ones.
  void begin_frame();
  void advance(const U* bits, std::size_t first, std::size_t n);
  void end_frame();
  /// A new frame whose differences nobody needs: the newest values become `bits`, the past is
  /// forgotten.
  void replace(std::span<const U> bits);

 private:
  /// One frame's differences. The start is shifted by another multiple of a cache line for each, so
  /// that equal indices do not fall into one set of the cache.
  struct Plane {
    std::unique_ptr<T[]> memory;
    std::size_t size = 0;
    T* data = nullptr;
  };
  /// Byte of value `first` in a frame.
  std::size_t offset_in_frame(std::size_t first) const {
    const std::size_t component = first / count_;
    return ((first - component * count_) * components_ + component) * sizeof(T);
  }
  struct Terms {
    std::array<const T*, order_max + 1> differences{};
    std::array<T, order_max> factors{};
  };
  /// Differences from age `age` on, at value `first`; weights in T.
  Terms terms(const Weights& weights, unsigned age, unsigned count, std::size_t first) const;
  void resize_plane(std::size_t slot, std::size_t size);
  /// Slot that the next frame's differences go to.
  std::size_t incoming() const { return (head_ + order_max - 1) % order_max; }

  std::uint32_t components_;
  std::uint64_t count_ = 0;
  unsigned depth_ = 0;
  std::size_t head_ = 0;  ///< slot of the newest difference
  std::vector<U> newest_;
  std::array<Plane, order_max> planes_;
};

}  // namespace varve::io::codec
