// Appends the records of a log in their right order and keeps its index: what LogWriter and recover
// have in common. Private to io.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/record_io.h"
#include "io/schema_check.h"

namespace varve::io {

/// How many index records before it those lie that index record `ordinal` points to, in order.
std::vector<std::uint64_t> skip_distances(std::uint64_t ordinal);

/// Gathers what the next index record will say.
class IndexBuilder {
 public:
  /// Steps, and bytes, after which an index record is due.
  static constexpr std::size_t steps_due = 512;
  static constexpr std::uint64_t bytes_due = std::uint64_t{64} << 20;
  /// Events after which one is due, so that a step's own (step_events_max) still fit into it.
  static constexpr std::size_t events_due = step_events_max(Limits{});

  /// True where `step` at `offset` continues the run of steps gathered so far.
  bool continues(std::uint64_t step, std::uint64_t offset) const;
  void add_step(std::uint64_t step, std::uint64_t offset, StoredState state);
  void add_event(std::uint64_t offset) { pending_.events.push_back(offset); }
  bool empty() const { return pending_.states.empty(); }
  bool due() const;
  /// The message for what was gathered, with its pointers to earlier index records.
  IndexMessage message() const;
  /// Notes that `message` stands at `offset`, and starts anew.
  void written(const IndexMessage& message, std::uint64_t offset);
  std::uint64_t written_so_far() const { return past_.size(); }

 private:
  IndexMessage pending_;
  std::uint64_t last_offset_ = 0;
  std::vector<SkipPointer> past_;  // all earlier index records: 16 bytes per 512 steps
  std::uint64_t events_before_ = 0;
};

class LogAppender {
 public:
  /// For a new, empty file.
  LogAppender(File& file, const LogId& id, const Limits& limits);

  /// Continues a log: walks all of `file`, checks every byte, and stands behind the last whole
  /// step. Throws LogError(damaged) for rot. `cut_bytes()` is then what lies behind: the torn tail,
  /// which the caller cuts.
  static LogAppender continuing(File& file, const LogId& id, const Limits& limits);

  void genesis(const Genesis& genesis, std::uint64_t particles_max);
  void event(const Event& event);
  /// Adds a step's record, and an index record where one is due.
  void step(std::uint64_t step, bool keyframe, const StepMessage& message,
            std::span<const std::span<const std::byte>> blobs);
  void gap(const GapMessage& message);
  /// Copies a record of a kind that this program does not know.
  void foreign(const Record& record, std::span<const std::byte> body);
  /// Writes and syncs what is outstanding, the index record included, and adds an end record.
  void end();
  void write() { records_.write(); }
  void sync();

  /// What an end record would say now; `steps` = 0: no step yet.
  const EndMessage& summary() const { return summary_; }
  std::uint64_t durable_step() const { return durable_step_; }
  std::uint64_t bytes() const { return records_.written(); }
  std::uint64_t cut_bytes() const { return cut_bytes_; }
  bool has_unsynced() const { return records_.has_unsynced(); }

 private:
  void absorb(const Record& record, std::vector<std::uint64_t>& loose_events,
              const std::string& path);
  void write_index();
  void note(std::uint64_t step, bool keyframe, const StepMessage& message, std::uint64_t offset);

  Limits limits_;
  RecordAppender records_;
  IndexBuilder index_;
  EndMessage summary_;
  std::uint64_t durable_step_ = 0;
  std::uint64_t cut_bytes_ = 0;
};

}  // namespace varve::io
