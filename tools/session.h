// What run, resume and fork do alike once an engine and an open log stand ready: advance and record
// with progress, stop on request, say how it ended.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/log_writer.h"
#include "tools/cli.h"
#include "tools/recording.h"
#include "tools/simulation_engine.h"

namespace varve::tools {

struct Session {
  Globals globals;
  std::string verb;  ///< "run"
  std::string path;  ///< of the log
  Target target;
  std::optional<double> stop_after_s;  ///< wall time
  std::vector<io::Event> first_events;  ///< recorded with the log's first state, counted as added
};

/// Runs to the target, prints the summary (JSON on stdout with --json) and returns the exit code:
/// 0, 5 after a numerical failure, 75 where it was stopped. The log is closed in every case.
int run_session(SimulationEngine& engine, std::unique_ptr<io::LogWriter> writer,
                const Session& session);

/// "90 s", "10min", "1.5h"; bare numbers are seconds. UsageError names the option otherwise.
double duration_option(const Invocation& invocation, const std::string& option);

/// --stop-after, where it is given.
std::optional<double> stop_after_option(const Invocation& invocation);

/// --threads: at least 1 (0: one per core of the machine).
unsigned threads_option(const Invocation& invocation);

/// --steps and --until as a target, counted from `at_step`; nothing if neither is given. UsageError
/// if both are.
std::optional<Target> target_option(const Invocation& invocation, std::uint64_t at_step);

/// Fluid mass [kg, per metre of depth in 2D] and particles that events added (removed: negative).
struct Added {
  double fluid_mass = 0;
  std::int64_t fluid_count = 0;
  std::int64_t grain_count = 0;
};
Added added_by(const std::vector<io::Event>& events);

/// "width: 6 fluid columns added, ..." - one line per event.
std::vector<std::string> event_lines(const std::vector<io::Event>& events);

/// The options that all recording verbs share.
OptionSpec threads_spec();
OptionSpec steps_spec(const std::string& help);
OptionSpec until_spec();
OptionSpec stop_after_spec();

}  // namespace varve::tools
