// varve check: what a scenario amounts to, before anything is run.
#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/assessment.h"
#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/probe.h"
#include "tools/scenario_file.h"
#include "tools/session.h"

namespace varve::tools {
namespace {

using nlohmann::ordered_json;

std::string bytes_text(double bytes) {
  constexpr const char* units[] = {"B", "kB", "MB", "GB", "TB"};
  int unit = 0;
  while (bytes >= 1000 && unit < 4) {
    bytes /= 1000;
    ++unit;
  }
  return fmt::format("{:.3g} {}", bytes, units[unit]);
}

std::string probe_text(const Probe& probe) {
  std::string text;
  if (probe.predicted_bytes > 0) text = bytes_text(probe.predicted_bytes) + ", from ";
  return text + fmt::format("{} steps in {:.2g} s: {} per step, {:.3g} B per particle-step",
                            probe.steps, probe.wall_s, bytes_text(probe.bytes_per_step),
                            probe.bytes_per_particle_step);
}

std::string log_size_text(const core::Assessment& a) {
  if (a.steps == 0) return "unknown: the length of the run is not given";
  return fmt::format("{} to {}", bytes_text(a.log_bytes_low), bytes_text(a.log_bytes_high));
}

/// Two columns.
std::string row(std::string_view name, const std::string& value) {
  return fmt::format("  {:<18} {}\n", name, value);
}

std::string limits_text(const core::Assessment& a) {
  std::string text;
  for (const core::StepLimit& limit : a.limits)
    text += row(limit.name, fmt::format("{:.4g} s  {}{}", limit.chosen, limit.formula,
                                        limit.name == a.step_set_by ? "  <- sets dt" : ""));
  return text;
}

std::string grains_text(const core::Scenario& s, const core::Assessment& a) {
  const char* per = s.domain.dimension == 2 ? "/m" : "";
  std::string text = "\ngrains\n";
  text += row("number", fmt::format("{} ({} rows x {} columns)", a.grains, s.grains.rows,
                                    s.grains.columns));
  text += row("mass", fmt::format("{:.6g} kg{} in all", a.grain_mass, per));
  if (s.is_coupled()) {
    text += row("terminal speed", fmt::format("{:.4g} m/s, one grain in fluid at rest",
                                              a.terminal_speed));
    text += row("Reynolds number", fmt::format("{:.4g}", a.reynolds));
    text += row("Stokes number", fmt::format("{:.4g}", a.stokes));
  }
  if (a.contact_time > 0) {
    text += row("stiffness", fmt::format("{:.6g} N/m{}", s.contact.stiffness,
                                         s.domain.dimension == 2 ? " per metre of depth" : ""));
    text += row("shortest contact", fmt::format("{:.4g} s, {} sub-steps per step", a.contact_time,
                                                a.substeps));
    text += row("restitution", fmt::format("{:.3f} on a wall, dry", a.restitution));
    text += row("overlap", fmt::format("{:.2g} % of d expected at impact", 100 * a.overlap));
  }
  return text;
}

std::string report(const ScenarioSource& source, const core::Assessment& a,
                   const std::optional<Probe>& probe) {
  const core::Scenario& s = source.scenario;
  const char* per = s.domain.dimension == 2 ? "/m" : "";
  std::string text = fmt::format("{}: {}\n\nmodels\n", source.name,
                                 s.title.empty() ? "a scenario" : s.title);
  for (const core::ModelUse& model : a.models)
    text += fmt::format("  {:<22} {:<4} {}\n", model.name, model.active ? "on" : "off",
                        model.reason);
  if (s.has_fluid()) {
    const core::Lattice lattice = core::fluid_lattice(s);
    text += "\nfluid\n";
    std::string sites = fmt::format("{} x {}", lattice.columns, lattice.rows);
    if (s.domain.dimension == 3) sites += fmt::format(" x {}", lattice.layers);
    if (lattice.particles < lattice.columns * lattice.rows * lattice.layers) sites += ", round";
    text += row("particles", fmt::format("{} ({})", a.fluid_particles, sites));
    text += row("mass", fmt::format("{:.6g} kg{}", a.fluid_mass, per));
    text += row("expected speed", fmt::format("{:.4g} m/s  {}", a.speeds.fluid,
                                              a.speeds.fluid_reason));
    text += row("sound speed",
                fmt::format("{:.6g} m/s (Mach {:.3g})", s.fluid.sound_speed, a.mach));
  }
  if (s.has_grains()) text += grains_text(s, a);
  text += "\ntime step\n";
  text += row("dt", fmt::format("{} s, set by {}", core::number_text(a.dt), a.step_set_by));
  text += limits_text(a);
  if (a.steps > 0)
    text += row("steps", fmt::format("{}", a.steps));
  for (const core::ScheduledChange& change : s.changes)
    text += row("event " + change.name, fmt::format("after step {}", change.at_step));
  text += "\nlog\n";
  text += row("state", bytes_text(static_cast<double>(a.state_bytes)) + " uncompressed");
  text += row("tier", s.record.tier == core::RecordTier::digests
                          ? "digests"
                          : s.record.every > 1 ? fmt::format("deltas every {}", s.record.every)
                                               : "deltas");
  text += row("size", log_size_text(a));
  if (probe) text += row("size by probe", probe_text(*probe));
  for (const core::Warning& warning : a.warnings)
    text += fmt::format("\nwarning: {}: {}", warning.key, warning.text);
  if (!a.warnings.empty()) text += '\n';
  return text;
}

ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json json_report(const ScenarioSource& source, const core::Assessment& a,
                         const std::optional<Probe>& probe) {
  const core::Scenario& s = source.scenario;
  ordered_json object;
  object["schema"] = "varve-check-1";
  object["scenario"] = source.name;
  object["title"] = s.title;
  if (s.domain.dimension == 2) object["per"] = "m depth";
  for (const core::ModelUse& model : a.models)
    object["models"].push_back(
        {{"name", model.name}, {"active", model.active}, {"reason", model.reason}});
  object["particles"] = {{"fluid", std::to_string(a.fluid_particles)},
                         {"grains", std::to_string(a.grains)}};
  object["mass_kg"] = {{"fluid", a.fluid_mass}, {"grains", a.grain_mass}};
  object["dt_s"] = a.dt;
  object["dt_set_by"] = a.step_set_by;
  for (const core::StepLimit& limit : a.limits)
    object["limits"].push_back({{"name", limit.name},
                                {"formula", limit.formula},
                                {"dt_s", number(limit.chosen)},
                                {"largest_s", number(limit.largest)}});
  object["steps"] = std::to_string(a.steps);
  object["substeps"] = std::to_string(a.substeps);
  object["contact_time_s"] = a.contact_time;
  object["sound_speed_m_s"] = number(s.fluid.sound_speed);
  object["mach"] = number(a.mach);
  object["speeds_m_s"] = {{"fluid", number(a.speeds.fluid)},
                          {"fluid_reason", a.speeds.fluid_reason},
                          {"grains", number(a.speeds.grains)},
                          {"grains_reason", a.speeds.grains_reason},
                          {"terminal", number(a.terminal_speed)}};
  object["reynolds"] = number(a.reynolds);
  object["stokes"] = number(a.stokes);
  object["overlap"] = number(a.overlap);
  object["restitution"] = a.restitution;
  object["log_bytes"] = {{"state", std::to_string(a.state_bytes)},
                         {"low", fmt::format("{:.0f}", a.log_bytes_low)},
                         {"high", fmt::format("{:.0f}", a.log_bytes_high)}};
  if (probe)
    object["log_bytes"]["probe"] = {
        {"steps", std::to_string(probe->steps)},
        {"predicted", fmt::format("{:.0f}", probe->predicted_bytes)},
        {"per_step", probe->bytes_per_step},
        {"per_particle_step", probe->bytes_per_particle_step},
        {"wall_s", probe->wall_s}};
  object["events"] = ordered_json::array();
  for (const core::ScheduledChange& change : s.changes) {
    ordered_json event{{"name", change.name}, {"at_step", std::to_string(change.at_step)}};
    for (const auto& [key, value] : change.settings) event["settings"][key] = value;
    object["events"].push_back(event);
  }
  object["warnings"] = ordered_json::array();
  for (const core::Warning& warning : a.warnings)
    object["warnings"].push_back({{"key", warning.key}, {"text", warning.text}});
  for (const auto& [key, value] : core::all_settings(s)) object["resolved"][key] = value;
  return object;
}

int run(const Invocation& invocation) {
  const ScenarioSource source =
      load_scenario(invocation.arguments[0], {invocation.values("set"), true});
  if (invocation.has("resolved")) {
    print(core::canonical_text(source.scenario));
    return exit_ok;
  }
  const core::Assessment assessment = core::assess(source.scenario);
  std::optional<Probe> probe;
  if (invocation.has("probe")) {
    const std::uint64_t steps =
        invocation.count("probe").value_or(default_probe_steps(source.scenario));
    if (steps == 0) throw UsageError("--probe: expected at least 1 step, got 0");
    probe = probe_log(source.scenario, assessment.steps, steps, {threads_option(invocation), 0});
  }
  print(invocation.globals.json ? json_report(source, assessment, probe).dump(2) + "\n"
                                : report(source, assessment, probe));
  return exit_ok;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  using namespace varve::tools;
  Verb verb;
  verb.name = "check";
  verb.usage = "FILE";
  verb.summary = "reads a scenario and shows what follows from it";
  verb.description =
      "Prints which models are on and why, particle counts, the time step and what sets it,\n"
      "expected speeds, Reynolds and Stokes numbers, the size the log will have, and warnings.\n"
      "All errors of a file are listed at once, with file:line:column; the exit code is then 3.\n"
      "FILE may also be the name of a preset (varve init --list).\n"
      "\n"
      "--probe computes the run's first N steps, encodes them as a run would, writes nothing, and\n"
      "takes the later half of them for typical: it costs what N steps of the run cost. Where a\n"
      "scene changes its character later (a long fall before the first contact, a long rest),\n"
      "give it more steps.\n"
      "\n"
      "  varve check column.cfg\n"
      "  varve check column.cfg -s fluid.spacing=0.5mm -s contact.damping=0.3\n"
      "  varve check column.cfg --probe         the log's size, to 20 % for the shipped scenes\n"
      "  varve check column.cfg --json | jq .dt_set_by\n"
      "  varve check column.cfg --resolved      every key, nothing left to derive\n";
  verb.options = {
      {"set,s", "KEY=VALUE", "set a key, over what the file says", true, ""},
      {"resolved", "", "print the resolved scenario instead; it reads back to the same bits", false,
       ""},
      {"probe", "=N", "predict the log's size from N steps (default: two intervals between "
                      "keyframes, at most 1024)", false, ""},
      threads_spec(),
  };
  verb.arguments_min = 1;
  verb.arguments_max = 1;
  verb.run = run;
  return verb_main(argc, argv, verb);
}
