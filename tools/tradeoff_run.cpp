// Runs of rungs: each is a child `varve run`, measured from its log, and stored under a name made
// from its content, so that a tradeoff that was stopped goes on where it was.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "core/criteria.h"
#include "core/parameters.h"
#include "io/digest.h"
#include "tools/measure.h"
#include "tools/probe.h"
#include "tools/recording.h"
#include "tools/signals.h"
#include "tools/subprocess.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr const char* rung_schema = "varve.tradeoff-rung/1";

double process_cpu() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string last_line(const std::string& text) {
  std::istringstream lines(text);
  std::string line, last;
  while (std::getline(lines, line))
    if (!line.empty()) last = line;
  return last;
}

/// What a result depends on: the scenario to the bit, the engine, the build, who measured.
std::string content_key(const core::Scenario& resolved, const std::vector<TradeMeasure>& measures,
                        const RunSettings& how) {
  std::string content = core::canonical_text(resolved);
  for (const core::ListedGrain& grain : resolved.grains.list)
    content += fmt::format("\n{} {} {} {}", grain.species, fmt::join(grain.position, " "),
                           fmt::join(grain.velocity, " "), fmt::join(grain.spin, " "));
  content += fmt::format("\nrevision {}\nthreads {}\n", core::engine_revision, how.threads);
  for (const auto& [name, value] : build_facts())
    if (name == "version" || name == "compiler" || name == "build" || name == "flags")
      content += fmt::format("{} {}\n", name, value);
  std::vector<std::string> names;
  for (const TradeMeasure& each : measures) names.push_back(each.name + " " + each.meaning);
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) content += name + "\n";
  return io::digest_text(content).hex().substr(0, 16);
}

struct Child {
  int code = 0;
  double cpu_s = 0, wall_s = 0;
};

/// Runs the child to its end, or to a signal of ours, which it gets too.
Child run_child(const std::vector<std::string>& words, const std::string& output,
                const std::string& errors, const StopSignals& signals) {
  const auto began = std::chrono::steady_clock::now();
  const int pid = start_program(words, output, errors);
  if (pid < 0)
    throw ToolError(exit_internal, fmt::format("{}: {}", words[0], std::strerror(-pid)));
  int status = 0;
  rusage used{};
  bool told = false;
  // Waiting in small pieces: a signal handler that restarts calls would never be noticed.
  while (wait4(pid, &status, WNOHANG, &used) == 0) {
    if (signals.received() != 0 && !told) {
      kill(pid, SIGTERM);
      told = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - began;
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  if (signals.received() != 0) throw Exit{exit_stopped};
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
          seconds(used.ru_utime) + seconds(used.ru_stime), wall.count()};
}

Json json_of(const RungRun& run) {
  Json object{{"schema", rung_schema},
              {"code", run.code},
              {"failure", run.failure},
              {"chain", run.chain},
              {"cpu_s", run.cost.cpu_s},
              {"wall_s", run.cost.wall_s},
              {"steps", std::to_string(run.cost.steps)},
              {"bytes", std::to_string(run.cost.bytes)},
              {"reading_s", run.reading_s}};
  Json& values = object["values"] = Json::object();
  for (const auto& [name, numbers] : run.values) values[name] = numbers;
  return object;
}

std::optional<RungRun> stored(const std::string& path) {
  const Json object = Json::parse(read_text(path), nullptr, false);
  if (object.is_discarded() || object.value("schema", "") != rung_schema) return std::nullopt;
  RungRun run;
  try {
    run.code = object.at("code");
    run.failure = object.at("failure");
    run.chain = object.at("chain");
    run.cost.cpu_s = object.at("cpu_s");
    run.cost.wall_s = object.at("wall_s");
    run.cost.steps = std::stoull(object.at("steps").get<std::string>());
    run.cost.bytes = std::stoull(object.at("bytes").get<std::string>());
    run.reading_s = object.at("reading_s");
    for (const auto& [name, numbers] : object.at("values").items())
      run.values[name] = numbers.get<std::vector<double>>();
  } catch (const std::exception&) {
    return std::nullopt;
  }
  run.cached = true;
  return run;
}

std::string result_path(const std::string& folder, const std::string& key) {
  return (fs::path(folder) / "rungs" / (key + ".json")).string();
}

void measure(const std::string& log_path, const core::Scenario& scenario, double until,
             const std::vector<TradeMeasure>& measures, RungRun& run) {
  const double began = process_cpu();
  const auto log = io::LogReader::open(log_path);
  RunView view(*log, scenario, until);
  bool summary = false, energies = false;
  for (const TradeMeasure& each : measures) {
    summary = summary || each.needs_summary;
    energies = energies || each.needs_energies;
  }
  view.read(summary, energies);
  std::vector<Measure> expressions;
  for (const TradeMeasure& each : measures)
    if (!each.expression.empty()) expressions.push_back(make_measure(each.name, each.expression));
  if (!expressions.empty()) {
    const Measured found = evaluate_measures(*log, scenario, expressions);
    for (std::size_t k = 0; k < expressions.size(); ++k)
      if (std::isfinite(found.values[k])) run.values[expressions[k].name] = {found.values[k]};
  }
  for (const TradeMeasure& each : measures) {
    if (!each.evaluate) continue;
    std::vector<double> values = each.evaluate(view);
    // What is no number did not happen, as far as an error of it goes.
    for (const double value : values)
      if (!std::isfinite(value)) values.clear();
    if (!values.empty()) run.values[each.name] = std::move(values);
  }
  run.reading_s = process_cpu() - began;
}

}  // namespace

std::optional<Cost> finished_cost(const core::Scenario& resolved,
                                  const std::vector<TradeMeasure>& measures,
                                  const RunSettings& how) {
  const auto run = stored(result_path(how.folder, content_key(resolved, measures, how)));
  return run ? std::optional<Cost>(run->cost) : std::nullopt;
}

RungRun run_rung(const TradeScene& scene, const std::vector<std::string>& settings,
                 const core::Scenario& resolved, const std::vector<TradeMeasure>& measures,
                 const RunSettings& how, const StopSignals& signals) {
  const std::string key = content_key(resolved, measures, how);
  const std::string path = result_path(how.folder, key);
  if (auto found = stored(path)) return *found;
  if (signals.received() != 0) throw Exit{exit_stopped};
  std::error_code ignored;
  fs::create_directories(fs::path(path).parent_path(), ignored);
  const std::string stem = (fs::path(path).parent_path() / key).string();
  const std::string log = stem + ".varve", output = stem + ".out", errors = stem + ".err";
  std::vector<std::string> words{executable_folder() + "/varve-run", scene.file};
  for (const std::string& each : settings_on_top(scene.settings, settings)) {
    words.push_back("-s");
    words.push_back(each);
  }
  for (const std::string& word :
       {std::string("-o"), log, std::string("--overwrite"), std::string("--threads"),
        std::to_string(how.threads), std::string("--json"), std::string("-q"),
        std::string("--progress"), std::string("none")})
    words.push_back(word);
  const auto tidy = [&] {
    for (const std::string& file : {output, errors}) fs::remove(file, ignored);
    if (!how.keep_logs) fs::remove(log, ignored);
  };
  RungRun run;
  try {
    const Child child = run_child(words, output, errors, signals);
    run.code = child.code;
    run.cost = {child.cpu_s, child.wall_s, 0, 0};
    const Json said = Json::parse(read_text(output), nullptr, false);
    if (said.is_object()) {
      run.cost.steps = std::stoull(said.value("steps", "0"));
      run.cost.bytes = std::stoull(said.value("log_bytes", "0"));
      run.chain = said.value("final_chain", "");
      if (said.contains("failure")) run.failure = said["failure"].value("text", "");
    }
    if (run.code != exit_ok && run.failure.empty()) run.failure = last_line(read_text(errors));
    if (run.code == exit_output) throw ToolError(exit_output, run.failure);
    if (run.code == exit_ok) measure(log, resolved, scene.until, measures, run);
    if (signals.received() != 0) throw Exit{exit_stopped};
  } catch (...) {
    // A child that was told to stop as it started leaves its lock and an unfinished log, too.
    for (const char* left : {"", ".lock", ".new"}) fs::remove(log + left, ignored);
    tidy();
    throw;
  }
  tidy();
  write_whole(path, json_of(run).dump(2) + "\n");
  return run;
}

Cost predict_cost(const core::Scenario& resolved, unsigned threads) {
  constexpr std::uint64_t few = 4;
  const std::uint64_t run_steps = core::steps_of_run(resolved);
  const auto probed = [&](std::uint64_t steps, Cost& cost) {
    const double began = process_cpu();
    const Probe probe = probe_log(resolved, run_steps, steps, {threads, 0});
    cost.cpu_s = process_cpu() - began;
    cost.steps = probe.steps;
    cost.bytes = static_cast<std::uint64_t>(std::max(0.0, probe.predicted_bytes));
    return probe.steps == run_steps;
  };
  Cost start;
  const bool all = probed(few, start);
  Cost cost = start;
  if (!all) {
    // Then about a twentieth of the run, within limits, to tell a step's time from the start-up's.
    const double step = start.cpu_s / static_cast<double>(few);
    const double aim = std::clamp(0.05 * step * static_cast<double>(run_steps), 0.01, 0.15);
    const auto steps = static_cast<std::uint64_t>(std::clamp(aim / step, 16.0, 4096.0));
    if (!probed(steps, cost))
      cost.cpu_s += std::max(0.0, cost.cpu_s - start.cpu_s) / static_cast<double>(steps - few) *
                    static_cast<double>(run_steps - steps);
  }
  cost.steps = run_steps;
  cost.wall_s = cost.cpu_s / threads;
  return cost;
}

void write_whole(const std::string& path, std::string_view text) {
  const std::string partial = path + ".part";
  std::FILE* file = std::fopen(partial.c_str(), "wb");
  const bool written = file && std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (!file || std::fclose(file) != 0 || !written || std::rename(partial.c_str(), path.c_str()))
    throw ToolError(exit_output, fmt::format("{}: {}", path, std::strerror(errno)));
}

}  // namespace varve::tools
