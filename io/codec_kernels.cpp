#include "io/codec_kernels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>

#include "io/codec_dispatch.h"

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

/// `Stride` 0: known only when the program runs.
template <class T, std::size_t Stride>
VARVE_INLINE void gather_strided(const std::byte* at, std::size_t components, std::size_t n,
                                 ImageOf<T>* bits) {
  const std::size_t stride = (Stride == 0 ? components : Stride) * sizeof(T);
  for (std::size_t i = 0; i < n; ++i) {
    bits[i] = load_bits<T>(at + i * stride);
  }
}

template <class T, std::size_t Stride>
VARVE_INLINE void scatter_strided(const ImageOf<T>* bits, std::size_t components, std::size_t n,
                                  std::byte* at) {
  const std::size_t stride = (Stride == 0 ? components : Stride) * sizeof(T);
  for (std::size_t i = 0; i < n; ++i) {
    store_bits<T>(at + i * stride, bits[i]);
  }
}

template <class T>
VARVE_INLINE void gather_body(const std::byte* at, std::size_t components, std::size_t n,
                              ImageOf<T>* bits) {
  switch (components) {
    case 1: return gather_strided<T, 1>(at, components, n, bits);
    case 2: return gather_strided<T, 2>(at, components, n, bits);
    case 3: return gather_strided<T, 3>(at, components, n, bits);
    default: return gather_strided<T, 0>(at, components, n, bits);
  }
}

template <class T>
VARVE_INLINE void scatter_body(const ImageOf<T>* bits, std::size_t components, std::size_t n,
                               std::byte* at) {
  switch (components) {
    case 1: return scatter_strided<T, 1>(bits, components, n, at);
    case 2: return scatter_strided<T, 2>(bits, components, n, at);
    case 3: return scatter_strided<T, 3>(bits, components, n, at);
    default: return scatter_strided<T, 0>(bits, components, n, at);
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

/// Four times the binary logarithm of |x|, roughly: exponent and two bits of a float. 4 for 1.
VARVE_INLINE std::int32_t quarter_bits(float x) {
  const auto bits = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(x) & 0x7fffffffu);
  const std::int32_t quarters = (bits >> 21) - (126 << 2);
  return quarters < 0 ? 0 : quarters;
}

template <class T>
VARVE_INLINE void expect_body(const StageBlock& block, const ImageOf<T>* base, std::size_t n,
                              ImageOf<T>* predicted, Expectation* expected) {
  using Signed = std::make_signed_t<ImageOf<T>>;
  constexpr float limit = sizeof(T) == 8 ? 4.0e18f : 1.0e9f;  // conversion to Signed is safe
  alignas(64) float step[block_values];
  alignas(64) std::int32_t code[block_values];
  const float* const r1 = block.past[0];
  const float* const r2 = block.past[1];
  const float* const r3 = block.past[2];
  const float* const r4 = block.past[3];
  const std::uint16_t* const level0 = block.level[0];
  const std::uint16_t* const level1 = block.level[1];
  const std::uint16_t* const level2 = block.level[2];
  const std::uint16_t* const level3 = block.level[3];
  for (std::size_t i = 0; i < n; ++i) {
    const float d1 = r1[i] - r2[i];
    const float d2 = r2[i] - r3[i];
    const float line = r1[i] + d1;
    const float parabola = 3 * d1 + r3[i];
    const float line_before = r2[i] + d2;
    const float parabola_before = 3 * d2 + r4[i];
    std::int32_t level = level0[i];
    float next = 0;
    float error = r1[i];
    std::int32_t other = level1[i];
    next = other < level ? r1[i] : next;
    error = other < level ? d1 : error;
    level = other < level ? other : level;
    other = level2[i];
    next = other < level ? line : next;
    error = other < level ? r1[i] - line_before : error;
    level = other < level ? other : level;
    other = level3[i];
    next = other < level ? parabola : next;
    error = other < level ? r1[i] - parabola_before : error;
    level = other < level ? other : level;

    const std::int32_t change = quarter_bits(error) * 16 - level;
    const std::int32_t fine = level >> 5;
    const std::int32_t coarse = level >> 6;
    const std::int32_t height = level < 256 ? fine : level < 512 ? 4 + coarse : 12 + (fine & 1);
    const std::int32_t trend =
        (change >= -95) + (change >= -31) + (change >= 32) + (change >= 96);
    const std::int32_t offset = level < 512 ? 0 : coarse - 8;
    const std::int32_t negative = error < 0 ? 128 : 0;
    step[i] = next > -limit && next < limit ? next : 0.0f;
    code[i] = (height * 5 + trend) | negative | (offset << 8);
  }
  for (std::size_t i = 0; i < n; ++i) {
    predicted[i] = base[i] + static_cast<ImageOf<T>>(static_cast<Signed>(step[i]));
  }
  for (std::size_t i = 0; i < n; ++i) {
    expected[i].context = static_cast<std::uint8_t>(code[i]);
    expected[i].offset = static_cast<std::uint8_t>(code[i] >> 8);
  }
}

/// Moves a running mean an eighth of the way to the newest error.
VARVE_INLINE std::uint16_t moved_level(std::int32_t level, float error) {
  return static_cast<std::uint16_t>(level + ((quarter_bits(error) * 16 - level + 4) >> 3));
}

template <class T>
VARVE_INLINE void learn_body(const StageBlock& block, const ImageOf<T>* bits,
                             const ImageOf<T>* base, std::size_t n) {
  using Signed = std::make_signed_t<ImageOf<T>>;
  alignas(64) float residual[block_values];
  for (std::size_t i = 0; i < n; ++i) {
    residual[i] = static_cast<float>(static_cast<Signed>(image_of_bits<T>(bits[i]) - base[i]));
  }
  const float* const r1 = block.past[0];
  const float* const r2 = block.past[1];
  const float* const r3 = block.past[2];
  std::uint16_t* const level0 = block.level[0];
  std::uint16_t* const level1 = block.level[1];
  std::uint16_t* const level2 = block.level[2];
  std::uint16_t* const level3 = block.level[3];
  for (std::size_t i = 0; i < n; ++i) {
    const float r = residual[i];
    const float d1 = r1[i] - r2[i];
    level0[i] = moved_level(level0[i], r);
    level1[i] = moved_level(level1[i], r - r1[i]);
    level2[i] = moved_level(level2[i], r - (r1[i] + d1));
    level3[i] = moved_level(level3[i], r - (3 * d1 + r3[i]));
  }
  std::copy_n(residual, n, block.incoming);
}

/// 2 to the power of -e, where 2 to the power of e is the unit in the last place of a value with
/// these bits. Where that leaves the range of T: the largest power.
template <class T>
VARVE_INLINE T units_per_one(ImageOf<T> bits) {
  using U = ImageOf<T>;
  constexpr int mantissa = sizeof(T) == 8 ? 52 : 23;
  constexpr U bias = sizeof(T) == 8 ? 1023 : 127;
  const U exponent = (bits & ~(U{1} << (sizeof(T) * 8 - 1))) >> mantissa;
  const U inverse = 2 * bias + mantissa - (exponent == 0 ? U{1} : exponent);
  return std::bit_cast<T>((inverse > 2 * bias ? 2 * bias : inverse) << mantissa);
}

template <class T>
VARVE_INLINE void look_back_body(const ImageOf<T>* newest, const T* const* differences,
                                 const T* weights, unsigned order, std::size_t n,
                                 float* residual) {
  constexpr T limit = static_cast<T>(1e18);
  alignas(64) T sum[block_values];
  std::fill_n(sum, n, T{});
  for (unsigned j = 0; j < order; ++j) {
    add_products<T, 1>(differences + 1 + j, weights + j, n, sum);
  }
  const T* const difference = differences[0];
  for (std::size_t i = 0; i < n; ++i) {
    const T left = static_cast<T>(difference[i] - sum[i]) * units_per_one<T>(newest[i]);
    residual[i] = left > -limit && left < limit ? static_cast<float>(left) : 0.0f;
  }
}

/// Lengths are found by way of a float's exponent: vectors have no instruction of their own for it.
/// Of neighbouring bits only the highest stays, so that the conversion cannot round up to the next
/// power of two. Several short loops, each of one width, since mixed ones stay scalar.
template <class T>
VARVE_INLINE void tokenise_body(ImageOf<T>* residuals, const Expectation* expected, std::size_t n,
                                Token* tokens) {
  using U = ImageOf<T>;
  alignas(64) float half[block_values];          // about half the magnitude
  alignas(64) std::uint32_t code[block_values];  // sign and lowest bit, then length and sign
  for (std::size_t i = 0; i < n; ++i) {
    const U sign = residuals[i] >> (sizeof(U) * 8 - 1);
    const U magnitude = (residuals[i] ^ (U{0} - sign)) + sign;
    const U halved = magnitude >> 1;
    half[i] = static_cast<float>(static_cast<std::make_signed_t<U>>(halved & ~(halved >> 1)));
    code[i] = static_cast<std::uint32_t>((magnitude & 1) | sign << 1);
    residuals[i] = magnitude;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t exponent = std::bit_cast<std::uint32_t>(half[i]) >> 23;
    const std::uint32_t length = exponent != 0 ? exponent - 125 : code[i] & 1;
    code[i] = length * 2 + (code[i] >> 1);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const U length = code[i] >> 1;
    const U highest = (U{1} << (length & (sizeof(U) * 8 - 1))) >> 1;
    residuals[i] &= length == sizeof(U) * 8 ? ~(U{1} << (sizeof(U) * 8 - 1)) : ~highest;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t length = code[i] >> 1;
    const std::uint32_t sign = code[i] & 1;
    const std::uint32_t nonzero = length != 0 ? 1 : 0;
    const std::uint32_t offset = expected[i].offset;
    const std::uint32_t disagree = sign ^ (static_cast<std::uint32_t>(expected[i].context) >> 7);
    const std::uint32_t symbol = (length - offset) * 2 + disagree;
    const std::uint32_t long_enough = length > offset ? 1 : 0;
    const std::uint32_t fits = symbol < tans_symbols ? long_enough : 0;
    const std::uint32_t written = fits != 0 ? symbol : tans_escape;
    const std::uint32_t raw = length - nonzero;
    const std::uint32_t known = nonzero != 0 ? written : 0;
    const std::uint32_t column = raw > raw_bits_max ? long_column : known;
    const std::uint32_t context = expected[i].context & 0x7f;
    tokens[i].word = (context * table_columns + column) | known << Token::symbol_at |
                     nonzero << Token::nonzero_at | sign << Token::negative_at |
                     raw << Token::raw_at;
  }
}

#define VARVE_KERNEL_SET(NAME, TARGET)                                                            \
  template <class T>                                                                              \
  struct NAME {                                                                                   \
    using U = ImageOf<T>;                                                                         \
    TARGET static void gather(const std::byte* at, std::size_t components, std::size_t n,         \
                              U* bits) {                                                          \
      gather_body<T>(at, components, n, bits);                                                    \
    }                                                                                             \
    TARGET static void scatter(const U* bits, std::size_t components, std::size_t n,              \
                               std::byte* at) {                                                   \
      scatter_body<T>(bits, components, n, at);                                                   \
    }                                                                                             \
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
    TARGET static void expect(const StageBlock& block, const U* base, std::size_t n,              \
                              U* predicted, Expectation* expected) {                              \
      if constexpr (std::is_floating_point_v<T>) {                                                \
        expect_body<T>(block, base, n, predicted, expected);                                      \
      }                                                                                           \
    }                                                                                             \
    TARGET static void learn(const StageBlock& block, const U* bits, const U* base,               \
                             std::size_t n) {                                                     \
      if constexpr (std::is_floating_point_v<T>) {                                                \
        learn_body<T>(block, bits, base, n);                                                      \
      }                                                                                           \
    }                                                                                             \
    TARGET static void look_back(const U* newest, const T* const* differences, const T* weights,  \
                                 unsigned order, std::size_t n, float* residual) {                \
      if constexpr (std::is_floating_point_v<T>) {                                                \
        look_back_body<T>(newest, differences, weights, order, n, residual);                      \
      }                                                                                           \
    }                                                                                             \
    TARGET static void tokenise(U* residuals, const Expectation* expected, std::size_t n,         \
                                Token* tokens) {                                                  \
      tokenise_body<T>(residuals, expected, n, tokens);                                           \
    }                                                                                             \
    TARGET static void subtract(const U* bits, const U* predicted, std::size_t n, U* residuals) { \
      for (std::size_t i = 0; i < n; ++i) {                                                       \
        residuals[i] = image_of_bits<T>(bits[i]) - predicted[i];                                  \
      }                                                                                           \
    }                                                                                             \
    TARGET static void add(const U* residuals, const U* predicted, std::size_t n, U* bits) {      \
      for (std::size_t i = 0; i < n; ++i) {                                                       \
        bits[i] = bits_of_image<T>(predicted[i] + residuals[i]);                                  \
      }                                                                                           \
    }                                                                                             \
    static constexpr Kernels<T> table{gather, scatter, predict, fold,      unfold,     subtract,  \
                                      add,    expect,  learn,   look_back, tokenise,   advance};  \
  };

// Integers have no second stage.
VARVE_KERNEL_SET(Baseline, )
#ifdef VARVE_CODEC_X86
VARVE_KERNEL_SET(Avx2, __attribute__((target("avx2,bmi,bmi2"))))
VARVE_KERNEL_SET(Avx512, __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,bmi,bmi2"))))
#endif

#ifdef VARVE_CODEC_X86
/// How many of a list of sets, the narrowest first, this machine can run.
std::size_t usable_sets() {
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("bmi2")) {
    return 1;
  }
  const bool wide = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                    __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  return wide ? 3 : 2;
}
#endif

}  // namespace

template <class T>
std::span<const Kernels<T>* const> all_kernels() {
#ifdef VARVE_CODEC_X86
  static constexpr std::array<const Kernels<T>*, 3> sets{&Baseline<T>::table, &Avx2<T>::table,
                                                         &Avx512<T>::table};
  static const std::size_t usable = usable_sets();
  return {sets.data(), usable};
#else
  static constexpr std::array<const Kernels<T>*, 1> sets{&Baseline<T>::table};
  return sets;
#endif
}

template <class T>
const Kernels<T>& kernels() {
  static const Kernels<T>& widest = *all_kernels<T>().back();
  return widest;
}

template const Kernels<double>& kernels<double>();
template std::span<const Kernels<double>* const> all_kernels<double>();
template const Kernels<float>& kernels<float>();
template std::span<const Kernels<float>* const> all_kernels<float>();
template const Kernels<std::uint64_t>& kernels<std::uint64_t>();
template std::span<const Kernels<std::uint64_t>* const> all_kernels<std::uint64_t>();
template const Kernels<std::uint32_t>& kernels<std::uint32_t>();
template std::span<const Kernels<std::uint32_t>* const> all_kernels<std::uint32_t>();
template const Kernels<std::uint8_t>& kernels<std::uint8_t>();
template std::span<const Kernels<std::uint8_t>* const> all_kernels<std::uint8_t>();

}  // namespace varve::io::codec
