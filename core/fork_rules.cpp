// What a fork or a scheduled change may do to a resolved scenario.
#include <algorithm>
#include <cmath>

#include "core/criteria.h"
#include "core/math.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

using Settings = std::vector<std::pair<std::string, std::string>>;

bool is_set(const Settings& settings, std::string_view key) {
  return std::any_of(settings.begin(), settings.end(),
                     [&](const auto& setting) { return setting.first == key; });
}

/// Largest value between a good and a bad one that still passes; `passes` is monotone.
template <class Passes>
double largest_passing(double good, double bad, const Passes& passes) {
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (good + bad);
    if (middle == good || middle == bad) break;
    (passes(middle) ? good : bad) = middle;
  }
  return good;
}

/// The step limit `name` of a scenario with one real key replaced.
double limit_with(Scenario scenario, std::string_view key, double value, std::string_view name) {
  std::get<Parameter::Real>(find_parameter(key)->access)(scenario) = value;
  for (const StepLimit& limit : step_limits(scenario))
    if (limit.name == name) return limit.largest;
  return INFINITY;
}

Problem step_problem(const Scenario& before, const Scenario& after, const Settings& settings,
                     const StepLimit& limit) {
  const std::string criterion = "the " + std::string(limit.name) + " limit " +
                                std::string(limit.formula);
  const std::string largest = number_below(limit.largest) + " s";
  if (is_set(settings, "time.dt")) {
    return {"time.dt", number_text(after.time.dt) + " s is above " + criterion +
                           "; largest safe value " + largest};
  }
  // A derived number keeps the parent's value, so the key that moved the limit is what is wrong.
  const std::string_view key = limit.name == "viscosity"      ? "fluid.viscosity"
                               : limit.name == "contact"      ? "contact.stiffness"
                               : limit.name == "acceleration" ? "gravity.magnitude"
                                                              : "time.dt";
  if (!is_set(settings, key))
    return {"time.dt", "the inherited " + number_text(after.time.dt) + " s is above " + criterion +
                           "; add time.dt of at most " + largest};
  const Parameter& parameter = *find_parameter(key);
  const auto get = std::get<Parameter::Real>(parameter.access);
  Scenario old = before, changed = after;
  const double safe = largest_passing(get(old), get(changed), [&](double value) {
    return within(after.time.dt, limit_with(after, key, value, limit.name));
  });
  std::string advice = "; largest safe value " + number_below(safe) + " " +
                       std::string(parameter.unit) + ", or add time.dt of at most " + largest;
  if (limit.name == "contact") advice += ", or time.substeps = 0 from the start";
  return {std::string(key), number_text(get(changed)) + " " + std::string(parameter.unit) +
                                " puts " + criterion + " below the inherited time.dt " +
                                number_text(after.time.dt) + " s" + advice};
}

std::vector<Problem> width_problems(const Scenario& before, const Scenario& after, int anchor) {
  const double change = after.domain.width - before.domain.width;
  if (change == 0) return {};
  if (before.domain.sides == Boundary::periodic)
    return {{"domain.width", "the sides are periodic; only walls can move"}};
  if (before.domain.dimension == 3 && before.domain.shape == Shape::pipe)
    return {{"domain.width", "the wall of a pipe is round and does not move by whole columns of "
                             "the lattice; start a new run of another width"}};
  if (!before.has_fluid()) return {};
  const double dx = before.fluid.spacing;
  const double walls = anchor == 0 ? 2 : 1;
  const double jumps = change / walls / dx;
  const double whole = std::floor(jumps + 0.5);
  if (std::abs(jumps - whole) > 1e-6) {
    const auto width_of = [&](double n) {
      return rough_number(before.domain.width + walls * n * dx) + " m";
    };
    const double low = std::floor(jumps);
    return {{"domain.width",
             number_text(after.domain.width) + " m moves each wall by " +
                 rough_number(change / walls) + " m, not a multiple of fluid.spacing " +
                 number_text(dx) + " m; nearest: " + width_of(low) + " or " + width_of(low + 1)}};
  }
  return {};
}

std::vector<Problem> set_changed_keys(Scenario& scenario, const Settings& settings, int anchor) {
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const auto& [key, value] = settings[i];
    const Parameter* parameter = find_parameter(key);
    if (key.starts_with("species.")) {
      problems.push_back({key, "cannot change in a fork or an event: " +
                                   std::string(fixed_reason(*find_parameter("grains.diameter")))});
      continue;
    }
    if (!parameter) {
      const std::string_view nearest = nearest_key(key);
      problems.push_back({key, "unknown key" + (nearest.empty()
                                                    ? std::string()
                                                    : "; did you mean '" + std::string(nearest) +
                                                          "'?")});
      continue;
    }
    if (std::any_of(settings.begin(), settings.begin() + static_cast<std::ptrdiff_t>(i),
                    [&key = key](const auto& earlier) { return earlier.first == key; })) {
      problems.push_back({key, "given twice"});
      continue;
    }
    if (parameter->change == Change::never) {
      problems.push_back({key, "cannot change in a fork or an event: " +
                                   std::string(fixed_reason(*parameter))});
      continue;
    }
    const bool length_of_run = key == "time.until" || key == "time.steps";
    if (value == "auto" && !length_of_run) {
      problems.push_back({key, "'auto' is derived at the start only; expected a value"});
      continue;
    }
    const double width = scenario.domain.width;
    if (const auto error = set_parameter(scenario, *parameter, value)) {
      problems.push_back({key, error->text});
      continue;
    }
    if (parameter->change != Change::geometry) continue;
    const double share = anchor == 0 ? 0.5 : anchor < 0 ? 0.0 : 1.0;
    double moved = share * (scenario.domain.width - width);
    if (scenario.has_fluid())  // exactly so many columns of the lattice
      moved = static_cast<double>(nearest_integer(moved / scenario.fluid.spacing)) *
              scenario.fluid.spacing;
    scenario.domain.left -= moved;
  }
  return problems;
}

std::vector<Problem> changed_limits(const Scenario& before, const Scenario& after,
                                    const Settings& settings, int anchor) {
  std::vector<Problem> problems = width_problems(before, after, anchor);
  const bool hertz = after.contact.law == ContactLaw::hertz;
  for (const bool of_linear : {true, false}) {
    const std::string key = of_linear ? "contact.stiffness" : "contact.youngs_modulus";
    if (is_set(settings, key) && after.has_grains() && hertz == of_linear)
      problems.push_back({key, std::string("contact.law is ") + (hertz ? "hertz" : "linear") +
                                   ": change " +
                                   (hertz ? "contact.youngs_modulus" : "contact.stiffness")});
  }
  if (is_set(settings, "contact.friction") && after.has_grains() && !after.contact.rotation &&
      after.contact.friction > 0)
    problems.push_back({"contact.friction",
                        "contact.rotation is off, so spin and tangential springs are not part of "
                        "this family's state; start with contact.rotation = on and friction 0"});
  const bool step_matters = std::any_of(settings.begin(), settings.end(), [](const auto& setting) {
    const Parameter* parameter = find_parameter(setting.first);
    return parameter && parameter->change == Change::parameter;
  });
  if (!step_matters) return problems;
  const std::vector<StepLimit> limits = step_limits(after);
  if (is_set(settings, "time.dt")) {
    const StepLimit& limit = binding_limit(limits, true);
    if (!within(after.time.dt, limit.largest))
      problems.push_back(step_problem(before, after, settings, limit));
  } else {
    for (const StepLimit& limit : limits)
      if (!within(after.time.dt, limit.largest))
        problems.push_back(step_problem(before, after, settings, limit));
  }
  constexpr std::int64_t substeps_max = 1'000'000;
  if (after.has_grains() && substeps(after) > substeps_max) {
    const bool stiffer = is_set(settings, "contact.stiffness");
    const double share = substeps_per_contact * after.time.dt / static_cast<double>(substeps_max);
    const double largest = least_effective_mass(after) * (pi / share) * (pi / share);
    problems.push_back({stiffer ? "contact.stiffness" : "time.dt",
                        "needs " + std::to_string(substeps(after)) +
                            " grain sub-steps per step, at most " + std::to_string(substeps_max) +
                            " are possible; largest safe contact.stiffness " +
                            number_below(largest) + " N/m"});
  }
  return problems;
}

}  // namespace

std::string_view fixed_reason(const Parameter& parameter) {
  if (parameter.change != Change::never) return "";
  const std::string_view key = parameter.key;
  const std::string_view section = key.substr(0, key.find('.'));
  if (key == "scenario.precision") return "the scalar type of the recorded state is fixed";
  if (key == "scenario.title") return "it names the family of runs";
  if (key == "domain.dimension") return "the dimension of the recorded state is fixed";
  if (key == "domain.left") return "the left side moves with domain.width";
  if (key == "domain.shape") return "the shape of the domain is fixed in a family of runs";
  if (key == "domain.lid_speed" || key == "domain.floor_speed")
    return "it is part of how the fluid is driven";
  if (key == "domain.height" || key == "domain.depth")
    return "only the side walls can move: change domain.width";
  if (section == "domain") return "the kind of boundary is fixed in a family of runs";
  if (key == "fluid.kernel" || key == "fluid.smoothing_ratio" || key == "fluid.spacing")
    return "kernel and resolution are fixed: the fluid's particles carry them";
  if (key == "fluid.density" || key == "fluid.sound_speed" || key == "fluid.pressure")
    return "the recorded density has its meaning from it";
  if (key == "fluid.present") return "the fields of the recorded state are fixed";
  if (section == "fluid") return "it is part of how the fluid started or is driven";
  if (section == "grains")
    return "number, size, material and start of the grains are fixed in a family of runs";
  if (key == "contact.time") return "it only sets the first stiffness: change contact.stiffness";
  if (key == "contact.rotation") return "spin and tangential springs are fields of the state";
  if (key == "contact.tangential_ratio") return "the recorded tangential springs depend on it";
  if (section == "coupling") return "the model of coupling is fixed in a family of runs";
  if (key == "time.cfl") return "the step is derived once, at the start: change time.dt";
  if (key == "time.substeps") return "it is fixed from the start";
  if (section == "guards") return "a run's guards are fixed from the start";
  return "it is fixed from the start";
}

std::vector<Problem> apply_settings(Scenario& scenario, const Settings& settings, int anchor) {
  Scenario changed = scenario;
  std::vector<Problem> problems = set_changed_keys(changed, settings, anchor);
  if (problems.empty()) problems = changed_limits(scenario, changed, settings, anchor);
  if (problems.empty()) scenario = std::move(changed);
  return problems;
}

}  // namespace varve::core
