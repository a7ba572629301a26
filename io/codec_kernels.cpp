#include "io/codec_kernels.h"

#include <algorithm>
#include <bit>
#include <type_traits>

// Bodies are forced inline into wrappers that only differ in the instructions they may use. A
// wrapper per width, chosen by hand, works with every sanitizer, which ifunc resolvers do not.
#if defined(__x86_64__) && defined(__GNUC__)
#define VARVE_CODEC_X86 1
#endif
#define VARVE_INLINE inline __attribute__((always_inline))

namespace varve::io::codec {
namespace {

template <class T>
VARVE_INLINE T value_of(ImageOf<T> bits) {
  if constexpr (std::is_floating_point_v<T>) {
    return std::bit_cast<T>(bits);
  } else {
    return static_cast<T>(bits);
  }
}

/// sum[i] += products of `Count` differences, in their order.
template <class T, unsigned Count>
VARVE_INLINE void add_products(const T* const* differences, const T* weights, std::size_t n,
                               T* sum) {
  const T* const d0 = differences[0];
  const T* const d1 = Count > 1 ? differences[1] : d0;
  const T* const d2 = Count > 2 ? differences[2] : d0;
  const T* const d3 = Count > 3 ? differences[3] : d0;
  const T w0 = weights[0];
  const T w1 = Count > 1 ? weights[1] : T{};
  const T w2 = Count > 2 ? weights[2] : T{};
  const T w3 = Count > 3 ? weights[3] : T{};
  for (std::size_t i = 0; i < n; ++i) {
    T s = static_cast<T>(sum[i] + static_cast<T>(w0 * d0[i]));
    if constexpr (Count > 1) {
      s = static_cast<T>(s + static_cast<T>(w1 * d1[i]));
    }
    if constexpr (Count > 2) {
      s = static_cast<T>(s + static_cast<T>(w2 * d2[i]));
    }
    if constexpr (Count > 3) {
      s = static_cast<T>(s + static_cast<T>(w3 * d3[i]));
    }
    sum[i] = s;
  }
}

template <class T>
VARVE_INLINE void predict_body(const ImageOf<T>* newest, const T* const* differences,
                               const T* weights, unsigned order, std::size_t n,
                               ImageOf<T>* image) {
  alignas(64) T sum[block_values];
  std::fill_n(sum, n, T{});
  unsigned j = 0;
  for (; j + 4 <= order; j += 4) {
    add_products<T, 4>(differences + j, weights + j, n, sum);
  }
  switch (order - j) {
    case 3: add_products<T, 3>(differences + j, weights + j, n, sum); break;
    case 2: add_products<T, 2>(differences + j, weights + j, n, sum); break;
    case 1: add_products<T, 1>(differences + j, weights + j, n, sum); break;
    default: break;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const auto predicted = static_cast<T>(value_of<T>(newest[i]) + sum[i]);
    if constexpr (std::is_floating_point_v<T>) {
      const auto bits = std::bit_cast<ImageOf<T>>(predicted);
      image[i] = image_of_bits<T>(predicted == predicted ? bits : newest[i]);
    } else {
      image[i] = predicted;
    }
  }
}

template <class T>
VARVE_INLINE void fold_body(const ImageOf<T>* bits, const ImageOf<T>* predicted, std::size_t n,
                            ImageOf<T>* folded) {
  for (std::size_t i = 0; i < n; ++i) {
    folded[i] = zigzag<ImageOf<T>>(image_of_bits<T>(bits[i]) - predicted[i]);
  }
}

template <class T>
VARVE_INLINE void unfold_body(const ImageOf<T>* folded, const ImageOf<T>* predicted, std::size_t n,
                              ImageOf<T>* bits) {
  for (std::size_t i = 0; i < n; ++i) {
    bits[i] = bits_of_image<T>(predicted[i] + unzigzag(folded[i]));
  }
}

template <class T>
VARVE_INLINE void advance_body(const ImageOf<T>* bits, ImageOf<T>* newest, T* difference,
                               std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    difference[i] = static_cast<T>(value_of<T>(bits[i]) - value_of<T>(newest[i]));
    newest[i] = bits[i];
  }
}

#define VARVE_KERNEL_SET(NAME, TARGET)                                                            \
  template <class T>                                                                              \
  struct NAME {                                                                                   \
    using U = ImageOf<T>;                                                                         \
    TARGET static void predict(const U* newest, const T* const* differences, const T* weights,    \
                               unsigned order, std::size_t n, U* image) {                         \
      predict_body<T>(newest, differences, weights, order, n, image);                             \
    }                                                                                             \
    TARGET static void fold(const U* bits, const U* predicted, std::size_t n, U* folded) {        \
      fold_body<T>(bits, predicted, n, folded);                                                   \
    }                                                                                             \
    TARGET static void unfold(const U* folded, const U* predicted, std::size_t n, U* bits) {      \
      unfold_body<T>(folded, predicted, n, bits);                                                 \
    }                                                                                             \
    TARGET static void advance(const U* bits, U* newest, T* difference, std::size_t n) {          \
      advance_body<T>(bits, newest, difference, n);                                               \
    }                                                                                             \
    static constexpr Kernels<T> table{predict, fold, unfold, advance};                            \
  };

VARVE_KERNEL_SET(Baseline, )
#ifdef VARVE_CODEC_X86
VARVE_KERNEL_SET(Avx2, __attribute__((target("avx2,bmi,bmi2"))))
VARVE_KERNEL_SET(Avx512, __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,bmi,bmi2"))))
#endif

template <class T>
const Kernels<T>& choose() {
#ifdef VARVE_CODEC_X86
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")) {
    return Avx512<T>::table;
  }
  if (__builtin_cpu_supports("avx2")) {
    return Avx2<T>::table;
  }
#endif
  return Baseline<T>::table;
}

}  // namespace

template <class T>
const Kernels<T>& kernels() {
  static const Kernels<T>& chosen = choose<T>();
  return chosen;
}

template const Kernels<double>& kernels<double>();
template const Kernels<float>& kernels<float>();
template const Kernels<std::uint64_t>& kernels<std::uint64_t>();
template const Kernels<std::uint32_t>& kernels<std::uint32_t>();
template const Kernels<std::uint8_t>& kernels<std::uint8_t>();

}  // namespace varve::io::codec
