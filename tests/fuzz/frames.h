// What the targets of the codec encode: schemas, by number, and frames that an input bends.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/frame.h"
#include "target.h"

namespace varve::fuzz {

inline constexpr unsigned schemas = 4;

inline io::Schema schema(unsigned number) {
  using io::ScalarType;
  io::Schema out;
  switch (number % schemas) {
    case 0:  // one population, doubles, positions that follow
      out.fields = {{"a.id", "a", ScalarType::u64, 1, "", true, true, ""},
                    {"a.mass", "a", ScalarType::f64, 1, "kg", false, true, ""},
                    {"a.x", "a", ScalarType::f64, 2, "m", false, false, "a.v"},
                    {"a.v", "a", ScalarType::f64, 2, "m/s", false, false, ""}};
      break;
    case 1:  // floats, no ids
      out.fields = {{"b.x", "b", ScalarType::f32, 3, "m", false, false, "b.v"},
                    {"b.v", "b", ScalarType::f32, 3, "m/s", false, false, ""},
                    {"b.kind", "b", ScalarType::u8, 1, "", false, true, ""}};
      break;
    case 2:  // whole numbers, keys of three parts
      out.fields = {{"key", "c", ScalarType::u64, 3, "", true, false, ""},
                    {"spring", "c", ScalarType::f64, 1, "m", false, false, ""},
                    {"count", "c", ScalarType::u32, 1, "", false, false, ""},
                    {"flag", "c", ScalarType::u8, 1, "", false, false, ""},
                    {"sum", "d", ScalarType::u64, 1, "", false, false, ""}};
      break;
    default:  // hints that are void
      out.fields = {{"e.id", "e", ScalarType::u32, 1, "", true, false, ""},
                    {"e.x", "e", ScalarType::f64, 1, "m", false, false, "e.v"},
                    {"e.v", "e", ScalarType::f32, 1, "m/s", false, true, ""}};
      break;
  }
  return out;
}

inline constexpr std::uint64_t particles_max = 420;

// A run of frames. Of each the input gives: particles that come or go i8, seed u16, length u8,
// bytes laid over the values. `flags`: how values change (bits 0-2), a gap in time (bit 4).
class Frames {
 public:
  explicit Frames(unsigned number) : schema_(fuzz::schema(number)) {
    frame_.counts.resize(schema_.fields.size());
    frame_.fields.resize(schema_.fields.size());
  }
  const io::Schema& schema() const { return schema_; }
  const io::Frame& frame() const { return frame_; }

  void next(std::uint8_t flags, Input& input) {
    const auto coming = input.number<std::int8_t>();
    const std::uint64_t seed = input.number<std::uint16_t>();
    const auto over = input.bytes(input.number<std::uint8_t>());
    frame_.dt = (flags & 16) != 0 ? 0.003 : 0.001;
    frame_.time += frame_.dt;
    ++frame_.step;
    const std::int64_t wanted = static_cast<std::int64_t>(count_) + 8 * coming;
    count_ = static_cast<std::uint64_t>(
        std::clamp<std::int64_t>(wanted, 0, static_cast<std::int64_t>(particles_max)));
    for (std::size_t i = 0; i < schema_.fields.size(); ++i) {
      const io::FieldDescriptor& field = schema_.fields[i];
      const std::uint64_t count = field.population == "d" ? 1 : count_;
      frame_.counts[i] = count;
      auto& bytes = frame_.fields[i];
      bytes.resize(count * field.bytes_per_particle());
      if (field.is_id) {
        ids(field, bytes, coming < 0 ? seed : 0);
      } else if (!field.constant || frame_.step == 1 || (flags & 7) == 7) {
        values(field, bytes, flags & 7, seed + i);
        if (!bytes.empty())
          for (std::size_t k = 0; k < over.size(); ++k)
            bytes[(seed * 131 + k) % bytes.size()] ^= over[k];
      }
    }
  }

 private:
  // Ascending keys; `shift` leaves some out.
  static void ids(const io::FieldDescriptor& field, std::vector<std::byte>& bytes,
                  std::uint64_t shift) {
    const std::size_t width = io::size_of(field.type);
    std::uint64_t key = shift % 7;
    for (std::size_t at = 0; at + field.bytes_per_particle() <= bytes.size();
         at += field.bytes_per_particle()) {
      key += 1 + (shift != 0 && key % 5 == shift % 5 ? 1 : 0);
      for (std::uint32_t c = 0; c < field.components; ++c) {
        const std::uint64_t part = c == 0 ? key / (field.components > 1 ? 3 : 1) : key * (c + 1);
        std::memcpy(bytes.data() + at + c * width, &part, width);
      }
    }
  }

  void values(const io::FieldDescriptor& field, std::vector<std::byte>& bytes, unsigned how,
              std::uint64_t seed) const {
    const std::size_t width = io::size_of(field.type);
    std::uint64_t state = seed;
    for (std::size_t at = 0; at + width <= bytes.size(); at += width) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      if (how == 0) {  // bits at random
        std::memcpy(bytes.data() + at, &state, width);
      } else if (field.type == io::ScalarType::f64) {
        nudge<double>(bytes.data() + at, at, how, state);
      } else if (field.type == io::ScalarType::f32) {
        nudge<float>(bytes.data() + at, at, how, state);
      } else {
        bytes[at] ^= static_cast<std::byte>(how > 3 ? state >> 60 : 0);
      }
    }
  }

  // Smooth motion, with noise in the lowest bits or now and then a jump.
  template <typename T>
  void nudge(std::byte* at, std::size_t place, unsigned how, std::uint64_t noise) const {
    auto value = static_cast<T>(std::sin(0.01 * static_cast<double>(place) + 30 * frame_.time));
    if (how >= 4) value *= 1 + std::numeric_limits<T>::epsilon() * static_cast<T>(noise >> 58);
    if (how >= 6 && noise >> 57 == 0) value = std::numeric_limits<T>::quiet_NaN();
    if (how == 3) std::memcpy(&value, at, sizeof(T));
    std::memcpy(at, &value, sizeof(T));
  }

  io::Schema schema_;
  std::uint64_t count_ = 0;
  io::Frame frame_;
};

}  // namespace varve::fuzz
