// varve export: states of a recorded run as files for other programs.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/constants.h"
#include "io/log_reader.h"
#include "tools/analysis_state.h"
#include "tools/cli.h"
#include "tools/export_writers.h"
#include "tools/simulation_engine.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

/// Names between commas.
std::vector<std::string> listed(const std::string& text) {
  std::vector<std::string> names;
  const std::string padded = text + ",";
  for (std::size_t begin = 0, comma; (comma = padded.find(',', begin)) != std::string::npos;
       begin = comma + 1)
    if (comma > begin) names.push_back(padded.substr(begin, comma - begin));
  return names;
}

std::vector<ExportPopulation> populations_of(const io::Schema& schema) {
  std::vector<ExportPopulation> populations;
  for (std::size_t f = 0; f < schema.fields.size(); ++f) {
    const io::FieldDescriptor& field = schema.fields[f];
    const auto same = [&](const ExportPopulation& p) { return p.name == field.population; };
    auto found = std::find_if(populations.begin(), populations.end(), same);
    if (found == populations.end()) {
      populations.push_back({field.population, {}, -1, -1});
      found = populations.end() - 1;
    }
    if (field.is_id)
      found->id = static_cast<int>(f);
    else if (field.name == field.population + ".position" && field.components <= 3 &&
             field.components >= 2)
      found->position = static_cast<int>(f);
    else
      found->fields.push_back(f);
  }
  return populations;
}

/// What --fields names, or every population with positions. Ids and positions always come along.
std::vector<ExportPopulation> selected(const Invocation& invocation, const io::Schema& schema,
                                       bool needs_positions) {
  const std::vector<ExportPopulation> all = populations_of(schema);
  std::vector<ExportPopulation> chosen;
  if (!invocation.has("fields")) {
    for (const ExportPopulation& each : all)
      if (each.position >= 0) chosen.push_back(each);
    return chosen;
  }
  std::string known;
  for (const io::FieldDescriptor& field : schema.fields)
    known += (known.empty() ? "" : ", ") + field.name;
  for (const std::string& name : listed(invocation.value("fields"))) {
    bool found = false;
    for (const ExportPopulation& each : all) {
      const bool whole = name == each.name;
      if (!whole && !name.starts_with(each.name + ".")) continue;
      if (needs_positions && each.position < 0)
        throw UsageError(fmt::format(
            "--fields: population '{}' has no positions; --to csv writes it", each.name));
      auto into = std::find_if(chosen.begin(), chosen.end(),
                               [&](const ExportPopulation& c) { return c.name == each.name; });
      ExportPopulation taken{each.name, {}, each.id, each.position};
      if (whole) taken.fields = each.fields;
      for (const int always : {each.id, each.position})
        found |= always >= 0 && schema.fields[static_cast<std::size_t>(always)].name == name;
      for (const std::size_t f : each.fields)
        if (schema.fields[f].name == name) taken.fields.push_back(f);
      found |= whole || !taken.fields.empty();
      if (!found) continue;
      if (into == chosen.end()) {
        chosen.push_back(taken);
        continue;
      }
      for (const std::size_t f : taken.fields)
        if (std::find(into->fields.begin(), into->fields.end(), f) == into->fields.end())
          into->fields.push_back(f);
      std::sort(into->fields.begin(), into->fields.end());
    }
    if (!found)
      throw UsageError(fmt::format("--fields: no field or population '{}'; this log has {}", name,
                                   known));
  }
  return chosen;
}

std::vector<double> species_radii(const core::Scenario& scenario) {
  std::vector<double> radii;
  if (!scenario.has_grains()) return radii;
  const auto take = [&](const auto& constants) {
    for (const auto& one : constants.species) radii.push_back(one.radius);
  };
  if (scenario.domain.dimension == 2)
    take(core::constants_of<2>(scenario));
  else
    take(core::constants_of<3>(scenario));
  return radii;
}

/// Domain and radii, which only the scenario of our own engine's logs tells.
void add_scenario(ExportPlan& plan, const io::LogReader& log) {
  plan.radii = [](const std::string&, const io::Frame&) { return std::vector<double>(); };
  if (log.genesis().engine != engine_name) return;
  const core::Scenario scenario = scenario_of(log.genesis(), log.path());
  const core::Domain& d = scenario.domain;
  const bool flat = d.dimension == 2;
  plan.origin = {d.left, 0, 0};
  plan.edges = {d.width, d.height, flat ? scenario.grains.diameter : d.depth};
  if (flat) plan.origin[2] = -0.5 * scenario.grains.diameter;
  using core::Boundary;
  plan.periodic = {d.sides == Boundary::periodic, d.bottom == Boundary::periodic,
                   !flat && d.faces == Boundary::periodic};
  plan.radii = [radii = species_radii(scenario), &log](const std::string& population,
                                                       const io::Frame& frame) {
    std::vector<double> each;
    if (population != "grains") return each;
    for (const std::uint64_t kind : wholes(log.genesis().schema, frame, "grains.species"))
      each.push_back(radii.at(static_cast<std::size_t>(kind)));
    return each;
  };
}

std::unique_ptr<ExportWriter> writer_for(const std::string& format, const ExportPlan& plan) {
  if (format == "vtp") return vtp_writer(plan);
  if (format == "extxyz") return extxyz_writer(plan);
  return csv_writer(plan);
}

int run_export(const Invocation& invocation) {
  const std::string format = invocation.has("to") ? invocation.value("to") : "";
  if (format != "vtp" && format != "csv" && format != "extxyz")
    throw UsageError(format.empty()
                         ? std::string("--to: expected vtp, csv or extxyz")
                         : fmt::format("--to: expected vtp, csv or extxyz, got '{}'", format));
  if (!invocation.has("output"))
    throw UsageError("-o: a folder for the files is needed");
  const auto log = io::LogReader::open(invocation.arguments.front());
  const StepRange range = parse_range(invocation.value("range"), *log);
  ExportPlan plan;
  plan.schema = &log->genesis().schema;
  plan.populations = selected(invocation, *plan.schema, format != "csv");
  plan.folder = invocation.value("output");
  plan.overwrite = invocation.has("overwrite");
  add_scenario(plan, *log);
  std::error_code failed;
  std::filesystem::create_directories(plan.folder, failed);
  if (failed) throw UsageError(fmt::format("-o: {}: {}", plan.folder, failed.message()));
  io::StatePart part;
  part.next_whole = [&range](std::uint64_t step) -> std::optional<std::uint64_t> {
    const std::uint64_t past = (step - range.first) % range.stride;
    return past == 0 ? step : step + (range.stride - past);
  };
  std::unique_ptr<ExportWriter> writer;
  std::uint64_t states = 0;
  log->for_each_part(range.first, range.last, part,
                     [&](const io::StepHeader& header, const io::Frame* frame, bool whole) {
                       if (!frame || !whole || (header.step - range.first) % range.stride != 0)
                         return true;
                       if (!writer) writer = writer_for(format, plan);
                       writer->take(*frame);
                       ++states;
                       return true;
                     });
  if (!writer)
    throw UsageError(
        fmt::format("{}: no state of steps {} to {} is stored (tier deltas stores all)",
                    log->path(), range.first, range.last));
  writer->finish();
  if (invocation.globals.json) {
    print(nlohmann::ordered_json{{"schema", "varve.export/1"},
                                 {"run", log->path()},
                                 {"format", format},
                                 {"states", std::to_string(states)},
                                 {"files", writer->files()}}
              .dump(2) +
          "\n");
  } else if (!invocation.globals.quiet) {
    print(fmt::format("{}: {} states in {} files\n", plan.folder, states, writer->files().size()));
  }
  return exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "export";
  verb.usage = "RUN --to vtp|csv|extxyz -o DIR";
  verb.summary = "States of a run as files for ParaView, OVITO and everything that reads CSV.";
  verb.description =
      "Every population with positions is written: grains, fluid. vtp: one file of points per\n"
      "population and state, and POPULATION.pvd over all of them, which ParaView opens with its\n"
      "times; extxyz: POPULATION.extxyz with a frame per state, for OVITO; csv: POPULATION.csv\n"
      "with a row per particle and state, units in the names of the columns. Numbers are exact:\n"
      "the recorded bits, or the shortest decimals that read back as them.\n\n"
      "  varve export column.varve --to vtp --range 0::100 -o vtp\n"
      "  varve export column.varve --to extxyz --fields grains -o ovito\n"
      "  varve export column.varve --to csv --fields grains.velocity --range last -o csv\n";
  verb.options = {
      {"to", "FORMAT", "vtp, csv or extxyz", false, ""},
      {"range", "A:B:S", "steps, each as in --at of the other verbs", false, "first:last"},
      {"fields", "NAMES", "fields or populations, comma between; ids and positions always come",
       false, ""},
      {"output,o", "DIR", "folder of the files; made if it is not there", false, ""},
      {"overwrite", "", "replace files that exist", false, ""},
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = run_export;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
