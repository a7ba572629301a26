#include "io/framing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "io/bytes.h"
#include "io/digest.h"

namespace varve::io {

namespace {

// Offsets within the header (io/FORMAT.md, "Record").
constexpr std::size_t at_magic = 0;
constexpr std::size_t at_version = 16;
constexpr std::size_t at_kind = 18;
constexpr std::size_t at_packing = 19;
constexpr std::size_t at_flags = 20;
constexpr std::size_t at_log_id = 24;
constexpr std::size_t at_sequence = 40;
constexpr std::size_t at_step = 48;
constexpr std::size_t at_durable_seq = 56;
constexpr std::size_t at_index_offset = 64;
constexpr std::size_t at_message_stored = 72;
constexpr std::size_t at_message_raw = 76;
constexpr std::size_t at_body_bytes = 80;
constexpr std::size_t at_message_checksum = 88;
constexpr std::size_t at_body_checksum = 96;
constexpr std::size_t at_header_checksum = 104;
static_assert(at_header_checksum + 8 == header_bytes);

}  // namespace

std::string name_of(RecordKind kind) {
  switch (kind) {
    case RecordKind::genesis: return "genesis";
    case RecordKind::step: return "step";
    case RecordKind::keyframe: return "keyframe";
    case RecordKind::event: return "event";
    case RecordKind::end: return "end";
    case RecordKind::gap: return "gap";
    case RecordKind::index: return "index";
  }
  return fmt::format("kind {:#04x}", static_cast<unsigned>(kind));
}

bool is_known(RecordKind kind) {
  switch (kind) {
    case RecordKind::genesis:
    case RecordKind::step:
    case RecordKind::keyframe:
    case RecordKind::event:
    case RecordKind::end:
    case RecordKind::gap:
    case RecordKind::index: return true;
  }
  return false;
}

std::uint64_t RecordHeader::record_bytes() const {
  return header_bytes + aligned(message_stored) + aligned(body_bytes);
}

HeaderBytes encode(const RecordHeader& header) {
  HeaderBytes out{};
  std::memcpy(out.data() + at_magic, record_magic.data(), record_magic.size());
  store_le(out.data() + at_version, header.version);
  store_le(out.data() + at_kind, static_cast<std::uint8_t>(header.kind));
  store_le(out.data() + at_packing, static_cast<std::uint8_t>(header.packing));
  store_le(out.data() + at_flags, header.flags);
  std::memcpy(out.data() + at_log_id, header.log_id.data(), header.log_id.size());
  store_le(out.data() + at_sequence, header.sequence);
  store_le(out.data() + at_step, header.step);
  store_le(out.data() + at_durable_seq, header.durable_seq);
  store_le(out.data() + at_index_offset, header.index_offset);
  store_le(out.data() + at_message_stored, header.message_stored);
  store_le(out.data() + at_message_raw, header.message_raw);
  store_le(out.data() + at_body_bytes, header.body_bytes);
  store_le(out.data() + at_message_checksum, header.message_checksum);
  store_le(out.data() + at_body_checksum, header.body_checksum);
  store_le(out.data() + at_header_checksum, checksum(std::span(out).first(at_header_checksum)));
  return out;
}

HeaderState decode(std::span<const std::byte, header_bytes> bytes, RecordHeader& header) {
  const std::byte* in = bytes.data();
  if (std::memcmp(in + at_magic, record_magic.data(), record_magic.size()) != 0) {
    return HeaderState::no_magic;
  }
  // A later version may lay out the rest in another way: the version comes before the checksum.
  header.version = load_le<std::uint16_t>(in + at_version);
  if (header.version != format_version) return HeaderState::other_version;
  if (load_le<std::uint64_t>(in + at_header_checksum) !=
      checksum(bytes.first<at_header_checksum>())) {
    return HeaderState::bad_checksum;
  }
  header.kind = static_cast<RecordKind>(load_le<std::uint8_t>(in + at_kind));
  header.packing = static_cast<Packing>(load_le<std::uint8_t>(in + at_packing));
  header.flags = load_le<std::uint32_t>(in + at_flags);
  std::memcpy(header.log_id.data(), in + at_log_id, header.log_id.size());
  header.sequence = load_le<std::uint64_t>(in + at_sequence);
  header.step = load_le<std::uint64_t>(in + at_step);
  header.durable_seq = load_le<std::uint64_t>(in + at_durable_seq);
  header.index_offset = load_le<std::uint64_t>(in + at_index_offset);
  header.message_stored = load_le<std::uint32_t>(in + at_message_stored);
  header.message_raw = load_le<std::uint32_t>(in + at_message_raw);
  header.body_bytes = load_le<std::uint64_t>(in + at_body_bytes);
  header.message_checksum = load_le<std::uint64_t>(in + at_message_checksum);
  header.body_checksum = load_le<std::uint64_t>(in + at_body_checksum);
  return HeaderState::valid;
}

std::string to_text(const LogId& id) {
  Digest digest;
  digest.bytes = id;
  return digest.hex();
}

std::optional<LogId> log_id_from(std::string_view text) {
  const auto digest = Digest::from_hex(text);
  if (!digest) return std::nullopt;
  return digest->bytes;
}

LogId random_log_id() {
  std::random_device device;
  LogId id;
  for (std::uint8_t& byte : id) byte = static_cast<std::uint8_t>(device());
  return id;
}

}  // namespace varve::io
