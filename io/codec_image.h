// Integer images of scalars. An image orders like the value it stands for, so that a good
// prediction gives a small integer difference, also across powers of two and across zero; it is a
// bijection on the bits, so that NaN payloads and -0 survive.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace varve::io::codec {

/// The unsigned integer that holds the bits of T: 64 bits wide for f64 and u64, else 32.
template <class T>
using ImageOf = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;

/// Image of the value with these bits: negative values reversed below, positive ones above.
template <class T>
constexpr ImageOf<T> image_of_bits(ImageOf<T> bits) {
  if constexpr (std::is_floating_point_v<T>) {
    using Signed = std::make_signed_t<ImageOf<T>>;
    constexpr int top = sizeof(T) * 8 - 1;
    const auto negative = static_cast<ImageOf<T>>(static_cast<Signed>(bits) >> top);
    return bits ^ (negative | (ImageOf<T>{1} << top));
  } else {
    return bits;
  }
}

/// Inverse of image_of_bits.
template <class T>
constexpr ImageOf<T> bits_of_image(ImageOf<T> image) {
  if constexpr (std::is_floating_point_v<T>) {
    using Signed = std::make_signed_t<ImageOf<T>>;
    constexpr int top = sizeof(T) * 8 - 1;
    const auto positive = static_cast<ImageOf<T>>(static_cast<Signed>(image) >> top);
    return image ^ (~positive | (ImageOf<T>{1} << top));
  } else {
    return image;
  }
}

/// Small differences of either sign become small unsigned numbers: 0, -1, 1, -2 ... -> 0, 1, 2, 3
/// ...
template <class U>
constexpr U zigzag(U difference) {
  using Signed = std::make_signed_t<U>;
  constexpr int top = sizeof(U) * 8 - 1;
  return (difference << 1) ^ static_cast<U>(static_cast<Signed>(difference) >> top);
}

/// Inverse of zigzag.
template <class U>
constexpr U unzigzag(U folded) {
  return (folded >> 1) ^ (U{0} - (folded & U{1}));
}

/// Number of bits needed to write `folded`: 0 for 0, 1 for 1, 2 for 2 and 3 ...
template <class U>
constexpr unsigned bit_length(U folded) {
  return static_cast<unsigned>(std::bit_width(folded));
}

/// Bits of a scalar at any address, in host order.
template <class T>
ImageOf<T> load_bits(const std::byte* at) {
  if constexpr (sizeof(T) == sizeof(ImageOf<T>)) {
    ImageOf<T> bits;
    std::memcpy(&bits, at, sizeof bits);
    return bits;
  } else {
    static_assert(sizeof(T) == 1);
    return static_cast<ImageOf<T>>(*at);
  }
}

template <class T>
void store_bits(std::byte* at, ImageOf<T> bits) {
  if constexpr (sizeof(T) == sizeof(ImageOf<T>)) {
    std::memcpy(at, &bits, sizeof bits);
  } else {
    *at = static_cast<std::byte>(bits);
  }
}

}  // namespace varve::io::codec
