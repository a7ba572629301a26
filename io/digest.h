// State digests and the chain over them. XXH3-128 detects accidents, not an adversary.
// Needs neither Cap'n Proto nor zstd, so that any build of an engine can be checked with it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "io/frame.h"

namespace varve::io {

/// 128 bits, most significant byte first (XXH3's canonical form).
struct Digest {
  std::array<std::uint8_t, 16> bytes{};
  auto operator<=>(const Digest&) const = default;
  /// 32 lower-case hexadecimal digits.
  std::string hex() const;
  /// Inverse of hex(); nothing if `text` is not 32 hexadecimal digits.
  static std::optional<Digest> from_hex(std::string_view text);
};

/// Digest of any bytes.
Digest digest_bytes(std::span<const std::byte> bytes);
Digest digest_text(std::string_view text);

/// XXH3-64 of any bytes: the checksum of the framing, not an identity.
std::uint64_t checksum(std::span<const std::byte> bytes);

/// Digest of a state: for every field of the schema, in its order, its name, count and values in
/// little-endian bytes (io/FORMAT.md, "Digest"). Step, time and tables are not part of it, unless
/// the engine publishes them as fields.
Digest digest_frame(const Schema& schema, const FrameView& frame);

/// The chain's start in a fresh run: digest of the canonical field schema (tables left out).
Digest chain_base(const Schema& schema);

/// chain[n] = H(chain[n-1] || digest[n]).
Digest chain_next(const Digest& previous, const Digest& state);

/// Digests of parameters and of events, apart from the chain (io/FORMAT.md, "Digest").
Digest digest_settings(std::span<const std::pair<std::string, std::string>> settings);
Digest digest_events(std::span<const Event> events);

}  // namespace varve::io
