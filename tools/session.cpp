#include "tools/session.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/progress.h"
#include "tools/signals.h"
#include "tools/steps.h"

namespace varve::tools {

namespace {

using Json = nlohmann::ordered_json;

/// How a session ended, for people and for scripts.
enum class Ending { end, signal, stop_after, numerical_failure };

std::string_view name_of(Ending ending) {
  switch (ending) {
    case Ending::end: return "end";
    case Ending::signal: return "signal";
    case Ending::stop_after: return "stop_after";
    case Ending::numerical_failure: return "numerical_failure";
  }
  return "end";
}

int exit_code(Ending ending) {
  switch (ending) {
    case Ending::end: return exit_ok;
    case Ending::numerical_failure: return exit_numerical;
    default: return exit_stopped;
  }
}

double rate(const RecordingResult& result) {
  const auto steps = static_cast<double>(result.last_step - result.first_step);
  return result.wall_s > 0 ? steps / result.wall_s : 0;
}

Json counters_json(const core::Counters& counters) {
  Json object{{"list_rebuilds", std::to_string(counters.list_rebuilds)},
              {"porosity_clamps", std::to_string(counters.porosity_clamps)},
              {"drag_porosity_clamps", std::to_string(counters.drag_porosity_clamps)},
              {"weak_coupling", std::to_string(counters.weak_coupling)},
              {"grain_substeps", std::to_string(counters.grain_substeps)}};
  Json& per_thread = object["items_per_thread"] = Json::array();
  for (const std::uint64_t items : counters.items_per_thread)
    per_thread.push_back(std::to_string(items));
  return object;
}

void print_json(const SimulationEngine& engine, const Session& session,
                const RecordingResult& result, Ending ending) {
  std::vector<io::Event> events = session.first_events;
  events.insert(events.end(), result.events.begin(), result.events.end());
  const Added added = added_by(events);
  Json object{{"schema", fmt::format("varve.{}/1", session.verb)},
              {"run", session.path},
              {"steps", std::to_string(result.last_step - result.first_step)},
              {"first_step", std::to_string(result.first_step)},
              {"last_step", std::to_string(result.last_step)},
              {"time_s", result.time},
              {"final_chain", result.status.chain.hex()},
              {"wall_s", result.wall_s},
              {"steps_per_s", rate(result)},
              {"log_bytes", std::to_string(result.status.bytes)}};
  object["added"] = {{"fluid_mass_kg", added.fluid_mass},
                     {"fluid_count", std::to_string(added.fluid_count)},
                     {"grain_count", std::to_string(added.grain_count)}};
  if (engine.simulation().scenario().domain.dimension == 2) object["added"]["per"] = "m depth";
  object["counters"] = counters_json(engine.simulation().counters());
  object["stop_reason"] = name_of(ending);
  if (result.failure) {
    Json& failure = object["failure"] = {{"text", result.failure->what()}};
    for (const auto& [key, value] : result.failure->details) failure[key] = value;
  }
  print(object.dump(2) + "\n");
}

/// Numbers that deserve attention even where nobody asked.
void print_counters(const core::Counters& counters, const Session& session) {
  const auto mention = [&](std::uint64_t number, const char* what) {
    if (number > 0) note(session.globals, fmt::format("warning: {} {}", number, what));
  };
  mention(counters.porosity_clamps, "times the porosity of a fluid particle was held at its floor");
  mention(counters.drag_porosity_clamps, "times the porosity in a drag law was held at its floor");
  mention(counters.weak_coupling,
          "grain-steps with less than half the fluid in reach of the grain");
}

void print_summary(const Session& session, const RecordingResult& result) {
  print(fmt::format("{}: steps {} to {}, t = {:.6g} s, chain {}\n", session.path,
                    result.first_step, result.last_step, result.time, result.status.chain.hex()));
  print(fmt::format("{:.2f} s, {:.4g} steps/s, log {}\n", result.wall_s, rate(result),
                    human_bytes(result.status.bytes)));
}

void print_ending(const Session& session, const RecordingResult& result, Ending ending) {
  if (ending == Ending::end) return;
  if (result.failure) {
    fmt::print(stderr, "varve {}: {}\nvarve {}: {} keeps every step up to {} (t = {:.6g} s)\n",
               session.verb, result.failure->what(), session.verb, session.path, result.last_step,
               result.time);
    return;
  }
  note(session.globals,
       fmt::format("stopped {} after step {} (t = {:.6g} s); the log is closed. Continue with: "
                   "varve resume {}",
                   ending == Ending::signal ? "by a signal" : "by --stop-after", result.last_step,
                   result.time, session.path));
}

}  // namespace

int run_session(SimulationEngine& engine, std::unique_ptr<io::LogWriter> writer,
                const Session& session) {
  const io::FrameView start = engine.frame();
  Progress progress(session.globals, session.verb, {session.target.last_step, session.target.until},
                    {start.step, start.time, start.dt, 0});
  const StopSignals signals;
  const auto began = std::chrono::steady_clock::now();
  Ending ending = Ending::end;
  const auto go_on = [&](const io::FrameView& frame) {
    if (progress.due())
      progress.update({frame.step, frame.time, frame.dt, writer->status().bytes});
    if (signals.received() != 0) ending = Ending::signal;
    if (session.stop_after_s) {
      const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - began;
      if (wall.count() >= *session.stop_after_s) ending = Ending::stop_after;
    }
    return ending == Ending::end;
  };
  const RecordingResult result = record(engine, *writer, session.target, go_on);
  writer.reset();
  progress.finish();
  if (result.reason == StopReason::reached) ending = Ending::end;
  if (result.reason == StopReason::failed) ending = Ending::numerical_failure;

  print_counters(engine.simulation().counters(), session);
  if (session.globals.json) {
    print_json(engine, session, result, ending);
  } else if (!session.globals.quiet) {
    print_summary(session, result);
  }
  print_ending(session, result, ending);
  return exit_code(ending);
}

double duration_option(const Invocation& invocation, const std::string& option) {
  const double seconds = parse_seconds(invocation.value(option), "--" + option);
  if (!(seconds >= 0))
    throw UsageError(fmt::format("--{}: expected a duration >= 0, got '{}'", option,
                                 invocation.value(option)));
  return seconds;
}

std::optional<double> stop_after_option(const Invocation& invocation) {
  if (!invocation.has("stop-after")) return std::nullopt;
  return duration_option(invocation, "stop-after");
}

unsigned threads_option(const Invocation& invocation) {
  constexpr std::uint64_t threads_max = 1024;
  const auto threads = invocation.count("threads");
  if (!threads) return 1;
  if (*threads > threads_max)
    throw UsageError(fmt::format("--threads: {} is too many; at most {}", *threads, threads_max));
  if (*threads == 0) return std::max(1u, std::thread::hardware_concurrency());
  return static_cast<unsigned>(*threads);
}

std::optional<Target> target_option(const Invocation& invocation, std::uint64_t at_step) {
  constexpr std::uint64_t steps_max = 1'000'000'000'000'000;
  const bool steps = invocation.has("steps"), until = invocation.has("until");
  if (steps && until) throw UsageError("--steps and --until exclude each other; give one of them");
  if (!steps && !until) return std::nullopt;
  Target target;
  if (until) {
    target.until = duration_option(invocation, "until");
  } else {
    const std::uint64_t count = invocation.count("steps").value_or(0);
    if (count > steps_max)
      throw UsageError(fmt::format("--steps: {} is too many; at most {}", count, steps_max));
    target.last_step = at_step + count;
  }
  return target;
}

Added added_by(const std::vector<io::Event>& events) {
  Added added;
  for (const io::Event& event : events) {
    const auto item = [&](std::string_view name) -> std::string {
      for (const auto& [key, value] : event.items)
        if (key == name) return value;
      return "0";
    };
    const std::string ids = event.kind == "grains_removed" ? item("ids") : "";
    if (!ids.empty()) added.grain_count -= 1 + std::count(ids.begin(), ids.end(), ' ');
    if (event.kind != "fluid_added" && event.kind != "fluid_removed") continue;
    const int sign = event.kind == "fluid_added" ? 1 : -1;
    const std::string mass = item("mass"), count = item("count");
    double kilograms = 0;
    std::int64_t particles = 0;
    std::from_chars(mass.data(), mass.data() + mass.size(), kilograms);
    std::from_chars(count.data(), count.data() + count.size(), particles);
    added.fluid_mass += sign * kilograms;
    added.fluid_count += sign * particles;
  }
  return added;
}

std::vector<std::string> event_lines(const std::vector<io::Event>& events) {
  std::vector<std::string> lines;
  for (const io::Event& event : events) {
    std::string line = fmt::format("step {}: {}", event.step, event.kind);
    for (const auto& [key, value] : event.items) line += fmt::format(" {} = {},", key, value);
    if (line.back() == ',') line.pop_back();
    lines.push_back(std::move(line));
  }
  return lines;
}

OptionSpec threads_spec() {
  return {"threads", "N", "threads of the engine (0: one per core); never changes a bit", false,
          "1"};
}
OptionSpec steps_spec(const std::string& help) { return {"steps", "N", help, false, ""}; }
OptionSpec until_spec() {
  return {"until", "T", "end at the first step with time >= T, e.g. '0.3 s'", false, ""};
}
OptionSpec stop_after_spec() {
  return {"stop-after", "D", "stop after this much wall time, e.g. 90s, 10min, 1.5h (exit 75)",
          false, ""};
}

}  // namespace varve::tools
