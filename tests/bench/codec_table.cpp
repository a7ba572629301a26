// The table of bytes per particle-step: varve and what others would take for the same states, on
// two scenes, at a small and a large time step, in doubles and floats.
//
//   varve_codec_table [--spacing METRES] [--particles N] [--steps N] [--markdown]
//
// `column` is the shipped scene, computed by varve's engine; two windows of `--steps` states each
// (256: one interval between keyframes), at t = 0.05 s, when the block falls, and at t = 0.45 s,
// when grains lie on each other. `dam` is the collapsing column of codec_scenes.h at t = 0.4 s,
// when the surge runs along the floor. The "whole log" has records, digests, contacts and keyframes
// in it; all other figures are of the states alone.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "io/log_writer.h"
#include "io/memory_file.h"
#include "tests/bench/codec_measure.h"
#include "tools/scenario_file.h"
#include "tools/simulation_engine.h"

namespace varve::bench {
namespace {

constexpr double small_dt = 1e-5;  // [s]

struct Options {
  std::string spacing = "1 mm";   // of the column's fluid
  std::size_t particles = 5750;   // of the dam
  std::size_t steps = 256;        // per window
  bool markdown = false;
};

/// One column of the table.
struct Case {
  std::string name;
  bool dam = false, floats = false;
  double dt = 0;                  // [s]; 0: the largest
  double must = 0, strive = 0;    // [bytes]; 0: none was set
};

/// What all windows of a case took together.
struct Result {
  std::vector<std::string> methods;
  std::map<std::string, double> bytes;
  double codec_encode = 0, codec_decode = 0, codec_bytes = 0;  // [ns], of varve's codec alone
  double weight = 0;
  std::size_t raw = 0;
  bool exact = true;

  void add(const std::string& method, double value) {
    if (std::find(methods.begin(), methods.end(), method) == methods.end())
      methods.push_back(method);
    bytes[method] += value;
  }
};

/// The fields of the populations that last: what others can be compared on.
Series lasting_fields(const io::Schema& all) {
  Series series;
  for (const io::FieldDescriptor& field : all.fields) {
    const bool lasts = std::any_of(all.fields.begin(), all.fields.end(), [&](const auto& other) {
      return other.population == field.population && other.is_id && other.constant;
    });
    if (lasts) series.schema.fields.push_back(field);
  }
  return series;
}

void keep(Series& series, const io::Schema& all, const io::FrameView& view) {
  io::Frame part;
  part.step = view.step;
  part.time = view.time;
  part.dt = view.dt;
  for (const io::FieldDescriptor& field : series.schema.fields) {
    const io::FieldView& source = view.fields[static_cast<std::size_t>(all.find(field.name))];
    part.counts.push_back(source.count);
    part.fields.emplace_back(source.bytes.begin(), source.bytes.end());
  }
  series.frames.push_back(std::move(part));
}

double particles_in(const Series& series) {
  double particles = 0;
  for (std::size_t f = 0; f < series.schema.fields.size(); ++f)
    if (series.schema.fields[f].is_id)
      particles += static_cast<double>(series.frames[0].counts[f]);
  return particles;
}

/// Bytes of raw state per particle of the first population.
std::size_t raw_of(const io::Schema& schema) {
  std::size_t raw = 0;
  for (const io::FieldDescriptor& field : schema.fields)
    if (field.population == schema.fields[0].population && !field.constant && !field.is_id)
      raw += field.bytes_per_particle();
  return raw;
}

void measure_states(const Series& series, Result& result) {
  for (const auto& baseline : baselines(series.schema)) {
    const Figures figures = measure_baseline(series, *baseline);
    result.exact = result.exact && figures.exact;
    result.add(baseline->name(), figures.bytes);
  }
  const Figures figures = measure_codec(series, series.frames.size());
  result.exact = result.exact && figures.exact;
  result.codec_bytes += figures.bytes;
  result.codec_encode += figures.encode_mean;
  result.codec_decode += figures.decode_mean;
  result.weight += 1;
  result.raw = raw_of(series.schema);
}

/// Runs the column to `time`, then records `options.steps` states of it.
void column_window(const Case& one, const Options& options, tools::SimulationEngine& engine,
                   const core::Scenario& scenario, double time, Result& result) {
  const io::Schema& schema = engine.schema();
  while (engine.frame().time < time) engine.advance();
  const std::string old_dt = fmt::format("{}", engine.frame().dt);
  if (one.dt > 0) engine.change({{"time.dt", fmt::format("{}", one.dt)}});
  for (int n = 0; n < 20; ++n) engine.advance();  // a change of dt leaves a kink behind
  Series series = lasting_fields(schema);
  io::MemoryFileSystem files;
  io::WriterOptions writer_options;
  writer_options.files = &files;
  const auto writer = io::LogWriter::create("column", tools::make_genesis(scenario, schema, 1),
                                            engine.frame(), engine.events(), writer_options);
  keep(series, schema, engine.frame());
  while (series.frames.size() < options.steps) {
    engine.advance();
    writer->append(engine.frame(), engine.events());
    keep(series, schema, engine.frame());
  }
  writer->close();
  series.particles = particles_in(series);
  const auto states = static_cast<double>(series.frames.size());
  result.add("varve, whole log",
             static_cast<double>(writer->status().bytes) / series.particles / states);
  if (one.dt > 0) engine.change({{"time.dt", old_dt}});
  measure_states(series, result);
}

Result measure_column(const Case& one, const Options& options) {
  std::vector<std::string> settings = {"fluid.spacing=" + options.spacing};
  if (one.floats) settings.push_back("scenario.precision=float");
  const core::Scenario scenario = tools::load_scenario("column", {settings, true}).scenario;
  const auto engine = tools::SimulationEngine::fresh(scenario, {});
  Result result;
  for (const double time : {0.05, 0.45})
    column_window(one, options, *engine, scenario, time, result);
  return result;
}

Result measure_dam(const Case& one, const Options& options) {
  SceneOptions scene;
  scene.scene = "dam";
  scene.particles = options.particles;
  scene.dt = one.dt;
  scene.steps = options.steps;
  // Steps at the largest dt are 0.16 h / c0 long.
  const double h = 1.25 * 1.4142135623730951 / std::sqrt(static_cast<double>(options.particles));
  scene.settle = static_cast<std::size_t>(0.4 / (0.16 * h / 40));
  Result result;
  measure_states(one.floats ? scene_series<float>(scene) : scene_series<double>(scene), result);
  return result;
}

void print_table(const std::vector<Case>& cases, const std::vector<Result>& results,
                 bool markdown) {
  const char* const between = markdown ? " | " : "  ";
  const auto row = [&](const std::string& name,
                       const std::function<std::string(std::size_t)>& value) {
    std::string line = fmt::format("{}{:<33}", markdown ? "| " : "", name);
    for (std::size_t c = 0; c < cases.size(); ++c)
      line += fmt::format("{}{:>{}}", between, value(c), cases[c].name.size());
    fmt::print("{}{}\n", line, markdown ? " |" : "");
  };
  const auto figure = [](double value) { return value > 0 ? fmt::format("{:.2f}", value) : "-"; };
  row("bytes per particle-step", [&](std::size_t c) { return cases[c].name; });
  if (markdown) {
    fmt::print("|---|");
    for (std::size_t c = 0; c < cases.size(); ++c) fmt::print("---:|");
    fmt::print("\n");
  }
  row("raw", [&](std::size_t c) { return std::to_string(results[c].raw); });
  std::vector<std::string> methods;
  for (const Result& result : results)
    for (const std::string& method : result.methods)
      if (method != "varve, whole log" &&
          std::find(methods.begin(), methods.end(), method) == methods.end())
        methods.push_back(method);
  for (const std::string& method : methods)
    row(method, [&](std::size_t c) {
      const auto found = results[c].bytes.find(method);
      return figure(found == results[c].bytes.end() ? 0 : found->second / results[c].weight);
    });
  row("varve", [&](std::size_t c) { return figure(results[c].codec_bytes / results[c].weight); });
  row("varve, whole log", [&](std::size_t c) {
    const auto found = results[c].bytes.find("varve, whole log");
    return figure(found == results[c].bytes.end() ? 0 : found->second / results[c].weight);
  });
  row("must", [&](std::size_t c) { return figure(cases[c].must); });
  row("strive for", [&](std::size_t c) { return figure(cases[c].strive); });
  row("varve encodes, ns", [&](std::size_t c) {
    return fmt::format("{:.0f}", results[c].codec_encode / results[c].weight);
  });
  row("varve decodes, ns", [&](std::size_t c) {
    return fmt::format("{:.0f}", results[c].codec_decode / results[c].weight);
  });
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    const auto value = [&]() -> std::string {
      if (i + 1 >= argc) throw std::invalid_argument(name + " needs a value");
      return argv[++i];
    };
    if (name == "--spacing") options.spacing = value();
    else if (name == "--particles") options.particles = std::stoul(value());
    else if (name == "--steps") options.steps = std::stoul(value());
    else if (name == "--markdown") options.markdown = true;
    else throw std::invalid_argument("unknown option " + name);
  }
  if (options.steps < 16) throw std::invalid_argument("--steps: at least 16");
  return options;
}

int run(const Options& options) {
  const std::vector<Case> cases = {
      {"column 1e-5", false, false, small_dt, 3.6, 3.0},
      {"column CFL", false, false, 0, 9.6, 8.2},
      {"dam 1e-5", true, false, small_dt, 4.5, 4.0},
      {"dam largest", true, false, 0, 9.0, 8.3},
      {"column 1e-5, float", false, true, small_dt, 0, 0},
      {"column CFL, float", false, true, 0, 0, 0},
      {"dam 1e-5, float", true, true, small_dt, 1.9, 1.4},
      {"dam largest, float", true, true, 0, 0, 0},
  };
  std::vector<Result> results;
  bool exact = true;
  for (const Case& one : cases) {
    results.push_back(one.dam ? measure_dam(one, options) : measure_column(one, options));
    exact = exact && results.back().exact;
    fmt::print(stderr, "{}: {:.3f}\n", one.name, results.back().codec_bytes /
                                                     results.back().weight);
  }
  print_table(cases, results, options.markdown);
#ifndef VARVE_HAVE_FPZIP
  fmt::print("fpzip was not measured: built without libfpzip-dev\n");
#endif
  if (!exact) fmt::print("A METHOD DID NOT GIVE BACK THE SAME BITS\n");
  return exact ? 0 : 1;
}

}  // namespace
}  // namespace varve::bench

int main(int argc, char** argv) {
  try {
    return varve::bench::run(varve::bench::parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "varve_codec_table: %s\n", error.what());
    return 2;
  }
}
