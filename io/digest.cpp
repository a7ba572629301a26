#include "io/digest.h"

#include <bit>

// Header-only, so that a foreign engine can check digests without linking any library.
#define XXH_INLINE_ALL
#include <xxhash.h>

#include "io/bytes.h"

namespace varve::io {

namespace {

constexpr std::string_view hex_digits = "0123456789abcdef";

Digest canonical(XXH128_hash_t hash) {
  XXH128_canonical_t bytes;
  XXH128_canonicalFromHash(&bytes, hash);
  Digest out;
  static_assert(sizeof(bytes.digest) == sizeof(out.bytes));
  std::memcpy(out.bytes.data(), bytes.digest, out.bytes.size());
  return out;
}

// A running hash fed with little-endian bytes.
class Hasher {
 public:
  Hasher() { XXH3_128bits_reset(&state_); }
  void raw(std::span<const std::byte> bytes) {
    if (!bytes.empty()) XXH3_128bits_update(&state_, bytes.data(), bytes.size());
  }
  // Values in host order: on a big-endian host they are swapped block by block.
  void values(std::span<const std::byte> bytes, std::size_t scalar_bytes) {
    if constexpr (std::endian::native == std::endian::little) {
      raw(bytes);
    } else {
      std::array<std::byte, 4096> block;
      while (!bytes.empty()) {
        const auto part = bytes.first(std::min(bytes.size(), block.size()));
        copy_le(block.data(), part, scalar_bytes);
        raw(std::span(block).first(part.size()));
        bytes = bytes.subspan(part.size());
      }
    }
  }
  Digest finish() const { return canonical(XXH3_128bits_digest(&state_)); }

 private:
  XXH3_state_t state_;
};

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

std::string Digest::hex() const {
  std::string out;
  out.reserve(2 * bytes.size());
  for (const std::uint8_t byte : bytes) {
    out += hex_digits[byte >> 4];
    out += hex_digits[byte & 15];
  }
  return out;
}

std::optional<Digest> Digest::from_hex(std::string_view text) {
  Digest out;
  if (text.size() != 2 * out.bytes.size()) return std::nullopt;
  for (std::size_t i = 0; i < out.bytes.size(); ++i) {
    const int high = hex_value(text[2 * i]);
    const int low = hex_value(text[2 * i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    out.bytes[i] = static_cast<std::uint8_t>(high << 4 | low);
  }
  return out;
}

Digest digest_bytes(std::span<const std::byte> bytes) {
  return canonical(XXH3_128bits(bytes.data(), bytes.size()));
}

Digest digest_text(std::string_view text) {
  return digest_bytes(std::as_bytes(std::span(text.data(), text.size())));
}

std::uint64_t checksum(std::span<const std::byte> bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

Digest digest_frame(const Schema& schema, const FrameView& frame) {
  Hasher hasher;
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    const FieldDescriptor& field = schema.fields[i];
    CanonicalBytes head;
    head.text(field.name);
    head.number(frame.fields[i].count);
    hasher.raw(head.bytes());
    hasher.values(frame.fields[i].bytes, size_of(field.type));
  }
  return hasher.finish();
}

Digest chain_base(const Schema& schema) {
  CanonicalBytes bytes;
  bytes.number(static_cast<std::uint32_t>(schema.fields.size()));
  for (const FieldDescriptor& field : schema.fields) {
    bytes.text(field.name);
    bytes.text(field.population);
    bytes.number(static_cast<std::uint8_t>(field.type));
    bytes.number(field.components);
    bytes.text(field.unit);
    bytes.number(static_cast<std::uint8_t>(field.is_id));
  }
  return digest_bytes(bytes.bytes());
}

Digest chain_next(const Digest& previous, const Digest& state) {
  std::array<std::uint8_t, 32> both;
  std::copy(previous.bytes.begin(), previous.bytes.end(), both.begin());
  std::copy(state.bytes.begin(), state.bytes.end(), both.begin() + 16);
  return digest_bytes(std::as_bytes(std::span(both)));
}

Digest digest_settings(std::span<const std::pair<std::string, std::string>> settings) {
  CanonicalBytes bytes;
  bytes.number(static_cast<std::uint32_t>(settings.size()));
  for (const auto& [key, value] : settings) {
    bytes.text(key);
    bytes.text(value);
  }
  return digest_bytes(bytes.bytes());
}

Digest digest_events(std::span<const Event> events) {
  CanonicalBytes bytes;
  bytes.number(static_cast<std::uint32_t>(events.size()));
  for (const Event& event : events) {
    bytes.number(event.step);
    bytes.text(event.kind);
    bytes.number(static_cast<std::uint32_t>(event.items.size()));
    for (const auto& [key, value] : event.items) {
      bytes.text(key);
      bytes.text(value);
    }
  }
  return digest_bytes(bytes.bytes());
}

}  // namespace varve::io
