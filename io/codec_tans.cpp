#include "io/codec_tans.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "io/codec_dispatch.h"
#include "io/codec_image.h"

namespace varve::io::codec {
namespace {

/// Weight of a class: powers of sqrt(2), rounded.
constexpr std::array<std::uint32_t, 16> class_weight{0,  4,  6,  8,   11,  16,  23,  32,
                                                     45, 64, 91, 128, 181, 256, 362, 512};
/// Groups of contexts of one level with fewer symbols are not worth a description.
constexpr double group_symbols_min = 24;
/// A context counts as having seen so many symbols that are distributed as in its group.
constexpr double prior_symbols = 6;

/// Class whose weight is nearest; 0 for none, at least 1 for some.
std::uint8_t class_of(double weight) {
  unsigned best = weight > 0 ? 1 : 0;
  for (unsigned k = 2; best > 0 && k < class_weight.size(); ++k) {
    if (std::abs(class_weight[k] - weight) < std::abs(class_weight[best] - weight)) {
      best = k;
    }
  }
  return static_cast<std::uint8_t>(best);
}

/// Spreads `total` slots over symbols by weight; every weight above 0 gets at least one slot.
/// Rounds down, then gives what is left to (or takes what is missing from) the largest.
std::array<std::uint16_t, tans_symbols> normalise(
    const std::array<std::uint32_t, tans_symbols>& weight) {
  std::array<std::uint16_t, tans_symbols> slots{};
  std::uint32_t sum = 0;
  for (const std::uint32_t w : weight) {
    sum += w;
  }
  std::uint32_t used = 0;
  unsigned largest = 0;
  for (unsigned s = 0; s < tans_symbols; ++s) {
    if (weight[s] > 0) {
      slots[s] = static_cast<std::uint16_t>(std::max(1u, weight[s] * tans_states / sum));
      used += slots[s];
      largest = weight[s] > weight[largest] ? s : largest;
    }
  }
  slots[largest] = static_cast<std::uint16_t>(slots[largest] + tans_states - used);
  return slots;
}

std::uint64_t load64(const std::byte* at) {
  std::uint64_t value;
  std::memcpy(&value, at, 8);
  if constexpr (std::endian::native == std::endian::big) {
    value = __builtin_bswap64(value);
  }
  return value;
}

void store64(std::byte* at, std::uint64_t value) {
  if constexpr (std::endian::native == std::endian::big) {
    value = __builtin_bswap64(value);
  }
  std::memcpy(at, &value, 8);
}

constexpr std::uint64_t low_bits(std::uint64_t value, unsigned n) {
  return value & ((std::uint64_t{1} << n) - 1);
}

/// Symbol that owns each state: slots scattered so that every symbol's are spread evenly.
std::array<std::uint8_t, tans_states> spread(const std::array<std::uint16_t, tans_symbols>& slots) {
  constexpr unsigned step = (tans_states >> 1) + (tans_states >> 3) + 3;
  std::array<std::uint8_t, tans_states> owner{};
  unsigned at = 0;
  for (unsigned s = 0; s < tans_symbols; ++s) {
    for (unsigned k = 0; k < slots[s]; ++k) {
      owner[at] = static_cast<std::uint8_t>(s);
      at = (at + step) % tans_states;
    }
  }
  return owner;
}

}  // namespace

Model::Model() {
  for (SymbolClasses& classes : classes_) {
    classes.fill(1);
  }
}

void Model::fit(const SymbolCounts& counts) {
  for (unsigned group = 0; group < tans_contexts; group += tans_trends) {
    std::array<double, tans_symbols> all{};
    double total = 0;
    for (unsigned c = group; c < group + tans_trends; ++c) {
      for (unsigned s = 0; s < tans_symbols; ++s) {
        all[s] += counts[c][s];
        total += counts[c][s];
      }
    }
    if (total < group_symbols_min) {
      continue;
    }
    for (unsigned c = group; c < group + tans_trends; ++c) {
      std::array<double, tans_symbols> weight{};
      for (unsigned s = 0; s < tans_symbols; ++s) {
        weight[s] = counts[c][s] + prior_symbols * all[s] / total;
      }
      const double most = *std::max_element(weight.begin(), weight.end());
      for (unsigned s = 0; s < tans_symbols; ++s) {
        classes_[c][s] = class_of(class_weight.back() * weight[s] / most);
      }
      classes_[c][tans_escape] = std::max<std::uint8_t>(classes_[c][tans_escape], 1);
    }
  }
}

std::array<std::uint16_t, tans_symbols> Model::frequencies(unsigned context) const {
  std::array<std::uint32_t, tans_symbols> weight{};
  for (unsigned s = 0; s < tans_symbols; ++s) {
    weight[s] = class_weight[classes_[context][s]];
  }
  return normalise(weight);
}

double Model::cost(const SymbolCounts& counts) const {
  constexpr double escaped_bits = 16;  // the escape itself, and length and sign behind it
  double bits = 0;
  for (unsigned c = 0; c < tans_contexts; ++c) {
    const auto slots = frequencies(c);
    for (unsigned s = 0; s < tans_symbols; ++s) {
      if (counts[c][s] > 0) {
        bits += counts[c][s] * (slots[s] > 0 ? tans_log - std::log2(slots[s]) : escaped_bits);
      }
    }
  }
  return bits;
}

void Model::write(ByteSink& sink) const {
  const auto plain = SymbolClasses{};
  for (const SymbolClasses& classes : classes_) {
    unsigned last = tans_symbols;
    while (last > 0 && classes[last - 1] == plain[last - 1]) {
      --last;
    }
    sink.u8(static_cast<std::uint8_t>(last));
    for (unsigned s = 0; s < last; s += 2) {
      const unsigned high = s + 1 < last ? classes[s + 1] : 0;
      sink.u8(static_cast<std::uint8_t>(classes[s] | (high << 4)));
    }
  }
}

void Model::read(ByteSource& source) {
  for (SymbolClasses& classes : classes_) {
    classes.fill(0);
    const unsigned last = source.u8();
    if (last > tans_symbols) {
      fail_damaged(source.field(), "a model of " + std::to_string(last) + " symbols");
    }
    for (unsigned s = 0; s < last; s += 2) {
      const unsigned pair = source.u8();
      classes[s] = static_cast<std::uint8_t>(pair & 15);
      if (s + 1 < last) {
        classes[s + 1] = static_cast<std::uint8_t>(pair >> 4);
      }
    }
    if (classes[tans_escape] == 0) {
      fail_damaged(source.field(), "a model without an escape");
    }
  }
}

struct EncodeTables {
  struct Step {
    std::uint32_t delta_bits = special;  ///< (state + delta_bits) >> 16: number of bits to emit
    std::uint32_t delta_state = 0;       ///< added to the rest of the state: where `next` has it
  };
  /// Marks what takes more than one step: symbols without a slot, the escape among them (its own
  /// step has a column behind all symbols'), and many raw bits.
  static constexpr std::uint32_t special = ~0u;
  std::array<Step, tans_contexts * table_columns> step;  ///< by Token::entry()
  std::array<std::uint16_t, tans_contexts * tans_states> next;
};

struct DecodeTables {
  /// What a state says: packed, since one load is all there is time for.
  /// Bits 0-9: base of the next state; 10-13: bits to add to it; 16-20: raw bits besides the
  /// offset; 24: the residual is not 0; 25: its sign is not the expected one; 26: escape.
  std::array<std::array<std::uint32_t, tans_states>, tans_contexts> step;
};

namespace {

void build(const Model& model, EncodeTables& tables) {
  for (unsigned c = 0; c < tans_contexts; ++c) {
    const auto slots = model.frequencies(c);
    const auto owner = spread(slots);
    std::array<std::uint32_t, tans_symbols> first{};
    std::uint32_t sum = 0;
    std::fill_n(tables.step.begin() + c * table_columns, table_columns, EncodeTables::Step());
    for (unsigned s = 0; s < tans_symbols; ++s) {
      first[s] = sum;
      if (slots[s] > 0) {
        // A state emits `bits` bits from slots << bits upwards, one less below.
        const auto width = static_cast<unsigned>(std::bit_width(slots[s] - 1u));
        const unsigned bits = slots[s] == 1 ? tans_log : tans_log + 1 - width;
        const unsigned column = s == tans_escape ? escape_column : s;
        EncodeTables::Step& step = tables.step[c * table_columns + column];
        step.delta_bits = (bits << 16) - (static_cast<std::uint32_t>(slots[s]) << bits);
        step.delta_state = c * tans_states + sum - slots[s];  // may wrap around below 0
      }
      sum += slots[s];
    }
    for (unsigned state = 0; state < tans_states; ++state) {
      tables.next[c * tans_states + first[owner[state]]++] =
          static_cast<std::uint16_t>(state + tans_states);
    }
  }
}

void build(const Model& model, DecodeTables& tables) {
  for (unsigned c = 0; c < tans_contexts; ++c) {
    const auto slots = model.frequencies(c);
    const auto owner = spread(slots);
    auto next = slots;
    for (unsigned state = 0; state < tans_states; ++state) {
      const unsigned symbol = owner[state];
      const unsigned x = next[symbol]++;
      const unsigned bits = tans_log + 1 - static_cast<unsigned>(std::bit_width(x));
      const unsigned length = symbol / 2;
      const unsigned raw = length == 0 ? 0 : length - 1;
      tables.step[c][state] = ((x << bits) - tans_states) | bits << 10 | raw << 16 |
                              (length != 0 ? 1u << 24 : 0) | (symbol & 1) << 25 |
                              (symbol == tans_escape ? 1u << 26 : 0);
    }
  }
}

/// Writes bits from a buffer's end towards its beginning: what is written last is read first.
struct BackwardWriter {
  std::byte* at = nullptr;
  std::uint64_t bits = 0;  ///< the lowest `count` are not in the buffer yet
  unsigned count = 0;      ///< below 8 between calls
  std::uint32_t state = tans_states;

  /// n <= 56. With nothing at all to write, what is stored is no part of the stream.
  VARVE_INLINE void put(std::uint64_t value, unsigned n) {
    bits = (bits << n) | value;
    count += n;
    store64(at - 8, bits << ((0u - count) & 63));
    at -= count >> 3;
    count &= 7;
  }
};
using Writers = std::array<BackwardWriter, tans_streams>;

/// One value: raw bits first, then what an escape needs, then state bits, since all is read
/// backwards.
VARVE_INLINE void put_value(const EncodeTables& tables, std::uint64_t raw_bits, Token token,
                            BackwardWriter& writer) {
  unsigned raw = token.raw();
  EncodeTables::Step step = tables.step[token.entry()];
  if (step.delta_bits == EncodeTables::special) [[unlikely]] {
    if (raw > 32) {
      writer.put(raw_bits >> 32, raw - 32);
    }
    writer.put(raw_bits & 0xffffffffu, std::min(raw, 32u));
    step = tables.step[token.escape_entry() - escape_column + token.symbol()];
    if (step.delta_bits == EncodeTables::special) {
      writer.put((raw + token.nonzero()) * 2 + token.negative(), 8);
      step = tables.step[token.escape_entry()];
    }
    raw = 0;
    raw_bits = 0;
  }
  const unsigned bits = (writer.state + step.delta_bits) >> 16;
  const std::uint64_t state_bits = low_bits(writer.state, bits);
  writer.state = tables.next[(writer.state >> bits) + step.delta_state];
  writer.put((raw_bits << bits) | state_bits, raw + bits);
}

template <class U>
VARVE_INLINE void put_run_body(const EncodeTables& tables, const U* raw_bits, const Token* tokens,
                               std::size_t n, Writers& all) {
  BackwardWriter w0 = all[0], w1 = all[1], w2 = all[2], w3 = all[3];
  std::size_t i = n;
  for (; i % tans_streams != 0; --i) {
    BackwardWriter& writer = i % tans_streams == 3 ? w2 : i % tans_streams == 2 ? w1 : w0;
    put_value(tables, raw_bits[i - 1], tokens[i - 1], writer);
  }
  for (; i > 0; i -= tans_streams) {
    put_value(tables, raw_bits[i - 1], tokens[i - 1], w3);
    put_value(tables, raw_bits[i - 2], tokens[i - 2], w2);
    put_value(tables, raw_bits[i - 3], tokens[i - 3], w1);
    put_value(tables, raw_bits[i - 4], tokens[i - 4], w0);
  }
  all = {w0, w1, w2, w3};
}

/// One stream while it is read.
struct BitReader {
  std::uint64_t bit;
  std::uint32_t state;
};

template <class U>
VARVE_INLINE U take_value(const DecodeTables& tables, const std::byte* data, Expectation expected,
                          BitReader& reader) {
  constexpr unsigned window_raw_max = 40;  // of 57 bits in a window: 9 of the state, 8 of an escape
  const std::uint32_t step = tables.step[expected.context & 0x7f][reader.state];
  std::uint64_t window = load64(data + (reader.bit >> 3)) >> (reader.bit & 7);
  const unsigned bits = step >> 10 & 15;
  reader.state = (step & 1023) + static_cast<std::uint32_t>(low_bits(window, bits));
  window >>= bits;
  std::uint64_t at = reader.bit + bits;
  std::uint64_t nonzero = step >> 24 & 1;
  unsigned negative = (step >> 25 & 1) ^ (expected.context >> 7);
  // The offset counts only behind symbols of residuals that are not 0.
  unsigned raw = (step >> 16 & 31) + (expected.offset & (0u - static_cast<unsigned>(nonzero)));
  if ((step >> 26 & 1) != 0) [[unlikely]] {
    const unsigned length = static_cast<unsigned>(window & 0xff) >> 1;
    negative = static_cast<unsigned>(window & 1);
    nonzero = length != 0 ? 1 : 0;
    raw = length - static_cast<unsigned>(nonzero);
    at += 8;
    window >>= 8;
  }
  raw &= 63;
  std::uint64_t low = low_bits(window, raw);
  if (raw > window_raw_max) [[unlikely]] {
    const std::uint64_t first = load64(data + (at >> 3)) >> (at & 7);
    const std::uint64_t second = load64(data + ((at + 32) >> 3)) >> (at & 7);
    low = (first & 0xffffffffu) | (low_bits(second, raw - 32) << 32);
  }
  reader.bit = at + raw;
  const auto magnitude = static_cast<U>(low | (nonzero << raw));
  const U mask = U{0} - static_cast<U>(negative);
  return (magnitude ^ mask) - mask;
}

/// Reads rows of four values; false as soon as a stream has run past its end.
template <class U>
VARVE_INLINE bool take_rows_body(const DecodeTables& tables, const std::byte* data,
                                 const Expectation* expected, std::size_t n,
                                 const std::uint64_t* ends, BitReader* readers, U* residuals) {
  BitReader r0 = readers[0], r1 = readers[1], r2 = readers[2], r3 = readers[3];
  const std::uint64_t e0 = ends[0], e1 = ends[1], e2 = ends[2], e3 = ends[3];
  for (std::size_t i = 0; i + tans_streams <= n; i += tans_streams) {
    residuals[i] = take_value<U>(tables, data, expected[i], r0);
    residuals[i + 1] = take_value<U>(tables, data, expected[i + 1], r1);
    residuals[i + 2] = take_value<U>(tables, data, expected[i + 2], r2);
    residuals[i + 3] = take_value<U>(tables, data, expected[i + 3], r3);
    if (r0.bit > e0 || r1.bit > e1 || r2.bit > e2 || r3.bit > e3) [[unlikely]] {
      return false;
    }
  }
  readers[0] = r0, readers[1] = r1, readers[2] = r2, readers[3] = r3;
  return true;
}

template <class U>
using PutRun = void (*)(const EncodeTables&, const U*, const Token*, std::size_t, Writers&);
template <class U>
using TakeRows = bool (*)(const DecodeTables&, const std::byte*, const Expectation*, std::size_t,
                          const std::uint64_t*, BitReader*, U*);

#define VARVE_TANS_SET(NAME, TARGET)                                                              \
  template <class U>                                                                              \
  struct NAME {                                                                                   \
    TARGET static void put_run(const EncodeTables& tables, const U* raw_bits,                     \
                               const Token* tokens, std::size_t n, Writers& writers) {            \
      put_run_body<U>(tables, raw_bits, tokens, n, writers);                                      \
    }                                                                                             \
    TARGET static bool take_rows(const DecodeTables& tables, const std::byte* data,               \
                                 const Expectation* expected, std::size_t n,                      \
                                 const std::uint64_t* ends, BitReader* readers, U* residuals) {   \
      return take_rows_body<U>(tables, data, expected, n, ends, readers, residuals);              \
    }                                                                                             \
  };

VARVE_TANS_SET(AnyMachine, )
#ifdef VARVE_CODEC_X86
VARVE_TANS_SET(BitInstructions, __attribute__((target("bmi,bmi2,lzcnt"))))
#endif

bool has_bit_instructions() {
#ifdef VARVE_CODEC_X86
  return __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("avx2");  // lzcnt came with avx2 and has no name of its own here
#else
  return false;
#endif
}

template <class U>
PutRun<U> put_run() {
#ifdef VARVE_CODEC_X86
  static const PutRun<U> chosen =
      has_bit_instructions() ? &BitInstructions<U>::put_run : &AnyMachine<U>::put_run;
  return chosen;
#else
  return &AnyMachine<U>::put_run;
#endif
}

template <class U>
TakeRows<U> take_rows() {
#ifdef VARVE_CODEC_X86
  static const TakeRows<U> chosen =
      has_bit_instructions() ? &BitInstructions<U>::take_rows : &AnyMachine<U>::take_rows;
  return chosen;
#else
  return &AnyMachine<U>::take_rows;
#endif
}

}  // namespace

template <class U>
TansEncoder<U>::TansEncoder() = default;
template <class U>
TansEncoder<U>::~TansEncoder() = default;

template <class U>
void TansEncoder<U>::set_model(const Model& model) {
  if (tables_ == nullptr) {
    tables_ = std::make_unique<EncodeTables>();
  }
  build(model, *tables_);
}

template <class U>
void TansEncoder<U>::encode(std::span<const U> raw_bits, std::span<const Token> tokens,
                            std::size_t run, std::vector<std::byte>& out) {
  constexpr std::size_t value_bytes_max = 11;  // 9 state bits, 8 of an escape, 63 raw ones
  Writers writers;
  const std::size_t runs = run == 0 ? 0 : raw_bits.size() / run;
  const std::size_t values_max = runs * (run / tans_streams + 1);
  const std::size_t room = values_max * value_bytes_max + 16;
  if (buffer_size_ < tans_streams * room) {
    buffer_size_ = tans_streams * room;
    buffer_ = std::make_unique_for_overwrite<std::byte[]>(buffer_size_);
  }
  for (unsigned k = 0; k < tans_streams; ++k) {
    writers[k].at = buffer_.get() + (k + 1) * room;
  }
  for (std::size_t r = runs; r-- > 0;) {
    put_run<U>()(*tables_, raw_bits.data() + r * run, tokens.data() + r * run, run, writers);
  }
  std::array<std::size_t, tans_streams> sizes{};
  std::size_t sum = 0;
  for (unsigned k = 0; k < tans_streams; ++k) {
    writers[k].at -= writers[k].count > 0;  // put() has left the last bits at the top of that byte
    sizes[k] = static_cast<std::size_t>(buffer_.get() + (k + 1) * room - writers[k].at);
    sum += sizes[k];
  }
  out.reserve(out.size() + sum + tans_streams * 12);
  ByteSink sink(out);
  for (unsigned k = 0; k < tans_streams; ++k) {
    const unsigned skip = (8 - writers[k].count) & 7;
    sink.u16(static_cast<std::uint16_t>((writers[k].state - tans_states) | (skip << tans_log)));
    sink.varint(sizes[k]);
  }
  for (unsigned k = 0; k < tans_streams; ++k) {
    sink.bytes({writers[k].at, sizes[k]});
  }
}

template <class U>
TansDecoder<U>::TansDecoder() = default;
template <class U>
TansDecoder<U>::~TansDecoder() = default;

template <class U>
void TansDecoder<U>::set_model(const Model& model) {
  if (tables_ == nullptr) {
    tables_ = std::make_unique<DecodeTables>();
  }
  build(model, *tables_);
}

/// Bytes that one row of four values, at 11 bytes each, may read behind a stream that has ended.
constexpr std::size_t overrun_bytes = 64;

template <class U>
void TansDecoder<U>::begin(ByteSource& source) {
  field_ = source.field();
  std::array<std::uint64_t, tans_streams> sizes{};
  std::array<unsigned, tans_streams> skip{};
  for (unsigned k = 0; k < tans_streams; ++k) {
    const unsigned start = source.u16();
    streams_[k].state = start & (tans_states - 1);
    skip[k] = start >> tans_log;
    sizes[k] = source.varint();
    if (skip[k] > 7 || sizes[k] > source.left() || (skip[k] > 0 && sizes[k] == 0)) {
      fail_damaged(field_, "a stream of bits does not fit its payload");
    }
  }
  std::uint64_t at = 0;
  for (unsigned k = 0; k < tans_streams; ++k) {
    streams_[k].bit = at * 8 + skip[k];
    at += sizes[k];
    streams_[k].end = at * 8;
  }
  if (at != source.left()) {
    fail_damaged(field_, "streams of " + std::to_string(at) + " bytes in a payload of " +
                             std::to_string(source.left()));
  }
  const auto rest = source.rest();
  data_.resize(rest.size() + overrun_bytes);
  std::copy(rest.begin(), rest.end(), data_.begin());
  std::fill(data_.end() - overrun_bytes, data_.end(), std::byte{0});
}

template <class U>
void TansDecoder<U>::decode(std::span<const Expectation> expected, U* residuals) {
  std::array<BitReader, tans_streams> readers;
  std::array<std::uint64_t, tans_streams> ends;
  for (unsigned k = 0; k < tans_streams; ++k) {
    readers[k] = {streams_[k].bit, streams_[k].state};
    ends[k] = streams_[k].end;
  }
  bool whole = take_rows<U>()(*tables_, data_.data(), expected.data(), expected.size(),
                              ends.data(), readers.data(), residuals);
  std::size_t i = expected.size() / tans_streams * tans_streams;
  for (unsigned k = 0; whole && i < expected.size(); ++i, ++k) {
    residuals[i] = take_value<U>(*tables_, data_.data(), expected[i], readers[k]);
    whole = readers[k].bit <= ends[k];
  }
  if (!whole) {
    fail_damaged(field_, "a stream of bits ends early");
  }
  for (unsigned k = 0; k < tans_streams; ++k) {
    streams_[k].bit = readers[k].bit;
    streams_[k].state = readers[k].state;
  }
}

template <class U>
void TansDecoder<U>::finish() const {
  for (const Stream& stream : streams_) {
    if (stream.bit != stream.end || stream.state != 0) {
      fail_damaged(field_, "a stream of bits does not end with its last value");
    }
  }
}

template class TansEncoder<std::uint64_t>;
template class TansEncoder<std::uint32_t>;
template class TansDecoder<std::uint64_t>;
template class TansDecoder<std::uint32_t>;

}  // namespace varve::io::codec
