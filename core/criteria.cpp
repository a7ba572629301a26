#include "core/criteria.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/contact_law.h"
#include "core/drag.h"
#include "core/initial_flow.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/parameters.h"
#include "core/random.h"
#include "core/walls.h"

namespace varve::core {
namespace {

template <int D>
double balance_speed(const Scenario& scenario, double diameter, double weight) {
  const DragLaw<D> law = make_drag_law<D>(scenario.coupling.drag);
  const auto drag = [&](double speed) {
    return speed * drag_coefficient<D>(law, {speed, 1.0, diameter,
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

double length_of(double x, double y, double z = 0) { return std::sqrt(x * x + y * y + z * z); }

/// [m/s] of the fastest grain at the start.
double first_speed(const Scenario& s) {
  if (s.grains.arrangement != Arrangement::list)
    return length_of(s.grains.velocity_x, s.grains.velocity_y, s.grains.velocity_z);
  double most = 0;
  for (const ListedGrain& grain : s.grains.list)
    most = std::max(most, length_of(grain.velocity[0], grain.velocity[1], grain.velocity[2]));
  return most;
}

/// Calls visit(pair) for every pair of species and each with a wall.
template <class Visit>
void each_pair(const Scenario& s, const Visit& visit) {
  std::vector<ContactBody> bodies;
  const int dimension = static_cast<int>(s.domain.dimension);
  for (const GrainSpecies& species : species_of(s)) {
    const double radius = 0.5 * species.diameter, mass = grain_mass(s, species);
    bodies.push_back({radius, mass, (dimension == 2 ? 0.5 : 0.4) * mass * radius * radius});
  }
  for (const ContactBody& i : bodies) {
    visit(contact_pair(s.contact, dimension, i, nullptr));
    for (const ContactBody& j : bodies) visit(contact_pair(s.contact, dimension, i, &j));
  }
}

double body_force(const Scenario& s) {
  return length_of(s.fluid.body_force_x, s.fluid.body_force_y, s.fluid.body_force_z);
}

bool grains_move(const Scenario& scenario) {
  return scenario.has_grains() && scenario.grains.motion != GrainMotion::frozen;
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

/// A Stokeslet that is spread and sampled by the Wendland kernel moves the fluid at its place by
/// 1.0737 F / (6 pi mu hc); F = 6 pi mu R u without it.
double undisturbed_slip(double radius, double coupling_length) {
  return 1 / (1 - 1.0737 * radius / coupling_length);
}

double periodic_minimum(const Scenario& s) {
  double least = 0;
  if (s.has_fluid()) least = kernel_support(s) + list_skin_ratio * smoothing_length(s);
  if (s.is_coupled())
    least = std::max(least, coupling_radius(s) + list_skin_ratio * smoothing_length(s));
  if (s.has_grains()) least = std::max(least, largest_diameter(s) * (1 + list_skin_ratio));
  return 2 * least;
}

std::vector<GrainSpecies> species_of(const Scenario& s) {
  std::vector<GrainSpecies> all{{"grains", s.grains.diameter, s.grains.density, s.grains.share}};
  for (GrainSpecies each : s.species) {
    if (std::isnan(each.diameter)) each.diameter = s.grains.diameter;
    if (std::isnan(each.density)) each.density = s.grains.density;
    all.push_back(std::move(each));
  }
  return all;
}

std::uint32_t species_at_start(const Scenario& s, std::uint64_t id) {
  if (s.grains.arrangement == Arrangement::list) return s.grains.list[id].species;
  if (s.species.empty()) return 0;
  constexpr std::uint64_t draw = 32;  // no other use of a grain's id has this number
  double total = s.grains.share;
  for (const GrainSpecies& each : s.species) total += each.share;
  const double at = total * uniform(static_cast<std::uint64_t>(s.grains.seed), id, draw);
  double sum = s.grains.share;
  std::uint32_t number = 0;
  while (number < s.species.size() && !(at < sum)) sum += s.species[number++].share;
  return number;
}

double largest_diameter(const Scenario& s) {
  double most = s.grains.diameter;
  for (const GrainSpecies& each : s.species)
    if (each.diameter > most) most = each.diameter;
  return most;
}

double least_diameter(const Scenario& s) {
  double least = s.grains.diameter;
  for (const GrainSpecies& each : s.species)
    if (each.diameter < least) least = each.diameter;
  return least;
}

double grain_volume(const Scenario& s, const GrainSpecies& species) {
  const double d = species.diameter;
  return s.domain.dimension == 2 ? pi * d * d / 4 : pi * d * d * d / 6;
}

double grain_mass(const Scenario& s, const GrainSpecies& species) {
  return species.density * grain_volume(s, species);
}

double grain_volume(const Scenario& s) { return grain_volume(s, species_of(s).front()); }
double grain_mass(const Scenario& s) { return grain_mass(s, species_of(s).front()); }

GrainTotals grain_totals(const Scenario& s) {
  const std::vector<GrainSpecies> species = species_of(s);
  std::vector<std::int64_t> counts(species.size(), 0);
  const std::int64_t grains = s.grain_count();
  if (species.size() == 1) counts[0] = grains;
  for (std::int64_t i = 0; species.size() > 1 && i < grains; ++i)
    ++counts[species_at_start(s, static_cast<std::uint64_t>(i))];
  GrainTotals totals;
  for (std::size_t k = 0; k < species.size(); ++k) {
    totals.volume += static_cast<double>(counts[k]) * grain_volume(s, species[k]);
    totals.mass += static_cast<double>(counts[k]) * grain_mass(s, species[k]);
  }
  return totals;
}

double least_effective_mass(const Scenario& s) {
  const std::vector<GrainSpecies> species = species_of(s);
  double least = grain_mass(s, species.front());
  for (const GrainSpecies& each : species) least = std::min(least, grain_mass(s, each));
  return s.grain_count() == 1 ? least : 0.5 * least;
}

double impact_speed(const Scenario& s) {
  const double expected = expected_speeds(s).grains;
  if (s.is_coupled()) return expected;
  return std::max(std::sqrt(2 * s.gravity.magnitude * s.domain.height), expected);
}

double contact_time(const Scenario& s) {
  if (s.contact.law == ContactLaw::linear)
    return pi * std::sqrt(least_effective_mass(s) / s.contact.stiffness);
  // It hardly depends on the speed; where nothing is known to move, a slow contact.
  constexpr double slow = 1e-3;
  const double speed = std::max(slow, impact_speed(s));
  double shortest = std::numeric_limits<double>::infinity();
  each_pair(s, [&](const ContactPair& pair) {
    shortest = std::min(shortest, undamped_contact_time(s.contact, pair, speed));
  });
  return shortest;
}

double lubrication_time(const Scenario& s) {
  double shortest = std::numeric_limits<double>::infinity();
  if (!s.contact.lubrication || !s.is_coupled()) return shortest;
  each_pair(s, [&](const ContactPair& pair) {
    const double rough = s.contact.lubrication_gap * pair.effective_radius;
    const double thinness = s.domain.dimension == 2 ? 1 / (rough * std::sqrt(rough)) : 1 / rough;
    const double resistance = s.fluid.viscosity * pair.lubrication * thinness;
    shortest = std::min(shortest, pair.effective_mass / resistance);
  });
  return shortest;
}

std::int64_t substeps(const Scenario& s) {
  if (s.time.substeps > 0) return s.time.substeps;
  if (!grains_move(s)) return 1;
  // A step of exactly tc0 / 30 is one sub-step, whichever way the division rounds.
  double exact = substeps_per_contact * s.time.dt / contact_time(s);
  if (s.contact.lubrication)
    exact = std::max(exact, substeps_per_film * s.time.dt / lubrication_time(s));
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(exact * (1 - 1e-12))));
}

bool has_free_surface(const Scenario& s) {
  if (!s.has_fluid()) return false;
  return s.domain.top == Boundary::free || s.fluid.level < s.domain.height ||
         !std::isnan(s.fluid.width);
}

double terminal_speed(const Scenario& s) {
  if (!s.has_grains() || !s.has_fluid()) return 0;
  double fastest = 0;
  for (const GrainSpecies& each : species_of(s)) {
    const double excess = std::abs(each.density - s.fluid.density);
    const double weight = excess * grain_volume(s, each) * s.gravity.magnitude;
    if (weight == 0) continue;
    fastest = std::max(fastest, s.domain.dimension == 2
                                    ? balance_speed<2>(s, each.diameter, weight)
                                    : balance_speed<3>(s, each.diameter, weight));
  }
  return fastest;
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
    const double first = first_speed(s);
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
    double ratio = s.is_coupled() ? 0.0 : 1.0;
    for (const GrainSpecies& each : species_of(s))
      if (s.is_coupled()) ratio = std::max(ratio, std::abs(1 - s.fluid.density / each.density));
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
      if (s.contact.lubrication) {
        const double film = n * lubrication_time(s);
        limits.push_back({"lubrication", "substeps m / (10 lambda)", film / substeps_per_film,
                          film / substeps_per_film_min});
      }
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

double grain_pitch(const Scenario& s) { return largest_diameter(s) * (1 + s.grains.gap); }

}  // namespace varve::core
