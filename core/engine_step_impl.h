// The step of Engine: one stage after the other.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/engine.h"
#include "core/engine_places_impl.h"

namespace varve::core {

namespace engine_detail {

/// Names of the stages as Counters reports them; a stage that a scene does not need never runs.
enum Pass : std::size_t {
  pass_lists, pass_porosity, pass_density, pass_walls, pass_stress, pass_artificial, pass_shift,
  pass_grain_forces, pass_contacts, pass_fluid, pass_reaction, pass_count
};
inline constexpr const char* pass_names[pass_count] = {
    "lists", "porosity", "density", "walls", "stress", "artificial_viscosity", "shifting",
    "grain_forces", "contacts", "fluid", "reaction"};

/// The skin of the lists over the smoothing length: small enough for short lists, large enough that
/// they live for several steps at CFL 0.25. It reaches no bit.
inline constexpr double skin_ratio = 0.25;

inline constexpr std::size_t nobody = std::numeric_limits<std::size_t>::max();

/// Throws where one of the numbers is not finite.
template <int N, class Numbers>
void require_finite(const Numbers& numbers, const char* field, std::uint64_t step,
                    std::uint64_t id) {
  for (int k = 0; k < N; ++k) {
    const auto value = static_cast<double>(numbers[k]);
    if (std::isfinite(value)) continue;
    throw NumericalFailure("not a finite number", step, field, id, value,
                           std::numeric_limits<double>::max(),
                           "lower time.cfl or time.dt; look at the steps before");
  }
}

}  // namespace engine_detail

/// Semi-implicit Euler in two sweeps: superficial density from x(n), v(n); then pressure from it,
/// all forces, v += dt a, x += dt v. One force evaluation per step.
template <int D, class P>
void Engine<D, P>::advance() {
  happenings_.clear();
  find_forces();
  if (has_grains()) move_grains();
  if (has_fluid()) move_fluid();
  commit();
  record_tables();
  refresh_spans();
  apply_scheduled();
}

template <int D, class P>
void Engine<D, P>::evaluate() {
  find_forces();
  if (!has_grains()) return;
  // Drag is a mean over the sub-steps: the grains move, and are not committed, nor is what tables
  // and ledger say of the last step.
  const Contacts<D, P> kept = contacts_;
  try {
    move_grains();
  } catch (...) {
    contacts_ = kept;
    throw;
  }
  evaluated_wall_impulse_ = contacts_.wall_impulse();
  contacts_ = kept;
}

template <int D, class P>
void Engine<D, P>::find_forces() {
  stage_digests_.begin();
  if (has_fluid()) {
    update_lists();
    digest_stage(Stage::neighbours);
    if (two_way()) find_porosity();
    prepare_fluid();
    find_density_and_pressure();
    if (work_.wall_count > 0) find_wall_values();
    find_stresses();
  }
  if (coupled()) find_grain_forces();
}

template <int D, class P>
void Engine<D, P>::update_lists() {
  const double skin = engine_detail::skin_ratio * c_.smoothing_length;
  bool stale = lists_.stale(state_.fluid.position, skin, workers_), order_always = false;
  if (coupled()) stale = stale || coupling_.stale(c_, state_, skin);
  if (options_.rebuild_seed != 0 &&
      random_bits(options_.rebuild_seed, state_.clock.step, 0) % 3 == 0) {
    stale = true;
    order_always = random_bits(options_.rebuild_seed, state_.clock.step, 1) % 2 == 0;
  }
  if (!stale) return;
  lists_.rebuild(state_.fluid.position,
                 std::span(work_.wall_position.data(), work_.wall_count), c_.support, skin,
                 c_.period, order_always, workers_);
  if (coupled())
    coupling_.rebuild(c_, state_, walls_, skin, workers_);
  ++counters_.list_rebuilds;
  count_pass(engine_detail::pass_lists);
}

template <int D, class P>
void Engine<D, P>::find_porosity() {
  workers_.run(state_.fluid.size(), engine_detail::cheap_items,
               [&](std::size_t begin, std::size_t end, unsigned) {
                 for (std::size_t a = begin; a < end; ++a)
                   work_.volume_before[a] =
                       state_.fluid.mass[a] / state_.fluid.superficial_density[a];
               });
  coupling_.porosity(c_, state_, work_.volume_before, work_.porosity, work_.floored_porosity,
                     workers_);
  digest_stage(Stage::porosity);
  counters_.porosity_clamps += coupling_.fluid_clamps();
  count_pass(engine_detail::pass_porosity);
}

template <int D, class P>
void Engine<D, P>::prepare_fluid() {
  workers_.run(state_.fluid.size(), engine_detail::cheap_items,
               [&](std::size_t begin, std::size_t end, unsigned) {
                 for (std::size_t a = begin; a < end; ++a) {
                   const Real rhob = state_.fluid.superficial_density[a];
                   if (!two_way()) work_.volume_before[a] = state_.fluid.mass[a] / rhob;
                   work_.density_before[a] = two_way() ? rhob / work_.floored_porosity[a] : rhob;
                 }
               });
}

template <int D, class P>
void Engine<D, P>::find_density_and_pressure() {
  if (lists_.ordered()) {
    const std::size_t n = state_.fluid.size();
    for (auto* each : {&work_.place_density, &work_.place_volume, &work_.place_pressure})
      each->resize(n);
    work_.place_stress.resize(n);
    work_.place_viscous.resize(c_.conjugate_pressure ? n : 0);
  }
  list_places();
  list_numbers(work_.density_before, work_.volume_before);
  sweep(sweeps_.density, state_.fluid.size());
  if (lists_.ordered())
    for_each_mapped(lists_.places(), [&](std::size_t a, std::size_t place) {
      next_.fluid.superficial_density[a] = work_.place_density[place];
      work_.volume[a] = work_.place_volume[place];
      work_.pressure[a] = work_.push[a] = work_.place_pressure[place];
    });
  if (c_.conjugate_pressure)
    coupling_.share_pressure(c_, work_.volume, work_.pressure, work_.porosity,
                             work_.floored_porosity, work_.push, workers_);
  digest_stage(Stage::pressure);
  count_pass(engine_detail::pass_density);
}

template <int D, class P>
void Engine<D, P>::find_wall_values() {
  sweep(sweeps_.extrapolate, work_.wall_count);
  digest_stage(Stage::walls);
  count_pass(engine_detail::pass_walls);
}

template <int D, class P>
void Engine<D, P>::find_stresses() {
  list_numbers(work_.push, work_.volume);
  sweep(sweeps_.stress, state_.fluid.size());
  count_pass(engine_detail::pass_stress);
  if (c_.artificial_alpha > 0 || c_.artificial_beta > 0) add_artificial_viscosity();
  if (lists_.ordered())
    for_each_mapped(lists_.places(), [&](std::size_t a, std::size_t place) {
      work_.stress_force[a] = work_.place_stress[place];
      if (c_.conjugate_pressure) work_.viscous_force[a] = work_.place_viscous[place];
    });
  if (c_.shifts()) find_shifts();
  digest_stage(Stage::stress);
}

template <int D, class P>
void Engine<D, P>::find_shifts() {
  sweep(sweeps_.shift, state_.fluid.size());
  count_pass(engine_detail::pass_shift);
}

template <int D, class P>
void Engine<D, P>::add_artificial_viscosity() {
  sweep(sweeps_.artificial, state_.fluid.size());
  count_pass(engine_detail::pass_artificial);
}

template <int D, class P>
void Engine<D, P>::find_grain_forces() {
  const FluidView<D, P> fluid{state_.fluid.position, state_.fluid.velocity, work_.volume,
                              c_.conjugate_pressure ? work_.viscous_force : work_.stress_force,
                              work_.pressure, work_.porosity};
  coupling_.forces(c_, state_, fluid, drag_law_, workers_);
  counters_.drag_porosity_clamps += coupling_.grain_clamps();
  counters_.weak_coupling += coupling_.weak_grains();
  digest_stage(Stage::coupling);
  count_pass(engine_detail::pass_grain_forces);
}

template <int D, class P>
void Engine<D, P>::move_grains() {
  const std::size_t n = state_.grains.size();
  work_.outer.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec<double, D>& weight = c_.species[state_.grains.species[i]].weight;
    work_.outer[i] = {weight, Vec<double, D>::Zero(), 0};
    if (!coupled()) continue;
    const GrainForce<D>& f = coupling_.grain_forces()[i];
    work_.outer[i] = {weight + f.hydrodynamic, f.fluid_velocity, f.coefficient};
  }
  if (c_.frozen) {
    next_.grains = state_.grains;
    next_.contacts = state_.contacts;
    hold_grains();
    return;
  }
  contacts_.advance(c_, work_.outer, walls_, scenario_.guards.overlap, state_.clock.step + 1,
                    state_.grains, state_.contacts, next_.grains, next_.contacts, workers_);
  counters_.grain_substeps += static_cast<std::uint64_t>(c_.substeps);
  count_pass(engine_detail::pass_contacts);
  if (coupled()) {
    coupling_.set_drag(contacts_.mean_drag());
    sum_work();
  }
  for (auto& x : next_.grains.position) wrap(x);
  digest_stage(Stage::contacts);
  check_grains();
}

/// Frozen grains feel the fluid and give it back; nothing moves them.
template <int D, class P>
void Engine<D, P>::hold_grains() {
  if (!coupled()) return;
  std::vector<Vec<double, D>> drag(state_.grains.size());
  for (std::size_t i = 0; i < drag.size(); ++i)
    drag[i] = work_.outer[i].coefficient *
              (work_.outer[i].fluid_velocity - state_.grains.velocity[i].template cast<double>());
  coupling_.set_drag(drag);
}

/// Work done on the grains by drag and by the fluid's stresses during the step [J].
template <int D, class P>
void Engine<D, P>::sum_work() {
  drag_work_ = hydrodynamic_work_ = 0;
  for (std::size_t i = 0; i < state_.grains.size(); ++i) {
    const GrainForce<D>& f = coupling_.grain_forces()[i];
    for (int k = 0; k < D; ++k) {
      const double moved = static_cast<double>(next_.grains.position[i][k]) -
                           static_cast<double>(state_.grains.position[i][k]);
      drag_work_ += f.drag[k] * moved;
      hydrodynamic_work_ += f.hydrodynamic[k] * moved;
    }
  }
}

template <int D, class P>
void Engine<D, P>::wrap(Vec<Position, D>& x) const {
  for (int k = 0; k < D; ++k) {
    const auto length = static_cast<Position>(c_.period.length[k]);
    const auto low = static_cast<Position>(c_.period.origin[k]);
    if (!(length > 0)) continue;
    if (x[k] < low) x[k] += length;
    // Not else: a point just below the seam may round onto it.
    if (x[k] >= low + length) x[k] -= length;
  }
}

/// Whether a guard stops grain i, without saying which.
template <int D, class P>
bool Engine<D, P>::grain_is_good(std::size_t i, double limit) const {
  const GrainState<D, P>& grains = next_.grains;
  double speed2 = 0, place = 0;
  for (int k = 0; k < D; ++k) {
    const auto v = static_cast<double>(grains.velocity[i][k]);
    speed2 += v * v;
    place += static_cast<double>(grains.position[i][k]);
  }
  if (c_.contact.rotation)
    for (int k = 0; k < spin_components<D>; ++k) place += static_cast<double>(grains.spin[i][k]);
  // Written so that a NaN fails too. A sum that overflows is looked at again.
  return (speed2 <= limit * limit) & (std::abs(place) <= std::numeric_limits<double>::max());
}

template <int D, class P>
void Engine<D, P>::check_grains() const {
  // Without fluid there is no sound speed: a grain that crosses itself within a sub-step has
  // failed.
  const double of_sound = scenario_.guards.speed * c_.sound_speed;
  const double per_diameter = static_cast<double>(c_.substeps) / c_.dt;
  for (std::size_t i = 0; i < next_.grains.size(); ++i) {
    const double limit =
        has_fluid() ? of_sound : c_.species[next_.grains.species[i]].diameter * per_diameter;
    if (!grain_is_good(i, limit)) report_grain(i, limit);
  }
}

/// Throws what a guard has to say of grain i, if any has.
template <int D, class P>
void Engine<D, P>::report_grain(std::size_t i, double limit) const {
  const GrainState<D, P>& grains = next_.grains;
  const std::uint64_t step = state_.clock.step + 1, id = grains.id[i];
  engine_detail::require_finite<D>(grains.velocity[i], "grains.velocity", step, id);
  if (c_.contact.rotation)
    engine_detail::require_finite<spin_components<D>>(grains.spin[i], "grains.spin", step, id);
  engine_detail::require_finite<D>(grains.position[i], "grains.position", step, id);
  double speed2 = 0;
  for (int k = 0; k < D; ++k) {
    const auto v = static_cast<double>(grains.velocity[i][k]);
    speed2 += v * v;
  }
  if (speed2 <= limit * limit) return;
  throw NumericalFailure("grain speed", step, "grains.velocity", id, std::sqrt(speed2), limit,
                         "lower time.dt or contact.stiffness, or raise fluid.sound_speed");
}

/// v += dt a, x += dt v for particles [begin, end); returns the first one that a guard stops.
template <int D, class P>
std::size_t Engine<D, P>::move_fluid_part(std::size_t begin, std::size_t end) {
  const Real dt = static_cast<Real>(c_.dt);
  const Position dt_position = static_cast<Position>(c_.dt);
  const Vec<Real, D> outside = c_.fluid_acceleration.template cast<Real>();
  std::size_t first_bad = engine_detail::nobody;
  for (std::size_t a = begin; a < end; ++a) {
    Vec<Real, D> force = work_.stress_force[a];
    if (two_way())
      force += coupling_.reaction(a, static_cast<double>(work_.volume[a])).template cast<Real>();
    const Vec<double, D> repulsion = wall_repulsion(state_.fluid.position[a]);
    const Vec<Real, D> acceleration =
        force / state_.fluid.mass[a] + outside + repulsion.template cast<Real>();
    Vec<Real, D>& v = next_.fluid.velocity[a];
    Vec<Position, D>& x = next_.fluid.position[a];
    v = state_.fluid.velocity[a] + dt * acceleration;
    x = state_.fluid.position[a] + dt_position * v.template cast<Position>();
    if (c_.shifts()) x += dt_position * work_.shift_velocity[a].template cast<Position>();
    wrap(x);
    if (first_bad == engine_detail::nobody && !fluid_is_good(a)) first_bad = a;
  }
  return first_bad;
}

/// True where no wall needs to be asked: nearly always.
template <int D, class P>
bool Engine<D, P>::clear_of_walls(const Vec<Position, D>& x) const {
  bool clear = true;
  for (int k = 0; k < D; ++k) {
    const auto along = static_cast<double>(x[k]);
    clear = clear && along >= clear_.lower[k] && along <= clear_.upper[k];
  }
  return clear;
}

/// Acceleration [m/s2] of fluid beyond a wall, back: 0.4 (c0/dx)^2 times its distance, which stops
/// 0.6 c0 before the guard's dx. Dummies alone hold fluid back by its pressure, and where that is
/// not above the mean, between a grain and a wall, particles creep through: diffusion evens out the
/// density that would stop them. Pushing before the wall is reached would disturb the flow along
/// it.
template <int D, class P>
Vec<double, D> Engine<D, P>::wall_repulsion(const Vec<Position, D>& x) const {
  Vec<double, D> sum = Vec<double, D>::Zero();
  if (clear_of_walls(x)) return sum;
  const Vec<double, D> place = x.template cast<double>();
  for (const Wall& wall : walls_) {
    const double inside = distance_inside<D>(wall, place);
    if (inside >= 0) continue;
    const double rate = c_.sound_speed / c_.spacing;
    sum -= 0.4 * rate * rate * inside * inward_normal<D>(wall, place);
  }
  return sum;
}

template <int D, class P>
void Engine<D, P>::move_fluid() {
  std::vector<std::size_t> bad(workers_.parts(), engine_detail::nobody);
  workers_.run(state_.fluid.size(), 64, [&](std::size_t begin, std::size_t end, unsigned part) {
    bad[part] = move_fluid_part(begin, end);
  });
  digest_stage(Stage::integration);
  count_pass(engine_detail::pass_fluid);
  if (two_way()) count_pass(engine_detail::pass_reaction);
  const std::size_t first = *std::min_element(bad.begin(), bad.end());
  if (first != engine_detail::nobody) report_fluid(first);
}

template <int D, class P>
double Engine<D, P>::density_deviation(std::size_t a) const {
  const double eps = two_way() ? static_cast<double>(work_.floored_porosity[a]) : 1.0;
  return static_cast<double>(next_.fluid.superficial_density[a]) / eps / c_.reference_density - 1;
}

/// How far a particle has gone through a wall [m]; negative inside.
template <int D, class P>
double Engine<D, P>::beyond_walls(const Vec<Position, D>& x) const {
  double beyond = -std::numeric_limits<double>::infinity();
  for (const Wall& wall : walls_)
    beyond = std::max(beyond, -distance_inside<D>(wall, x.template cast<double>()));
  return beyond;
}

template <int D, class P>
bool Engine<D, P>::fluid_is_good(std::size_t a) const {
  double speed2 = 0, place = 0;
  for (int k = 0; k < D; ++k) {
    const auto v = static_cast<double>(next_.fluid.velocity[a][k]);
    speed2 += v * v;
    place += static_cast<double>(next_.fluid.position[a][k]);
  }
  const double limit = scenario_.guards.speed * c_.sound_speed;
  // Written so that a NaN fails too.
  return speed2 <= limit * limit && std::isfinite(place) &&
         std::abs(density_deviation(a)) <= scenario_.guards.density_deviation &&
         (clear_of_walls(next_.fluid.position[a]) ||
          !(beyond_walls(next_.fluid.position[a]) > c_.spacing));
}

template <int D, class P>
void Engine<D, P>::report_fluid(std::size_t a) const {
  const std::uint64_t step = state_.clock.step + 1, id = state_.fluid.id[a];
  engine_detail::require_finite<1>(&next_.fluid.superficial_density[a], "fluid.superficial_density",
                                   step, id);
  engine_detail::require_finite<D>(next_.fluid.velocity[a], "fluid.velocity", step, id);
  engine_detail::require_finite<D>(next_.fluid.position[a], "fluid.position", step, id);
  const double deviation = density_deviation(a);
  if (!(std::abs(deviation) <= scenario_.guards.density_deviation))
    throw NumericalFailure("density deviation", step, "fluid.superficial_density", id, deviation,
                           scenario_.guards.density_deviation,
                           "raise coupling.length or coupling.porosity_floor, or lower time.cfl");
  double speed2 = 0;
  for (int k = 0; k < D; ++k) {
    const auto v = static_cast<double>(next_.fluid.velocity[a][k]);
    speed2 += v * v;
  }
  const double limit = scenario_.guards.speed * c_.sound_speed;
  if (!(speed2 <= limit * limit))
    throw NumericalFailure("fluid speed", step, "fluid.velocity", id, std::sqrt(speed2), limit,
                           "lower time.cfl or raise fluid.sound_speed");
  throw NumericalFailure("fluid beyond a wall", step, "fluid.position", id,
                         beyond_walls(next_.fluid.position[a]), c_.spacing,
                         "lower time.cfl or raise fluid.sound_speed");
}

template <int D, class P>
void Engine<D, P>::commit() {
  ClockState& clock = state_.clock;
  ++clock.step;
  clock.time = clock.since_time + static_cast<double>(clock.step - clock.since_step) * clock.dt;
  if (has_fluid()) {
    std::swap(state_.fluid.position, next_.fluid.position);
    std::swap(state_.fluid.velocity, next_.fluid.velocity);
    std::swap(state_.fluid.superficial_density, next_.fluid.superficial_density);
  }
  if (has_grains()) {
    std::swap(state_.grains, next_.grains);
    std::swap(state_.contacts, next_.contacts);
  }
}

}  // namespace varve::core
