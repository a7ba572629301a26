// The codec's inner loops over blocks of values. Each exists once in the source and is compiled for
// several widths of vector registers; the widest that the machine has is chosen when the program
// starts. All of them are element-wise, so the width cannot reach a bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "io/codec_image.h"

namespace varve::io::codec {

/// Values that one kernel call handles at most: its scratch stays in the first-level cache.
inline constexpr std::size_t block_values = 1024;

/// What is known of a residual before it is read (codec_tans.h).
struct Expectation {
  std::uint8_t context;  ///< class of level and of its last change; bit 7: sign of the one before
  /// Bits that every residual has besides those of its symbol, unless it is 0.
  std::uint8_t offset;
};

/// Symbols of the entropy coder; the one behind which length and sign follow as they are.
inline constexpr unsigned tans_symbols = 32;
inline constexpr unsigned tans_escape = 1;

/// Raw bits that fit into one write together with those of a state.
inline constexpr unsigned raw_bits_max = 46;
/// Columns of the encoder's table, one row per context: the symbols, the escape's own step, and one
/// for residuals of more raw bits.
inline constexpr unsigned escape_column = tans_symbols;
inline constexpr unsigned long_column = tans_symbols + 1;
inline constexpr unsigned table_columns = tans_symbols + 2;

/// How a residual is written (codec_tans.h): what the encoder needs of it, in one word.
struct Token {
  std::uint32_t word;
  static constexpr unsigned symbol_at = 12, nonzero_at = 17, negative_at = 18, raw_at = 24;

  /// Entry of the encoder's table: context * table_columns + column.
  unsigned entry() const { return word & 0xfff; }
  unsigned symbol() const { return word >> symbol_at & 31; }
  unsigned context() const { return entry() / table_columns; }
  unsigned nonzero() const { return word >> nonzero_at & 1; }
  unsigned negative() const { return word >> negative_at & 1; }
  /// Number of raw bits behind the symbol.
  unsigned raw() const { return word >> raw_at; }
  /// Entry of the escape in the same context.
  unsigned escape_entry() const {
    return entry() - (raw() > raw_bits_max ? long_column : symbol()) + escape_column;
  }
};

/// Past residuals that a second prediction is made from, and the candidates for it: the residual
/// itself is expected to be 0, or to continue the past ones as a constant, a line or a parabola.
inline constexpr unsigned past_residuals = 4;
inline constexpr unsigned candidates = 4;

/// A block of the second stage's memory.
struct StageBlock {
  const float* past[past_residuals];  ///< newest first
  std::uint16_t* level[candidates];   ///< running mean of each candidate's error, 64 per bit
  float* incoming;                    ///< where the newest residual goes; may be past[3]
};

template <class T>
struct Kernels {
  using U = ImageOf<T>;
  /// bits[i] of scalar i * components from `at` on.
  void (*gather)(const std::byte* at, std::size_t components, std::size_t n, U* bits);
  /// Inverse of gather.
  void (*scatter)(const U* bits, std::size_t components, std::size_t n, std::byte* at);
  /// image[i] of newest[i] + sum_j weights[j] * differences[j][i], summed from j = 0 upwards from
  /// +0 in T. Where the sum is not a number: the image of newest[i]. n <= block_values.
  void (*predict)(const U* newest, const T* const* differences, const T* weights, unsigned order,
                  std::size_t n, U* image);
  /// folded[i] = zigzag(image of bits[i] - predicted[i]).
  void (*fold)(const U* bits, const U* predicted, std::size_t n, U* folded);
  /// Inverse of fold.
  void (*unfold)(const U* folded, const U* predicted, std::size_t n, U* bits);
  /// residuals[i] = image of bits[i] - predicted[i].
  void (*subtract)(const U* bits, const U* predicted, std::size_t n, U* residuals);
  /// Inverse of subtract.
  void (*add)(const U* residuals, const U* predicted, std::size_t n, U* bits);
  /// Floating types only, as the following three. For each value takes the candidate whose level is
  /// lowest, adds what it says to the image `base`, and tells what is to be expected of the rest.
  void (*expect)(const StageBlock& block, const U* base, std::size_t n, U* predicted,
                 Expectation* expected);
  /// Takes in the true residuals, image of bits[i] - base[i].
  void (*learn)(const StageBlock& block, const U* bits, const U* base, std::size_t n);
  /// What these weights would have left over in the past: differences[0][i] minus the prediction
  /// from the differences behind it, in units in the last place of newest[i].
  void (*look_back)(const U* newest, const T* const* differences, const T* weights, unsigned order,
                    std::size_t n, float* residual);
  /// Tokens of residuals, which are two's complement, under these expectations. Each residual is
  /// replaced by its raw bits: the magnitude without its highest bit.
  void (*tokenise)(U* residuals, const Expectation* expected, std::size_t n, Token* tokens);
  /// difference[i] = bits[i] - newest[i] as values; newest[i] = bits[i].
  void (*advance)(const U* bits, U* newest, T* difference, std::size_t n);
};

/// The kernels for this machine.
template <class T>
const Kernels<T>& kernels();

/// All sets of kernels that this machine can run, the narrowest first.
template <class T>
std::span<const Kernels<T>* const> all_kernels();

}  // namespace varve::io::codec
