// varve fork: a new run from any step of a recorded one, with named keys changed.
#include <filesystem>
#include <system_error>

#include <fmt/format.h>

#include "core/units.h"
#include "io/errors.h"
#include "io/log_reader.h"
#include "io/log_writer.h"
#include "tools/branch.h"
#include "tools/cli.h"
#include "tools/family.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;

/// Settings of -s in their order, then the flags that abbreviate one.
std::vector<io::Setting> settings_of(const Invocation& invocation) {
  std::vector<io::Setting> settings;
  for (const std::string& text : invocation.values("set")) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0) {
      fmt::print(stderr, "<command line>:{}: error: '{}' is no setting; expected KEY=VALUE\n",
                 settings.size() + 1, text);
      throw Exit{exit_scenario};
    }
    settings.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  if (invocation.has("damping"))
    settings.emplace_back("contact.damping", invocation.value("damping"));
  if (invocation.has("width")) settings.emplace_back("domain.width", invocation.value("width"));
  return settings;
}

core::ChangeOptions change_options(const Invocation& invocation) {
  core::ChangeOptions options;
  const std::string outside = invocation.value("outside"), anchor = invocation.value("anchor");
  if (outside == "push") {
    options.outside = core::OutsideMode::push;
  } else if (outside == "remove") {
    options.outside = core::OutsideMode::remove;
  } else if (outside != "error") {
    throw UsageError(fmt::format("--outside: expected error, push or remove, got '{}'", outside));
  }
  if (anchor == "left") {
    options.anchor = -1;
  } else if (anchor == "right") {
    options.anchor = 1;
  } else if (anchor != "none") {
    throw UsageError(fmt::format("--anchor: expected left, right or none, got '{}'", anchor));
  }
  return options;
}

/// --perturb in metres; a pure number with the unit d is a multiple of the grains' diameter.
double perturbation(const Invocation& invocation, double diameter) {
  const std::string text = invocation.has("perturb") ? invocation.value("perturb") : "1e-6 d";
  const bool relative = text.ends_with('d');
  const auto read = core::read_quantity(relative ? text.substr(0, text.size() - 1) : text);
  const auto* quantity = std::get_if<core::Quantity>(&read);
  const core::Dimension length{0, 1, 0};
  if (quantity == nullptr || quantity->is_angle || !(quantity->value >= 0) ||
      (quantity->has_unit && (relative || quantity->dimension != length)))
    throw UsageError(fmt::format(
        "--perturb: '{}' is not an amplitude; expected a length >= 0 such as '1e-9 m', or '1e-6 d' "
        "(grain diameters)", text));
  const double amplitude = quantity->value * (relative ? diameter : 1.0);
  if (amplitude > 0.01 * diameter)
    throw UsageError(fmt::format("--perturb: {} m is more than a hundredth of a grain; largest "
                                 "safe value {} m", core::number_text(amplitude),
                                 core::number_below(0.01 * diameter)));
  return amplitude;
}

std::string default_output(const std::string& parent, std::uint64_t step) {
  const fs::path path(parent);
  const std::string name = fmt::format("{}.fork-{}.varve", path.stem().string(), step);
  return (path.parent_path() / name).string();
}

/// Copies a log, as far as it is written now, beside the child, where it is found by its id.
void copy_beside(const std::string& log, const std::string& child, bool overwrite) {
  const fs::path source(log), folder = fs::path(child).parent_path();
  std::error_code error;
  if (fs::equivalent(source.parent_path().empty() ? "." : source.parent_path(),
                     folder.empty() ? "." : folder, error))
    return;
  const fs::path copy = folder / source.filename();
  if (fs::exists(copy) && !overwrite)
    throw UsageError(fmt::format("--detach: {} exists; --overwrite replaces it", copy.string()));
  fs::copy_file(source, copy, fs::copy_options::overwrite_existing, error);
  if (error)
    throw io::LogError(io::ErrorKind::write_failed, copy.string(),
                       "copying the parent: " + error.message());
}

/// The parent and as many of its ancestors as can be found.
void copy_family(const io::LogReader& parent, const std::string& child, bool overwrite,
                 const std::optional<std::string>& parent_option) {
  copy_beside(parent.path(), child, overwrite);
  for (auto ancestor = open_parent(parent, parent_option); ancestor;
       ancestor = open_parent(*ancestor, parent_option))
    copy_beside(ancestor->path(), child, overwrite);
}

void describe_branch(const Globals& globals, const io::LogReader& parent, const Branch& branch,
                     const std::string& path) {
  const io::Lineage& lineage = *branch.genesis.lineage;
  const auto header = parent.header(lineage.step);
  note(globals, fmt::format("{}: from {} at step {} (t = {:.6g} s)", path, parent.path(),
                            lineage.step, header ? header->time : 0));
  for (const auto& change : lineage.changes)
    note(globals, fmt::format("  {}: {} -> {}", change.key, change.from, change.to));
  if (lineage.changes.empty()) note(globals, "  nothing changes");
  for (const std::string& line : event_lines(branch.events)) note(globals, "  " + line);
  for (const std::string& line : branch.notes) note(globals, line);
  if (parent.genesis().engine_revision != branch.genesis.engine_revision)
    note(globals,
         fmt::format("warning: recorded by engine revision {}, continued by {}: equality with the "
                     "parent is not promised",
                     parent.genesis().engine_revision, branch.genesis.engine_revision));
}

/// Other revisions may be forked where the state itself is stored; what is not must be re-executed.
void require_forkable(const io::LogReader& parent, std::uint64_t step) {
  const auto header = parent.header(step);
  require_this_engine(parent,
                      fmt::format("; the state of step {} is not stored and can't be made again",
                                  step),
                      header && header->has_state);
}

int fork(const Invocation& invocation) {
  const auto parent_option = invocation.has("parent")
                                 ? std::optional<std::string>(invocation.value("parent"))
                                 : std::nullopt;
  auto [parent, step] = open_at(io::LogReader::open(invocation.arguments.at(0)),
                                invocation.value("at"), parent_option);
  BranchRequest request;
  request.step = step;
  warn_if_incomplete(*parent);
  require_forkable(*parent, request.step);

  const core::RunOptions run_options{threads_option(invocation), 0};
  request.settings = settings_of(invocation);
  request.options = change_options(invocation);
  request.target = target_option(invocation, request.step);
  if (invocation.has("ramp-time")) request.ramp_time = duration_option(invocation, "ramp-time");
  if (invocation.has("perturb") || invocation.has("seed")) {
    request.perturb =
        perturbation(invocation, scenario_of(parent->genesis(), parent->path()).grains.diameter);
    request.seed = invocation.count("seed").value_or(1);
  }
  Branch branch = make_branch(*parent, request, run_options);

  Session session;
  session.globals = invocation.globals;
  session.verb = "fork";
  session.path = invocation.has("output") ? invocation.value("output")
                                          : default_output(parent->path(), request.step);
  session.target = target_of(branch.engine->simulation().scenario());
  session.stop_after_s = stop_after_option(invocation);
  session.first_events = branch.events;
  io::WriterOptions options;
  options.overwrite = invocation.has("overwrite");
  std::error_code unrelated;
  if (options.overwrite && fs::equivalent(parent->path(), session.path, unrelated))
    throw UsageError(fmt::format("{}: the parent itself can't be the output", session.path));
  auto writer = io::LogWriter::create(session.path, branch.genesis, branch.first.view(),
                                      branch.events, options);
  if (invocation.has("detach"))
    copy_family(*parent, session.path, options.overwrite, parent_option);
  describe_branch(session.globals, *parent, branch, session.path);
  parent.reset();
  return run_session(*branch.engine, std::move(writer), session);
}

Verb verb() {
  Verb verb;
  verb.name = "fork";
  verb.usage = "RUN";
  verb.summary = "Starts a new run from any step of a recorded one, with named keys changed.";
  verb.description =
      "The child's first state is step K after the change; it runs on to the parent's last step\n"
      "unless --steps or --until say otherwise. It holds its own state and needs its parent for\n"
      "nothing. A fork without a change is bit-identical to its parent.\n\n"
      "  varve fork column.varve --at t=0.3s --damping 0.25 -o softer.varve\n"
      "  varve fork column.varve --at 50% --width 8cm --ramp-time 0.1s\n"
      "  varve fork column.varve --at first-contact -s fluid.viscosity='20 mPa.s'\n";
  verb.options = {
      {"at", "STEP", "where: 12000, t=0.3s, 50%, first, last-100, first-contact", false, ""},
      {"set,s", "KEY=VALUE", "change a key", true, ""},
      {"damping", "X", "same as -s contact.damping=X", false, ""},
      {"width", "L", "same as -s domain.width=L; both walls move by half the change", false, ""},
      {"outside", "MODE", "grains left outside: error, push or remove", false, "error"},
      {"anchor", "SIDE", "wall that stays: left, right or none", false, "none"},
      {"ramp-time", "T", "reach the width over T, in jumps of one spacing", false, ""},
      {"perturb", "AMP", "shift the grains by a draw of at most AMP (--seed alone: 1e-6 d)", false,
       ""},
      {"seed", "S", "of --perturb", false, ""},
      steps_spec("so many steps beyond the fork"),
      until_spec(),
      stop_after_spec(),
      threads_spec(),
      {"output,o", "RUN", "log to write [RUN.fork-STEP.varve]", false, ""},
      {"overwrite", "", "replace an existing log", false, ""},
      {"parent", "PATH", "log or folder with RUN's parent, if --at lies before RUN", false, ""},
      {"detach", "", "copy the parent's log, and its ancestors', beside the child", false, ""},
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = fork;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
