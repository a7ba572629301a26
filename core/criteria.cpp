#include "core/criteria.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/drag.h"
#include "core/initial_flow.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/parameters.h"
#include "core/walls.h"

namespace varve::core {
namespace {

template <int D>
double balance_speed(const Scenario& scenario, double weight) {
  const DragLaw<D> law = make_drag_law<D>(scenario.coupling.drag);
  const auto drag = [&](double speed) {
    return speed * drag_coefficient<D>(law, {speed, 1.0, scenario.grains.diameter,
                                             scenario.fluid.density, scenario.fluid.viscosity});
  };
  double low = 0, high = 1e-9;
  while (drag(high) < weight) {
    low = high;
    high *= 2;
    if (high > 1e6) return std::numeric_limits<double>::infinity();
  }
  // Halving until the interval holds no further double: the result depends on nothing but the law.
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (drag(middle) < weight ? low : high) = middle;
  }
  return high;
}

double length_of(double x, double y, double z) { return std::sqrt(x * x + y * y + z * z); }

double body_force(const Scenario& s) {
  return length_of(s.fluid.body_force_x, s.fluid.body_force_y, s.fluid.body_force_z);
}

bool grains_move(const Scenario& scenario) {
  return scenario.has_grains() && scenario.grains.motion == GrainMotion::free;
}

/// What a body force does to the fluid: where it drives it round through periodic sides, the speed
/// in the middle of a plane channel (or pipe) with the walls beside it; else a free fall along the
/// domain.
double body_force_speed(const Scenario& s) {
  const Domain& d = s.domain;
  const bool solid = d.dimension == 3, pipe = solid && d.shape == Shape::pipe;
  const double force = body_force(s);
  const double parts[] = {std::abs(s.fluid.body_force_x), std::abs(s.fluid.body_force_y),
                          std::abs(s.fluid.body_force_z)};
  const Boundary ends[] = {d.sides, d.bottom, solid ? d.faces : Boundary::periodic};
  const double extents[] = {d.width, d.height, solid ? d.depth : 0};
  const std::ptrdiff_t along = std::max_element(parts, parts + 3) - parts;
  double gap = std::numeric_limits<double>::infinity();
  for (std::ptrdiff_t k = 0; k < 3; ++k)
    if (k != along && ends[k] != Boundary::periodic) gap = std::min(gap, extents[k]);
  if (ends[along] == Boundary::periodic && std::isfinite(gap))
    return force * gap * gap * s.fluid.density / ((pipe ? 16 : 8) * s.fluid.viscosity);
  return std::sqrt(2 * force * extents[along]);
}

}  // namespace

double smoothing_length(const Scenario& s) { return s.fluid.smoothing_ratio * s.fluid.spacing; }

double kernel_support(const Scenario& s) {
  return support_ratio(s.fluid.kernel) * smoothing_length(s);
}

double coupling_radius(const Scenario& s) { return 2 * s.coupling.length; }

double periodic_minimum(const Scenario& s) {
  double least = 0;
  if (s.has_fluid()) least = kernel_support(s) + list_skin_ratio * smoothing_length(s);
  if (s.is_coupled())
    least = std::max(least, coupling_radius(s) + list_skin_ratio * smoothing_length(s));
  if (s.has_grains()) least = std::max(least, s.grains.diameter * (1 + list_skin_ratio));
  return 2 * least;
}

double grain_volume(const Scenario& s) {
  const double d = s.grains.diameter;
  return s.domain.dimension == 2 ? pi * d * d / 4 : pi * d * d * d / 6;
}

double grain_mass(const Scenario& s) { return s.grains.density * grain_volume(s); }

double least_effective_mass(const Scenario& s) {
  const bool one = s.grains.rows == 1 && s.grains.columns == 1 && s.grains.layers == 1;
  return one ? grain_mass(s) : 0.5 * grain_mass(s);
}

double contact_time(const Scenario& s) {
  return pi * std::sqrt(least_effective_mass(s) / s.contact.stiffness);
}

std::int64_t substeps(const Scenario& s) {
  if (s.time.substeps > 0) return s.time.substeps;
  if (!grains_move(s)) return 1;
  // A step of exactly tc0 / 30 is one sub-step, whichever way the division rounds.
  const double exact = substeps_per_contact * s.time.dt / contact_time(s);
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(exact * (1 - 1e-12))));
}

bool has_free_surface(const Scenario& s) {
  if (!s.has_fluid()) return false;
  return s.domain.top == Boundary::free || s.fluid.level < s.domain.height ||
         !std::isnan(s.fluid.width);
}

double terminal_speed(const Scenario& s) {
  if (!s.has_grains() || !s.has_fluid()) return 0;
  const double excess = std::abs(s.grains.density - s.fluid.density);
  const double weight = excess * grain_volume(s) * s.gravity.magnitude;
  if (weight == 0) return 0;
  return s.domain.dimension == 2 ? balance_speed<2>(s, weight) : balance_speed<3>(s, weight);
}

double SpeedEstimate::sound_speed() const {
  const double needed = std::max(10 * fluid, 20 * grains);
  return needed > 0 ? needed : 1.0;
}

SpeedEstimate expected_speeds(const Scenario& s) {
  SpeedEstimate estimate;
  estimate.fluid_reason = "no force acts on the fluid";
  if (!s.has_fluid()) {
    estimate.fluid_reason = "no fluid";
  } else {
    const double driven = body_force_speed(s);
    if (driven > 0) {
      estimate.fluid = driven;
      estimate.fluid_reason = "body force over the domain";
    }
    const auto at_least = [&](double speed, const char* reason) {
      if (speed <= estimate.fluid) return;
      estimate.fluid = speed;
      estimate.fluid_reason = reason;
    };
    at_least(std::abs(s.domain.lid_speed), "domain.lid_speed");
    at_least(std::abs(s.domain.floor_speed), "domain.floor_speed");
    at_least(largest_initial_speed(s), "flow at the start");
    if (s.fluid.pressure == PressureForm::full && s.gravity.magnitude > 0) {
      const double level = std::isnan(s.fluid.level) ? s.domain.height : s.fluid.level;
      const double fall = std::sqrt(2 * s.gravity.magnitude * level);
      at_least(fall, "full pressure: sqrt(2 g H)");
    }
  }
  estimate.grains_reason = "no grains";
  if (s.has_grains() && s.grains.motion == GrainMotion::frozen) {
    estimate.grains_reason = "grains are frozen";
  } else if (s.has_grains()) {
    const double first =
        length_of(s.grains.velocity_x, s.grains.velocity_y, s.grains.velocity_z);
    const double settling = s.is_coupled() ? terminal_speed(s) : 0;
    estimate.grains = std::max(first, settling);
    estimate.grains_reason =
        settling >= first ? "terminal speed of one grain" : "speed of the grains at the start";
    if (!s.is_coupled()) estimate.grains_reason = "grains do not feel the fluid";
  }
  return estimate;
}

double outer_acceleration(const Scenario& s) {
  double largest = 0;
  if (s.has_fluid()) {
    largest = body_force(s);
    if (s.fluid.pressure != PressureForm::excess) largest += s.gravity.magnitude;
  }
  if (grains_move(s)) {
    const double ratio =
        s.is_coupled() ? std::abs(1 - s.fluid.density / s.grains.density) : 1.0;
    largest = std::max(largest, std::min(1.0, ratio) * s.gravity.magnitude);
  }
  return largest;
}

std::vector<StepLimit> step_limits(const Scenario& s) {
  std::vector<StepLimit> limits;
  if (s.has_fluid()) {
    const double h = smoothing_length(s);
    const double cfl = s.time.cfl * h / s.fluid.sound_speed;
    limits.push_back({"cfl", "cfl h / c0", cfl, cfl});
    const double g = outer_acceleration(s);
    if (g > 0) {
      const double falling = 0.25 * std::sqrt(h / g);
      limits.push_back({"acceleration", "0.25 sqrt(h / g)", falling, falling});
    }
    double viscous = 0.125 * h * h * s.fluid.density / s.fluid.viscosity;
    if (s.fluid.artificial_alpha > 0) {
      // Monaghan's linear term acts like a kinematic viscosity alpha c0 h / (2 (D + 2)).
      const double added = s.fluid.artificial_alpha * s.fluid.sound_speed * h /
                           (2 * (static_cast<double>(s.domain.dimension) + 2));
      viscous = 0.125 * h * h / (s.fluid.viscosity / s.fluid.density + added);
    }
    limits.push_back({"viscosity", "0.125 h^2 rho0 / mu", viscous, viscous});
  }
  if (grains_move(s)) {
    const double tc0 = contact_time(s);
    // With fluid the grains are sub-stepped as often as needed, unless the number was given.
    const bool counted = s.time.substeps > 0;
    const double n = counted ? static_cast<double>(s.time.substeps) : 1.0;
    if (counted) {
      limits.push_back({"contact", "substeps tc0 / 30", n * tc0 / substeps_per_contact,
                        n * tc0 / substeps_per_contact_min});
    } else if (!s.has_fluid()) {
      constexpr double without_limit = std::numeric_limits<double>::infinity();
      limits.push_back({"contact", "tc0 / 30", tc0 / substeps_per_contact, without_limit});
    }
  }
  if (limits.empty()) limits.push_back({"nothing moves", "1 ms", 1e-3, 1e-3});
  return limits;
}

const StepLimit& binding_limit(const std::vector<StepLimit>& limits, bool of_largest) {
  return *std::min_element(limits.begin(), limits.end(), [&](const auto& a, const auto& b) {
    return of_largest ? a.largest < b.largest : a.chosen < b.chosen;
  });
}

bool within(double dt, double limit) { return dt <= limit * (1 + 1e-9); }

std::uint64_t last_step_at(double seconds, double dt) {
  const double exact = seconds / dt + 1e-6;
  if (!(exact > 0)) return 0;
  return static_cast<std::uint64_t>(std::floor(std::min(exact, 9e15)));
}

std::uint64_t first_step_at(double seconds, double dt) {
  const double exact = seconds / dt - 1e-6;
  if (!(exact > 0)) return 0;
  return static_cast<std::uint64_t>(std::ceil(std::min(exact, 9e15)));
}

std::uint64_t steps_of_run(const Scenario& s) {
  if (s.time.steps > 0) return static_cast<std::uint64_t>(s.time.steps);
  if (std::isnan(s.time.until)) return 0;
  std::uint64_t since_step = 0;
  double since_time = 0;
  Scenario now;
  now.time.dt = s.time.dt;
  for (const ScheduledChange& change : s.changes) {
    const auto step = static_cast<std::uint64_t>(change.at_step);
    const double time = since_time + static_cast<double>(step - since_step) * now.time.dt;
    if (time >= s.time.until) break;
    for (const auto& [key, value] : change.settings)
      if (key == "time.dt") set_parameter(now, *find_parameter(key), value);
    since_step = step;
    since_time = time;
  }
  return since_step + first_step_at(s.time.until - since_time, now.time.dt);
}

Lattice fluid_lattice(const Scenario& s) {
  if (!s.has_fluid()) return {};
  const double level = std::isnan(s.fluid.level) ? s.domain.height : s.fluid.level;
  const auto along = [&](double extent) {
    return nearest_integer(std::min(extent / s.fluid.spacing, 1e15));
  };
  Lattice lattice{along(std::isnan(s.fluid.width) ? s.domain.width : s.fluid.width),
                  along(level)};
  if (s.domain.dimension == 3) lattice.layers = along(s.domain.depth);
  std::int64_t sites = lattice.columns * lattice.layers;
  if (s.domain.dimension == 3 && s.domain.shape == Shape::pipe) {
    sites = 0;
    for (std::int64_t k = 0; k < lattice.layers; ++k)
      for (std::int64_t i = 0; i < lattice.columns; ++i)
        sites += in_pipe(i, k, lattice.columns) ? 1 : 0;
  }
  lattice.particles = sites * lattice.rows;
  return lattice;
}

double grain_pitch(const Scenario& s) { return s.grains.diameter * (1 + s.grains.gap); }

}  // namespace varve::core
