// Rules that a schema, a genesis and a frame must keep, checked where they enter and where they are
// read back.
#pragma once

#include <span>
#include <string>

#include "io/errors.h"
#include "io/genesis.h"
#include "io/limits.h"

namespace varve::io {

/// Throws LogError(`kind`, `path`) naming the first rule that does not hold. `kind` is mismatch for
/// what an engine hands over and damaged for what a log says.
void check_schema(const Schema& schema, ErrorKind kind, const std::string& path,
                  const Limits& limits);
void check_genesis(const Genesis& genesis, ErrorKind kind, const std::string& path,
                   const Limits& limits);

/// Throws LogError(mismatch) where `frame` does not fit `schema`: number of fields and tables,
/// counts per population, byte lengths. No tables at all stands for tables without rows.
void check_frame(const Schema& schema, const FrameView& frame, const std::string& path,
                 std::uint64_t particles_max, const Limits& limits);

/// Throws LogError(mismatch) where the ids of a population do not ascend; ids of several components
/// are compared from the first on.
void check_ids(const Schema& schema, const FrameView& frame, const std::string& path);

/// Bytes of one row of a table.
std::size_t row_bytes(const TableDescriptor& table);

/// Events that one step can have: half of what an index record may name, so that the events of a
/// step always fit into the next index record, whatever came before them.
constexpr std::uint64_t step_events_max(const Limits& limits) { return limits.list_items_max / 2; }

/// Throws LogError (limit) for events of a step that could not be read again.
void check_events(std::span<const Event> events, std::uint64_t step, const std::string& path,
                  const Limits& limits);

}  // namespace varve::io
