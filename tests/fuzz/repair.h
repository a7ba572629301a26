// Makes changed logs hold again at their outside, so that what lies behind a checksum is reached.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace varve::fuzz {

// Which parts of a log are made to hold, by bits of an input's first byte.
inline constexpr std::uint8_t repair_checksums = 0x10;  ///< of header, message and body
inline constexpr std::uint8_t repair_places = 0x20;     ///< log id, sequence, durable mark
inline constexpr std::uint8_t repair_contents = 0x40;   ///< run id, blobs' checksums, chain

/// Repairs every record that begins at a multiple of 8 and whose lengths fit into the file.
void repair(std::vector<std::byte>& log, std::uint8_t mode);

/// Writes the run id that the content gives into an unpacked genesis message.
void repair_run_id(std::vector<std::byte>& message);

}  // namespace varve::fuzz
