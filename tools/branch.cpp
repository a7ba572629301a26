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

Branch make_branch(const io::LogReader& parent, const BranchRequest& request,
                   const core::RunOptions& run_options) {
  auto source = SimulationEngine::of_genesis(parent.genesis(), parent.path(), run_options);
  seek(parent, request.step, *source);
  const core::Scenario before = source->simulation().scenario();
  check_settings(before, request.settings, request.options);

  Branch branch;
  Changes changes;
  Settings at_once;
  core::Scenario outputs = before;  // where the keys that touch no state are set
  std::optional<double> ramped_width;
  for (const auto& [key, value] : request.settings) {
    core::Scenario scratch = before;
    core::set_parameter(scratch, *core::find_parameter(key), value);
    if (text_of(scratch, key) == text_of(before, key)) continue;  // no change
    changes.push_back({key, text_of(before, key), text_of(scratch, key)});
    if (is_output(key)) {
      core::set_parameter(outputs, *core::find_parameter(key), value);
    } else if (key == "domain.width" && request.ramp_time) {
      ramped_width = scratch.domain.width;
    } else {
      at_once.emplace_back(key, text_of(scratch, key));
    }
  }
  if (request.ramp_time && !ramped_width)
    throw UsageError("--ramp-time: the width does not change; give another --width");
  if (!at_once.empty()) {
    const auto scheduled = static_cast<std::ptrdiff_t>(source->events().size());  // at this step
    source->change(at_once, request.options);
    branch.events.assign(source->events().begin() + scheduled, source->events().end());
  }
  core::Scenario child = remaining(source->simulation().scenario(), request.step);
  child.time.steps = outputs.time.steps;
  child.time.until = outputs.time.until;
  child.record = outputs.record;
  const bool new_width = std::any_of(changes.begin(), changes.end(), [](const auto& change) {
    return change.key == "domain.width";
  });
  if (new_width && request.options.anchor != 0)
    changes.push_back({"fork.anchor", "both", request.options.anchor < 0 ? "left" : "right"});
  if (new_width && request.options.outside != core::OutsideMode::error)
    changes.push_back({"fork.outside", "error",
                       request.options.outside == core::OutsideMode::push ? "push" : "remove"});
  if (ramped_width) {
    schedule_ramp(child, request.step, *ramped_width, *request.ramp_time, request.options);
    changes.push_back({"fork.ramp_time", "0", core::number_text(*request.ramp_time)});
  }
  set_target(child, parent, request, child.time.dt != before.time.dt);

  branch.first = io::Frame::copy_of(source->frame());
  if (request.perturb > 0) {
    const std::uint64_t moved =
        perturb_grains(source->schema(), branch.first, request.perturb, request.seed);
    const std::string amplitude = core::number_text(request.perturb);
    const std::string seed = std::to_string(request.seed);
    branch.events.push_back({request.step,
                             "perturb",
                             {{"amplitude_m", amplitude},
                              {"seed", seed},
                              {"grains_moved", std::to_string(moved)}}});
    changes.push_back({"fork.perturb", "0", amplitude + " seed " + seed});
    if (moved == 0)
      branch.notes.push_back("warning: --perturb is below the resolution of the positions: no "
                             "grain moved");
  }
  // What the parent recorded of step K itself happened before the change.
  if (auto tables = parent.tables(request.step)) {
    branch.first.rows = std::move(tables->rows);
    branch.first.tables = std::move(tables->tables);
  }

  const std::uint32_t revision = parent.genesis().engine_revision;
  if (revision != core::engine_revision)
    changes.push_back({"engine.revision", std::to_string(revision),
                       std::to_string(core::engine_revision)});

  branch.genesis = make_genesis(child, source->schema(), run_options.threads);
  branch.genesis.lineage = make_lineage(parent, request.step, std::move(changes));
  // The child is run from what its log holds, as any later resume or replay of it.
  branch.engine = SimulationEngine::of_genesis(branch.genesis, parent.path(), run_options);
  branch.engine->restore(branch.first.view());
  return branch;
}

}  // namespace varve::tools
