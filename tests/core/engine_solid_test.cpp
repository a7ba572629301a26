// Three dimensions: what holds in two must hold here too, in a box, a pipe and with periodic faces.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pair_sweeps.h"
#include "core/walls.h"
#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

using V3 = Vec<double, 3>;

/// 2 x 2 x 2 spheres dropped near the floor of a box of 10 x 10 x 10 mm.
Scenario spheres() {
  Scenario s;
  s.domain.dimension = 3;
  s.domain.width = s.domain.height = s.domain.depth = 0.01;
  s.fluid.sound_speed = 2.5;
  s.grains.rows = s.grains.columns = s.grains.layers = 2;
  s.grains.density = 2000;
  s.grains.gap = 0.02;
  s.grains.jitter = 0.005;
  s.grains.lowest_y = 1.4e-3;
  s.grains.velocity_x = 0.015;
  s.grains.velocity_y = -0.05;
  s.grains.velocity_z = 0.01;
  s.time.steps = 1000;
  return s;
}

Scenario pipe() {
  Scenario s = spheres();
  s.domain.shape = Shape::pipe;
  s.domain.width = 0.012;
  s.domain.depth = automatic;
  s.grains.velocity_x = 0.06;  // towards the curved wall
  return s;
}

struct Named {
  std::string name;
  Scenario scenario;
};

std::vector<Named> scenes() {
  Scenario seam = spheres();
  seam.domain.faces = Boundary::periodic;
  seam.domain.depth = 0.013;
  seam.grains.centre_z = 1e-3;
  seam.fluid.body_force_z = 2;
  Scenario open = spheres();
  open.domain.top = Boundary::free;
  open.fluid.level = 8e-3;
  open.fluid.sound_speed = 5;
  open.grains.velocity_y = -0.15;  // its step is short
  open.gravity.tilt = 0.1;
  Scenario single = spheres();
  single.precision = Precision::float_;
  Scenario mixed = spheres();
  mixed.precision = Precision::mixed;
  return {{"box", spheres()}, {"pipe", pipe()},  {"seam", seam},
          {"open", open},     {"float", single}, {"mixed", mixed}};
}

Trace run(const Scenario& scenario, const RunOptions& options, std::uint64_t steps) {
  const auto simulation = started(scenario, options);
  return traced(*simulation, steps);
}

TEST(EngineSolid, VectorsHaveThreeComponentsAndSpinToo) {
  const auto simulation = started(spheres());
  for (const char* name : {"fluid.position", "fluid.velocity", "grains.position",
                           "grains.velocity", "grains.spin", "contacts.spring"})
    EXPECT_EQ(simulation->fields()[field_index(*simulation, name)].components, 3u) << name;
  EXPECT_EQ(simulation->fields()[field_index(*simulation, "fluid.mass")].unit, "kg");
  EXPECT_EQ(field(*simulation, "fluid.mass").size(), 1000u);
  EXPECT_EQ(field(*simulation, "grains.velocity").size(), 3 * 8u);
}

TEST(EngineSolid, MomentumIsKeptToRoundOff) {
  for (const Named& each : scenes()) {
    if (each.scenario.precision != Precision::double_) continue;
    SCOPED_TRACE(each.name);
    const auto simulation = started(each.scenario);
    double worst = 0, worst_reaction = 0, moved = 0, contacts = 0;
    for (int n = 0; n < 40; ++n) {
      simulation->advance();
      const StepLedger ledger = simulation->ledger();
      worst = std::max(worst, momentum_residual(ledger, simulation->clock().dt));
      worst_reaction = std::max(worst_reaction, reaction_residual(ledger));
      moved += norm(ledger.fluid_momentum_change) + norm(ledger.grain_momentum_change);
      contacts += static_cast<double>(simulation->table(0).rows);
    }
    EXPECT_LE(worst, 1e-12);
    EXPECT_LE(worst_reaction, 1e-12);
    EXPECT_GT(moved, 0);
    EXPECT_GT(contacts, 0);
  }
}

TEST(EngineSolid, NeitherThreadsNorListsNorInstructionsReachABit) {
  constexpr std::uint64_t steps = 30;
  const int widest = static_cast<int>(best_instruction_set());
  for (const Named& scene : scenes()) {
    const Trace alone = run(scene.scenario, {.threads = 1}, steps);
    for (const unsigned threads : {2u, 3u, 8u})
      EXPECT_EQ(first_difference(alone, run(scene.scenario, {.threads = threads}, steps)), -1)
          << scene.name << ", threads " << threads;
    EXPECT_EQ(first_difference(alone, run(scene.scenario, {.rebuild_seed = 7}, steps)), -1)
        << scene.name << ", lists rebuilt at random";
    for (int set = 0; set < widest; ++set)
      EXPECT_EQ(first_difference(alone, run(scene.scenario, {.instruction_set = set}, steps)), -1)
          << scene.name << ", instruction set " << set;
  }
}

TEST(EngineSolid, EveryStepIsARestartPoint) {
  for (const Named& scene : scenes()) {
    const Scenario s = resolved(scene.scenario);
    auto straight = Simulation::create(s, {}), hopping = Simulation::create(s, {});
    std::uint64_t contacts = 0;
    for (int n = 0; n < 30; ++n) {
      straight->advance();
      const Snapshot state(*hopping);
      hopping = Simulation::restore(s, state.spans(), {});
      hopping->advance();
      ASSERT_EQ(digest(*straight), digest(*hopping)) << scene.name << ", step " << n + 1;
      contacts += straight->field(field_index(*straight, "contacts.key")).count;
    }
    EXPECT_GT(contacts, 0u) << scene.name;
  }
}

TEST(EngineSolid, AChangeThatChangesNothingIsInvisible) {
  const auto parent = started(spheres()), child = started(spheres());
  for (int n = 0; n < 10; ++n) {
    parent->advance();
    child->advance();
  }
  child->change({{"domain.width", "0.01"}, {"contact.damping", "0.2"}}, {});
  EXPECT_EQ(first_difference(traced(*parent, 20), traced(*child, 20)), -1);
}

// ---- fluid at rest ----

TEST(EngineSolid, UnderAFreeSurfaceThePressureIsThatOfTheDepth) {
  Scenario s;
  s.domain.dimension = 3;
  s.domain.width = s.domain.depth = 0.02;
  s.domain.height = 0.03;
  s.domain.top = Boundary::free;
  s.fluid.spacing = 2e-3;
  s.fluid.level = 0.024;
  s.fluid.smoothing_ratio = 1.5;
  s.fluid.viscosity = 0.1;
  s.time.until = 0.25;
  const auto simulation = started(s);
  while (simulation->clock().time < 0.25) simulation->advance();
  const std::vector<double> p = simulation->fluid_report().pressure;
  const std::vector<double> x = field(*simulation, "fluid.position");
  // Least squares of p over depth, away from the walls and the surface.
  double n = 0, sy = 0, sp = 0, syy = 0, syp = 0;
  for (std::size_t a = 0; a < p.size(); ++a) {
    const double y = x[3 * a + 1];
    const auto inner = [&](double c, double length) { return c > 5e-3 && c < length - 5e-3; };
    if (!inner(x[3 * a], 0.02) || !inner(x[3 * a + 2], 0.02) || !inner(y, 0.024)) continue;
    n += 1;
    sy += y;
    sp += p[a];
    syy += y * y;
    syp += y * p[a];
  }
  const double slope = (n * syp - sy * sp) / (n * syy - sy * sy);
  RecordProperty("slope_over_rho_g", std::to_string(-slope / 9810));
  EXPECT_NEAR(slope, -9810, 0.02 * 9810);
  for (const double v : field(*simulation, "fluid.velocity"))
    EXPECT_LT(std::abs(v), 1e-2 * std::sqrt(9.81 * 0.024));
}

TEST(EngineSolid, AClosedBoxAndAClosedPipeStayAtRestToTheLastBit) {
  for (Scenario s : {spheres(), pipe()}) {
    s.grains.rows = 0;
    const auto simulation = started(s);
    for (int n = 0; n < 50; ++n) simulation->advance();
    EXPECT_THAT(field(*simulation, "fluid.velocity"), testing::Each(0.0));
  }
}

// ---- one grain ----

TEST(EngineSolid, AFallingSphereReachesTheSpeedOfItsDragLaw) {
  Scenario s = spheres();
  s.domain.height = 0.04;
  s.grains.rows = s.grains.columns = s.grains.layers = 1;
  s.grains.diameter = 1e-3;
  s.grains.density = 1500;
  s.grains.lowest_y = 0.035;
  s.grains.velocity_x = s.grains.velocity_y = s.grains.velocity_z = 0;
  s.fluid.viscosity = 0.1;
  s.coupling.mode = CouplingMode::one_way;
  s.coupling.length = 2e-3;
  s.coupling.drag = Drag::stokes;
  const auto simulation = started(s);
  const double speed = 500 * 9.81 * 1e-6 / (18 * 0.1);  // Stokes: (rho_s - rho0) g d^2 / 18 mu
  const double relaxation = 1500 * 1e-6 / (18 * 0.1);
  while (simulation->clock().time < 12 * relaxation) simulation->advance();
  const std::vector<double> v = field(*simulation, "grains.velocity");
  EXPECT_NEAR(v[1], -speed, 1e-3 * speed);
  EXPECT_NEAR(v[0], 0, 1e-6 * speed);
  EXPECT_NEAR(v[2], 0, 1e-6 * speed);
}

TEST(EngineSolid, ASphereHitsTheCurvedWallWhereItIs) {
  Scenario s = pipe();
  s.fluid.present = false;
  s.gravity.magnitude = 0;
  s.grains.rows = s.grains.columns = s.grains.layers = 1;
  s.grains.lowest_y = 5e-3;
  s.grains.jitter = 0;
  s.grains.velocity_x = 0.03;
  s.grains.velocity_y = 0;
  s.grains.velocity_z = 0.04;
  s.contact.damping = 0;
  s.contact.friction = 0;
  const auto simulation = started(s);
  const double gap = 0.006 - 0.5 * s.grains.diameter;  // from the axis to the wall
  double farthest = 0;
  std::uint64_t hits = 0;
  while (simulation->clock().time < 2.2 * gap / 0.05) {
    simulation->advance();
    const std::vector<double> x = field(*simulation, "grains.position");
    const double out_x = x[0] - 0.006, out_z = x[2] - 0.006;
    farthest = std::max(farthest, std::sqrt(out_x * out_x + out_z * out_z));
    for (const std::uint64_t partner : column<std::uint64_t>(*simulation, 0, "partner")) {
      EXPECT_EQ(partner, wall_pipe);
      ++hits;
    }
  }
  EXPECT_GT(hits, 0u);
  EXPECT_NEAR(farthest, gap, 0.05 * s.grains.diameter);
  // Head on, along a radius, without loss: back the way it came.
  const std::vector<double> v = field(*simulation, "grains.velocity");
  EXPECT_NEAR(v[0], -0.03, 0.03 * 0.02);
  EXPECT_NEAR(v[1], 0, 1e-12);
  EXPECT_NEAR(v[2], -0.04, 0.04 * 0.02);
}

// ---- a changed width ----

TEST(EngineSolid, AWiderBoxHoldsMoreFluidAndANarrowerOneLess) {
  const auto simulation = started(spheres());
  for (int n = 0; n < 5; ++n) simulation->advance();
  const auto mass = [&] {
    double sum = 0;
    for (const double m : field(*simulation, "fluid.mass")) sum += m;
    return sum;
  };
  const double before = mass();
  simulation->change({{"domain.width", "0.012"}}, {});
  EXPECT_EQ(field(*simulation, "fluid.mass").size(), 1200u);
  EXPECT_NEAR(mass() - before, 1000 * 0.002 * 0.01 * 0.01, 1e-9);
  for (int n = 0; n < 20; ++n) simulation->advance();
  simulation->change({{"domain.width", "0.01"}}, {});
  EXPECT_NEAR(mass(), before, 0.6 * 1000 * 1e-9);
  const std::vector<double> x = field(*simulation, "fluid.position");
  for (std::size_t a = 0; a < x.size(); a += 3) {
    EXPECT_GE(x[a], 0);
    EXPECT_LE(x[a], 0.01);
  }
  for (int n = 0; n < 20; ++n) simulation->advance();
}

TEST(EngineSolid, TheWidthOfAPipeStays) {
  const auto simulation = started(pipe());
  try {
    simulation->change({{"domain.width", "0.014"}}, {});
    FAIL() << "nothing was refused";
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("domain.width"));
    EXPECT_THAT(error.what(), testing::HasSubstr("pipe"));
  }
}

}  // namespace
}  // namespace varve::core::test
