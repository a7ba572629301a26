// varve analyze: observables of a recorded run, from its log alone.
#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/log_reader.h"
#include "tools/analysis.h"
#include "tools/analysis_json.h"
#include "tools/cli.h"
#include "tools/simulation_engine.h"
#include "tools/snapshot.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

/// Files (or standard output) that tables go to. A table that can't be written whole is an error,
/// never a shorter file that looks like one.
class CsvFiles {
 public:
  CsvFiles(const std::string& where, const std::vector<const Observable*>& tables) {
    if (tables.empty()) return;
    if (tables.size() > 1 || std::filesystem::is_directory(where)) {
      if (where == "-")
        throw UsageError("--csv: standard output takes one observable; give a folder for several");
      std::error_code failed;
      std::filesystem::create_directories(where, failed);
      if (failed)
        throw UsageError(fmt::format("--csv: {}: {}", where, failed.message()));
      for (const Observable* table : tables)
        open(*table, (std::filesystem::path(where) / (table->name + ".csv")).string());
      return;
    }
    if (where != "-") open(*tables.front(), where);
  }

  void row(const Observable& table, const std::vector<std::string>& cells) {
    const std::string line = fmt::format("{}\n", fmt::join(cells, ","));
    const auto found = files_.find(&table);
    if (found == files_.end()) return print(line);
    if (std::fwrite(line.data(), 1, line.size(), found->second.file.get()) != line.size())
      fail(found->second);
  }

  void close() {
    for (auto& [table, output] : files_) {
      std::FILE* file = output.file.release();
      if (std::fclose(file) != 0) fail(output);
    }
  }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct Output {
    std::string path;
    std::unique_ptr<std::FILE, Closer> file;
  };
  [[noreturn]] static void fail(const Output& output) {
    throw ToolError(exit_output, fmt::format("{}: {}", output.path, std::strerror(errno)));
  }
  void open(const Observable& table, const std::string& path) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    if (!file) throw UsageError(fmt::format("--csv: {}: {}", path, std::strerror(errno)));
    files_[&table] = {path, std::unique_ptr<std::FILE, Closer>(file)};
  }
  std::map<const Observable*, Output> files_;
};

const char* rows_of(const Observable& table) {
  if (table.every_step) return "of every step in the range";
  return table.needs == Needs::grains ? "of the steps asked for"
                                      : "of the steps asked for, or of those of --fluid";
}

void print_list(const core::Scenario& scenario) {
  for (const Observable& each : observables()) {
    print(fmt::format("{}\n  {}\n  formula  {}\n  source   {}\n  rows     {}\n  columns  {}\n",
                      each.name, each.summary, each.formula, each.source,
                      rows_of(each), fmt::join(each.columns(scenario), ", ")));
  }
  print(
      "\nNumbers of the run (--json, 'scalars'); those with * rest on the states that are decoded "
      "whole (--fluid), those over a window on the one of the terminal speed\n");
  for (const ScalarInfo& info : scalar_infos())
    print(fmt::format("{}{}\n  {}\n", info.name,
                      info.unit.empty() ? std::string() : " [" + info.unit + "]", info.formula));
}

std::vector<const Observable*> tables_asked_for(const Invocation& invocation) {
  std::vector<const Observable*> tables;
  for (const std::string& list : invocation.values("observable")) {
    const std::string padded = list + ",";
    for (std::size_t begin = 0, comma; (comma = padded.find(',', begin)) != std::string::npos;
         begin = comma + 1) {
      const std::string name = padded.substr(begin, comma - begin);
      if (name.empty()) continue;
      if (name == "all")
        for (const Observable& each : observables()) tables.push_back(&each);
      else
        tables.push_back(&find_observable(name));
    }
  }
  return tables;
}

std::optional<std::pair<double, double>> window_asked_for(const Invocation& invocation) {
  if (!invocation.has("window")) return std::nullopt;
  const std::string text = invocation.value("window");
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos)
    throw UsageError(fmt::format("--window: expected FROM:TO in seconds, got '{}'", text));
  const double from = parse_seconds(text.substr(0, colon), "--window");
  const double to = parse_seconds(text.substr(colon + 1), "--window");
  if (!(from < to))
    throw UsageError(fmt::format("--window: expected FROM < TO, got '{}'", text));
  return std::pair(from, to);
}

std::optional<FluidSteps> fluid_asked_for(const Invocation& invocation) {
  if (!invocation.has("fluid")) return std::nullopt;
  const std::string text = invocation.value("fluid");
  if (text == "keyframes") return FluidSteps{FluidSteps::Rule::keyframes, 1};
  if (text == "all") return FluidSteps{FluidSteps::Rule::every, 1};
  std::uint64_t every = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), every);
  if (read.ec != std::errc{} || read.ptr != text.data() + text.size() || every == 0)
    throw UsageError(
        fmt::format("--fluid: expected keyframes, all or a number of steps >= 1, got '{}'", text));
  return FluidSteps{FluidSteps::Rule::every, every};
}

/// Points of --at-point, and the centres of --grid's cells.
std::vector<double> points_asked_for(const Invocation& invocation,
                                     const core::Scenario& scenario) {
  const auto dimension = static_cast<std::size_t>(scenario.domain.dimension);
  std::vector<double> points;
  for (const std::string& text : invocation.values("at-point")) {
    std::size_t found = 0, begin = 0;
    for (;;) {
      const std::size_t comma = text.find(',', begin);
      const std::string part = text.substr(begin, comma - begin);
      double value = 0;
      const auto read = std::from_chars(part.data(), part.data() + part.size(), value);
      if (part.empty() || read.ec != std::errc{} || read.ptr != part.data() + part.size() ||
          !std::isfinite(value))
        throw UsageError(
            fmt::format("--at-point: '{}' in '{}' is no number of metres", part, text));
      points.push_back(value);
      ++found;
      if (comma == std::string::npos) break;
      begin = comma + 1;
    }
    if (found != dimension)
      throw UsageError(fmt::format("--at-point: expected {} coordinates in metres, got '{}'",
                                   dimension, text));
  }
  if (const auto spacing = invocation.number("grid")) {
    if (!(*spacing > 0))
      throw UsageError(fmt::format("--grid: expected a spacing > 0 in metres, got {}", *spacing));
    const core::Domain& d = scenario.domain;
    const double lower[] = {d.left, 0, 0};
    const double upper[] = {d.left + d.width, d.height, d.depth};
    double cells = 1;
    for (std::size_t k = 0; k < dimension; ++k) cells *= (upper[k] - lower[k]) / *spacing;
    if (cells > 1e7)
      throw UsageError(fmt::format("--grid: {} m makes {:.2g} points; at most 1e7 are possible",
                                   *spacing, cells));
    const std::vector<double> grid = core::lattice_points(
        dimension, std::span(lower, dimension), std::span(upper, dimension), *spacing);
    points.insert(points.end(), grid.begin(), grid.end());
  }
  return points;
}

void print_summary(const io::LogReader& log, const AnalysisSummary& s) {
  print(fmt::format("{}: steps {} to {}, t = {:.6g} to {:.6g} s, {} states, {} grains\n",
                    log.path(), s.first_step, s.last_step, s.first_time, s.last_time, s.states,
                    s.grains));
  if (s.settling) {
    const core::Window& w = *s.settling;
    print(fmt::format("settling speed   {:.5g} m/s, deviation {:.2g}, {} (drift {:.2g} m/s)\n",
                      w.mean, w.deviation, w.stationary ? "stationary" : "not stationary",
                      w.drift));
    print(fmt::format("  window         {:.5g} to {:.5g} s: {}\n", w.from, w.to, s.window_rule));
    if (s.acceleration_time)
      print(fmt::format("  95 % of it     after {:.5g} s\n", *s.acceleration_time));
    print(fmt::format("  peak           {:.5g} m/s at {:.5g} s\n", s.peak_speed, s.peak_time));
    if (s.oscillation)
      print(fmt::format("  oscillation    {:.3g} m/s, period {:.3g} s ({} turns)\n",
                        s.oscillation->amplitude, s.oscillation->period, s.turns.size()));
  }
  if (s.first_contact)
    print(fmt::format("contacts         first at {:.5g} s{}, {} between grains, {} with walls\n",
                      *s.first_contact,
                      s.first_floor_contact
                          ? fmt::format(", with the floor at {:.5g} s", *s.first_floor_contact)
                          : std::string(),
                      s.collisions, s.wall_collisions));
  if (s.peak_force > 0)
    print(fmt::format("  peak force     {:.4g} N at {:.5g} s\n", s.peak_force, s.peak_force_time));
  if (s.restitution.mean == s.restitution.mean)
    print(fmt::format("  restitution    {:.3g}, deviation {:.2g}, of {} hits of walls\n",
                      s.restitution.mean, s.restitution.deviation, s.wall_hits));
  if (s.first_contact)
    print(fmt::format("  lost           {:.4g} J by normal damping, {:.4g} by tangential, {:.4g} "
                      "by friction\n",
                      s.normal_loss, s.tangential_loss, s.friction_loss));
  if (s.rest_time)
    print(fmt::format("at rest          from {:.5g} s (no grain faster than 1 mm/s)\n",
                      *s.rest_time));
}

/// A picture per state: the file itself where the name ends in .svg, else a folder.
void write_picture(const std::string& where, const core::Scenario& scenario,
                   const ObservedStep& now) {
  std::filesystem::path path = where;
  if (path.extension() != ".svg") {
    std::error_code failed;
    std::filesystem::create_directories(path, failed);
    if (failed) throw UsageError(fmt::format("--svg: {}: {}", where, failed.message()));
    path /= fmt::format("step_{:09}.svg", now.step);
  }
  const std::string text = snapshot_svg(scenario, now);
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"),
                                                       &std::fclose);
  if (!file) throw UsageError(fmt::format("--svg: {}: {}", path.string(), std::strerror(errno)));
  const bool written = std::fwrite(text.data(), 1, text.size(), file.get()) == text.size();
  if (std::fclose(file.release()) != 0 || !written)
    throw ToolError(exit_output, fmt::format("{}: {}", path.string(), std::strerror(errno)));
}

void ask_for_pictures(const std::string& where, AnalysisRequest& request) {
  const StepRange& range = request.range;
  if (where.ends_with(".svg") && range.last - range.first >= range.stride)
    throw UsageError(fmt::format(
        "--svg: {} is one picture; name one step (--range STEP), or a folder for several", where));
  request.pictures = true;
  request.on_state = [where](const core::Scenario& scenario, const ObservedStep& now,
                             bool whole) {
    if (whole) write_picture(where, scenario, now);
  };
}

int run_analyze(const Invocation& invocation) {
  const auto log = io::LogReader::open(invocation.arguments.front());
  const core::Scenario scenario = scenario_of(log->genesis(), log->path());
  if (invocation.has("list")) {
    print_list(scenario);
    return exit_ok;
  }
  AnalysisRequest request;
  request.range = parse_range(invocation.value("range"), *log);
  request.window = window_asked_for(invocation);
  request.tables = tables_asked_for(invocation);
  request.points = points_asked_for(invocation, scenario);
  request.fluid = fluid_asked_for(invocation);
  if (invocation.has("svg")) ask_for_pictures(invocation.value("svg"), request);
  const bool looks_at_points = std::any_of(request.tables.begin(), request.tables.end(),
                                           [](const Observable* table) { return table->points; });
  if (request.points.empty() && looks_at_points) {
    // 'all' means all that can be had.
    if (request.tables.size() == 1)
      throw UsageError("--observable flow needs --grid SPACING or --at-point X,Y");
    std::erase_if(request.tables, [](const Observable* table) { return table->points; });
  }
  if (invocation.has("csv") && request.tables.empty())
    throw UsageError("--csv needs --observable NAMES (or all); --list tells which there are");
  const bool to_output = !request.tables.empty() && invocation.value("csv") == "-";
  if (to_output && invocation.globals.json)
    throw UsageError("--json and a table on standard output exclude each other; give --csv FILE");
  CsvFiles files(invocation.value("csv"), request.tables);
  const AnalysisSummary summary =
      analyze(*log, scenario, request,
              [&](const Observable& table, const std::vector<std::string>& row) {
                files.row(table, row);
              });
  files.close();
  if (invocation.globals.json)
    print(summary_json(log->path(), summary).dump(2) + "\n");
  else if (!to_output)
    print_summary(*log, summary);
  return exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "analyze";
  verb.usage = "RUN";
  verb.summary = "Observables of a recorded run: settling, contacts, porosity, energies.";
  verb.description =
      "Everything is computed from the log: decoded states and the contact records that the\n"
      "engine wrote, nothing is executed again. Without --observable a summary is printed; with\n"
      "it tables are written as CSV, units in the column names.\n\n"
      "The terminal speed is the mean settling speed over the window: the second half of the time\n"
      "to the first contact with the floor (or of the run), unless --window names another. It is\n"
      "called stationary if a straight line through the window changes by at most 5 % of it.\n\n"
      "  varve analyze column.varve\n"
      "  varve analyze column.varve --observable settling > settling.csv\n"
      "  varve analyze column.varve --observable all --csv tables --range 0::10\n"
      "  varve analyze column.varve --observable flow --grid 0.002 --range last\n"
      "  varve analyze column.varve --observable settling,vortices --fluid keyframes --csv tables\n"
      "  varve analyze column.varve --svg column.svg --range t=0.16s\n"
      "  varve analyze column.varve --list      what there is, with formula and source\n";
  verb.options = {
      {"observable", "NAMES", "tables to write, comma between; 'all' for every one", true, ""},
      {"csv", "PATH", "file of the table, folder of several; - for standard output", false, "-"},
      {"range", "A:B:S", "steps, each as in --at of the other verbs", false, "first:last"},
      {"fluid", "STEPS", "whose fluid is looked at, for tables of fluid and forces and for the "
       "numbers of the run: keyframes, all, or every so many", false, ""},
      {"window", "FROM:TO", "times that the terminal speed is taken over", false, ""},
      {"grid", "SPACING", "of the flow: points a lattice of this spacing [m] apart", false, ""},
      {"at-point", "X,Y", "of the flow: this point [m]; may be repeated", true, ""},
      {"svg", "PATH", "a picture of each state asked for, grains over the fluid's velocity: a file "
       "(one step), or a folder", false, ""},
      {"list", "", "names, columns, formulas and sources of the observables", false, ""},
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = run_analyze;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
