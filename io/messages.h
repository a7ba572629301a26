// The structured part of every record, as plain structs. Cap'n Proto stays in messages.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/framing.h"
#include "io/genesis.h"
#include "io/limits.h"

namespace varve::io {

/// One field's blob in a record's body.
struct FieldBlob {
  std::uint64_t checksum = 0;
  std::uint32_t count = 0;
  std::uint32_t stored = 0;
  std::uint8_t method = 0;
  std::uint8_t order = 0;
};

/// One table's blob: its columns one after the other.
struct TableBlob {
  std::uint64_t checksum = 0;
  std::uint32_t rows = 0;
  std::uint32_t stored = 0;
  Packing packing = Packing::plain;
};

struct StepMessage {
  double time = 0, dt = 0;
  Digest digest, chain;
  std::vector<FieldBlob> fields;  ///< empty: no state stored
  std::vector<TableBlob> tables;  ///< empty: no rows
  /// Length of the body that the blobs describe.
  std::uint64_t body_bytes() const;
};

struct SkipPointer {
  std::uint64_t offset = 0;
  std::uint64_t last_step = 0;
};

/// What an index says of one step.
enum class StoredState : std::uint8_t { none = 0, delta = 1, keyframe = 2 };

struct IndexMessage {
  std::uint64_t ordinal = 0;
  std::uint64_t first_step = 0;
  std::uint64_t first_offset = 0;
  std::vector<std::uint32_t> gaps;   ///< per further step, in units of eight bytes
  std::vector<StoredState> states;   ///< per step
  std::vector<SkipPointer> skips;
  std::vector<std::uint64_t> events;
  std::uint64_t events_before = 0;

  std::uint64_t last_step() const { return first_step + states.size() - 1; }
};

struct EndMessage {
  std::uint64_t first_step = 0, steps = 0, last_step = 0;
  double time = 0, dt = 0;
  Digest digest, chain;
  bool has_state = false;
};

struct GapMessage {
  std::uint64_t from = 0, to = 0;
  std::string what;
};

using Bytes = std::vector<std::byte>;

// Encoders give one Cap'n Proto segment. Decoders throw LogError (damaged, limit); the caller adds
// path and offset.
Bytes encode_genesis(const Genesis& genesis, std::uint64_t particles_max);
Bytes encode(const StepMessage& message);
Bytes encode(const Event& event);
Bytes encode(const IndexMessage& message);
Bytes encode(const EndMessage& message);
Bytes encode(const GapMessage& message);

struct GenesisMessage {
  Genesis genesis;
  std::uint64_t particles_max = 0;
};
GenesisMessage decode_genesis(std::span<const std::byte> bytes, const Limits& limits);
StepMessage decode_step(std::span<const std::byte> bytes, const Limits& limits);
Event decode_event(std::span<const std::byte> bytes, std::uint64_t step, const Limits& limits);
IndexMessage decode_index(std::span<const std::byte> bytes, const Limits& limits);
EndMessage decode_end(std::span<const std::byte> bytes);
GapMessage decode_gap(std::span<const std::byte> bytes, const Limits& limits);

}  // namespace varve::io
