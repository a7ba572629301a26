#include "tools/study_estimate.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "core/units.h"
#include "tools/probe.h"
#include "tools/recording.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

/// Particles as check counts them, near enough for an estimate.
double particles_of(const core::Scenario& s) {
  double count = s.domain.width * s.domain.height / (s.fluid.spacing * s.fluid.spacing);
  if (s.domain.dimension == 3) count *= s.domain.depth / s.fluid.spacing;
  return std::max(1.0, count);
}

double steps_of(const core::Scenario& s) {
  if (s.time.steps > 0) return static_cast<double>(s.time.steps);
  return std::ceil(s.time.until / s.time.dt);
}

/// Steps of a fork: from where it begins, as far as that can be told without the parent's log.
double fork_steps(const StudyCase& each, const core::Scenario& scenario) {
  if (each.steps) return std::stod(*each.steps);
  const double whole = steps_of(scenario);
  const std::string& at = each.at;
  double number = 0;
  if (at.starts_with("t=") && read_number(at.substr(2), {0, 0, 1}, number).empty())
    return std::max(0.0, whole - number / scenario.time.dt);
  if (at.ends_with('%') && read_number(at, {}, number).empty()) return whole * (1 - number);
  const auto [end, error] = std::from_chars(at.data(), at.data() + at.size(), number);
  if (error == std::errc{} && end == at.data() + at.size()) return std::max(0.0, whole - number);
  return whole;
}

/// Cost of one particle in one step.
struct Rate {
  double seconds = 0, bytes = 0;
};

std::optional<Rate> probed(const core::Scenario& scenario, double particles) {
  // About a fifth of a second on a machine of today.
  const auto steps = static_cast<std::uint64_t>(std::clamp(2e5 / particles, 4.0, 200.0));
  try {
    const Probe probe = probe_log(scenario, 0, steps, {1, 0});
    return Rate{probe.wall_s / (static_cast<double>(probe.steps) * particles),
                probe.bytes_per_step / particles};
  } catch (const EngineFailure&) {
    return std::nullopt;  // it fails within the first steps: it will not take long
  }
}

}  // namespace

std::vector<Estimate> estimate_members(const StudyPlan& plan, const StudyStore& store,
                                       const std::set<std::size_t>& selection) {
  std::vector<Estimate> estimates;
  std::map<std::size_t, Rate> by_case;
  std::set<std::string> seen;
  for (const std::size_t index : selection) {
    const StudyMember& member = plan.members[index];
    if (!seen.insert(member.id).second) continue;
    Estimate each;
    each.index = index;
    each.particles = particles_of(member.scenario);
    each.steps = member.is_fork ? fork_steps(plan.case_of(member), member.scenario)
                                : steps_of(member.scenario);
    each.ended = store.read_row(member.id).has_value();
    if (each.ended) {
      const StudyTiming timing = store.read_timing(member.id);
      each.steps = static_cast<double>(timing.steps);
      each.seconds = timing.run_s + timing.measure_s;
      each.bytes = static_cast<double>(timing.log_bytes);
      const double work = each.steps * each.particles;
      if (work > 0) by_case[member.case_index] = {each.seconds / work, each.bytes / work};
    }
    estimates.push_back(each);
  }
  for (Estimate& each : estimates) {
    if (each.ended) continue;
    const StudyMember& member = plan.members[each.index];
    if (by_case.count(member.case_index) == 0)
      by_case[member.case_index] = probed(member.scenario, each.particles).value_or(Rate{});
    const Rate& rate = by_case[member.case_index];
    each.seconds = rate.seconds * each.particles * each.steps;
    each.bytes = rate.bytes * each.particles * each.steps;
  }
  return estimates;
}

}  // namespace varve::tools
