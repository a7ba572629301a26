#include "io/codec_tans.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "io/codec_image.h"

namespace varve::io::codec {
namespace {

/// Weight of a class: powers of sqrt(2), rounded.
constexpr std::array<std::uint32_t, 16> class_weight{0,  4,  6,  8,   11,  16,  23,  32,
                                                     45, 64, 91, 128, 181, 256, 362, 512};
/// Contexts with fewer symbols are not worth a description of their own.
constexpr std::uint32_t context_symbols_min = 24;

/// Spreads `total` slots over symbols by weight; every weight above 0 gets at least one slot.
/// Rounds down, then gives what is left to (or takes what is missing from) the largest.
std::array<std::uint16_t, tans_symbols> normalise(const std::array<std::uint32_t, tans_symbols>& weight) {
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
  for (unsigned c = 0; c < tans_contexts; ++c) {
    std::uint32_t sum = 0;
    std::uint32_t most = 0;
    for (const std::uint32_t n : counts[c]) {
      sum += n;
      most = std::max(most, n);
    }
    if (sum < context_symbols_min) {
      continue;
    }
    for (unsigned s = 0; s < tans_symbols; ++s) {
      const double weight = 512.0 * counts[c][s] / most;
      unsigned best = 0;
      for (unsigned k = 1; weight > 0 && k < 16; ++k) {
        best = k == 1 || std::abs(class_weight[k] - weight) < std::abs(class_weight[best] - weight)
                   ? k
                   : best;
      }
      classes_[c][s] = static_cast<std::uint8_t>(best);
    }
    classes_[c][tans_escape] = std::max<std::uint8_t>(classes_[c][tans_escape], 1);
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
    std::uint32_t delta_bits = 0;  ///< (state + delta_bits) >> 16 is the number of bits to emit
    std::int32_t delta_state = 0;
  };
  std::array<std::array<Step, tans_symbols>, tans_contexts> step;
  std::array<std::array<std::uint16_t, tans_states>, tans_contexts> next;
  std::array<std::uint32_t, tans_contexts> possible{};  ///< bit s: symbol s has a slot
};

struct DecodeTables {
  struct Step {
    std::uint16_t base;
    std::uint8_t bits;
    std::uint8_t symbol;
  };
  std::array<std::array<Step, tans_states>, tans_contexts> step;
};

namespace {

void build(const Model& model, EncodeTables& tables) {
  for (unsigned c = 0; c < tans_contexts; ++c) {
    const auto slots = model.frequencies(c);
    const auto owner = spread(slots);
    std::array<std::uint32_t, tans_symbols> first{};
    std::uint32_t sum = 0;
    tables.possible[c] = 0;
    for (unsigned s = 0; s < tans_symbols; ++s) {
      first[s] = sum;
      if (slots[s] > 0) {
        // A state emits `bits` bits from slots << bits upwards, one less below.
        const auto width = static_cast<unsigned>(std::bit_width(slots[s] - 1u));
        const unsigned bits = slots[s] == 1 ? tans_log : tans_log + 1 - width;
        tables.step[c][s].delta_bits = (bits << 16) - (static_cast<std::uint32_t>(slots[s]) << bits);
        tables.step[c][s].delta_state = static_cast<std::int32_t>(sum) - slots[s];
        tables.possible[c] |= 1u << s;
      }
      sum += slots[s];
    }
    for (unsigned state = 0; state < tans_states; ++state) {
      tables.next[c][first[owner[state]]++] = static_cast<std::uint16_t>(state + tans_states);
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
      tables.step[c][state] = {static_cast<std::uint16_t>((x << bits) - tans_states),
                               static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(symbol)};
    }
  }
}

/// Writes bits from a buffer's end towards its beginning: what is written last is read first.
struct BackwardWriter {
  std::byte* at = nullptr;
  std::uint64_t bits = 0;  ///< the lowest `count` are not in the buffer yet
  unsigned count = 0;      ///< below 8 between calls
  std::uint32_t state = tans_states;

  /// n <= 56
  void put(std::uint64_t value, unsigned n) {
    bits = (bits << n) | value;
    count += n;
    store64(at - 8, (bits << 1) << (63 - count));
    at -= count >> 3;
    count &= 7;
  }
};

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
void TansEncoder<U>::symbolise(std::span<const U> residuals, std::span<const Expectation> expected,
                               std::span<std::uint8_t> symbols) {
  constexpr unsigned top = sizeof(U) * 8 - 1;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const U sign = residuals[i] >> top;
    const U magnitude = sign != 0 ? U{0} - residuals[i] : residuals[i];
    const unsigned length = bit_length(magnitude);
    const unsigned agree = length == 0 ? 0 : static_cast<unsigned>(sign) ^ (expected[i].context >> 7);
    const unsigned offset = expected[i].offset;
    const unsigned symbol = (length - offset) * 2 + agree;  // huge where length < offset
    const bool fits = length >= offset + (offset != 0) && symbol < tans_symbols;
    symbols[i] = static_cast<std::uint8_t>(fits ? symbol : tans_escape);
  }
}

template <class U>
void TansEncoder<U>::encode(std::span<const U> residuals, std::span<const Expectation> expected,
                            std::span<const std::uint8_t> symbols, std::size_t run,
                            std::vector<std::byte>& out) {
  constexpr unsigned top = sizeof(U) * 8 - 1;
  constexpr std::size_t value_bytes_max = 11;  // 9 state bits, 8 of an escape, 63 raw ones
  std::array<BackwardWriter, tans_streams> writers;
  const std::size_t runs = run == 0 ? 0 : residuals.size() / run;
  const std::size_t values_max = runs * (run / tans_streams + 1);
  for (unsigned k = 0; k < tans_streams; ++k) {
    buffers_[k].resize(values_max * value_bytes_max + 16);
    writers[k].at = buffers_[k].data() + buffers_[k].size();
  }
  const EncodeTables& tables = *tables_;
  const auto put = [&](BackwardWriter& writer, std::size_t i) {
    const unsigned context = expected[i].context & 0x7f;
    const U sign = residuals[i] >> top;
    const U magnitude = sign != 0 ? U{0} - residuals[i] : residuals[i];
    const unsigned length = bit_length(magnitude);
    const unsigned raw = length - (length != 0);
    unsigned symbol = symbols[i];
    const std::uint64_t raw_bits = low_bits(magnitude, raw);
    if (raw > 46) [[unlikely]] {
      writer.put(raw_bits >> 32, raw - 32);
      writer.put(raw_bits & 0xffffffffu, 32);
    }
    if ((tables.possible[context] >> symbol & 1) == 0 || symbol == tans_escape) [[unlikely]] {
      symbol = tans_escape;
      if (raw <= 46) {
        writer.put(raw_bits, raw);
      }
      writer.put(length * 2 + static_cast<unsigned>(sign), 8);
    }
    const EncodeTables::Step step = tables.step[context][symbol];
    const unsigned bits = (writer.state + step.delta_bits) >> 16;
    const std::uint64_t state_bits = low_bits(writer.state, bits);
    const auto index = static_cast<std::int32_t>(writer.state >> bits) + step.delta_state;
    writer.state = tables.next[context][static_cast<std::size_t>(index)];
    if (raw > 46 || symbol == tans_escape) [[unlikely]] {
      writer.put(state_bits, bits);
    } else {
      writer.put((raw_bits << bits) | state_bits, raw + bits);
    }
  };
  for (std::size_t r = runs; r-- > 0;) {
    const std::size_t first = r * run;
    std::size_t i = run;
    for (; i % tans_streams != 0; --i) {
      put(writers[(i - 1) % tans_streams], first + i - 1);
    }
    for (; i > 0; i -= tans_streams) {
      put(writers[3], first + i - 1);
      put(writers[2], first + i - 2);
      put(writers[1], first + i - 3);
      put(writers[0], first + i - 4);
    }
  }
  ByteSink sink(out);
  std::array<std::size_t, tans_streams> sizes{};
  for (unsigned k = 0; k < tans_streams; ++k) {
    BackwardWriter& writer = writers[k];
    const unsigned skip = (8 - writer.count) & 7;
    sink.u16(static_cast<std::uint16_t>((writer.state - tans_states) | (skip << tans_log)));
    writer.at -= writer.count > 0;  // put() has left the last bits at the top of the byte below
    sizes[k] = static_cast<std::size_t>(buffers_[k].data() + buffers_[k].size() - writer.at);
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
  const DecodeTables& tables = *tables_;
  const std::byte* const data = data_.data();
  std::array<Stream, tans_streams> streams = streams_;
  const auto take = [&](Stream& stream, std::size_t i) {
    const Expectation known = expected[i];
    const DecodeTables::Step step = tables.step[known.context & 0x7f][stream.state];
    std::uint64_t window = load64(data + (stream.bit >> 3)) >> (stream.bit & 7);
    stream.state = step.base + static_cast<std::uint32_t>(low_bits(window, step.bits));
    window >>= step.bits;
    stream.bit += step.bits;
    unsigned length = (step.symbol >> 1) + known.offset;
    unsigned negative = (step.symbol & 1) ^ (known.context >> 7);
    if (step.symbol == tans_escape) [[unlikely]] {
      length = static_cast<unsigned>(window & 0xff) >> 1;
      negative = static_cast<unsigned>(window & 1);
      stream.bit += 8;
      window >>= 8;
    }
    const unsigned raw = (length - (length != 0)) & 63;
    std::uint64_t bits;
    if (raw > 40) [[unlikely]] {
      bits = (load64(data + (stream.bit >> 3)) >> (stream.bit & 7)) & 0xffffffffu;
      const std::uint64_t upper = low_bits(load64(data + ((stream.bit + 32) >> 3)) >>
                                               ((stream.bit + 32) & 7),
                                           raw - 32);
      bits |= upper << 32;
    } else {
      bits = low_bits(window, raw);
    }
    stream.bit += raw;
    const auto magnitude =
        static_cast<U>(length != 0 ? bits | (std::uint64_t{1} << raw) : std::uint64_t{0});
    const U mask = U{0} - static_cast<U>(negative);
    residuals[i] = (magnitude ^ mask) - mask;
  };
  std::size_t i = 0;
  for (; i + tans_streams <= expected.size(); i += tans_streams) {
    take(streams[0], i);
    take(streams[1], i + 1);
    take(streams[2], i + 2);
    take(streams[3], i + 3);
    if (((streams[0].end - streams[0].bit) | (streams[1].end - streams[1].bit) |
         (streams[2].end - streams[2].bit) | (streams[3].end - streams[3].bit)) >>
        63) [[unlikely]] {
      fail_damaged(field_, "a stream of bits ends early");
    }
  }
  for (unsigned k = 0; i < expected.size(); ++i, ++k) {
    take(streams[k], i);
    if (streams[k].bit > streams[k].end) {
      fail_damaged(field_, "a stream of bits ends early");
    }
  }
  streams_ = streams;
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
