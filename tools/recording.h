// What joins any engine to a log: recording its steps, going back to one of them, executing them
// again and comparing. Knows io::Engine and the log only; an engine of any kind can be driven by
// it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/engine.h"
#include "io/log_reader.h"
#include "io/log_writer.h"
#include "tools/cli.h"

namespace varve::tools {

/// Thrown by an engine's advance() where it cannot go on; its state is then that of the last good
/// step. `details` are key/value pairs for machine-readable output (criterion, field, id, ...).
class EngineFailure : public ToolError {
 public:
  explicit EngineFailure(const std::string& text,
                         std::vector<std::pair<std::string, std::string>> facts = {})
      : ToolError(exit_numerical, text), details(std::move(facts)) {}
  std::vector<std::pair<std::string, std::string>> details;
};

/// The first thing in which a record and its re-execution differ.
struct Mismatch {
  std::uint64_t step = 0;
  double time = 0;  ///< [s]
  /// Field of the state, "TABLE.COLUMN" of an event table, or "events". Empty where the log stores
  /// only the digest of this step.
  std::string field;
  std::optional<std::string> component;  ///< "fluid.velocity.y" where the field has several
  std::optional<std::string> particle;   ///< id (the index where the population has no ids)
  std::optional<std::uint64_t> row;      ///< in an event table
  std::string recorded, computed;        ///< values: hex floats, whole numbers, or words
  std::optional<std::uint64_t> ulp;      ///< distance of the values in representable numbers
  io::Digest recorded_digest, computed_digest;
};
/// One sentence: step, time, field, particle, both values.
std::string describe(const Mismatch& mismatch);

/// Re-executing recorded steps gave other bits than the record: exit 1 in every verb.
class Divergence : public ToolError {
 public:
  Divergence(const std::string& path, Mismatch found);
  Mismatch mismatch;
};

/// First value in which two states of one schema differ; nothing if their digests are equal.
std::optional<Mismatch> first_difference(const io::Schema& schema, const io::FrameView& recorded,
                                         const io::FrameView& computed);
/// First row and column in which the tables of two steps differ.
std::optional<Mismatch> first_table_difference(const io::Schema& schema,
                                               const io::FrameView& recorded,
                                               const io::FrameView& computed);

/// Brings `engine` to a recorded step: the nearest stored state, then re-execution, every step on
/// the way checked against its digest. Returns the number of steps executed. Throws LogError
/// (not_found where the log does not hold the step, damaged) and Divergence.
std::uint64_t seek(const io::LogReader& log, std::uint64_t step, io::Engine& engine);

/// State of a step, decoded where it is stored, else re-executed by what `make_engine` returns
/// (called only then). Throws as seek().
io::Frame state_at(const io::LogReader& log, std::uint64_t step,
                   const std::function<std::unique_ptr<io::Engine>()>& make_engine);

/// How far to go: at most `last_step`, and no further than the first step with time >= `until`.
struct Target {
  std::optional<std::uint64_t> last_step;
  std::optional<double> until;  ///< [s]
  bool reached(std::uint64_t step, double time) const;
};

enum class StopReason { reached, asked, failed };

struct RecordingResult {
  StopReason reason = StopReason::reached;
  std::uint64_t first_step = 0;  ///< where the engine stood at the start
  std::uint64_t last_step = 0;
  double time = 0;               ///< [s] at last_step
  double wall_s = 0;
  std::vector<io::Event> events;         ///< of the recorded steps
  std::optional<EngineFailure> failure;  ///< with reason `failed`
  io::WriterStatus status;               ///< after closing
};

/// Advances `engine` and appends every step until the target is reached, the engine fails or
/// `go_on` (called after every step) returns false; then closes the log. An error of the log is
/// thrown on with the last durable step in its text.
RecordingResult record(io::Engine& engine, io::LogWriter& writer, const Target& target,
                       const std::function<bool(const io::FrameView&)>& go_on);

struct ReplayResult {
  std::uint64_t started_at = 0;     ///< step of the stored state that re-execution began with
  std::uint64_t last_step = 0;      ///< last step compared
  std::uint64_t steps_checked = 0;  ///< digests compared, the first state's included
  bool stopped = false;             ///< `go_on` returned false
  std::optional<Mismatch> first;
};

/// Executes the steps `from`..`to` again, from the nearest stored state at or before `from`, and
/// compares every state, every event table and every event with the record; ends at the first
/// difference. `go_on` is called after every step.
ReplayResult replay(const io::LogReader& log, io::Engine& engine, std::uint64_t from,
                    std::uint64_t to, const std::function<bool(const io::FrameView&)>& go_on);

/// Chain that a fork at `step` of `log` starts from: that of the step before, or the log's own base
/// where `step` is its first.
io::Digest fork_chain_base(const io::LogReader& log, std::uint64_t step);

/// Lineage of a fork of `log` at `step`, with the keys that change.
io::Lineage make_lineage(const io::LogReader& log, std::uint64_t step,
                         std::vector<io::Lineage::Change> changes);

/// Throws UsageError where the log was recorded by another engine or another revision of it.
void require_same_engine(const io::LogReader& log, const std::string& engine,
                         std::uint32_t revision, const std::string& what_else_to_do);

}  // namespace varve::tools
