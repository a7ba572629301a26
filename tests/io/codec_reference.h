// A second decoder for fields that change, written from io/CODEC.md alone: value by value, without
// blocks, vectors or tables that outlive a record. It shares no code with io/codec*.
#pragma once

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <type_traits>
#include <vector>

namespace varve::io::test {

/// Reads a payload front to back.
struct ReferenceBytes {
  const std::uint8_t* at;
  const std::uint8_t* end;
  std::uint64_t fixed(int width) {
    std::uint64_t value = 0;
    for (int i = 0; i < width; ++i) {
      value |= std::uint64_t{*at++} << (8 * i);
    }
    return value;
  }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
      const std::uint64_t byte = *at++;
      value |= (byte & 127) << shift;
      if (byte < 128) {
        return value;
      }
    }
  }
};

/// T is double or float. Decodes methods 18 to 21 (and takes whole frames).
template <class T>
class ReferenceField {
 public:
  using U = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
  using S = std::make_signed_t<U>;

  explicit ReferenceField(std::size_t components) : components_(components) {}
  const std::vector<U>& newest() const { return newest_; }

  void whole(const std::vector<std::byte>& frame) {
    newest_ = by_component(frame);
    differences_.clear();
    kept_.clear();
  }

  /// `times[0]` is the record's own time.
  std::vector<std::byte> decode(int method, unsigned order, const std::vector<std::byte>& payload,
                                const std::vector<double>& times) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(payload.data());
    ReferenceBytes bytes{first, first + payload.size()};
    const std::vector<T> weights = read_weights(bytes, order, times);
    std::vector<U> values(newest_.size());
    if (method == 19) {
      for (std::size_t v = 0; v < values.size(); ++v) {
        const U folded = static_cast<U>(bytes.varint());
        values[v] = bits_of(extrapolated(weights, v) + ((folded >> 1) ^ (U{0} - (folded & 1))));
      }
    } else if (method == 20) {
      const auto planes = bytes.fixed(1);
      std::vector<std::uint8_t> plane(planes * values.size());
      ZSTD_decompress(plane.data(), plane.size(), bytes.at,
                      static_cast<std::size_t>(bytes.end - bytes.at));
      for (std::size_t v = 0; v < values.size(); ++v) {
        U folded = 0;
        for (std::size_t p = 0; p < planes; ++p) {
          folded |= static_cast<U>(plane[p * values.size() + v]) << (8 * p);
        }
        values[v] = bits_of(extrapolated(weights, v) + ((folded >> 1) ^ (U{0} - (folded & 1))));
      }
    } else if (method == 21) {
      staged(bytes, weights, values);
    } else {
      throw std::logic_error("not a method of this reference");
    }
    push(values);
    return by_particle(values);
  }

  std::vector<std::byte> follow(const ReferenceField& slopes, double dt,
                                const std::vector<std::byte>& payload) {
    std::vector<U> values(newest_.size());
    const T step = static_cast<T>(dt);
    for (std::size_t v = 0; v < values.size(); ++v) {
      const T moved = step * std::bit_cast<T>(slopes.newest_[v]);
      const T value = std::bit_cast<T>(newest_[v]) + moved;
      values[v] = std::isnan(value) ? newest_[v] : std::bit_cast<U>(value);
    }
    const auto* first = reinterpret_cast<const std::uint8_t*>(payload.data());
    ReferenceBytes bytes{first, first + payload.size()};
    std::size_t next = 0;
    for (std::uint64_t k = bytes.varint(); k > 0; --k) {
      const std::size_t v = next + bytes.varint();
      const U folded = static_cast<U>(bytes.varint());
      values[v] = bits_of(image(values[v]) + ((folded >> 1) ^ (U{0} - (folded & 1))));
      next = v + 1;
    }
    newest_ = values;
    differences_.clear();
    kept_.clear();
    return by_particle(values);
  }

 private:
  static constexpr int top = sizeof(T) * 8 - 1;
  static U image(U bits) { return bits >> top ? ~bits : bits | (U{1} << top); }
  static U bits_of(U image) { return image >> top ? image ^ (U{1} << top) : ~image; }

  std::vector<U> by_component(const std::vector<std::byte>& frame) const {
    const std::size_t count = frame.size() / sizeof(T) / components_;
    std::vector<U> values(count * components_);
    for (std::size_t v = 0; v < values.size(); ++v) {
      const std::size_t at = (v % count * components_ + v / count) * sizeof(T);
      std::memcpy(&values[v], frame.data() + at, sizeof(T));
    }
    return values;
  }
  std::vector<std::byte> by_particle(const std::vector<U>& values) const {
    const std::size_t count = values.size() / components_;
    std::vector<std::byte> frame(values.size() * sizeof(T));
    for (std::size_t v = 0; v < values.size(); ++v) {
      const std::size_t at = (v % count * components_ + v / count) * sizeof(T);
      std::memcpy(frame.data() + at, &values[v], sizeof(T));
    }
    return frame;
  }

  void push(const std::vector<U>& values) {
    std::vector<T> difference(values.size());
    for (std::size_t v = 0; v < values.size(); ++v) {
      difference[v] = std::bit_cast<T>(values[v]) - std::bit_cast<T>(newest_[v]);
    }
    differences_.insert(differences_.begin(), difference);
    differences_.resize(std::min<std::size_t>(differences_.size(), 12));
    newest_ = values;
  }

  static bool equal_steps(unsigned order, const std::vector<double>& t) {
    const double h = t[0] - t[1];
    const double e = 1e-9 * h + 1e-15 * std::abs(t[0]);
    for (unsigned i = 1; i <= order; ++i) {
      const double s = t[i] - t[i + 1];
      if (!(s > 0 && h > 0)) {
        return true;
      }
      if (s - h > e || s - h < -e) {
        return false;
      }
    }
    return true;
  }

  std::vector<T> read_weights(ReferenceBytes& bytes, unsigned order, const std::vector<double>& t) {
    std::vector<double> weights(order);
    const auto kind = bytes.fixed(1);
    if (kind == 1) {
      for (double& weight : weights) {
        weight = std::bit_cast<double>(bytes.fixed(8));
      }
      kept_ = weights;
    } else if (kind == 2) {
      weights = kept_;
    } else if (equal_steps(order, t)) {
      double b = 1;
      for (unsigned j = 0; j < order; ++j) {
        b = b * (order - j) / (j + 1);
        weights[j] = j % 2 == 0 ? b : -b;
      }
    } else {
      const double h = t[0] - t[1];
      for (unsigned j = 0; j < order; ++j) {
        double product = 1;
        for (unsigned m = 0; m < order; ++m) {
          const double um = (t[m + 2] - t[1]) / h;
          const double uj = (t[j + 2] - t[1]) / h;
          product = m == j ? product : product * (um / (um - uj));
        }
        weights[j] = product * (h / (t[j + 1] - t[j + 2]));
      }
    }
    return {weights.begin(), weights.end()};
  }

  U extrapolated(const std::vector<T>& weights, std::size_t v) const {
    T sum = 0;
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const T product = weights[j] * differences_[j][v];
      sum = sum + product;
    }
    const T value = std::bit_cast<T>(newest_[v]) + sum;
    return image(std::isnan(value) ? newest_[v] : std::bit_cast<U>(value));
  }

  // ---- second stage ----
  struct Memory {
    std::array<float, 4> r{};
    std::array<int, 4> level{};
  };
  struct Stream {
    const std::uint8_t* first;
    std::uint64_t bit;
    unsigned state;
    std::uint64_t take(unsigned n) {
      std::uint64_t value = 0;
      for (unsigned i = 0; i < n; ++i, ++bit) {
        value |= std::uint64_t{first[bit / 8] >> (bit % 8) & 1u} << i;
      }
      return value;
    }
  };
  struct Slot {
    unsigned symbol, bits, base;
  };

  static int quarters(float f) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(std::abs(f));
    return std::max(0, static_cast<int>(bits >> 21) - 504);
  }
  static std::array<float, 4> expectations(float a, float b, float c) {
    const float ab = a - b;
    const float line = a + ab;
    const float three = 3 * ab;
    return {0, a, line, three + c};
  }

  static std::vector<Slot> slots_of(const std::array<unsigned, 32>& classes) {
    constexpr std::array<unsigned, 16> weight_of{0,  4,  6,  8,   11,  16,  23,  32,
                                                 45, 64, 91, 128, 181, 256, 362, 512};
    unsigned sum = 0;
    for (const unsigned c : classes) {
      sum += weight_of[c];
    }
    std::array<unsigned, 32> share{};
    unsigned given = 0;
    std::size_t heaviest = 0;
    for (std::size_t s = 0; s < 32; ++s) {
      const unsigned weight = weight_of[classes[s]];
      share[s] = weight == 0 ? 0 : std::max(1u, 512 * weight / sum);
      given += share[s];
      heaviest = weight > weight_of[classes[heaviest]] ? s : heaviest;
    }
    share[heaviest] = share[heaviest] + 512 - given;
    std::vector<Slot> slots(512);
    unsigned position = 0;
    for (unsigned s = 0; s < 32; ++s) {
      for (unsigned k = 0; k < share[s]; ++k) {
        slots[position].symbol = s;
        position = (position + 323) % 512;
      }
    }
    std::array<unsigned, 32> y = share;
    for (Slot& slot : slots) {
      const unsigned own = y[slot.symbol]++;
      slot.bits = 9 - static_cast<unsigned>(std::bit_width(own) - 1);
      slot.base = (own << slot.bits) - 512;
    }
    return slots;
  }

  void rebase(ReferenceBytes& bytes, const std::vector<T>& weights) {
    const int step = static_cast<std::int8_t>(bytes.fixed(1));
    std::array<int, 4> shift{};
    for (int& s : shift) {
      s = static_cast<std::int16_t>(bytes.fixed(2));
    }
    constexpr int mantissa = sizeof(T) == 8 ? 52 : 23;
    constexpr int bias = sizeof(T) == 8 ? 1023 : 127;
    for (std::size_t v = 0; v < memory_.size(); ++v) {
      Memory& memory = memory_[v];
      const int exponent = static_cast<int>((newest_[v] << 1) >> (mantissa + 1));
      const int power = std::min(2 * bias + mantissa - std::max(exponent, 1), 2 * bias);
      const T unit = std::ldexp(T{1}, power - bias);
      for (std::size_t a = 0; a < 4; ++a) {
        memory.r[a] = 0;
        if (a + 1 + weights.size() <= differences_.size()) {
          T sum = 0;
          for (std::size_t j = 0; j < weights.size(); ++j) {
            const T product = weights[j] * differences_[a + 1 + j][v];
            sum = sum + product;
          }
          const T left = (differences_[a][v] - sum) * unit;
          memory.r[a] = left > T(-1e18) && left < T(1e18) ? static_cast<float>(left) : 0.0f;
        }
      }
      const auto old = memory.level;
      for (int j = 0; j < 4; ++j) {
        const auto from = static_cast<std::size_t>(std::clamp(j + step, 0, 3));
        const auto to = static_cast<std::size_t>(j);
        memory.level[to] = std::clamp(old[from] + shift[to], 0, 4500);
      }
    }
  }

  void staged(ReferenceBytes& bytes, const std::vector<T>& weights, std::vector<U>& values) {
    const auto flags = bytes.fixed(1);
    if (flags & 4) {
      memory_.assign(values.size(), Memory{});
    }
    if (flags & 2) {
      rebase(bytes, weights);
    }
    if (flags & 1) {
      models_.clear();
      for (int c = 0; c < 70; ++c) {
        std::array<unsigned, 32> classes{};
        const auto n = bytes.fixed(1);
        for (std::size_t s = 0; s < n; s += 2) {
          const auto pair = static_cast<unsigned>(bytes.fixed(1));
          classes[s] = pair & 15;
          if (s + 1 < n) {
            classes[s + 1] = pair >> 4;
          }
        }
        models_.push_back(slots_of(classes));
      }
    }
    std::array<Stream, 4> streams{};
    std::array<std::uint64_t, 4> sizes{};
    for (std::size_t k = 0; k < 4; ++k) {
      const auto start = static_cast<unsigned>(bytes.fixed(2));
      streams[k].state = start & 511;
      streams[k].bit = start >> 9;
      sizes[k] = bytes.varint();
    }
    for (std::size_t k = 0; k < 4; ++k) {
      streams[k].first = bytes.at;
      bytes.at += sizes[k];
    }
    const std::size_t count = values.size() / components_;
    for (std::size_t v = 0; v < values.size(); ++v) {
      values[v] = staged_value(streams[v % count % 4], extrapolated(weights, v), memory_[v]);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      if (streams[k].bit != sizes[k] * 8 || streams[k].state != 0) {
        throw std::logic_error("a stream does not end where it should");
      }
    }
    if (bytes.at != bytes.end) {
      throw std::logic_error("bytes behind the streams");
    }
  }

  U staged_value(Stream& stream, U base, Memory& memory) const {
    const auto& r = memory.r;
    const auto expected = expectations(r[0], r[1], r[2]);
    const auto before = expectations(r[1], r[2], r[3]);
    std::size_t used = 0;
    for (std::size_t j = 1; j < 4; ++j) {
      used = memory.level[j] < memory.level[used] ? j : used;
    }
    const int level = memory.level[used];
    const float error = r[0] - before[used];
    const float limit = sizeof(T) == 8 ? 4.0e18f : 1.0e9f;
    const float e = expected[used] > -limit && expected[used] < limit ? expected[used] : 0.0f;
    const U predicted = base + static_cast<U>(static_cast<S>(e));

    const int height = level < 256   ? level >> 5
                       : level < 512 ? 4 + (level >> 6)
                                     : 12 + (level >> 5 & 1);
    const int offset = level < 512 ? 0 : (level >> 6) - 8;
    const int c = 16 * quarters(error) - level;
    const int trend = (c >= -95) + (c >= -31) + (c >= 32) + (c >= 96);
    const bool negative_before = error < 0;

    const Slot slot = models_[static_cast<std::size_t>(5 * height + trend)][stream.state];
    stream.state = slot.base + static_cast<unsigned>(stream.take(slot.bits));
    std::uint64_t length = slot.symbol == 0 ? 0 : slot.symbol / 2 + static_cast<unsigned>(offset);
    bool negative = (slot.symbol % 2 == 1) != negative_before;
    if (slot.symbol == 1) {
      const std::uint64_t plain = stream.take(8);
      length = plain / 2;
      negative = plain % 2 == 1;
    }
    U x = 0;
    if (length > 0) {
      x = static_cast<U>(stream.take(static_cast<unsigned>(length) - 1));
      x |= U{1} << (length - 1);
    }
    const U value = predicted + (negative ? U{0} - x : x);

    const auto residual = static_cast<float>(static_cast<S>(value - base));
    for (std::size_t j = 0; j < 4; ++j) {
      int& own = memory.level[j];
      own = own + ((16 * quarters(residual - expected[j]) - own + 4) >> 3);
    }
    memory.r = {residual, r[0], r[1], r[2]};
    return bits_of(value);
  }

  std::size_t components_;
  std::vector<U> newest_;
  std::vector<std::vector<T>> differences_;
  std::vector<double> kept_;
  std::vector<Memory> memory_;
  std::vector<std::vector<Slot>> models_;
};

}  // namespace varve::io::test
