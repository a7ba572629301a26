// Ids of a population: ascending keys of one or more components, stored as runs or differences, and
// the edit that leads from one step's ids to the next one's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/codec.h"

namespace varve::io::codec {

/// True if the field holds ids that this file can handle: integers.
bool is_identity(const FieldDescriptor& field);

/// True if keys (all components, the first one leading) ascend strictly.
bool ascending(const FieldDescriptor& field, std::span<const std::byte> ids, std::uint64_t count);

/// Stores ascending ids whole.
void encode_ids(const FieldDescriptor& field, const FieldView& ids, EncodedField& out);
/// Inverse; throws LogError(damaged) unless the payload holds exactly `encoded.count` ascending
/// ids.
void decode_ids(const FieldDescriptor& field, const EncodedField& encoded,
                std::span<std::byte> ids);

/// Stores what leads from `before` to `after`, both ascending. `sources[i]` is the old index of the
/// i-th particle or no_source. False, and nothing stored, where less than half of the particles
/// stay.
bool encode_edit(const FieldDescriptor& field, const FieldView& before, const FieldView& after,
                 EncodedField& out, std::vector<std::uint64_t>& sources);
/// Inverse; sets `sources`, whose size is `encoded.count`, and fills `after`.
void decode_edit(const FieldDescriptor& field, const FieldView& before,
                 const EncodedField& encoded, std::span<std::byte> after,
                 std::vector<std::uint64_t>& sources);

}  // namespace varve::io::codec
