// Liquid at rest: bit-exact in the excess form; with the full pressure it has to find its rest, the
// pressure of its depth, and to lose the energy it started with.
#include <algorithm>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

constexpr double depth = 0.06;  // [m] H

Scenario tank(double spacing) {
  Scenario s;
  s.domain.width = 0.04;
  s.domain.height = depth;
  s.fluid.spacing = spacing;
  s.time.until = 10 * std::sqrt(depth / 9.81);
  return s;
}

double speed_rms(const Simulation& simulation) {
  const std::vector<double> v = field(simulation, "fluid.velocity");
  double sum = 0;
  for (const double each : v) sum += each * each;
  return std::sqrt(2 * sum / static_cast<double>(v.size()));
}

double kinetic_energy(const Simulation& simulation) {
  const std::vector<double> v = field(simulation, "fluid.velocity");
  const std::vector<double> m = field(simulation, "fluid.mass");
  double sum = 0;
  for (std::size_t a = 0; a < m.size(); ++a)
    sum += 0.5 * m[a] * (v[2 * a] * v[2 * a] + v[2 * a + 1] * v[2 * a + 1]);
  return sum;
}

TEST(EngineTank, AClosedBoxInTheExcessFormStaysAtRestToTheLastBit) {
  for (const double spacing : {2e-3, 1e-3}) {
    Scenario scenario = tank(spacing);
    scenario.fluid.sound_speed = 1;
    const auto simulation = started(scenario);
    const Snapshot first(*simulation);
    for (int n = 0; n < 300; ++n) {
      simulation->advance();
      ASSERT_THAT(field(*simulation, "fluid.velocity"), testing::Each(0.0)) << "step " << n;
    }
    const Snapshot last(*simulation);
    for (std::size_t k = 0; k < first.bytes.size(); ++k) {
      if (simulation->fields()[k].population == "clock") continue;
      EXPECT_EQ(first.bytes[k], last.bytes[k]) << simulation->fields()[k].name;
    }
  }
}

/// A run with full pressure over 10 sqrt(H/g), looked at every 2 ms; pressures over the last 0.15
/// s.
struct RestRun {
  double speed = 0;        // rms at the end over sqrt(gH)
  double peak_energy = 0;  // [J/m]
  std::vector<double> energies;  // means over tenths of the run
  double worst_now = 0;    // largest |p - rho g depth| of any particle at any time, over rho g H
  double worst_mean = 0;   // the same of particles' means over time

  explicit RestRun(const Scenario& raw) {
    const Scenario s = resolved(raw);
    const auto simulation = Simulation::create(s, {});
    const double end = s.time.until, scale = s.fluid.density * s.gravity.magnitude * depth;
    std::map<std::size_t, std::pair<double, int>> sums;
    std::vector<int> looks(10, 0);
    energies.assign(10, 0);
    double next = 0;
    while (simulation->clock().time < end) {
      simulation->advance();
      const double t = simulation->clock().time;
      if (t < next) continue;
      next += 2e-3;
      const double energy = kinetic_energy(*simulation);
      const auto tenth = std::min<std::size_t>(9, static_cast<std::size_t>(10 * t / end));
      energies[tenth] += energy;
      ++looks[tenth];
      peak_energy = std::max(peak_energy, energy);
      if (t < end - 0.15) continue;
      const std::vector<double> p = simulation->fluid_report().pressure;
      const std::vector<double> x = field(*simulation, "fluid.position");
      const double margin = 2 * s.fluid.smoothing_ratio * s.fluid.spacing;
      for (std::size_t a = 0; a < p.size(); ++a) {
        const double from_side = std::min(x[2 * a], s.domain.width - x[2 * a]);
        const double below = depth - x[2 * a + 1];
        if (std::min({from_side, below, x[2 * a + 1]}) < margin) continue;
        const double off = p[a] / scale - below / depth;
        worst_now = std::max(worst_now, std::abs(off));
        sums[a].first += off;
        ++sums[a].second;
      }
    }
    for (std::size_t k = 0; k < 10; ++k) energies[k] /= looks[k];
    for (const auto& [a, sum] : sums)
      worst_mean = std::max(worst_mean, std::abs(sum.first / sum.second));
    speed = speed_rms(*simulation) / std::sqrt(s.gravity.magnitude * depth);
  }
};

void report(const RestRun& run) {
  testing::Test::RecordProperty("speed_over_root_gH", std::to_string(run.speed));
  testing::Test::RecordProperty("worst_pressure_now", std::to_string(run.worst_now));
  testing::Test::RecordProperty("worst_pressure_mean", std::to_string(run.worst_mean));
  testing::Test::RecordProperty("energy_last_over_peak",
                                std::to_string(run.energies.back() / run.peak_energy));
}

// h = 1.25 dx, the default for moving grains, leaves the kernel's sum over the lattice 1.8 % short
// of its integral, and the pressure that carries the liquid is as much too large: at rest wider
// kernels are needed.

Scenario open_tank(double smoothing, double jitter) {
  Scenario scenario = tank(2e-3);
  scenario.domain.top = Boundary::free;
  scenario.domain.height = 0.08;
  scenario.fluid.level = depth;
  scenario.fluid.smoothing_ratio = smoothing;
  scenario.fluid.jitter = jitter;
  return scenario;
}

TEST(EngineTank, UnderAFreeSurfaceThePressureIsThatOfTheDepth) {
  const RestRun run(open_tank(1.5, 0));
  report(run);
  EXPECT_LT(run.speed, 1e-2);
  EXPECT_LT(run.worst_now, 1e-2);
}

TEST(EngineTank, UnderAFreeSurfaceTaitsEquationGivesTheSamePressure) {
  Scenario scenario = open_tank(1.5, 0);
  scenario.fluid.equation_of_state = EquationOfState::tait;
  const RestRun run(scenario);
  report(run);
  EXPECT_LT(run.speed, 1e-2);
  EXPECT_LT(run.worst_now, 1e-2);
}

TEST(EngineTank, TaitsEquationHasTheExponentSeven) {
  for (const double compression : {-0.01, 0.02, 0.1}) {
    Scenario scenario = tank(2e-3);
    scenario.domain.bottom = scenario.domain.top = scenario.domain.sides = Boundary::periodic;
    scenario.fluid.sound_speed = 2;
    scenario.fluid.density_diffusion = 0;
    scenario.fluid.equation_of_state = EquationOfState::tait;
    const auto simulation = started(scenario);
    std::vector<double> rhob = field(*simulation, "fluid.superficial_density");
    rhob.assign(rhob.size(), 1000 * (1 + compression));
    set_field(*simulation, "fluid.superficial_density", rhob);
    simulation->advance();
    const double expected = 1000 * 4 / 7.0 * (std::pow(1 + compression, 7) - 1);
    for (const double p : simulation->fluid_report().pressure)
      ASSERT_NEAR(p, expected, 1e-9 * std::abs(expected));
  }
}

TEST(EngineTank, DisturbedUnderAFreeSurfaceItLosesItsEnergyAndFindsThatPressure) {
  const RestRun run(open_tank(2, 0.05));
  report(run);
  EXPECT_LT(run.speed, 1e-2);
  EXPECT_LT(run.worst_now, 1e-2);
  for (std::size_t k = 1; k < 10; ++k) EXPECT_LT(run.energies[k], run.energies[k - 1]);
  EXPECT_LT(run.energies[9], 0.1 * run.peak_energy);
}

TEST(EngineTank, FluidBeyondAWallComesBack) {
  Scenario scenario = tank(2e-3);
  scenario.fluid.sound_speed = 1;
  const auto simulation = started(scenario);
  std::vector<double> x = field(*simulation, "fluid.position");
  const std::size_t lost = 20 * 10;  // the first of a row, beside the left wall
  ASSERT_NEAR(x[2 * lost], 1e-3, 1e-12);
  x[2 * lost] = -0.5e-3;
  set_field(*simulation, "fluid.position", x);
  double worst = 0;
  for (int n = 0; n < 200; ++n) {
    simulation->advance();
    worst = std::max(worst, momentum_residual(simulation->ledger(), simulation->clock().dt));
  }
  EXPECT_GT(field(*simulation, "fluid.position")[2 * lost], 0);
  EXPECT_LE(worst, 1e-12);
}

TEST(EngineTankSlow, DisturbedLiquidAroundAFrozenBlockFindsItsRest) {
  Scenario scenario = tank(1e-3);
  scenario.fluid.pressure = PressureForm::full;
  scenario.fluid.jitter = 0.05;
  scenario.fluid.smoothing_ratio = 1.5;
  scenario.grains.rows = scenario.grains.columns = 4;
  scenario.grains.gap = 0.1;
  scenario.grains.motion = GrainMotion::frozen;
  const RestRun run(scenario);
  report(run);
  EXPECT_LT(run.speed, 1e-2);
  // Single particles between the grains still jump by 1.6 % now and then; their means do not.
  EXPECT_LT(run.worst_mean, 1e-2);
  EXPECT_LT(run.worst_now, 3e-2);
  for (std::size_t k = 2; k < 10; ++k)
    EXPECT_LT(run.energies[k], 1.2 * run.energies[k - 1]) << "tenth " << k;
  EXPECT_LT(run.energies[9], 0.05 * run.peak_energy);
}

}  // namespace
}  // namespace varve::core::test
