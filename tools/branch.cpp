#include "tools/branch.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

#include "core/parameters.h"
#include "core/random.h"
#include "core/units.h"
#include "tools/cli.h"

namespace varve::tools {

namespace {

using Settings = std::vector<io::Setting>;
using Changes = std::vector<io::Lineage::Change>;

bool is_output(const std::string& key) {
  const core::Parameter* parameter = core::find_parameter(key);
  return parameter != nullptr && parameter->change == core::Change::outputs;
}

std::string text_of(const core::Scenario& scenario, const std::string& key) {
  return core::get_parameter(scenario, *core::find_parameter(key));
}

/// The scenario that a child starts from: as it stands, with what is still to come.
core::Scenario remaining(core::Scenario now, std::uint64_t step) {
  std::erase_if(now.changes, [&](const core::ScheduledChange& change) {
    return change.at_step <= static_cast<std::int64_t>(step);
  });
  return now;
}

std::string free_name(const core::Scenario& scenario, int number) {
  std::string name = fmt::format("ramp-{}", number);
  const auto taken = [&] {
    return std::any_of(scenario.changes.begin(), scenario.changes.end(),
                       [&](const core::ScheduledChange& change) { return change.name == name; });
  };
  while (taken()) name += "-again";
  return name;
}

/// Spreads a changed width over `ramp_time`: jumps of one spacing per moving wall, the i-th of n at
/// i/n of the time. A continuous ramp would compress the fluid of a closed box.
void schedule_ramp(core::Scenario& child, std::uint64_t step, double width, double ramp_time,
                   const core::ChangeOptions& options) {
  const double from = child.domain.width;
  const double jump = (options.anchor == 0 ? 2 : 1) * child.fluid.spacing;
  const double exact = std::abs(width - from) / jump;
  const auto jumps = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::floor(exact + 0.5)));
  const double steps = ramp_time / child.time.dt;
  if (steps < static_cast<double>(jumps))
    throw UsageError(fmt::format(
        "--ramp-time: {} s are {:.6g} steps, and the change of width takes {} jumps of one "
        "spacing; at least {} s are needed",
        core::number_text(ramp_time), steps, jumps,
        core::number_above(static_cast<double>(jumps) * child.time.dt)));
  for (std::int64_t i = 1; i <= jumps; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(jumps);
    const double moved = (width > from ? 1 : -1) * static_cast<double>(i) * jump;
    const double reached = i == jumps ? width : from + moved;
    core::ScheduledChange change;
    change.name = free_name(child, static_cast<int>(i));
    change.at_step = static_cast<std::int64_t>(step) +
                     static_cast<std::int64_t>(std::floor(share * steps + 0.5));
    change.settings = {{"domain.width", core::number_text(reached)}};
    change.anchor = options.anchor;
    change.outside = options.outside;
    const auto later = std::find_if(
        child.changes.begin(), child.changes.end(),
        [&](const core::ScheduledChange& other) { return other.at_step > change.at_step; });
    child.changes.insert(later, std::move(change));
  }
}

template <class Real>
std::uint64_t shift_field(std::vector<std::byte>& bytes, std::size_t components,
                          const std::vector<std::uint64_t>& ids, double amplitude,
                          std::uint64_t seed) {
  // Each component by at most amplitude / components: the shift's length stays below the amplitude.
  const double reach = amplitude / static_cast<double>(components);
  std::uint64_t moved = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    bool different = false;
    for (std::size_t c = 0; c < components; ++c) {
      std::byte* at = bytes.data() + (i * components + c) * sizeof(Real);
      Real value;
      std::memcpy(&value, at, sizeof value);
      const Real shifted =
          static_cast<Real>(static_cast<double>(value) + reach * core::symmetric(seed, ids[i], c));
      different = different || shifted != value;
      std::memcpy(at, &shifted, sizeof shifted);
    }
    if (different) ++moved;
  }
  return moved;
}

/// Shifts every grain; returns how many moved.
std::uint64_t perturb_grains(const io::Schema& schema, io::Frame& frame, double amplitude,
                             std::uint64_t seed) {
  const int position = schema.find("grains.position"), id = schema.find("grains.id");
  if (position < 0 || id < 0)
    throw UsageError("--perturb: the scene has no grains that could be shifted");
  const io::FieldDescriptor& field = schema.fields[static_cast<std::size_t>(position)];
  std::vector<std::uint64_t> ids(frame.counts[static_cast<std::size_t>(id)]);
  std::memcpy(ids.data(), frame.fields[static_cast<std::size_t>(id)].data(),
              ids.size() * sizeof(std::uint64_t));
  std::vector<std::byte>& bytes = frame.fields[static_cast<std::size_t>(position)];
  return field.type == io::ScalarType::f32
             ? shift_field<float>(bytes, field.components, ids, amplitude, seed)
             : shift_field<double>(bytes, field.components, ids, amplitude, seed);
}

/// Whether the scenario's own end is the last step that the parent holds.
bool ends_where_meant(const core::Scenario& scenario, const io::LogReader& parent) {
  const Target target = target_of(scenario);
  const std::uint64_t last = parent.last_step();
  if (last == parent.first_step()) return false;
  const auto before = parent.header(last - 1), end = parent.header(last);
  return before && end && !target.reached(last - 1, before->time) &&
         target.reached(last, end->time);
}

/// Length of the child's run, as keys of its scenario.
void set_target(core::Scenario& child, const io::LogReader& parent, const BranchRequest& request,
                bool dt_changed) {
  const auto given = [&](const char* key) {
    return std::any_of(request.settings.begin(), request.settings.end(),
                       [&](const io::Setting& setting) { return setting.first == key; });
  };
  Target target;
  if (request.target) {
    target = *request.target;
  } else if (given("time.steps") || given("time.until")) {
    if (!given("time.steps")) child.time.steps = 0;
    return;
  } else if (dt_changed) {
    target.until = parent.header(parent.last_step())->time;
  } else if (ends_where_meant(child, parent)) {
    return;  // the parent's own length says it
  } else {
    target.last_step = parent.last_step();
  }
  child.time.steps = target.last_step ? static_cast<std::int64_t>(*target.last_step) : 0;
  if (target.until) child.time.until = *target.until;
}

}  // namespace

void check_settings(const core::Scenario& now, const Settings& settings,
                    const core::ChangeOptions& options) {
  bool bad_value = false;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const auto& [key, value] = settings[i];
    const core::Parameter* parameter = core::find_parameter(key);
    std::string error;
    if (parameter == nullptr) {
      const std::string_view near = core::nearest_key(key);
      error = fmt::format("unknown key '{}'{}", key,
                          near.empty() ? "" : fmt::format("; did you mean '{}'?", near));
    } else if (parameter->change != core::Change::never) {
      core::Scenario scratch = now;
      if (const auto found = core::set_parameter(scratch, *parameter, value))
        error = fmt::format("{}: {}", key, found->text);
    }
    if (error.empty()) continue;
    bad_value = true;
    fmt::print(stderr, "<command line>:{}: error: {}\n", i + 1, error);
  }
  if (bad_value) throw Exit{exit_scenario};
  core::Scenario changed = now;
  std::string reasons;
  for (const core::Problem& problem : core::apply_settings(changed, settings, options.anchor))
    reasons += fmt::format("{}{}: {}", reasons.empty() ? "" : "\n  ", problem.key, problem.text);
  if (!reasons.empty()) throw UsageError(reasons);
}

namespace {

/// A request's settings, sorted by how they are made.
struct Plan {
  Changes changes;                     ///< those that change anything, for the lineage
  Settings at_once;                    ///< made by the engine at step K
  core::Scenario outputs;              ///< holds the new values of keys that touch no state
  std::optional<double> ramped_width;  ///< [m] reached by scheduled jumps
};

Plan plan_changes(const core::Scenario& before, const BranchRequest& request) {
  Plan plan;
  plan.outputs = before;
  bool new_width = false;
  for (const auto& [key, value] : request.settings) {
    core::Scenario scratch = before;
    core::set_parameter(scratch, *core::find_parameter(key), value);
    const std::string from = text_of(before, key), to = text_of(scratch, key);
    if (from == to) continue;
    plan.changes.push_back({key, from, to});
    new_width = new_width || key == "domain.width";
    if (is_output(key)) {
      core::set_parameter(plan.outputs, *core::find_parameter(key), value);
    } else if (key == "domain.width" && request.ramp_time) {
      plan.ramped_width = scratch.domain.width;
    } else {
      plan.at_once.emplace_back(key, to);
    }
  }
  if (request.ramp_time && !plan.ramped_width)
    throw UsageError("--ramp-time: the width does not change; give another --width");
  const core::ChangeOptions& options = request.options;
  if (new_width && options.anchor != 0)
    plan.changes.push_back({"fork.anchor", "both", options.anchor < 0 ? "left" : "right"});
  if (new_width && options.outside != core::OutsideMode::error)
    plan.changes.push_back({"fork.outside", "error",
                            options.outside == core::OutsideMode::push ? "push" : "remove"});
  if (plan.ramped_width)
    plan.changes.push_back({"fork.ramp_time", "0", core::number_text(*request.ramp_time)});
  return plan;
}

/// Shifts the grains of the branch's first state and says so in its events and changes.
void perturb_first(Branch& branch, Changes& changes, const io::Schema& schema,
                   const BranchRequest& request) {
  const std::uint64_t moved = perturb_grains(schema, branch.first, request.perturb, request.seed);
  const std::string amplitude = core::number_text(request.perturb);
  const std::string seed = std::to_string(request.seed);
  branch.events.push_back({request.step,
                           "perturb",
                           {{"amplitude_m", amplitude},
                            {"seed", seed},
                            {"grains_moved", std::to_string(moved)}}});
  changes.push_back({"fork.perturb", "0", amplitude + " seed " + seed});
  if (moved == 0)
    branch.notes.push_back(
        "warning: --perturb is below the resolution of the positions: no grain moved");
}

/// What the parent recorded of step K itself happened before the change: the child keeps it, in
/// those tables that both have.
void take_tables(Branch& branch, const io::LogReader& parent, std::uint64_t step) {
  const std::vector<io::TableDescriptor>& ours = branch.genesis.schema.tables;
  const std::vector<io::TableDescriptor>& theirs = parent.genesis().schema.tables;
  const auto recorded = parent.tables(step);
  branch.first.rows.assign(ours.size(), 0);
  branch.first.tables.clear();
  for (std::size_t t = 0; t < ours.size(); ++t) {
    branch.first.tables.emplace_back(ours[t].columns.size());
    const auto same = std::find(theirs.begin(), theirs.end(), ours[t]);
    const auto index = static_cast<std::size_t>(same - theirs.begin());
    if (!recorded || index >= recorded->tables.size()) continue;
    branch.first.rows[t] = recorded->rows[index];
    branch.first.tables[t] = recorded->tables[index];
  }
}

}  // namespace

Branch make_branch(const io::LogReader& parent, const BranchRequest& request,
                   const core::RunOptions& run_options) {
  auto source = SimulationEngine::of_genesis(parent.genesis(), parent.path(), run_options);
  seek(parent, request.step, *source);
  const core::Scenario before = source->simulation().scenario();
  check_settings(before, request.settings, request.options);

  Branch branch;
  Plan plan = plan_changes(before, request);
  if (!plan.at_once.empty()) {
    const auto scheduled = static_cast<std::ptrdiff_t>(source->events().size());  // at this step
    source->change(plan.at_once, request.options);
    branch.events.assign(source->events().begin() + scheduled, source->events().end());
  }
  core::Scenario child = remaining(source->simulation().scenario(), request.step);
  child.time.steps = plan.outputs.time.steps;
  child.time.until = plan.outputs.time.until;
  child.record = plan.outputs.record;
  if (plan.ramped_width)
    schedule_ramp(child, request.step, *plan.ramped_width, *request.ramp_time, request.options);
  set_target(child, parent, request, child.time.dt != before.time.dt);

  branch.first = io::Frame::copy_of(source->frame());
  if (request.perturb > 0) perturb_first(branch, plan.changes, source->schema(), request);
  const std::uint32_t revision = parent.genesis().engine_revision;
  if (revision != core::engine_revision)
    plan.changes.push_back({"engine.revision", std::to_string(revision),
                            std::to_string(core::engine_revision)});
  // The child is run from what its log holds, as any later resume or replay of it.
  branch.genesis = make_genesis(child, {}, run_options.threads);
  branch.genesis.files = parent.genesis().files;
  branch.engine = SimulationEngine::of_genesis(branch.genesis, parent.path(), run_options);
  branch.engine->restore(branch.first.view());
  branch.genesis.schema = branch.engine->schema();
  branch.genesis.lineage = make_lineage(parent, request.step, std::move(plan.changes));
  take_tables(branch, parent, request.step);
  return branch;
}

}  // namespace varve::tools
