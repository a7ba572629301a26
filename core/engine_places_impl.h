// What Engine gives the pair sweeps to read and takes from them: by place in the lists, which is
// not always the order of the state (core/fluid_lists.h).
#pragma once

#include "core/engine.h"

namespace varve::core {

namespace engine_detail {

/// Items of a loop of few instructions below which a second thread is not worth waking.
inline constexpr std::size_t cheap_items = 2048;

}  // namespace engine_detail

template <int D, class P>
SweepData<D, P> Engine<D, P>::sweep_data() {
  SweepData<D, P> s;
  s.count = state_.fluid.size();
  s.position = reinterpret_cast<const Position*>(state_.fluid.position.data());
  s.velocity = reinterpret_cast<const Real*>(state_.fluid.velocity.data());
  s.mass = state_.fluid.mass.data();
  s.superficial_density = state_.fluid.superficial_density.data();
  s.porosity = two_way() ? work_.floored_porosity.data() : nullptr;
  const bool ordered = lists_.ordered();
  s.order = ordered ? lists_.order().data() : nullptr;
  s.records = work_.records.data();
  s.place_position = ordered ? reinterpret_cast<const Position*>(work_.place_position.data())
                             : s.position;
  s.place_velocity =
      ordered ? reinterpret_cast<const Real*>(work_.place_velocity.data()) : s.velocity;
  s.first = work_.first;
  s.second = work_.second;
  s.fluid = lists_.fluid();
  s.walls = lists_.walls();
  s.of_walls = lists_.of_walls();
  s.wall_count = work_.wall_count;
  s.wall_position = reinterpret_cast<const Position*>(work_.wall_position.data());
  s.wall_own_velocity = reinterpret_cast<const Real*>(work_.wall_own_velocity.data());
  s.wall_volume = work_.wall_volume.data();
  s.wall_viscous_volume = work_.wall_viscous_volume.data();
  s.density_out =
      ordered ? work_.place_density.data() : next_.fluid.superficial_density.data();
  s.volume_out = ordered ? work_.place_volume.data() : work_.volume.data();
  s.pressure_out = ordered ? work_.place_pressure.data() : work_.pressure.data();
  s.push_out = ordered ? work_.place_pressure.data() : work_.push.data();
  s.superficial_density_next = next_.fluid.superficial_density.data();
  s.volume = work_.volume.data();
  s.pressure = work_.pressure.data();
  s.push = work_.push.data();
  s.wall_push = work_.wall_push.data();
  s.wall_velocity = reinterpret_cast<Real*>(work_.wall_velocity.data());
  s.stress_force =
      reinterpret_cast<Real*>((ordered ? work_.place_stress : work_.stress_force).data());
  s.viscous_force =
      reinterpret_cast<Real*>((ordered ? work_.place_viscous : work_.viscous_force).data());
  s.conjugate = c_.conjugate_pressure;
  s.smoothing_length = static_cast<Real>(c_.smoothing_length);
  s.dt = static_cast<Real>(c_.dt);
  s.reference_density = static_cast<Real>(c_.reference_density);
  s.sound_speed = static_cast<Real>(c_.sound_speed);
  s.viscosity = static_cast<Real>(c_.viscosity);
  s.diffusion = static_cast<Real>(c_.diffusion);
  s.tait_pressure = static_cast<Real>(c_.tait_pressure);
  s.artificial_alpha = static_cast<Real>(c_.artificial_alpha);
  s.artificial_beta = static_cast<Real>(c_.artificial_beta);
  s.gradient_correction = work_.gradient_correction.data();
  s.shift_velocity = reinterpret_cast<Real*>(work_.shift_velocity.data());
  s.shifting_speed = static_cast<Real>(c_.shifting_speed);
  for (int k = 0; k < D; ++k) {
    s.gravity[k] = static_cast<Real>(c_.fluid_acceleration[k]);
    // Fluid at rest in the full form has grad rho = rho0 g / c0^2; diffusion acts on what is left.
    s.hydrostatic_gradient[k] =
        c_.full_pressure ? static_cast<Real>(c_.reference_density * c_.gravity[k] /
                                             (c_.sound_speed * c_.sound_speed))
                         : Real(0);
    s.period[k] = static_cast<Position>(c_.period.length[k]);
  }
  return s;
}

/// Runs one loop of the pair sweeps over `points` places or dummies.
template <int D, class P>
void Engine<D, P>::sweep(typename PairSweeps<D, P>::Loop loop, std::size_t points) {
  const SweepData<D, P> data = sweep_data();
  workers_.run((points + lanes - 1) / lanes, 4,
               [&](std::size_t begin, std::size_t end, unsigned) { loop(data, begin, end); });
}

/// Calls `body(k, map[k])` for every particle, `map` being the order of the lists or their places;
/// an empty one is k itself. Stores at k then follow each other and what is scattered is loads: a
/// processor has many of these under way at once.
template <int D, class P>
template <class Body>
void Engine<D, P>::for_each_mapped(std::span<const std::int32_t> map, const Body& body) {
  workers_.run(state_.fluid.size(), engine_detail::cheap_items,
               [&](std::size_t begin, std::size_t end, unsigned) {
                 for (std::size_t k = begin; k < end; ++k)
                   body(k, map.empty() ? k : static_cast<std::size_t>(map[k]));
               });
}

/// Brings position and velocity to where pairs read them. Nothing to do where lists have the order
/// of the state and no records are read.
template <int D, class P>
void Engine<D, P>::list_places() {
  const std::size_t n = state_.fluid.size();
  const bool records = sweeps_.reads_records;
  const bool positions = lists_.ordered() && (!records || record_velocity<D, P> == 0);
  const bool velocities = lists_.ordered() && !records;
  if (records) work_.records.resize(n);
  if (positions) work_.place_position.resize(n);
  if (velocities) work_.place_velocity.resize(n);
  if (!records && !positions) return;
  for_each_mapped(lists_.order(), [&](std::size_t place, std::size_t a) {
    if (positions) work_.place_position[place] = state_.fluid.position[a];
    if (velocities) work_.place_velocity[place] = state_.fluid.velocity[a];
    if (!records) return;
    Real* const number = work_.records[place].number;
    for (int k = 0; k < D; ++k) {
      if constexpr (record_velocity<D, P> > 0) number[k] = state_.fluid.position[a][k];
      number[record_velocity<D, P> + static_cast<std::size_t>(k)] = state_.fluid.velocity[a][k];
    }
  });
}

/// The same for the two numbers of a sweep.
template <int D, class P>
void Engine<D, P>::list_numbers(const std::vector<Real>& first, const std::vector<Real>& second) {
  work_.first = first.data();
  work_.second = second.data();
  if (sweeps_.reads_records) {
    for_each_mapped(lists_.order(), [&](std::size_t place, std::size_t a) {
      work_.records[place].number[record_first<D, P>] = first[a];
      work_.records[place].number[record_first<D, P> + 1] = second[a];
    });
  } else if (lists_.ordered()) {
    work_.place_first.resize(first.size());
    work_.place_second.resize(first.size());
    work_.first = work_.place_first.data();
    work_.second = work_.place_second.data();
    for_each_mapped(lists_.order(), [&](std::size_t place, std::size_t a) {
      work_.place_first[place] = first[a];
      work_.place_second[place] = second[a];
    });
  }
}

}  // namespace varve::core
