// Whole records: reading one at an offset, walking them in order past damage, and appending them.
// Private to io; LogReader, LogWriter, verify and recover are built from these.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/errors.h"
#include "io/file.h"
#include "io/framing.h"
#include "io/limits.h"
#include "io/messages.h"

namespace varve::io {

/// A record as read. `message` is uncompressed and verified; the body is verified only where asked.
struct Record {
  std::uint64_t offset = 0;
  RecordHeader header;
  Bytes message;
  std::uint64_t end() const { return offset + header.record_bytes(); }
  std::uint64_t body_offset() const {
    return offset + header_bytes + aligned(header.message_stored);
  }
};

enum class Check {
  message,  ///< header and message
  body,     ///< also the body and the padding: every byte of the record
};

/// Reads records of one file and checks everything that a record alone can tell.
class RecordSource {
 public:
  RecordSource(const File& file, const Limits& limits) : file_(file), limits_(limits) {}

  /// Records of other logs are refused from here on.
  void bind(const LogId& id) { log_id_ = id; }

  /// Reads the record at `offset` of a file `file_end` bytes long. False where there is none that
  /// holds; `problem()` says why. Throws LogError(unsupported) for what must not be skipped.
  bool read(std::uint64_t offset, std::uint64_t file_end, Check check, Record& out);
  const std::string& problem() const { return problem_; }
  /// damaged, or limit where a cap was exceeded.
  ErrorKind problem_kind() const { return problem_kind_; }
  /// True where the failed record only reaches beyond the file's end.
  bool cut_short() const { return cut_short_; }

  /// Bytes [offset, offset + size) of a body that `read` has found inside the file.
  void read_bytes(std::uint64_t offset, std::span<std::byte> out) const;

  /// First offset >= `from`, a multiple of 8, with a valid header of this log; `file_end` if none.
  std::uint64_t find_header(std::uint64_t from, std::uint64_t file_end) const;
  /// Last such offset < `before` whose record begins there; nothing if none.
  std::optional<RecordHeader> find_last_header(std::uint64_t before, std::uint64_t& offset) const;

  const File& file() const { return file_; }
  const Limits& limits() const { return limits_; }
  std::uint64_t reads() const { return reads_; }

 private:
  bool fail(std::string text, ErrorKind kind = ErrorKind::damaged);
  bool check_header(std::uint64_t offset, std::uint64_t file_end, const RecordHeader& header);
  bool take_message(std::span<const std::byte> stored, Record& out);
  bool check_body(const Record& record);
  bool header_at(std::span<const std::byte> bytes, RecordHeader& header) const;

  const File& file_;
  Limits limits_;
  std::optional<LogId> log_id_;
  std::string problem_;
  ErrorKind problem_kind_ = ErrorKind::damaged;
  bool cut_short_ = false;
  std::uint64_t reads_ = 0;
  Bytes buffer_;
};

/// A stretch of the file that does not hold.
struct BadStretch {
  std::uint64_t from = 0, to = 0;      ///< bytes; equal where records are merely missing
  std::uint64_t sequence = 0;          ///< the sequence expected at `from`
  std::string what;
  bool to_end = false;                 ///< nothing whole follows
  bool cut_short = false;              ///< a record that reaches beyond the file's end
  bool only_index = false;             ///< what is lost is known to be index records
  ErrorKind kind = ErrorKind::damaged; ///< limit where a cap was exceeded
};

/// Visits records in order of the file, resynchronising behind damage.
class RecordWalk {
 public:
  /// Stands for the sequence of whatever record is found first.
  static constexpr std::uint64_t any_sequence = UINT64_MAX;

  enum class Item { record, bad, end };

  RecordWalk(RecordSource& source, std::uint64_t offset, std::uint64_t sequence,
             std::uint64_t file_end, Check check);
  Item next();
  const Record& record() const { return record_; }
  const BadStretch& bad() const { return bad_; }
  /// Where the next record is expected, and its sequence.
  std::uint64_t offset() const { return offset_; }
  std::uint64_t sequence() const { return sequence_; }
  /// Highest durable mark of the headers visited.
  std::uint64_t durable_seq() const { return durable_seq_; }

 private:
  Item accept();
  Item resynchronise(std::string what, bool cut_short, ErrorKind kind);
  bool follows_itself(const Record& record);

  RecordSource& source_;
  std::uint64_t offset_;
  std::uint64_t sequence_;
  std::uint64_t file_end_;
  Check check_;
  std::uint64_t durable_seq_ = 0;
  bool pending_ = false;  // record_ was found behind the bad stretch just reported
  Record record_;
  Record probe_;
  BadStretch bad_;
};

/// Tells whether deltas can be decoded: from a keyframe on, as long as no step is missing.
class DeltaChain {
 public:
  /// Takes the next step's record; true where a state in it can be decoded.
  bool add(const RecordHeader& header) {
    intact_ = header.kind == RecordKind::keyframe || (intact_ && header.step == last_ + 1);
    last_ = header.step;
    return intact_;
  }
  void interrupt() { intact_ = false; }

 private:
  bool intact_ = false;
  std::uint64_t last_ = 0;
};

/// Appends records to a file: gathers a group, writes it at once.
class RecordAppender {
 public:
  struct Start {
    std::uint64_t offset = 0;
    std::uint64_t sequence = 0;
    std::uint64_t durable_seq = 0;
    std::uint64_t index_offset = 0;
  };
  RecordAppender(File& file, const LogId& id, const Start& start, const Limits& limits);

  /// Adds a record to the group; returns its offset. Blobs are padded and put one after the other.
  std::uint64_t add(RecordKind kind, std::uint64_t step, std::span<const std::byte> message,
                    std::span<const std::span<const std::byte>> blobs = {});
  /// Writes the group with one call.
  void write();
  /// Syncs what is written; later headers say so.
  void sync();

  std::uint64_t offset() const { return offset_; }    ///< where the next record will stand
  std::uint64_t written() const { return written_; }  ///< length of the file so far
  std::uint64_t next_sequence() const { return sequence_; }
  std::uint64_t durable_seq() const { return durable_seq_; }
  bool has_unsynced() const { return unsynced_; }

 private:
  File* file_;
  LogId log_id_;
  Limits limits_;
  std::uint64_t offset_;
  std::uint64_t written_;
  std::uint64_t sequence_;
  std::uint64_t durable_seq_;
  std::uint64_t index_offset_;
  bool unsynced_ = false;
  Bytes group_;
  Bytes packed_;
};

/// Reads the genesis record at the start of `file` and binds `source` to its log id. Throws
/// LogError: not_a_log, unsupported, damaged, limit.
GenesisMessage read_genesis(RecordSource& source, std::uint64_t* record_end = nullptr);

/// Throws `error` again with the path and, where it has none, the offset.
[[noreturn]] void rethrow_at(const LogError& error, const std::string& path, std::uint64_t offset);

}  // namespace varve::io
