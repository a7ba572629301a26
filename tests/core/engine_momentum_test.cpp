// Momentum: what fluid and grains gain is what walls and gravity give, to round-off, and the fluid
// loses exactly what the grains get. The check itself is tested on laws that are not symmetric.
#include <gtest/gtest.h>

#include "core/kernel.h"
#include "core/walls.h"
#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

using V2 = Vec<double, 2>;

struct Named {
  std::string name;
  Scenario scenario;
};

std::vector<Named> symmetric_scenes() {
  Scenario column = small_column();
  Scenario slip = small_column();
  slip.domain.sides = slip.domain.bottom = Boundary::free_slip;
  Scenario full = small_column();
  full.fluid.pressure = PressureForm::full;
  full.fluid.jitter = 0.05;
  Scenario open = small_column();
  open.domain.top = Boundary::free;
  open.fluid.level = 0.016;
  open.fluid.sound_speed = 8;
  open.gravity.tilt = 0.1;
  Scenario pipe = small_column();
  pipe.domain.sides = Boundary::periodic;
  pipe.fluid.body_force_x = 1;
  Scenario frozen = small_column();
  frozen.grains.motion = GrainMotion::frozen;
  frozen.grains.velocity_x = frozen.grains.velocity_y = 0;
  frozen.fluid.body_force_y = 2;
  Scenario conservative = small_column();
  conservative.coupling.porosity = Porosity::conservative;
  conservative.grains.lowest_y = 8e-3;
  Scenario common_step = small_column();
  common_step.time.substeps = 1;
  common_step.time.dt = 5e-6;
  Scenario fluid_alone = small_column();
  fluid_alone.grains.rows = 0;
  fluid_alone.fluid.pressure = PressureForm::full;
  fluid_alone.fluid.jitter = 0.05;
  Scenario dry = small_column();
  dry.fluid.present = false;
  Scenario cubic = small_column();
  cubic.fluid.kernel = Kernel::cubic;
  Scenario quintic = small_column();
  quintic.fluid.kernel = Kernel::quintic;
  return {{"column", column},     {"free slip", slip},          {"full pressure", full},
          {"free surface", open}, {"periodic, driven", pipe},   {"frozen", frozen},
          {"conservative porosity", conservative},              {"common step", common_step},
          {"fluid alone", fluid_alone},                         {"grains alone", dry},
          {"cubic kernel", cubic},                              {"quintic kernel", quintic}};
}

TEST(EngineMomentum, IsKeptToRoundOffAtEveryStepOfEveryKindOfScene) {
  for (const Named& each : symmetric_scenes()) {
    SCOPED_TRACE(each.name);
    const auto simulation = started(each.scenario);
    double worst = 0, worst_reaction = 0, moved = 0;
    for (int n = 0; n < 100; ++n) {
      simulation->advance();
      const StepLedger ledger = simulation->ledger();
      worst = std::max(worst, momentum_residual(ledger, simulation->clock().dt));
      worst_reaction = std::max(worst_reaction, reaction_residual(ledger));
      moved += norm(ledger.fluid_momentum_change) + norm(ledger.grain_momentum_change);
    }
    EXPECT_LE(worst, 1e-12);
    EXPECT_LE(worst_reaction, 1e-12);
    EXPECT_GT(moved, 0);
  }
}

TEST(EngineMomentum, AnAsymmetricLawFailsTheCheck) {
  // One-way coupling is such a law: grains take from the fluid what the fluid does not lose.
  Scenario scenario = small_column();
  scenario.coupling.mode = CouplingMode::one_way;
  const auto simulation = started(scenario);
  simulation->advance();
  const StepLedger ledger = simulation->ledger();
  EXPECT_GT(momentum_residual(ledger, simulation->clock().dt), 1e-6);
  EXPECT_GT(reaction_residual(ledger), 1e-6);
}

TEST(EngineMomentum, ASmallFaultInAnyOneSumFailsTheCheck) {
  const auto simulation = started(small_column());
  for (int n = 0; n < 50; ++n) simulation->advance();
  const StepLedger sound = simulation->ledger();
  const double dt = simulation->clock().dt;
  ASSERT_LE(momentum_residual(sound, dt), 1e-12);
  for (auto part : {&StepLedger::fluid_momentum_change, &StepLedger::grain_momentum_change,
                    &StepLedger::walls_on_fluid, &StepLedger::walls_on_grains,
                    &StepLedger::external_on_grains}) {
    StepLedger faulty = sound;
    // In units of force, a millionth of what acts in all.
    const double share = 1e-6 * sound.force_scale;
    const bool impulse = part == &StepLedger::fluid_momentum_change ||
                         part == &StepLedger::grain_momentum_change;
    (faulty.*part)[1] += impulse ? dt * share : share;
    EXPECT_GT(momentum_residual(faulty, dt), 1e-9);
  }
  StepLedger faulty = sound;
  faulty.fluid_from_grains[0] *= 1 + 1e-6;
  EXPECT_GT(reaction_residual(faulty), 1e-12);
}

// ---- wall forces once more, by the test's own loops ----

/// Force of all dummies on the fluid from plain loops over the state before and the pressures of
/// the last step. `asymmetric`: of dummies that answer with their own pressure alone.
V2 walls_by_hand(const Simulation& simulation, const std::vector<double>& position_before,
                 const std::vector<double>& velocity_before, bool asymmetric) {
  const Scenario& s = simulation.scenario();
  const double h = s.fluid.smoothing_ratio * s.fluid.spacing,
               dv = s.fluid.spacing * s.fluid.spacing;
  const SmoothingKernel<2, Kernel::wendland_c2> kernel(h);
  const std::vector<double> mass = field(simulation, "fluid.mass");
  const std::vector<double> rhob = field(simulation, "fluid.superficial_density");
  const std::vector<double> pressure = simulation.fluid_report().pressure;
  const V2 gravity =
      s.fluid.pressure == PressureForm::full ? V2(0, -s.gravity.magnitude) : V2(V2::Zero());
  V2 total = V2::Zero();
  for (const WallDummy<2>& dummy : wall_dummies(s, fluid_dummy_layers(s))) {
    double weights = 0, p = 0;
    V2 v = V2::Zero();
    for (std::size_t a = 0; a < mass.size(); ++a) {
      const V2 x(position_before[2 * a], position_before[2 * a + 1]);
      const double w = kernel.value((dummy.position - x).norm());
      const double rho =
          s.fluid.density + pressure[a] / (s.fluid.sound_speed * s.fluid.sound_speed);
      weights += w;
      p += w * (pressure[a] + rho * gravity.dot(dummy.position - x));
      v += w * V2(velocity_before[2 * a], velocity_before[2 * a + 1]);
    }
    if (weights <= 0) continue;
    p /= weights;
    v = -v / weights;
    for (std::size_t a = 0; a < mass.size(); ++a) {
      const V2 d = V2(position_before[2 * a], position_before[2 * a + 1]) - dummy.position;
      const double r2 = d.squaredNorm(), slope = kernel.slope(std::sqrt(r2));
      const double volumes = mass[a] / rhob[a] * dv;
      const V2 slip = V2(velocity_before[2 * a], velocity_before[2 * a + 1]) - v;
      const double pressures = asymmetric ? p : pressure[a] + p;
      total += -pressures * volumes * slope * d +
               2 * s.fluid.viscosity * volumes * slope * (r2 / (r2 + 0.01 * h * h)) * slip;
    }
  }
  return total;
}

TEST(EngineMomentum, WallForcesAreThoseOfTheEquationsWrittenDownAgain) {
  for (const PressureForm form : {PressureForm::excess, PressureForm::full}) {
    Scenario scenario = small_column();
    scenario.fluid.pressure = form;
    scenario.fluid.jitter = 0.03;
    // In the conjugate form walls also act through images of grains, as the balances above hold.
    scenario.coupling.pressure_force = PressureForce::averaged;
    const auto simulation = started(scenario);
    for (int n = 0; n < 20; ++n) simulation->advance();
    const std::vector<double> x = field(*simulation, "fluid.position");
    const std::vector<double> v = field(*simulation, "fluid.velocity");
    simulation->advance();
    StepLedger ledger = simulation->ledger();
    const double dt = simulation->clock().dt;
    const V2 by_hand = walls_by_hand(*simulation, x, v, false);
    EXPECT_NEAR(by_hand[0], ledger.walls_on_fluid[0], 1e-12 * ledger.force_scale);
    EXPECT_NEAR(by_hand[1], ledger.walls_on_fluid[1], 1e-12 * ledger.force_scale);
    ledger.walls_on_fluid = {by_hand[0], by_hand[1]};
    EXPECT_LE(momentum_residual(ledger, dt), 1e-12);
    const V2 wrong = walls_by_hand(*simulation, x, v, true);
    ledger.walls_on_fluid = {wrong[0], wrong[1]};
    EXPECT_GT(momentum_residual(ledger, dt), 1e-6);
  }
}

}  // namespace
}  // namespace varve::core::test
