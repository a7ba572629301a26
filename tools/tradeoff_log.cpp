// The price of recording: the same states written in every tier and cadence, then sought at random.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/criteria.h"
#include "core/random.h"
#include "io/log_writer.h"
#include "tools/progress.h"
#include "tools/scratch_folder.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"
#include "tools/svg_plot.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t states_bytes_max = std::uint64_t{512} << 20;
constexpr int rounds = 3;

double process_cpu() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double wall_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// One way to record, and what it was found to take.
struct Recording {
  std::string name;
  core::RecordTier tier;
  std::int64_t every, keyframe_steps;
  double bytes_per_step = 0;
  double encode_s = 0;     ///< CPU per step: copying, digest, encoding, writing, syncing
  double seek_cpu_s = 0, seek_wall_s = 0;  ///< means: open, find, decode or execute again
  bool front = false;
};

std::vector<Recording> recordings() {
  using enum core::RecordTier;
  return {{"deltas, keyframes 64", deltas, 1, 64},     {"deltas, keyframes 256", deltas, 1, 256},
          {"deltas, keyframes 1024", deltas, 1, 1024}, {"every 4", deltas, 4, 256},
          {"every 16", deltas, 16, 256},               {"every 64", deltas, 64, 256},
          {"digests, keyframes 16", digests, 1, 16},   {"digests, keyframes 64", digests, 1, 64},
          {"digests, keyframes 256", digests, 1, 256},
          {"digests, keyframes 1024", digests, 1, 1024}};
}

struct Recorded {
  core::Scenario scenario;
  std::vector<io::Frame> frames;
  std::vector<std::vector<io::Event>> events;
  io::Schema schema;
  double particles = 0, raw_bytes = 0;  ///< of one state
  double engine_s = 0;                  ///< CPU per step, without recording
};

double state_bytes(const io::Frame& frame) {
  double sum = 0;
  for (const auto& field : frame.fields) sum += static_cast<double>(field.size());
  return sum;
}

Recorded compute(const core::Scenario& scenario, std::uint64_t steps, const Globals& globals) {
  Recorded out;
  out.scenario = scenario;
  const auto engine = SimulationEngine::fresh(scenario, {});
  out.schema = engine->schema();
  out.frames.push_back(io::Frame::copy_of(engine->frame()));
  out.events.push_back(engine->events());
  out.raw_bytes = state_bytes(out.frames.front());
  for (std::size_t f = 0; f < out.schema.fields.size(); ++f)
    if (out.schema.fields[f].is_id && out.schema.fields[f].constant)
      out.particles += static_cast<double>(out.frames.front().counts[f]);
  const auto most = static_cast<std::uint64_t>(
      static_cast<double>(states_bytes_max) / std::max(1.0, out.raw_bytes));
  if (steps > most) {
    note(globals, fmt::format("{} states of {} would not fit in memory: {} are recorded", steps,
                              human_bytes(static_cast<std::uint64_t>(out.raw_bytes)), most));
    steps = most;
  }
  for (std::uint64_t n = 0; n < steps; ++n) {
    const double began = process_cpu();
    engine->advance();
    out.engine_s += process_cpu() - began;
    out.frames.push_back(io::Frame::copy_of(engine->frame()));
    out.events.push_back(engine->events());
  }
  out.engine_s /= static_cast<double>(std::max<std::uint64_t>(1, steps));
  return out;
}

/// Writes all states so; returns CPU time of the whole process.
double write_log(const Recorded& recorded, const Recording& how, const std::string& path) {
  core::Scenario scenario = recorded.scenario;
  scenario.record.tier = how.tier;
  scenario.record.every = how.every;
  scenario.record.keyframe_steps = how.keyframe_steps;
  const io::Genesis genesis = make_genesis(scenario, recorded.schema, 1);
  io::WriterOptions options;
  options.overwrite = true;
  const double began = process_cpu();
  const auto writer = io::LogWriter::create(path, genesis, recorded.frames.front().view(),
                                            recorded.events.front(), options);
  for (std::size_t n = 1; n < recorded.frames.size(); ++n)
    writer->append(recorded.frames[n].view(), recorded.events[n]);
  writer->close();
  return process_cpu() - began;
}

void measure_seeks(const std::string& path, std::uint64_t seeks, Recording& how) {
  for (std::uint64_t k = 0; k < seeks; ++k) {
    const double cpu = process_cpu(), wall = wall_now();
    const auto log = io::LogReader::open(path);
    const double draw = core::uniform(1, k, 0);
    const auto span = static_cast<double>(log->last_step() - log->first_step());
    const std::uint64_t step =
        log->first_step() + static_cast<std::uint64_t>(std::floor(draw * (span + 0.999)));
    state_at(*log, step, [&]() -> std::unique_ptr<io::Engine> {
      return SimulationEngine::of_genesis(log->genesis(), path, {});
    });
    how.seek_cpu_s += (process_cpu() - cpu) / static_cast<double>(seeks);
    how.seek_wall_s += (wall_now() - wall) / static_cast<double>(seeks);
  }
}

bool beats(const Recording& a, const Recording& b) {
  const bool as_good = a.bytes_per_step <= b.bytes_per_step && a.encode_s <= b.encode_s &&
                       a.seek_cpu_s <= b.seek_cpu_s;
  return as_good && (a.bytes_per_step < b.bytes_per_step || a.encode_s < b.encode_s ||
                     a.seek_cpu_s < b.seek_cpu_s);
}

std::string table_of(const std::string& file, const Recorded& recorded,
                     const std::vector<Recording>& all, std::uint64_t seeks) {
  const double steps = static_cast<double>(recorded.frames.size()) - 1;
  std::string out = fmt::format(
      "{}: {:g} steps of {:g} particles, {} raw; the engine takes {:.3g} ms of CPU a step\n"
      "encoding: CPU of copy, digest, codec, writing (median of {}); seek: mean of {} random "
      "steps, log opened for each\n{:<26}{:>12}{:>14}{:>12}{:>12}{:>12}{:>12}\n",
      file, steps, recorded.particles, human_bytes(static_cast<std::uint64_t>(recorded.raw_bytes)),
      1e3 * recorded.engine_s, rounds, seeks, "", "bytes/step", "/particle", "us/step",
      "/ engine", "seek ms", "wall ms");
  for (const Recording& each : all)
    out += fmt::format("{} {:<24}{:>12.5g}{:>14.4g}{:>12.4g}{:>11.1f}%{:>12.3g}{:>12.3g}\n",
                       each.front ? '*' : ' ', each.name, each.bytes_per_step,
                       each.bytes_per_step / recorded.particles, 1e6 * each.encode_s,
                       100 * each.encode_s / recorded.engine_s, 1e3 * each.seek_cpu_s,
                       1e3 * each.seek_wall_s);
  return out + "* nothing else is as small, as quick to write and as quick to seek\n";
}

std::string json_of(const std::string& file, const Recorded& recorded,
                    const std::vector<Recording>& all, std::uint64_t seeks) {
  Json object{{"schema", "varve.tradeoff_log/1"},
              {"scenario", file},
              {"steps", std::to_string(recorded.frames.size() - 1)},
              {"particles", std::to_string(static_cast<std::uint64_t>(recorded.particles))},
              {"raw_bytes_per_step", recorded.raw_bytes},
              {"engine_cpu_s_per_step", recorded.engine_s},
              {"seeks", std::to_string(seeks)}};
  Json& rows = object["recordings"] = Json::array();
  for (const Recording& each : all)
    rows.push_back({{"name", each.name},
                    {"tier", each.tier == core::RecordTier::deltas ? "deltas" : "digests"},
                    {"every", each.every},
                    {"keyframe_steps", each.keyframe_steps},
                    {"bytes_per_step", each.bytes_per_step},
                    {"bytes_per_particle_step", each.bytes_per_step / recorded.particles},
                    {"encode_cpu_s_per_step", each.encode_s},
                    {"seek_cpu_s", each.seek_cpu_s},
                    {"seek_wall_s", each.seek_wall_s},
                    {"front", each.front}});
  return object.dump(2) + "\n";
}

std::string csv_of(const std::vector<Recording>& all) {
  std::string out =
      "recording,bytes_per_step,encode_cpu_s_per_step,seek_cpu_s,seek_wall_s,front\n";
  for (const Recording& each : all)
    out += fmt::format("\"{}\",{},{},{},{},{}\n", each.name, each.bytes_per_step, each.encode_s,
                       each.seek_cpu_s, each.seek_wall_s, each.front ? 1 : 0);
  return out;
}

std::string svg_of(const std::string& file, const std::vector<Recording>& all) {
  Plot plot;
  plot.title = file + ": bytes against seek";
  plot.x_label = "bytes per step";
  plot.y_label = "CPU seconds to seek";
  plot.log_x = plot.log_y = true;
  plot.series.resize(3);
  for (std::size_t k = 0; k < 3; ++k) {
    plot.series[k].name = std::array{"deltas", "every k", "digests"}[k];
    plot.series[k].line = false;
  }
  for (const Recording& each : all) {
    PlotSeries& series =
        plot.series[each.tier == core::RecordTier::digests ? 2 : (each.every > 1 ? 1 : 0)];
    series.x.push_back(each.bytes_per_step);
    series.y.push_back(each.seek_cpu_s);
    series.labels.push_back(each.every > 1 ? std::to_string(each.every)
                                           : std::to_string(each.keyframe_steps));
  }
  return svg_of(plot);
}

/// Steps executed again by a mean seek.
double steps_again(const Recording& how, double steps) {
  const double apart = how.tier == core::RecordTier::digests
                           ? static_cast<double>(how.keyframe_steps)
                           : static_cast<double>(how.every);
  return 0.5 * (std::min(apart, steps) - 1);
}

}  // namespace

int trade_log(const Invocation& invocation) {
  const std::string& file = invocation.arguments.front();
  const TradeScene scene = load_trade_scene(file, invocation.values("set"), {});
  const std::uint64_t run_steps = core::steps_of_run(scene.base);
  const std::uint64_t steps = std::min(invocation.count("steps").value_or(1024), run_steps);
  const std::uint64_t seeks = invocation.count("seeks").value_or(32);
  if (steps < 16) throw UsageError(fmt::format("--log: {} steps are too few; at least 16", steps));
  if (seeks < 1) throw UsageError("--seeks: expected at least 1");
  std::vector<Recording> all = recordings();

  const Cost whole = predict_cost(scene.base, 1);
  const double each = whole.cpu_s / static_cast<double>(std::max<std::uint64_t>(1, run_steps));
  double predicted = static_cast<double>(steps) * each *
                     (1 + 0.5 * rounds * static_cast<double>(all.size()));
  for (const Recording& how : all)
    predicted +=
        static_cast<double>(seeks) * steps_again(how, static_cast<double>(steps)) * each;
  const std::string plan =
      fmt::format("{} recordings of {} steps, {} seeks in each: at most about {:.3g} CPU-seconds\n",
                  all.size(), steps, seeks, predicted);
  if (invocation.has("budget") && predicted > duration_option(invocation, "budget"))
    throw UsageError(fmt::format("--budget: {}; fewer --steps or --seeks take less",
                                 plan.substr(0, plan.size() - 1)));
  if (invocation.has("dry-run")) {
    print(plan);
    return exit_ok;
  }
  if (!invocation.globals.quiet) fmt::print(stderr, "{}", plan);

  const Recorded recorded = compute(scene.base, steps, invocation.globals);
  const ScratchFolder scratch;
  const std::string path = scratch.file("log.varve");
  std::vector<std::vector<double>> times(all.size());
  for (int round = 0; round < rounds; ++round)
    for (std::size_t k = 0; k < all.size(); ++k)
      times[k].push_back(write_log(recorded, all[k], path));
  for (std::size_t k = 0; k < all.size(); ++k) {
    std::nth_element(times[k].begin(), times[k].begin() + rounds / 2, times[k].end());
    const auto appended = static_cast<double>(recorded.frames.size() - 1);
    all[k].encode_s = times[k][rounds / 2] / appended;
    write_log(recorded, all[k], path);
    all[k].bytes_per_step = static_cast<double>(std::filesystem::file_size(path)) / appended;
    measure_seeks(path, seeks, all[k]);
  }
  for (Recording& one : all)
    one.front = std::none_of(all.begin(), all.end(),
                             [&](const Recording& other) { return beats(other, one); });
  if (invocation.has("output")) {
    const std::filesystem::path folder(invocation.value("output"));
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    write_whole((folder / "log.json").string(), json_of(file, recorded, all, seeks));
    write_whole((folder / "log.csv").string(), csv_of(all));
    write_whole((folder / "log.svg").string(), svg_of(file, all));
  }
  print(invocation.globals.json ? json_of(file, recorded, all, seeks)
                                : table_of(file, recorded, all, seeks));
  return exit_ok;
}

}  // namespace varve::tools
