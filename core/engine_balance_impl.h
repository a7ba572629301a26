// Momentum and energy of the step that Engine::evaluate() looked into.
//
// Kinetic energy of the fluid changes by dt sum F . (v + v')/2 exactly, whatever F is: every force
// is split by what it does. Its compression energy is U = sum m u(rho), du = p drho / rho^2 with
// rho = rhob / eps (floored as the engine floors it) and the superficial density that the step's
// pressure has. What moves U is continuity and the porosity, whose work the conjugate forces give
// back (core/coupling.h), and density diffusion, which is a loss: m (u(rho) - u(rho without the
// step's diffusion)). Shear is Morris's, drag and the viscous part of the hydrodynamic force lose
// F . (u - v) between the mean of the fluid around a grain and the grain.
//
// Three terms are the discretisation's own: dummies push with their own pressure on top of the
// fluid's, which continuity knows nothing of (wall_pressure); E3 takes S_j for 1, which it is not
// where fluid is uneven (pressure_volume and so on); and continuity takes the places at the step's
// start for the whole step (step_pressure, of first order in dt). The averaged form has no energy
// that its pressure belongs to: what it gains or loses shows in no term.
#pragma once

#include <cmath>

#include "core/engine.h"
#include "core/kernel.h"
#include "core/math.h"

namespace varve::core {

namespace engine_detail {

template <int D>
double inner(const Vec<double, D>& a, const Vec<double, D>& b) {
  double sum = 0;
  for (int k = 0; k < D; ++k) sum += a[k] * b[k];
  return sum;
}

template <int D, class T>
Vec<double, D> doubles(const Vec<T, D>& v) {
  return v.template cast<double>();
}

/// Calls `use` with the kernel of that name, from its own double arithmetic.
template <int D, class Use>
void with_kernel(Kernel kernel, double h, const Use& use) {
  switch (kernel) {
    case Kernel::cubic: return use(SmoothingKernel<D, Kernel::cubic, double>(h));
    case Kernel::quintic: return use(SmoothingKernel<D, Kernel::quintic, double>(h));
    case Kernel::wendland_c2: break;
  }
  use(SmoothingKernel<D, Kernel::wendland_c2, double>(h));
}

}  // namespace engine_detail

/// a - b over the nearest periodic image.
template <int D, class P>
Vec<double, D> Engine<D, P>::apart(const Vec<Position, D>& a, const Vec<Position, D>& b) const {
  Vec<double, D> d;
  for (int k = 0; k < D; ++k) {
    d[k] = static_cast<double>(a[k]) - static_cast<double>(b[k]);
    const double length = c_.period.length[k];
    if (d[k] > 0.5 * length) d[k] -= length;
    if (d[k] < -0.5 * length) d[k] += length;
  }
  return d;
}

/// u(rho) [J/kg], 0 at the reference density: the integral of p / rho^2.
template <int D, class P>
double Engine<D, P>::internal_energy(double density) const {
  const double rho0 = c_.reference_density, ratio = density / rho0;
  if (c_.tait_pressure > 0) {
    const double r2 = ratio * ratio, r6 = r2 * r2 * r2;
    return c_.tait_pressure / rho0 * ((r6 - 1) / 6 + 1 / ratio - 1);
  }
  return c_.sound_speed * c_.sound_speed * (log(ratio) + 1 / ratio - 1);
}

/// Velocities that move_fluid() would give, by the same operations.
template <int D, class P>
std::vector<Vec<double, D>> Engine<D, P>::velocities_ahead() const {
  const Real dt = static_cast<Real>(c_.dt);
  const Vec<Real, D> outside = c_.fluid_acceleration.template cast<Real>();
  std::vector<Vec<double, D>> ahead(state_.fluid.size());
  for (std::size_t a = 0; a < ahead.size(); ++a) {
    Vec<Real, D> force = work_.stress_force[a];
    if (two_way())
      force += coupling_.reaction(a, static_cast<double>(work_.volume[a])).template cast<Real>();
    const Vec<double, D> repulsion = wall_repulsion(state_.fluid.position[a]);
    const Vec<Real, D> acceleration =
        force / state_.fluid.mass[a] + outside + repulsion.template cast<Real>();
    const Vec<Real, D> v = state_.fluid.velocity[a] + dt * acceleration;
    ahead[a] = v.template cast<double>();
  }
  return ahead;
}

/// What the gradients of particle a make of a separation: itself, unless they are corrected.
template <int D, class P>
Vec<double, D> Engine<D, P>::corrected(std::size_t a, const Vec<double, D>& d) const {
  if (!c_.shifts()) return d;
  Vec<double, D> along = Vec<double, D>::Zero();
  std::size_t n = lists_.place_of(a) * symmetric_numbers<D>;
  for (int c = 0; c < D; ++c)
    for (int k = c; k < D; ++k, ++n) {
      const auto number = static_cast<double>(work_.gradient_correction[n]);
      along[c] += number * d[k];
      if (k != c) along[k] += number * d[c];
    }
  return along;
}

/// grad W . v of a pair of particle a that is `d` apart and will part with `v`, here less a step
/// later, halved: continuity uses the places of the step's start all the step long.
template <int D, class P>
template <class SmoothingKernel>
double Engine<D, P>::late_work(const SmoothingKernel& kernel, std::size_t a,
                               const Vec<double, D>& d, const Vec<double, D>& v) const {
  using engine_detail::inner;
  const Vec<double, D> then = d + c_.dt * v;
  return 0.5 * (kernel.slope(std::sqrt(inner<D>(d, d))) * inner<D>(corrected(a, d), v) -
                kernel.slope(std::sqrt(inner<D>(then, then))) * inner<D>(corrected(a, then), v));
}

/// Shear, artificial viscosity and density diffusion among the fluid.
template <int D, class P>
template <class SmoothingKernel>
void Engine<D, P>::balance_pairs(const SmoothingKernel& kernel,
                                 const std::vector<Vec<double, D>>& mean,
                                 std::vector<Vec<double, D>>& viscous,
                                 std::vector<double>& diffused, StepBalance& sum) const {
  using V = Vec<double, D>;
  using engine_detail::inner, engine_detail::doubles;
  const GroupedLists lists = lists_.fluid();
  const double h = c_.smoothing_length, soft = 0.01 * h * h;
  const bool artificial = c_.artificial_alpha > 0 || c_.artificial_beta > 0;
  const V hydrostatic = c_.full_pressure ? V(c_.reference_density /
                                             (c_.sound_speed * c_.sound_speed) * c_.gravity)
                                         : V(V::Zero());
  for (std::size_t a = 0; a < state_.fluid.size(); ++a) {
    const std::size_t at = lists_.place_of(a), g = at / lanes, l = at % lanes;
    const V va = doubles<D>(state_.fluid.velocity[a]);
    const double volume = work_.volume[a], rhob = next_.fluid.superficial_density[a];
    V shear = V::Zero(), pushed = V::Zero();
    double spread = 0;
    for (std::uint32_t k = lists.start[g]; k < lists.start[g + 1]; ++k) {
      const std::size_t b =
          lists_.index_at(lists.index[static_cast<std::size_t>(k) * lanes + l]);
      if (b == a) continue;
      const V d = apart(state_.fluid.position[a], state_.fluid.position[b]);
      const double r2 = inner<D>(d, d), slope = kernel.slope(std::sqrt(r2));
      if (!(slope < 0)) continue;
      const V dv = va - doubles<D>(state_.fluid.velocity[b]);
      const double other = work_.volume[b];
      sum.step_pressure -= static_cast<double>(work_.push[a]) * volume * other *
                           late_work(kernel, a, d, V(2 * (mean[a] - mean[b]) - dv));
      shear += other * slope * (r2 / (r2 + soft)) * dv;
      spread += static_cast<double>(work_.volume_before[b]) * slope *
                (static_cast<double>(work_.density_before[a]) -
                 static_cast<double>(work_.density_before[b]) - inner<D>(hydrostatic, d));
      const double approach = inner<D>(dv, d);
      if (!artificial || !(approach < 0)) continue;
      const double phi = h * approach / (r2 + soft);
      const double other_rhob = next_.fluid.superficial_density[b];
      pushed -= other * rhob * other_rhob / (0.5 * (rhob + other_rhob)) *
                (c_.artificial_beta * phi - c_.artificial_alpha * c_.sound_speed) * phi * slope * d;
    }
    viscous[a] += 2 * c_.viscosity * volume * shear;
    sum.viscous_loss -= 2 * c_.viscosity * volume * inner<D>(shear, mean[a]);
    sum.artificial_loss -= volume * inner<D>(pushed, mean[a]);
    // What diffusion added to the intrinsic density in this step.
    const double eps = two_way() ? static_cast<double>(work_.floored_porosity[a]) : 1.0;
    const double gained = c_.dt * 2 * c_.diffusion * h * c_.sound_speed * spread;
    diffused[a] = gained * eps / rhob;
    sum.diffusion_loss += static_cast<double>(state_.fluid.mass[a]) / c_.dt *
                          (internal_energy(rhob / eps - gained) - internal_energy(rhob / eps));
  }
}

/// Shear at the walls: what they take, and what walls that move put in; their pressure likewise.
template <int D, class P>
template <class SmoothingKernel>
void Engine<D, P>::balance_walls(const SmoothingKernel& kernel,
                                 const std::vector<Vec<double, D>>& mean,
                                 std::vector<Vec<double, D>>& viscous, StepBalance& sum) const {
  using V = Vec<double, D>;
  using engine_detail::inner, engine_detail::doubles;
  const double h = c_.smoothing_length, soft = 0.01 * h * h;
  const bool artificial = c_.artificial_alpha > 0 || c_.artificial_beta > 0;
  for (std::size_t w = 0; w < work_.wall_count; ++w)
    for (const std::int32_t index : lists_.fluid_near_wall(w)) {
      const auto a = static_cast<std::size_t>(index);
      const V d = apart(state_.fluid.position[a], work_.wall_position[w]);
      const double r2 = inner<D>(d, d), slope = kernel.slope(std::sqrt(r2));
      if (!(slope < 0)) continue;
      const V va = doubles<D>(state_.fluid.velocity[a]);
      const V own = doubles<D>(work_.wall_own_velocity[w]);
      const double volume = work_.volume[a];
      const double viscous_volume = work_.wall_viscous_volume[w];
      const V shear = 2 * c_.viscosity * volume * viscous_volume * slope * (r2 / (r2 + soft)) *
                      (va - doubles<D>(work_.wall_velocity[w]));
      const V pressed = -(static_cast<double>(work_.push[a]) +
                          static_cast<double>(work_.wall_push[w])) *
                        volume * static_cast<double>(work_.wall_volume[w]) * slope *
                        corrected(a, d);
      viscous[a] += shear;
      sum.wall_viscous_loss -= inner<D>(shear, V(mean[a] - own));
      sum.walls_on_fluid += inner<D>(V(shear + pressed), own);
      sum.step_pressure -= static_cast<double>(work_.push[a]) * volume *
                           static_cast<double>(work_.wall_volume[w]) *
                           late_work(kernel, a, d, V(2 * mean[a] - va - own));
      sum.wall_pressure -= static_cast<double>(work_.wall_push[w]) * volume *
                           static_cast<double>(work_.wall_volume[w]) * slope *
                           inner<D>(corrected(a, d), V(mean[a] - own));
      const double approach = inner<D>(V(va - own), d);
      if (!artificial || !(approach < 0)) continue;
      const double phi = h * approach / (r2 + soft), rhob = next_.fluid.superficial_density[a];
      const V pushed = -volume * static_cast<double>(work_.wall_volume[w]) * rhob *
                       (c_.artificial_beta * phi - c_.artificial_alpha * c_.sound_speed) * phi *
                       slope * d;
      sum.artificial_loss -= inner<D>(pushed, V(mean[a] - own));
      sum.walls_on_fluid += inner<D>(pushed, own);
    }
}

template <int D, class P>
void Engine<D, P>::balance_fluid(std::vector<Vec<double, D>>& mean,
                                 std::vector<Vec<double, D>>& viscous,
                                 std::vector<double>& diffused, StepBalance& sum) const {
  using V = Vec<double, D>;
  using engine_detail::inner, engine_detail::doubles;
  const std::size_t n = state_.fluid.size();
  const std::vector<V> ahead = velocities_ahead();
  mean.resize(n);
  viscous.assign(n, V::Zero());
  diffused.assign(n, 0);
  for (std::size_t a = 0; a < n; ++a) {
    const auto m = static_cast<double>(state_.fluid.mass[a]);
    const V v = doubles<D>(state_.fluid.velocity[a]);
    mean[a] = 0.5 * (v + ahead[a]);
    sum.fluid_kinetic += 0.5 * m * inner<D>(v, v);
    sum.fluid_gain += m / c_.dt * inner<D>(V(ahead[a] - v), mean[a]);
    sum.external_on_fluid += m * inner<D>(c_.fluid_acceleration, mean[a]);
    sum.walls_on_fluid += m * inner<D>(wall_repulsion(state_.fluid.position[a]), mean[a]);
    const double eps = two_way() ? static_cast<double>(work_.floored_porosity[a]) : 1.0;
    sum.compression +=
        m * internal_energy(static_cast<double>(next_.fluid.superficial_density[a]) / eps);
  }
  engine_detail::with_kernel<D>(scenario_.fluid.kernel, c_.smoothing_length, [&](const auto& w) {
    balance_pairs(w, mean, viscous, diffused, sum);
    balance_walls(w, mean, viscous, sum);
  });
}

/// Between the grains and the fluid around them.
template <int D, class P>
void Engine<D, P>::balance_grains(const std::vector<Vec<double, D>>& mean,
                                  const std::vector<Vec<double, D>>& viscous,
                                  const std::vector<double>& diffused, StepBalance& sum) const {
  using V = Vec<double, D>;
  using engine_detail::inner;
  for (std::size_t i = 0; i < state_.grains.size(); ++i) {
    const GrainForce<D>& f = coupling_.grain_forces()[i];
    const V moved = apart(next_.grains.position[i], state_.grains.position[i]) / c_.dt;
    const auto near = coupling_.fluid_of(i);
    const auto weights = coupling_.weights_of(i);
    V around = V::Zero(), stress = V::Zero();
    double pressure = 0, spread = 0;
    for (std::size_t k = 0; k < near.size(); ++k) {
      const auto a = static_cast<std::size_t>(near[k]);
      const double weight = static_cast<double>(work_.volume[a]) * weights[k];
      around += weight * mean[a];
      stress += weights[k] * viscous[a];
      spread -= weight * diffused[a];
      if (two_way() && static_cast<double>(work_.porosity[a]) >= c_.porosity_floor)
        pressure += weight * static_cast<double>(work_.pressure[a]);
    }
    if (c_.conjugate_pressure && !c_.conservative_porosity) {
      const double volume = c_.species[state_.grains.species[i]].volume;
      sum.pressure_volume.push_back(f.weight > 0 ? volume * pressure / f.weight : 0);
      sum.shepard_sum.push_back(f.weight);
      sum.shepard_diffusion.push_back(spread);
    }
    V shear = V::Zero();
    if (f.weight > 0) {
      around /= f.weight;
      shear = c_.species[state_.grains.species[i]].volume * stress / f.weight;
    }
    // One-way coupling takes nothing from the fluid: its grains lose against a fluid given.
    sum.drag_loss += inner<D>(f.drag, V(around - moved));
    sum.shear_loss += inner<D>(shear, V(around - moved));
    sum.on_grains += inner<D>(V(f.hydrodynamic + f.drag), moved);
    for (int k = 0; k < D; ++k) sum.shear_on_grains.push_back(shear[k]);
  }
}

/// Energy in the springs of the contacts that the state holds.
template <int D, class P>
double Engine<D, P>::contact_elastic() const {
  using V = Vec<double, D>;
  using engine_detail::inner, engine_detail::doubles;
  double sum = 0;
  const bool linear = c_.contact.law == ContactLaw::linear;
  const auto place = [&](std::uint64_t id) {
    const auto& ids = state_.grains.id;
    return static_cast<std::size_t>(std::lower_bound(ids.begin(), ids.end(), id) - ids.begin());
  };
  for (std::size_t k = 0; k < state_.contacts.size(); ++k) {
    const ContactKey& key = state_.contacts.key[k];
    const std::size_t i = place(key.grain), n = c_.species.size();
    double distance = 0;
    std::size_t other = n;
    if (key.kind == 1) {
      for (const Wall& wall : walls_)
        if (wall.number == key.partner)
          distance = distance_inside<D>(wall, doubles<D>(state_.grains.position[i]));
    } else {
      const std::size_t j = place(key.partner);
      other = state_.grains.species[j];
      const V d = apart(state_.grains.position[i], state_.grains.position[j]);
      distance = std::sqrt(inner<D>(d, d));
    }
    const ContactPair& pair = c_.pairs[state_.grains.species[i] * (n + 1) + other];
    const double overlap = std::max(0.0, pair.reach - distance);
    const ContactResponse r =
        linear ? LinearLaw::at(pair, overlap) : HertzLaw::at(pair, overlap);
    // Hertz: F ~ overlap^(3/2).
    sum += (linear ? 0.5 : 0.4) * r.elastic * overlap;
    if (k < state_.contacts.spring.size()) {
      const V spring = doubles<D>(state_.contacts.spring[k]);
      sum += 0.5 * r.tangential_stiffness * inner<D>(spring, spring);
    }
    if (k < state_.contacts.rolling.size()) {
      const auto angle = doubles<spin_components<D>>(state_.contacts.rolling[k]);
      sum += 0.5 * pair.rolling_stiffness * r.normal_stiffness *
             inner<spin_components<D>>(angle, angle);
    }
  }
  return sum;
}

template <int D, class P>
StepBalance Engine<D, P>::balance() const {
  using V = Vec<double, D>;
  using engine_detail::doubles;
  StepBalance sum;
  std::vector<V> mean, viscous;
  std::vector<double> diffused;
  V fluid_change = V::Zero(), grain_change = V::Zero();
  if (has_fluid()) balance_fluid(mean, viscous, diffused, sum);
  if (coupled()) balance_grains(mean, viscous, diffused, sum);
  if (has_grains()) sum.contact_elastic = contact_elastic();
  for (std::size_t a = 0; a < mean.size(); ++a)
    fluid_change += 2 * static_cast<double>(state_.fluid.mass[a]) *
                    (mean[a] - doubles<D>(state_.fluid.velocity[a]));
  for (std::size_t i = 0; i < state_.grains.size(); ++i)
    grain_change += c_.species[state_.grains.species[i]].mass *
                    (doubles<D>(next_.grains.velocity[i]) - doubles<D>(state_.grains.velocity[i]));
  sum.ledger = ledger_of(state_.fluid, fluid_change, grain_change, evaluated_wall_impulse_);
  return sum;
}

}  // namespace varve::core
