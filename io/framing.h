// The record header: what every record says of itself before anything else of it is believed.
// io/FORMAT.md, "Record", is normative.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace varve::io {

inline constexpr std::uint16_t format_version = 1;

/// Starts every record, so that a scan can find the next one behind damage.
inline constexpr std::array<std::uint8_t, 16> record_magic = {
    0x89, 'V', 'A', 'R', 'V', 'E', 0x0d, 0x0a, 0x1a, 0x0a, 0xd3, 0x5c, 0x91, 0xe6, 0x2b, 0xf8};

inline constexpr std::size_t header_bytes = 112;
inline constexpr std::size_t alignment_bytes = 8;

/// Kinds below 0x80 are critical: a reader that does not know one must refuse the log. Kinds from
/// 0x80 on are skippable. 0 is never valid.
enum class RecordKind : std::uint8_t {
  genesis = 0x01,
  step = 0x02,
  keyframe = 0x03,
  event = 0x04,
  end = 0x05,
  gap = 0x06,
  index = 0x81,
};
std::string name_of(RecordKind kind);
bool is_known(RecordKind kind);
inline bool is_critical(RecordKind kind) { return static_cast<std::uint8_t>(kind) < 0x80; }
/// Kinds that hold one step of the run.
inline bool is_step(RecordKind kind) {
  return kind == RecordKind::step || kind == RecordKind::keyframe;
}

/// How a message or a table is stored.
enum class Packing : std::uint8_t { plain = 0, zstd = 1 };

/// Flag: the two checksums of message and body are present. The lower sixteen flags are critical.
inline constexpr std::uint32_t flag_checksums = 1;
inline constexpr std::uint32_t flags_critical = 0xffff;

using LogId = std::array<std::uint8_t, 16>;

struct RecordHeader {
  std::uint16_t version = format_version;
  RecordKind kind = RecordKind::genesis;
  Packing packing = Packing::plain;  ///< of the message
  std::uint32_t flags = flag_checksums;
  LogId log_id{};
  std::uint64_t sequence = 0;      ///< 0, 1, 2 ... within the log
  std::uint64_t step = 0;          ///< the step it belongs to
  std::uint64_t durable_seq = 0;   ///< highest sequence known synced when this was written
  std::uint64_t index_offset = 0;  ///< of the last index record before this one; 0: none
  std::uint32_t message_stored = 0;
  std::uint32_t message_raw = 0;
  std::uint64_t body_bytes = 0;
  std::uint64_t message_checksum = 0;
  std::uint64_t body_checksum = 0;

  bool has_checksums() const { return (flags & flag_checksums) != 0; }
  /// Length of the whole record, padding included. Only meaningful once the lengths are checked.
  std::uint64_t record_bytes() const;
};

/// `bytes` rounded up to the alignment.
constexpr std::uint64_t aligned(std::uint64_t bytes) {
  return (bytes + (alignment_bytes - 1)) / alignment_bytes * alignment_bytes;
}

using HeaderBytes = std::array<std::byte, header_bytes>;
HeaderBytes encode(const RecordHeader& header);

/// What a header's bytes turned out to be.
enum class HeaderState {
  valid,
  no_magic,      ///< not the start of a record
  bad_checksum,  ///< the header does not hold
  other_version, ///< a format version that this program does not know
};
/// Decodes and checks magic, version and the header's own checksum, nothing else.
HeaderState decode(std::span<const std::byte, header_bytes> bytes, RecordHeader& header);

/// Log ids as text: 32 hexadecimal digits.
std::string to_text(const LogId& id);
std::optional<LogId> log_id_from(std::string_view text);
/// A random log id.
LogId random_log_id();

}  // namespace varve::io
