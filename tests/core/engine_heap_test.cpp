// Grains at rest on the floor, where porosity is low and changes fast: fluid must not be drawn
// through the wall, and a heap must come to rest under its weight.
#include <algorithm>

#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

/// How far fluid went through a wall at most [m]; negative inside.
double deepest(const Simulation& simulation) {
  const std::vector<double> x = field(simulation, "fluid.position");
  const Domain& d = simulation.scenario().domain;
  double most = -d.width;
  for (std::size_t a = 0; a < x.size(); a += 2)
    most = std::max({most, d.left - x[a], x[a] - d.left - d.width, -x[a + 1], x[a + 1] - d.height});
  return most;
}

TEST(EngineHeap, OfNineGrainsOnTheFloorKeepsTheFluidInside) {
  for (const Porosity porosity : {Porosity::kernel, Porosity::conservative})
    for (const std::int64_t seed : {1, 2, 3}) {
      SCOPED_TRACE("seed " + std::to_string(seed) +
                   (porosity == Porosity::kernel ? "" : ", conservative"));
      Scenario scenario = small_column();
      scenario.grains.seed = seed;
      scenario.coupling.porosity = porosity;
      const auto simulation = started(scenario);
      double worst = -1;
      for (int n = 0; n < 1200; ++n) {
        simulation->advance();
        worst = std::max(worst, deepest(*simulation));
      }
      EXPECT_LT(worst, 0.5 * scenario.fluid.spacing);
      // They have come down.
      EXPECT_GE(simulation->field(field_index(*simulation, "contacts.key")).count, 3u);
    }
}

/// Mean square speed of the fluid [m2/s2].
double fluid_speed2(const Simulation& simulation) {
  double sum = 0;
  const std::vector<double> v = field(simulation, "fluid.velocity");
  for (const double each : v) sum += each * each;
  return 2 * sum / static_cast<double>(v.size());
}

// The averaged form feeds the fluid between packed grains until a guard stops the run; the
// conjugate one lets a heap of the same grains come to rest.
TEST(EngineHeapSlow, OfManyGrainsComesToRestInTheFluidWithConjugateForces) {
  Scenario scenario = small_column();
  scenario.domain.width = 0.03;
  scenario.domain.height = 0.04;
  scenario.grains.rows = 4;
  scenario.grains.columns = 8;
  scenario.grains.velocity_x = 0;
  scenario.grains.lowest_y = automatic;
  scenario.guards.density_deviation = 0.8;
  const auto simulation = started(scenario);
  double fastest = 0;
  while (simulation->clock().time < 1.2) {
    simulation->advance();
    fastest = std::max(fastest, fluid_speed2(*simulation));
  }
  double left = 0;
  for (const double v : field(*simulation, "grains.velocity"))
    left = std::max(left, std::abs(v));
  EXPECT_LT(left, 0.03);  // some still roll; falling they reached 0.2
  EXPECT_LT(fluid_speed2(*simulation), 0.1 * fastest);
  EXPECT_LT(deepest(*simulation), 0.5 * scenario.fluid.spacing);
}

TEST(EngineHeap, WithoutFluidComesToRestAndTheFloorCarriesItsWeight) {
  Scenario scenario = small_column();
  scenario.fluid.present = false;
  scenario.contact.damping = 0.5;
  // Three upright columns, which stand; a heap would spread and roll for long.
  scenario.grains.jitter = 0;
  scenario.grains.velocity_x = 0;
  const auto simulation = started(scenario);
  const double dt = simulation->clock().dt;
  while (simulation->clock().time < 0.5) simulation->advance();
  double floor = 0;
  const int steps = static_cast<int>(0.05 / dt);
  for (int n = 0; n < steps; ++n) {
    simulation->advance();
    floor += simulation->ledger().walls_on_grains[1] / steps;
  }
  const double d = scenario.grains.diameter;
  const double weight = 9 * 0.25 * 3.14159265358979 * d * d * scenario.grains.density * 9.81;
  EXPECT_NEAR(floor / weight, 1, 1e-3);
  for (const double v : field(*simulation, "grains.velocity")) EXPECT_NEAR(v, 0, 1e-4);
}

}  // namespace
}  // namespace varve::core::test
