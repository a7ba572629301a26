// Reads a log: any step by index or by scan, needing no lock, while it is being written or after it
// was torn or damaged. One state in memory at a time; memory does not grow with the number of
// steps.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/genesis.h"
#include "io/limits.h"

namespace varve::io {

class FileSystem;

/// How a log ends.
enum class Completeness {
  complete,  ///< whole records to the end (closed() tells whether an End record is the last)
  torn,      ///< bytes beyond the last whole record, none of them known durable
  damaged,   ///< a record that was durable does not hold
};
std::string_view name_of(Completeness completeness);

/// What every step record says without decoding its state.
struct StepHeader {
  std::uint64_t step = 0;
  double time = 0, dt = 0;
  Digest digest, chain;
  bool has_state = false;  ///< a state is stored (delta or keyframe), not only its digest
};

struct Damage {
  std::int64_t offset = 0;
  std::string what;           ///< record kind and what did not hold
  /// Steps that cannot be read because of it, inclusive; none where step_from > step_to.
  std::uint64_t step_from = 1, step_to = 0;
};

/// Bytes by record kind and by field, for `info`.
struct ByteCount {
  std::string name;
  std::uint64_t records = 0, stored = 0, raw = 0;
};

/// What a walk over many states decodes of them.
struct StatePart {
  std::vector<std::string> populations;  ///< of every state; names that there are none of are legal
  bool keyframes = false;                ///< states that are stored whole are decoded whole
  /// Least step at or after the one given whose state is decoded whole, or none; never smaller for
  /// a larger argument.
  std::function<std::optional<std::uint64_t>(std::uint64_t step)> next_whole;
};

/// Not for use by several threads at once: each opens its own.
class LogReader {
 public:
  /// Throws LogError (not_found, not_a_log, unsupported, limit, damaged where genesis itself is or
  /// no step is whole).
  static std::unique_ptr<LogReader> open(const std::string& path, FileSystem* files = nullptr,
                                         const Limits& limits = {});
  virtual ~LogReader() = default;

  virtual const std::string& path() const = 0;
  virtual const Genesis& genesis() const = 0;
  virtual std::uint64_t first_step() const = 0;
  virtual std::uint64_t last_step() const = 0;
  /// As far as is known: opening looks at the end, reading at what it reads, verify() at all. A
  /// part of a record behind the end of a log that is just being written is not called torn.
  virtual Completeness completeness() const = 0;
  virtual bool closed() const = 0;
  /// Bytes beyond the last whole record (torn), else 0.
  virtual std::uint64_t torn_bytes() const = 0;

  /// Header of a step, by index; nothing where the log does not hold the step.
  virtual std::optional<StepHeader> header(std::uint64_t step) const = 0;
  /// Nearest step <= `step` that the log holds; its first step where there is none.
  virtual std::uint64_t held_at_or_before(std::uint64_t step) const = 0;
  /// Nearest step <= `step` whose state is stored, from which re-execution can start.
  virtual std::optional<std::uint64_t> stored_step_at_or_before(std::uint64_t step) const = 0;
  /// The state of a step, tables included. Nothing where its state is not stored (tier digests,
  /// every k) or lost. Throws LogError(damaged) where the decoded state's digest is not the
  /// recorded one.
  virtual std::optional<Frame> frame(std::uint64_t step) const = 0;
  /// Tables recorded at a step (empty tables where none were).
  virtual std::optional<Frame> tables(std::uint64_t step) const = 0;
  /// Calls `visit` for every held step in [from, to] in order, states decoded one after the other
  /// (`frame` is null where no state is stored). Stops when `visit` returns false.
  virtual void for_each(
      std::uint64_t from, std::uint64_t to,
      const std::function<bool(const StepHeader&, const Frame*)>& visit) const = 0;
  /// The same where most states are wanted in part: `visit` is told whether the state is whole.
  /// Where it is not, only the fields of `part.populations` are there, held by the checksums of
  /// their blobs; other fields are empty. Whole states are checked against their digests.
  virtual void for_each_part(
      std::uint64_t from, std::uint64_t to, const StatePart& part,
      const std::function<bool(const StepHeader&, const Frame*, bool whole)>& visit) const = 0;
  /// The same without decoding any state.
  virtual void for_each_header(std::uint64_t from, std::uint64_t to,
                               const std::function<bool(const StepHeader&)>& visit) const = 0;
  /// Events in order of step, all of them (they are few).
  virtual std::vector<Event> events() const = 0;
  /// Last step whose time is <= `time` + 1e-6 dt; first step where `time` lies before it.
  virtual std::uint64_t step_at_time(double time) const = 0;

  /// Follows a growing file: true if there are more steps than before.
  virtual bool refresh() = 0;
  /// Full walk: every byte is checked; returns what does not hold.
  struct Verification {
    Completeness completeness = Completeness::complete;
    bool closed = false;
    std::uint64_t bytes_checked = 0, file_bytes = 0, steps = 0;
    std::vector<Damage> damage;
  };
  /// `decode`: also every state, against its digest.
  virtual Verification verify(bool decode = true) const = 0;
  virtual std::vector<ByteCount> bytes_by_kind() const = 0;
  virtual std::vector<ByteCount> bytes_by_field() const = 0;
  /// Records and index entries read since opening.
  virtual std::uint64_t header_reads() const = 0;
};

/// What recover() did.
struct Recovery {
  std::uint64_t steps_kept = 0;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> lost;  ///< step ranges, inclusive
  std::vector<Damage> damage;
  bool lossy = false;
};
/// Writes everything whole in `input` to the new file `output`, verifies it, never touches the
/// input.
Recovery recover(const std::string& input, const std::string& output, bool overwrite = false,
                 FileSystem* files = nullptr);

}  // namespace varve::io
