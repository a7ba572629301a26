// What Engine says about its last step, each sum by a pass of its own.
#pragma once

#include "core/engine.h"
#include "core/geometry_change.h"
#include "core/kernel.h"
#include "core/parameters.h"
#include "core/units.h"

namespace varve::core {

namespace engine_detail {

template <int D>
std::vector<double> listed(const Vec<double, D>& v) {
  return {v.data(), v.data() + D};
}

}  // namespace engine_detail

template <int D, class P>
const Counters& Engine<D, P>::counters() const {
  counters_.items_per_thread = workers_.items_done();
  return counters_;
}

template <int D, class P>
ChangeOptions Engine<D, P>::scheduled_options(const ScheduledChange& scheduled) {
  ChangeOptions options;
  options.anchor = scheduled.anchor;
  options.outside = scheduled.outside;
  return options;
}

/// Words for what a change of width did.
template <int D, class P>
void Engine<D, P>::describe(const GeometryReport& report, std::vector<Happening>& happenings) {
  const auto number = [](double value) { return number_text(value); };
  const auto ids = [](const std::vector<std::uint64_t>& list) {
    std::string text;
    for (const std::uint64_t id : list) text += (text.empty() ? "" : " ") + std::to_string(id);
    return text;
  };
  happenings.push_back({"walls",
                        {{"left", number(report.walls.left)},
                         {"width", number(report.walls.width)},
                         {"mass_before", number(report.mass_before)},
                         {"mass_after", number(report.mass_after)},
                         {"mass_adjusted", number(report.mass_adjusted)}}});
  if (report.fluid_added > 0)
    happenings.push_back({"fluid_added",
                          {{"count", std::to_string(report.fluid_added)},
                           {"mass", number(report.mass_added)}}});
  if (report.fluid_removed > 0)
    happenings.push_back({"fluid_removed",
                          {{"count", std::to_string(report.fluid_removed)},
                           {"mass", number(report.mass_removed)}}});
  if (report.fluid_pulled > 0)
    happenings.push_back({"fluid_pulled", {{"count", std::to_string(report.fluid_pulled)}}});
  if (!report.grains_pushed.empty())
    happenings.push_back({"grains_pushed", {{"ids", ids(report.grains_pushed)}}});
  if (!report.grains_removed.empty())
    happenings.push_back({"grains_removed", {{"ids", ids(report.grains_removed)}}});
  if (report.contacts_removed > 0)
    happenings.push_back(
        {"contacts_removed", {{"count", std::to_string(report.contacts_removed)}}});
}

/// Force on the dummies' side: the sum over dummies of minus what each does to the fluid near it,
/// with the pressures and velocities of the last force evaluation, which was of the state `at`.
template <int D, class P>
Vec<double, D> Engine<D, P>::walls_on_fluid(const FluidState<D, P>& at) const {
  Vec<double, D> total = Vec<double, D>::Zero();
  const double h = c_.smoothing_length, soft = 0.01 * h * h;
  const bool artificial = c_.artificial_alpha > 0 || c_.artificial_beta > 0;
  for (std::size_t w = 0; w < work_.wall_count; ++w)
    for (const std::int32_t index : lists_.fluid_near_wall(w)) {
      const auto a = static_cast<std::size_t>(index);
      Vec<double, D> d;
      double r2 = 0;
      for (int k = 0; k < D; ++k) {
        d[k] = static_cast<double>(at.position[a][k]) -
               static_cast<double>(work_.wall_position[w][k]);
        const double length = c_.period.length[k];
        if (d[k] > 0.5 * length) d[k] -= length;
        if (d[k] < -0.5 * length) d[k] += length;
        r2 += d[k] * d[k];
      }
      const double slope = kernel_slope_of<D>(scenario_.fluid.kernel, h, std::sqrt(r2));
      const double volumes = static_cast<double>(work_.volume[a]) *
                             static_cast<double>(work_.wall_volume[w]);
      const double viscous = static_cast<double>(work_.volume[a]) *
                             static_cast<double>(work_.wall_viscous_volume[w]);
      const double pressures = static_cast<double>(work_.push[a]) +
                               static_cast<double>(work_.wall_push[w]);
      const Vec<double, D> along = corrected(a, d);
      double approach = 0;
      for (int k = 0; k < D; ++k) {
        const auto v = static_cast<double>(at.velocity[a][k]);
        const double dv = v - static_cast<double>(work_.wall_velocity[w][k]);
        total[k] += -pressures * volumes * slope * along[k] +
                    2 * c_.viscosity * viscous * slope * (r2 / (r2 + soft)) * dv;
        approach += (v - static_cast<double>(work_.wall_own_velocity[w][k])) * d[k];
      }
      if (!artificial || !(approach < 0)) continue;
      const double phi = h * approach / (r2 + soft);
      total -= static_cast<double>(state_.fluid.mass[a]) *
               static_cast<double>(work_.wall_volume[w]) *
               (c_.artificial_beta * phi - c_.artificial_alpha * c_.sound_speed) * phi * slope * d;
    }
  if (c_.conjugate_pressure) total += coupling_.walls_on_fluid();
  for (std::size_t a = 0; a < state_.fluid.size(); ++a)
    total += static_cast<double>(state_.fluid.mass[a]) * wall_repulsion(at.position[a]);
  return total;
}

template <int D, class P>
StepLedger Engine<D, P>::ledger() const {
  using V = Vec<double, D>;
  // next_ holds the state in which the forces were evaluated.
  V fluid_change = V::Zero(), grain_change = V::Zero();
  for (std::size_t a = 0; a < state_.fluid.size(); ++a) {
    const V dv = state_.fluid.velocity[a].template cast<double>() -
                 next_.fluid.velocity[a].template cast<double>();
    fluid_change += static_cast<double>(state_.fluid.mass[a]) * dv;
  }
  for (std::size_t i = 0; i < state_.grains.size(); ++i) {
    const V dv = state_.grains.velocity[i].template cast<double>() -
                 next_.grains.velocity[i].template cast<double>();
    grain_change += c_.species[state_.grains.species[i]].mass * dv;
  }
  return ledger_of(next_.fluid, fluid_change, grain_change, contacts_.wall_impulse());
}

/// The sums of a step whose forces were evaluated at `at`, with the changes of momentum given.
template <int D, class P>
StepLedger Engine<D, P>::ledger_of(const FluidState<D, P>& at, const Vec<double, D>& fluid_change,
                                   const Vec<double, D>& grain_change,
                                   const Vec<double, D>& wall_impulse) const {
  using V = Vec<double, D>;
  V fluid_external = V::Zero(), reactions = V::Zero();
  V grain_external = V::Zero(), from_fluid = V::Zero();
  double scale = 0;
  for (std::size_t a = 0; a < state_.fluid.size(); ++a) {
    const auto m = static_cast<double>(state_.fluid.mass[a]);
    fluid_external += m * c_.fluid_acceleration;
    const V reaction = c_.two_way ? coupling_.reaction(a, static_cast<double>(work_.volume[a]))
                                  : V(V::Zero());
    reactions += reaction;
    const V stress = work_.stress_force[a].template cast<double>();
    scale += stress.norm() + reaction.norm() + m * c_.fluid_acceleration.norm();
  }
  for (std::size_t i = 0; i < state_.grains.size(); ++i) {
    const SpeciesConstants<D>& one = c_.species[state_.grains.species[i]];
    V acting = V::Zero();
    if (c_.coupled) {
      const GrainForce<D>& f = coupling_.grain_forces()[i];
      acting = f.hydrodynamic + f.drag;
    }
    from_fluid += acting;
    // Something holds a frozen grain against everything else.
    grain_external += c_.frozen ? V(-acting) : one.weight;
    scale += acting.norm() + one.weight.norm();
  }
  // Part of the reactions near a wall is the wall's: it mirrors the grains.
  if (c_.conjugate_pressure) reactions -= coupling_.walls_on_fluid();
  V on_grains = V::Zero();
  if (scenario_.has_grains() && !c_.frozen) on_grains = wall_impulse / c_.dt;
  using engine_detail::listed;
  return {listed<D>(fluid_change),   listed<D>(grain_change),   listed<D>(walls_on_fluid(at)),
          listed<D>(on_grains),      listed<D>(fluid_external), listed<D>(grain_external),
          listed<D>(from_fluid),     listed<D>(reactions),      scale + on_grains.norm()};
}

template <int D, class P>
std::vector<GrainReport> Engine<D, P>::grain_reports() const {
  std::vector<GrainReport> reports;
  if (!c_.coupled) return reports;
  for (const GrainForce<D>& f : coupling_.grain_forces())
    reports.push_back({engine_detail::listed<D>(f.hydrodynamic), engine_detail::listed<D>(f.drag),
                       engine_detail::listed<D>(f.fluid_velocity), f.porosity, f.weight});
  return reports;
}

template <int D, class P>
FluidReport Engine<D, P>::fluid_report() const {
  FluidReport report;
  report.pressure.assign(work_.pressure.begin(), work_.pressure.end());
  report.porosity.assign(state_.fluid.size(), 1.0);
  if (c_.two_way) report.porosity.assign(work_.porosity.begin(), work_.porosity.end());
  return report;
}

}  // namespace varve::core
