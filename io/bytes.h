// Little-endian bytes, whatever the host. Everything on disk and everything digested passes here.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace varve::io {

/// `value` with its bytes reversed.
template <typename T>
  requires std::is_trivially_copyable_v<T>
inline T byte_swapped(T value) {
  std::array<std::byte, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  std::reverse(raw.begin(), raw.end());
  std::memcpy(&value, raw.data(), sizeof(T));
  return value;
}

/// Writes a scalar at `out`, little endian.
template <typename T>
inline void store_le(std::byte* out, T value) {
  if constexpr (std::endian::native == std::endian::big) value = byte_swapped(value);
  std::memcpy(out, &value, sizeof(T));
}

/// Reads a little-endian scalar at `in`.
template <typename T>
inline T load_le(const std::byte* in) {
  T value;
  std::memcpy(&value, in, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) value = byte_swapped(value);
  return value;
}

/// Copies scalars of `scalar_bytes` each between host order and little endian (either direction).
inline void copy_le(std::byte* out, std::span<const std::byte> in, std::size_t scalar_bytes) {
  if (in.empty()) return;
  if (std::endian::native == std::endian::little || scalar_bytes == 1) {
    std::memcpy(out, in.data(), in.size());
    return;
  }
  for (std::size_t at = 0; at + scalar_bytes <= in.size(); at += scalar_bytes) {
    for (std::size_t b = 0; b < scalar_bytes; ++b) out[at + b] = in[at + scalar_bytes - 1 - b];
  }
}

/// Builds the canonical byte strings that are digested: integers little endian, strings with their
/// length (u32) in front.
class CanonicalBytes {
 public:
  template <typename T>
    requires std::is_arithmetic_v<T>
  void number(T value) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    store_le(bytes_.data() + at, value);
  }
  void text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    raw(std::as_bytes(std::span(value.data(), value.size())));
  }
  void raw(std::span<const std::byte> value) {
    bytes_.insert(bytes_.end(), value.begin(), value.end());
  }
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace varve::io
