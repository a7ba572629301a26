#include "io/record_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "io/digest.h"
#include "io/errors.h"
#include "io/packing.h"
#include "io/schema_check.h"

namespace varve::io {

namespace {

// What one read fetches at first: a step's header and message fit, its blobs mostly do not.
constexpr std::size_t first_read_bytes = 1024;
constexpr std::size_t scan_bytes = std::size_t{1} << 18;

bool all_zero(std::span<const std::byte> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
}

}  // namespace

void rethrow_at(const LogError& error, const std::string& path, std::uint64_t offset) {
  if (!error.path().empty()) throw LogError(error);
  throw LogError(error.kind(), path, error.what(), static_cast<std::int64_t>(offset));
}

GenesisMessage read_genesis(RecordSource& source, std::uint64_t* record_end) {
  const File& file = source.file();
  const std::string& path = file.path();
  const std::uint64_t size = file.size();
  if (size == 0) throw LogError(ErrorKind::not_a_log, path, "is empty, not a varve log");
  HeaderBytes head{};
  const std::size_t got = file.read_at(0, head);
  const std::size_t compared = std::min(got, record_magic.size());
  if (std::memcmp(head.data(), record_magic.data(), compared) != 0) {
    throw LogError(ErrorKind::not_a_log, path, "is not a varve log");
  }
  RecordHeader header;
  if (got == header_bytes && decode(head, header) == HeaderState::other_version) {
    throw LogError(ErrorKind::unsupported, path,
                   fmt::format("format version {}; this program reads version {}", header.version,
                               format_version),
                   0);
  }
  Record record;
  if (!source.read(0, size, Check::body, record)) {
    throw LogError(source.problem_kind(), path, "genesis: " + source.problem(), 0);
  }
  if (record.header.kind != RecordKind::genesis || record.header.sequence != 0) {
    throw LogError(ErrorKind::damaged, path,
                   fmt::format("begins with a {} record, sequence {}, where genesis is expected",
                               name_of(record.header.kind), record.header.sequence),
                   0);
  }
  GenesisMessage out;
  try {
    out = decode_genesis(record.message, source.limits());
    check_genesis(out.genesis, ErrorKind::damaged, "", source.limits());
  } catch (const LogError& error) {
    rethrow_at(error, path, 0);
  }
  if (out.genesis.log_id != to_text(record.header.log_id)) {
    throw LogError(ErrorKind::damaged, path, "genesis names another log id than its header", 0);
  }
  source.bind(record.header.log_id);
  if (record_end != nullptr) *record_end = record.end();
  return out;
}

bool RecordSource::fail(std::string text, ErrorKind kind) {
  problem_ = std::move(text);
  problem_kind_ = kind;
  return false;
}

bool RecordSource::header_at(std::span<const std::byte> bytes, RecordHeader& header) const {
  return decode(bytes.first<header_bytes>(), header) == HeaderState::valid &&
         (!log_id_ || header.log_id == *log_id_);
}

bool RecordSource::check_header(std::uint64_t offset, std::uint64_t file_end,
                                const RecordHeader& header) {
  const std::string kind = name_of(header.kind);
  if (log_id_ && header.log_id != *log_id_) {
    return fail(fmt::format("{} record: belongs to log {}, not to this one", kind,
                            to_text(header.log_id)));
  }
  // Everything below was covered by a checksum that holds: what is not understood here is not
  // damage but another program's doing.
  const auto unsupported = [&](const std::string& text) {
    throw LogError(ErrorKind::unsupported, file_.path(), text, static_cast<std::int64_t>(offset));
  };
  if (static_cast<std::uint8_t>(header.kind) == 0) return fail("a record of kind 0");
  if (!is_known(header.kind) && is_critical(header.kind)) {
    unsupported(fmt::format("critical record of unknown {}; a newer program wrote it", kind));
  }
  if ((header.flags & flags_critical & ~flag_checksums) != 0) {
    unsupported(fmt::format("{} record: unknown critical flags {:#x}", kind, header.flags));
  }
  if (header.message_raw > limits_.message_bytes_max) {
    return fail(fmt::format("{} record: message of {} bytes exceeds message_bytes_max {}", kind,
                            header.message_raw, limits_.message_bytes_max),
                ErrorKind::limit);
  }
  if (header.body_bytes > limits_.body_bytes_max) {
    return fail(fmt::format("{} record: body of {} bytes exceeds body_bytes_max {}", kind,
                            header.body_bytes, limits_.body_bytes_max),
                ErrorKind::limit);
  }
  if (header.step > limits_.step_max) {
    return fail(fmt::format("{} record: step {} exceeds step_max {}", kind, header.step,
                            limits_.step_max),
                ErrorKind::limit);
  }
  if (header.durable_seq >= header.sequence && header.sequence > 0) {
    return fail(fmt::format("{} record: claims to have been durable before it was written", kind));
  }
  if (header.index_offset % alignment_bytes != 0 || (offset > 0 && header.index_offset >= offset)) {
    return fail(fmt::format("{} record: names an index record behind itself", kind));
  }
  if (header.record_bytes() > file_end - offset) {
    cut_short_ = true;
    return fail(fmt::format("{} record of {} bytes: the file ends after {}", kind,
                            header.record_bytes(), file_end - offset));
  }
  return true;
}

bool RecordSource::take_message(std::span<const std::byte> stored, Record& out) {
  const RecordHeader& header = out.header;
  const std::string kind = name_of(header.kind);
  const auto padding = stored.subspan(header.message_stored);
  stored = stored.first(header.message_stored);
  if (header.has_checksums() && checksum(stored) != header.message_checksum) {
    return fail(kind + " record: the checksum of its message does not hold");
  }
  if (!all_zero(padding)) return fail(kind + " record: the padding of its message is not zero");
  try {
    check_ratio(header.message_raw, header.message_stored, kind + " record", limits_);
    out.message.resize(header.message_raw);
    unpack(header.packing, stored, out.message, kind + " record", limits_);
  } catch (const LogError& error) {
    return fail(error.what(), error.kind());
  }
  return true;
}

bool RecordSource::check_body(const Record& record) {
  // Read whole: its length is bounded by the cap and by what the file really holds.
  const std::uint64_t length = aligned(record.header.body_bytes);
  if (length == 0) {
    if (record.header.has_checksums() && record.header.body_checksum != 0) {
      return fail(name_of(record.header.kind) + " record: a checksum for a body that is not there");
    }
    return true;
  }
  if (buffer_.size() < length) buffer_.resize(length);
  const auto body = std::span(buffer_).first(length);
  read_bytes(record.body_offset(), body);
  const std::string kind = name_of(record.header.kind);
  if (record.header.has_checksums() &&
      checksum(body.first(record.header.body_bytes)) != record.header.body_checksum) {
    return fail(kind + " record: the checksum of its body does not hold");
  }
  if (!all_zero(body.subspan(record.header.body_bytes))) {
    return fail(kind + " record: the padding of its body is not zero");
  }
  return true;
}

bool RecordSource::read(std::uint64_t offset, std::uint64_t file_end, Check check, Record& out) {
  cut_short_ = false;
  if (offset % alignment_bytes != 0) return fail("an offset that is not a multiple of 8");
  if (offset >= file_end || file_end - offset < header_bytes) {
    cut_short_ = true;
    return fail(fmt::format("{} bytes where a record's header needs {}",
                            offset < file_end ? file_end - offset : 0, header_bytes));
  }
  ++reads_;
  const std::size_t first = std::min<std::uint64_t>(first_read_bytes, file_end - offset);
  if (buffer_.size() < first_read_bytes) buffer_.resize(first_read_bytes);
  read_bytes(offset, std::span(buffer_).first(first));
  switch (decode(std::span(buffer_).first<header_bytes>(), out.header)) {
    case HeaderState::valid: break;
    case HeaderState::no_magic: return fail("no record begins here");
    case HeaderState::bad_checksum:
      return fail("record header: its checksum does not hold");
    case HeaderState::other_version:
      return fail(fmt::format("record of format version {}; this program reads version {}",
                              out.header.version, format_version));
  }
  out.offset = offset;
  if (!check_header(offset, file_end, out.header)) return false;
  const std::uint64_t message = aligned(out.header.message_stored);
  if (header_bytes + message > first) {
    if (buffer_.size() < header_bytes + message) buffer_.resize(header_bytes + message);
    read_bytes(offset + first, std::span(buffer_).subspan(first, header_bytes + message - first));
  }
  if (!take_message(std::span(buffer_).subspan(header_bytes, message), out)) return false;
  return check == Check::message || check_body(out);
}

void RecordSource::read_bytes(std::uint64_t offset, std::span<std::byte> out) const {
  if (file_.read_at(offset, out) != out.size()) {
    throw LogError(ErrorKind::damaged, file_.path(), "the file became shorter while it was read",
                   static_cast<std::int64_t>(offset));
  }
}

std::uint64_t RecordSource::find_header(std::uint64_t from, std::uint64_t file_end) const {
  Bytes chunk;
  for (std::uint64_t at = aligned(from); at + header_bytes <= file_end;) {
    const std::size_t size =
        std::min<std::uint64_t>(scan_bytes + header_bytes, file_end - at);
    chunk.resize(size);
    read_bytes(at, chunk);
    std::size_t i = 0;
    for (; i + header_bytes <= size; i += alignment_bytes) {
      if (std::memcmp(chunk.data() + i, record_magic.data(), record_magic.size()) != 0) continue;
      RecordHeader header;
      if (header_at(std::span(chunk).subspan(i), header)) return at + i;
    }
    at += i;
  }
  return file_end;
}

std::optional<RecordHeader> RecordSource::find_last_header(std::uint64_t before,
                                                           std::uint64_t& offset) const {
  Bytes chunk;
  if (before < header_bytes) return std::nullopt;
  std::uint64_t high = (before - header_bytes) / alignment_bytes * alignment_bytes;
  for (;;) {
    const std::uint64_t low = high > scan_bytes ? high - scan_bytes : 0;
    chunk.resize(high - low + header_bytes);
    read_bytes(low, chunk);
    for (std::uint64_t at = high; ; at -= alignment_bytes) {
      const auto bytes = std::span(chunk).subspan(at - low);
      RecordHeader header;
      if (std::memcmp(bytes.data(), record_magic.data(), record_magic.size()) == 0 &&
          header_at(bytes, header)) {
        offset = at;
        return header;
      }
      if (at == low) break;
    }
    if (low == 0) return std::nullopt;
    high = low - alignment_bytes;
  }
}

RecordWalk::RecordWalk(RecordSource& source, std::uint64_t offset, std::uint64_t sequence,
                       std::uint64_t file_end, Check check)
    : source_(source), offset_(offset), sequence_(sequence), file_end_(file_end), check_(check) {}

RecordWalk::Item RecordWalk::accept() {
  offset_ = record_.end();
  sequence_ = record_.header.sequence + 1;
  durable_seq_ = std::max(durable_seq_, record_.header.durable_seq);
  return Item::record;
}

// True where the record after `record` is the next in sequence, or there is none: then the records
// in between are missing and `record` itself is where it belongs.
bool RecordWalk::follows_itself(const Record& record) {
  if (record.end() >= file_end_) return true;
  if (!source_.read(record.end(), file_end_, Check::message, probe_)) return true;
  return probe_.header.sequence == record.header.sequence + 1;
}

RecordWalk::Item RecordWalk::next() {
  if (pending_) {
    pending_ = false;
    return accept();
  }
  if (offset_ >= file_end_) return Item::end;
  if (!source_.read(offset_, file_end_, check_, record_)) {
    return resynchronise(source_.problem(), source_.cut_short(), source_.problem_kind());
  }
  if (sequence_ == any_sequence || record_.header.sequence == sequence_) return accept();
  return resynchronise(fmt::format("{} record: sequence {} where {} is expected",
                                   name_of(record_.header.kind), record_.header.sequence,
                                   sequence_),
                       false, ErrorKind::damaged);
}

RecordWalk::Item RecordWalk::resynchronise(std::string what, bool cut_short, ErrorKind kind) {
  bad_ = {offset_, file_end_, sequence_, std::move(what), true, cut_short, false, kind};
  std::uint64_t indexes = 0;  // damaged index records: their headers hold, the rest does not
  for (std::uint64_t at = source_.find_header(offset_, file_end_); at < file_end_;) {
    const bool whole = source_.read(at, file_end_, check_, record_);
    if (whole && record_.header.sequence >= sequence_ && follows_itself(record_)) {
      bad_.to = at;
      bad_.to_end = false;
      bad_.only_index = indexes == record_.header.sequence - sequence_;
      pending_ = true;
      offset_ = at;
      return Item::bad;
    }
    // Even a record that is not accepted tells what was durable when it was written.
    durable_seq_ = std::max(durable_seq_, record_.header.durable_seq);
    if (!whole && record_.header.kind == RecordKind::index) ++indexes;
    const std::uint64_t next = whole ? record_.end() : at + alignment_bytes;
    at = source_.find_header(next, file_end_);
  }
  offset_ = file_end_;
  return Item::bad;
}

RecordAppender::RecordAppender(File& file, const LogId& id, const Start& start,
                               const Limits& limits)
    : file_(&file),
      log_id_(id),
      limits_(limits),
      offset_(start.offset),
      written_(start.offset),
      sequence_(start.sequence),
      durable_seq_(start.durable_seq),
      index_offset_(start.index_offset) {}

std::uint64_t RecordAppender::add(RecordKind kind, std::uint64_t step,
                                  std::span<const std::byte> message,
                                  std::span<const std::span<const std::byte>> blobs) {
  const auto at_most = [&](std::uint64_t value, std::uint64_t cap, const char* name) {
    if (value > cap) {
      throw LogError(ErrorKind::limit, file_->path(),
                     fmt::format("{} record of step {}: {} exceeds {} {}", name_of(kind), step,
                                 value, name, cap));
    }
  };
  at_most(step, limits_.step_max, "step_max");
  at_most(message.size(), limits_.message_bytes_max, "message_bytes_max");
  RecordHeader header;
  header.kind = kind;
  header.log_id = log_id_;
  header.sequence = sequence_;
  header.step = step;
  header.durable_seq = durable_seq_;
  header.index_offset = index_offset_;
  // A step's message is mostly checksums: it would not shrink.
  if (is_step(kind)) {
    packed_.assign(message.begin(), message.end());
  } else {
    header.packing = pack(message, packed_, limits_);
  }
  header.message_raw = static_cast<std::uint32_t>(message.size());
  header.message_stored = static_cast<std::uint32_t>(packed_.size());
  header.message_checksum = checksum(packed_);
  for (const auto& blob : blobs) header.body_bytes += aligned(blob.size());
  at_most(header.body_bytes, limits_.body_bytes_max, "body_bytes_max");

  const std::size_t start = group_.size();
  group_.resize(start + header.record_bytes());  // new bytes are zero: the padding
  std::byte* at = group_.data() + start + header_bytes;
  std::memcpy(at, packed_.data(), packed_.size());
  at += aligned(packed_.size());
  std::byte* const body = at;
  for (const auto& blob : blobs) {
    if (!blob.empty()) std::memcpy(at, blob.data(), blob.size());
    at += aligned(blob.size());
  }
  if (header.body_bytes > 0) header.body_checksum = checksum({body, header.body_bytes});
  const HeaderBytes encoded = encode(header);
  std::memcpy(group_.data() + start, encoded.data(), encoded.size());

  const std::uint64_t here = offset_;
  offset_ += header.record_bytes();
  ++sequence_;
  if (kind == RecordKind::index) index_offset_ = here;
  return here;
}

void RecordAppender::write() {
  if (group_.empty()) return;
  file_->write_at(written_, group_);
  written_ += group_.size();
  unsynced_ = true;
  group_.clear();
}

void RecordAppender::sync() {
  if (!unsynced_) return;
  file_->sync();
  unsynced_ = false;
  durable_seq_ = sequence_ - 1;
}

}  // namespace varve::io
