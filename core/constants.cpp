#include "core/constants.h"

#include <algorithm>

#include "core/criteria.h"
#include "core/kernel.h"
#include "core/math.h"

namespace varve::core {

template <int D>
SpeciesConstants<D> species_constants(double diameter, double density) {
  const double d = diameter;
  SpeciesConstants<D> one;
  one.diameter = d;
  one.radius = 0.5 * d;
  one.volume = D == 2 ? 0.25 * pi * d * d : pi * d * d * d / 6;
  one.mass = density * one.volume;
  one.inertia = (D == 2 ? 0.5 : 0.4) * one.mass * one.radius * one.radius;
  return one;
}

template <int D>
void Constants<D>::set_pairs() {
  const auto body = [](const SpeciesConstants<D>& one) {
    return ContactBody{one.radius, one.mass + one.added_mass, one.inertia};
  };
  pairs.clear();
  largest_diameter = least_diameter = species.front().diameter;
  for (const SpeciesConstants<D>& one : species) {
    largest_diameter = std::max(largest_diameter, one.diameter);
    least_diameter = std::min(least_diameter, one.diameter);
    for (const SpeciesConstants<D>& other : species) {
      const ContactBody partner = body(other);
      pairs.push_back(contact_pair(contact, D, body(one), &partner));
    }
    pairs.push_back(contact_pair(contact, D, body(one), nullptr));
  }
}

namespace {

template <int D>
void set_grains(const Scenario& s, Constants<D>& c) {
  c.frozen = s.grains.motion == GrainMotion::frozen;
  // With hydrostatics taken out, the fluid's excess pressure does not carry a grain: its weight is
  // the submerged one. In the full form the pressure gradient does, and Archimedes is not added.
  const bool submerged = c.coupled && !c.full_pressure;
  for (const GrainSpecies& each : species_of(s)) {
    SpeciesConstants<D> one = species_constants<D>(each.diameter, each.density);
    const double density = submerged ? each.density - s.fluid.density : each.density;
    one.weight = density * one.volume * c.gravity;
    if (c.coupled) one.added_mass = s.coupling.added_mass * s.fluid.density * one.volume;
    if (c.coupled && s.coupling.self_disturbance)
      one.slip_factor = undisturbed_slip(one.radius, s.coupling.length);
    c.species.push_back(one);
  }
  c.contact = s.contact;
  c.set_pairs();
  c.substeps = substeps(s);
}

}  // namespace

template <int D>
Constants<D> constants_of(const Scenario& s) {
  Constants<D> c;
  c.dt = s.time.dt;
  c.coupled = s.is_coupled();
  c.two_way = c.coupled && s.coupling.mode == CouplingMode::two_way;
  c.full_pressure = s.fluid.pressure == PressureForm::full;
  c.gravity[0] = s.gravity.magnitude * sin(s.gravity.tilt);
  c.gravity[1] = -s.gravity.magnitude * cos(s.gravity.tilt);
  if (s.domain.sides == Boundary::periodic) {
    c.period.origin[0] = s.domain.left;
    c.period.length[0] = s.domain.width;
  }
  if (s.domain.bottom == Boundary::periodic) c.period.length[1] = s.domain.height;
  if constexpr (D == 3)
    if (s.domain.shape == Shape::box && s.domain.faces == Boundary::periodic)
      c.period.length[2] = s.domain.depth;
  if (s.has_fluid()) {
    c.spacing = s.fluid.spacing;
    c.smoothing_length = s.fluid.smoothing_ratio * s.fluid.spacing;
    c.support = support_ratio(s.fluid.kernel) * c.smoothing_length;
    c.reference_density = s.fluid.density;
    c.sound_speed = s.fluid.sound_speed;
    c.viscosity = s.fluid.viscosity;
    c.diffusion = s.fluid.density_diffusion;
    if (s.fluid.equation_of_state == EquationOfState::tait)
      c.tait_pressure = s.fluid.density * (s.fluid.sound_speed * s.fluid.sound_speed) / 7;
    c.artificial_alpha = s.fluid.artificial_alpha;
    c.artificial_beta = s.fluid.artificial_beta;
    c.shifting_speed = s.fluid.shifting * 0.1 * s.fluid.sound_speed;
    if (c.full_pressure) c.fluid_acceleration = c.gravity;
    c.fluid_acceleration[0] += s.fluid.body_force_x;
    c.fluid_acceleration[1] += s.fluid.body_force_y;
    if constexpr (D == 3) c.fluid_acceleration[2] += s.fluid.body_force_z;
  }
  if (s.has_grains()) set_grains(s, c);
  if (c.coupled) {
    c.coupling_length = s.coupling.length;
    c.porosity_floor = s.coupling.porosity_floor;
    c.exclude_own_volume = s.coupling.exclude_own_volume;
    c.conservative_porosity = s.coupling.porosity == Porosity::conservative;
    c.conjugate_pressure =
        c.two_way && s.coupling.pressure_force == PressureForce::conjugate;
  }
  return c;
}

template struct Constants<2>;
template struct Constants<3>;
template SpeciesConstants<2> species_constants<2>(double, double);
template SpeciesConstants<3> species_constants<3>(double, double);
template Constants<2> constants_of<2>(const Scenario&);
template Constants<3> constants_of<3>(const Scenario&);

}  // namespace varve::core
