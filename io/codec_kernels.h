// The codec's inner loops over blocks of values. Each exists once in the source and is compiled for
// several widths of vector registers; the widest that the machine has is chosen when the program
// starts. All of them are element-wise, so the width cannot reach a bit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "io/codec_image.h"

namespace varve::io::codec {

/// Values that one kernel call handles at most: its scratch stays in the first-level cache.
inline constexpr std::size_t block_values = 1024;

template <class T>
struct Kernels {
  using U = ImageOf<T>;
  /// image[i] of newest[i] + sum_j weights[j] * differences[j][i], summed from j = 0 upwards from
  /// +0 in T. Where the sum is not a number: the image of newest[i]. n <= block_values.
  void (*predict)(const U* newest, const T* const* differences, const T* weights, unsigned order,
                  std::size_t n, U* image);
  /// folded[i] = zigzag(image of bits[i] - predicted[i]).
  void (*fold)(const U* bits, const U* predicted, std::size_t n, U* folded);
  /// Inverse of fold.
  void (*unfold)(const U* folded, const U* predicted, std::size_t n, U* bits);
  /// difference[i] = bits[i] - newest[i] as values; newest[i] = bits[i].
  void (*advance)(const U* bits, U* newest, T* difference, std::size_t n);
};

/// The kernels for this machine.
template <class T>
const Kernels<T>& kernels();

}  // namespace varve::io::codec
