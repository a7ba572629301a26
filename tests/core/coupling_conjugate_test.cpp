// The conjugate pressure forces: the slope of the fluid's energy, nothing under an even pressure.
#include <cmath>

#include <gtest/gtest.h>

#include "core/coupling.h"
#include "core/math.h"
#include "core/random.h"

namespace varve::core {
namespace {

using P = DoublePrecision;
using V2 = Vec<double, 2>;

/// A disturbed piece of fluid above a floor and beside a wall, with uneven pressure, and three
/// grains: two that overlap each other's reach, one near the corner.
struct Bed {
  Constants<2> c;
  State<2, P> state;
  std::vector<double> volume, pressure, porosity, floored, push;
  std::vector<V2> viscous;
  Workers workers{1};
  CouplingStage<2, P> stage;

  explicit Bed(Porosity form) {
    c.spacing = 1e-3;
    c.species = {species_constants<2>(2.5e-3, 1250)};
    c.reference_density = 1000;
    c.viscosity = 0.01;
    c.coupled = c.two_way = c.conjugate_pressure = true;
    c.conservative_porosity = form == Porosity::conservative;
    c.coupling_length = c.species[0].diameter;
    c.porosity_floor = 0.1;
    constexpr std::size_t n = 20;
    for (std::size_t a = 0; a < n * n; ++a) {
      state.fluid.id.push_back(a);
      state.fluid.position.emplace_back(
          (static_cast<double>(a % n) + 0.5 + 0.2 * symmetric(1, a, 0)) * c.spacing,
          (static_cast<double>(a / n) + 0.5 + 0.2 * symmetric(1, a, 1)) * c.spacing);
      state.fluid.velocity.emplace_back(V2::Zero());
      volume.push_back(c.spacing * c.spacing * (1 + 0.05 * symmetric(2, a, 0)));
      pressure.push_back(20 * symmetric(3, a, 0) + 5e3 * state.fluid.position[a][1]);
    }
    viscous.assign(n * n, V2::Zero());
    const V2 places[] = {{9.3e-3, 9.1e-3}, {11.9e-3, 9.6e-3}, {1.5e-3, 1.4e-3}};
    for (const V2& x : places) {
      state.grains.id.push_back(state.grains.size());
      state.grains.species.push_back(0);
      state.grains.position.push_back(x);
      state.grains.velocity.emplace_back(V2::Zero());
    }
  }

  void evaluate() {
    const std::size_t n = volume.size();
    porosity.assign(n, 0);
    floored.assign(n, 0);
    push.assign(n, 0);
    std::vector<Wall> walls;
    walls.push_back({wall_left, Boundary::no_slip, 0, 0.0, 1.0});
    walls.push_back({wall_bottom, Boundary::no_slip, 1, 0.0, 1.0});
    stage.rebuild(c, state, walls, 0, workers);
    stage.porosity(c, state, volume, porosity, floored, workers);
    stage.share_pressure(c, volume, pressure, porosity, floored, push, workers);
    stage.forces(c, state,
                 {state.fluid.position, state.fluid.velocity, volume, viscous, pressure, porosity},
                 make_drag_law<2>(Drag::stokes), workers);
    stage.set_drag(std::vector<V2>(state.grains.size(), V2::Zero()));
  }

  /// sum_a V_a p_a eps_a: what changes of the energy while places alone do, its sign turned.
  double work() {
    evaluate();
    double sum = 0;
    for (std::size_t a = 0; a < volume.size(); ++a) sum += volume[a] * pressure[a] * porosity[a];
    return sum;
  }
  V2 slope(V2& place) {
    const double step = 1e-8;
    V2 result;
    for (int k = 0; k < 2; ++k) {
      const double at = place[k];
      place[k] = at + step;
      const double above = work();
      place[k] = at - step;
      const double below = work();
      place[k] = at;
      result[k] = (above - below) / (2 * step);
    }
    return result;
  }
};

TEST(CouplingConjugate, ForcesAreTheSlopeOfTheEnergy) {
  Bed bed(Porosity::conservative);
  bed.evaluate();
  std::vector<V2> on_grains, on_fluid;
  for (const GrainForce<2>& f : bed.stage.grain_forces()) on_grains.push_back(f.pressure);
  for (std::size_t a = 0; a < bed.volume.size(); ++a)
    on_fluid.push_back(bed.stage.reaction(a, bed.volume[a]));
  double scale = 0;
  for (const V2& f : on_grains) scale = std::max(scale, f.norm());
  ASSERT_GT(scale, 1e-3);
  for (std::size_t i = 0; i < on_grains.size(); ++i)
    EXPECT_LT((bed.slope(bed.state.grains.position[i]) - on_grains[i]).norm(), 1e-5 * scale)
        << "grain " << i;
  for (const std::size_t a : {std::size_t{21}, std::size_t{1}, std::size_t{189}, std::size_t{230}})
    EXPECT_LT((bed.slope(bed.state.fluid.position[a]) - on_fluid[a]).norm(), 1e-5 * scale)
        << "fluid " << a;
}

TEST(CouplingConjugate, PlainPorosityIsCloseToThat) {
  Bed bed(Porosity::kernel);
  bed.evaluate();
  for (std::size_t i = 0; i < bed.state.grains.size(); ++i) {
    const V2 force = bed.stage.grain_forces()[i].pressure;
    // The even part of the pressure is what they differ by, and here it is uneven as well.
    EXPECT_LT((bed.slope(bed.state.grains.position[i]) - force).norm(), 0.3 * force.norm());
    bed.evaluate();
  }
}

TEST(CouplingConjugate, AnEvenPressureExertsNothing) {
  for (const Porosity form : {Porosity::kernel, Porosity::conservative}) {
    Bed bed(form);
    bed.pressure.assign(bed.pressure.size(), 370.0);
    bed.evaluate();
    const double scale = 370 * bed.c.species[0].diameter;
    for (const GrainForce<2>& f : bed.stage.grain_forces())
      EXPECT_LT(f.pressure.norm(), 1e-12 * scale);
    for (std::size_t a = 0; a < bed.volume.size(); ++a) {
      EXPECT_NEAR(bed.push[a], 370, 1e-10);
      EXPECT_LT(bed.stage.reaction(a, bed.volume[a]).norm(), 1e-12 * scale);
    }
  }
}

TEST(CouplingConjugate, WhatWallsTakeIsWhatIsMissingFromTheBalance) {
  for (const Porosity form : {Porosity::kernel, Porosity::conservative}) {
    Bed bed(form);
    bed.evaluate();
    V2 fluid = V2::Zero(), grains = V2::Zero();
    double scale = 0;
    for (std::size_t a = 0; a < bed.volume.size(); ++a)
      fluid += bed.stage.reaction(a, bed.volume[a]);
    for (const GrainForce<2>& f : bed.stage.grain_forces()) {
      grains += f.hydrodynamic;
      scale += f.hydrodynamic.norm();
    }
    EXPECT_LT((fluid + grains - bed.stage.walls_on_fluid()).norm(), 1e-13 * scale);
    // The grain in the corner has images.
    EXPECT_GT(bed.stage.walls_on_fluid().norm(), 1e-3 * scale);
  }
}

}  // namespace
}  // namespace varve::core
