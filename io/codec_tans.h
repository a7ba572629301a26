// Entropy coding of residuals: a table-driven asymmetric numeral system over 32 symbols in many
// contexts, plus raw bits, in four interleaved streams. A symbol says how long a residual is
// compared with what was expected, and whether it has the sign of the one before.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/codec_bytes.h"
#include "io/codec_kernels.h"

namespace varve::io::codec {

inline constexpr unsigned tans_log = 9;  ///< states per context: 2^9
inline constexpr unsigned tans_states = 1u << tans_log;
inline constexpr unsigned tans_trends = 5;  ///< contexts of one level, side by side
inline constexpr unsigned tans_contexts = 14 * tans_trends;
inline constexpr unsigned tans_streams = 4;

/// How often each symbol is expected, in 15 classes a factor sqrt(2) apart; 0: never.
using SymbolClasses = std::array<std::uint8_t, tans_symbols>;

/// Occurrences of symbols by context.
using SymbolCounts = std::array<std::array<std::uint32_t, tans_symbols>, tans_contexts>;

/// Frequencies of all contexts, as both sides know them.
class Model {
 public:
  Model();
  /// Classes that fit the counts; levels that hardly occur keep what they have.
  void fit(const SymbolCounts& counts);
  /// Bits that the symbols with these counts would need.
  double cost(const SymbolCounts& counts) const;
  void write(ByteSink& sink) const;
  void read(ByteSource& source);
  /// Frequencies of one context: they sum up to tans_states, none of the escape is 0.
  std::array<std::uint16_t, tans_symbols> frequencies(unsigned context) const;

 private:
  std::array<SymbolClasses, tans_contexts> classes_;
};

struct EncodeTables;
struct DecodeTables;

/// Writes residuals given by their tokens. U is the residual's width.
template <class U>
class TansEncoder {
 public:
  TansEncoder();
  ~TansEncoder();
  void set_model(const Model& model);
  /// Appends the four streams. The values come in runs of `run`, coded one after the other; stream
  /// k takes values k, k+4, k+8 ... of each run.
  void encode(std::span<const U> raw_bits, std::span<const Token> tokens, std::size_t run,
              std::vector<std::byte>& out);

 private:
  std::unique_ptr<EncodeTables> tables_;
  /// Room for the longest streams there can be; only what is used of it becomes memory.
  std::unique_ptr<std::byte[]> buffer_;
  std::size_t buffer_size_ = 0;
};

/// Reads them back, piece by piece.
template <class U>
class TansDecoder {
 public:
  TansDecoder();
  ~TansDecoder();
  void set_model(const Model& model);
  /// Takes the streams from the rest of `source`.
  void begin(ByteSource& source);
  /// The next residuals, all of one run; `expected` of as many values. Only the last piece of a run
  /// may have a length that is not a multiple of four. Damage ends in LogError here or in finish().
  void decode(std::span<const Expectation> expected, U* residuals);
  /// Throws unless the streams ended where they should.
  void finish() const;

 private:
  struct Stream {
    std::uint64_t bit = 0;  ///< position in data_
    std::uint64_t end = 0;
    std::uint32_t state = 0;
  };
  std::unique_ptr<DecodeTables> tables_;
  std::vector<std::byte> data_;
  std::array<Stream, tans_streams> streams_;
  std::string field_;
};

}  // namespace varve::io::codec
