// A scene holds, runs and stores what it needs and nothing else.
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

using testing::Contains;
using testing::Each;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

std::vector<std::string> field_names(const Simulation& simulation) {
  std::vector<std::string> names;
  for (const FieldInfo& info : simulation.fields()) names.push_back(info.name);
  return names;
}
std::vector<std::string> table_names(const Simulation& simulation) {
  std::vector<std::string> names;
  for (const TableInfo& info : simulation.tables()) names.push_back(info.name);
  return names;
}

/// How often each stage ran in ten steps.
std::map<std::string, std::uint64_t> passes(Simulation& simulation) {
  for (int n = 0; n < 10; ++n) simulation.advance();
  std::map<std::string, std::uint64_t> counts;
  for (const auto& [name, count] : simulation.counters().passes) counts[name] = count;
  return counts;
}

TEST(EngineModules, FluidAndGrainsTogetherRunEverything) {
  Scenario scenario = small_column();
  scenario.fluid.artificial_alpha = 0.01;
  const auto simulation = started(scenario);
  EXPECT_THAT(table_names(*simulation), Contains("contacts"));
  EXPECT_THAT(table_names(*simulation), Contains("work"));
  auto count = passes(*simulation);
  count.erase("lists");
  EXPECT_EQ(count["shifting"], 0u);  // of fluid alone
  count.erase("shifting");
  for (const auto& [name, ran] : count) EXPECT_EQ(ran, 10u) << name;
}

TEST(EngineModules, ArtificialViscosityIsNoPassUnlessAskedFor) {
  const auto simulation = started(small_column());
  EXPECT_EQ(passes(*simulation)["artificial_viscosity"], 0u);
}

TEST(EngineModules, WithoutGrainsThereIsNoFieldTableOrStageOfThem) {
  Scenario scenario = small_column();
  scenario.grains.rows = 0;
  const auto simulation = started(scenario);
  EXPECT_THAT(field_names(*simulation), Each(Not(StartsWith("grains"))));
  EXPECT_THAT(field_names(*simulation), Each(Not(StartsWith("contacts"))));
  EXPECT_THAT(table_names(*simulation), IsEmpty());
  auto count = passes(*simulation);
  for (const char* name : {"porosity", "grain_forces", "contacts", "reaction"})
    EXPECT_EQ(count[name], 0u) << name;
  for (const char* name : {"density", "walls", "stress", "fluid"})
    EXPECT_EQ(count[name], 10u) << name;
  EXPECT_THAT(simulation->grain_reports(), IsEmpty());
  EXPECT_EQ(simulation->counters().grain_substeps, 0u);
}

TEST(EngineModules, WithoutFluidThereIsNoFieldOrStageOfIt) {
  Scenario scenario = small_column();
  scenario.fluid.present = false;
  const auto simulation = started(scenario);
  EXPECT_THAT(field_names(*simulation), Each(Not(StartsWith("fluid"))));
  EXPECT_THAT(table_names(*simulation), testing::ElementsAre("contacts"));
  auto count = passes(*simulation);
  for (const auto& [name, ran] : count) EXPECT_EQ(ran, name == "contacts" ? 10u : 0u) << name;
  EXPECT_THAT(simulation->fluid_report().pressure, IsEmpty());
  EXPECT_EQ(simulation->counters().list_rebuilds, 0u);
}

TEST(EngineModules, WithoutRotationThereIsNoSpinAndNoSpring) {
  Scenario scenario = small_column();
  scenario.contact.rotation = false;
  scenario.contact.friction = 0;
  const auto simulation = started(scenario);
  EXPECT_THAT(field_names(*simulation), Not(Contains("grains.spin")));
  EXPECT_THAT(field_names(*simulation), Not(Contains("contacts.spring")));
  EXPECT_THAT(field_names(*simulation), Contains("contacts.key"));
  traced(*simulation, 60);
  EXPECT_GT(simulation->field(field_index(*simulation, "contacts.key")).count, 0u);
}

TEST(EngineModules, WithoutWallsTheirStageDoesNotRun) {
  Scenario scenario = small_column();
  scenario.domain.sides = scenario.domain.bottom = scenario.domain.top = Boundary::periodic;
  const auto simulation = started(scenario);
  EXPECT_EQ(passes(*simulation)["walls"], 0u);
}

TEST(EngineModules, OneWayCouplingSpreadsNothing) {
  Scenario scenario = small_column();
  scenario.coupling.mode = CouplingMode::one_way;
  const auto simulation = started(scenario);
  auto count = passes(*simulation);
  EXPECT_EQ(count["porosity"], 0u);
  EXPECT_EQ(count["reaction"], 0u);
  EXPECT_EQ(count["grain_forces"], 10u);
}

TEST(EngineModules, FrozenGrainsHaveNoContactsAndDoNotMove) {
  Scenario scenario = small_column();
  scenario.grains.motion = GrainMotion::frozen;
  scenario.grains.velocity_x = scenario.grains.velocity_y = 0;
  scenario.fluid.body_force_x = 3;
  const auto simulation = started(scenario);
  const std::vector<double> before = field(*simulation, "grains.position");
  EXPECT_EQ(passes(*simulation)["contacts"], 0u);
  EXPECT_EQ(field(*simulation, "grains.position"), before);
  EXPECT_THAT(field(*simulation, "grains.velocity"), Each(0.0));
  EXPECT_EQ(simulation->table(0).rows, 0u);
  // They are felt all the same.
  EXPECT_GT(norm(simulation->ledger().fluid_from_grains), 0);
}

TEST(EngineModules, FluidThatNoGrainActsOnMovesAsIfThereWereNone) {
  Scenario alone = small_column();
  alone.grains.rows = 0;
  alone.fluid.jitter = 0.05;
  alone.fluid.pressure = PressureForm::full;
  alone.time.dt = 2e-5;  // what is derived otherwise depends on the grains
  const auto expected = started(alone);
  for (const CouplingMode mode : {CouplingMode::one_way, CouplingMode::off}) {
    Scenario with = small_column();
    with.fluid = alone.fluid;
    with.time.dt = 2e-5;
    with.coupling.mode = mode;
    const auto simulation = started(with);
    const auto fresh = started(alone);
    for (int n = 0; n < 50; ++n) {
      simulation->advance();
      fresh->advance();
    }
    for (const char* name : {"fluid.position", "fluid.velocity", "fluid.superficial_density"})
      EXPECT_EQ(field(*simulation, name), field(*fresh, name)) << name;
  }
}

TEST(EngineModules, AGrainFarAwayLeavesThePorosityAtOneToTheBit) {
  Scenario scenario = small_column();
  scenario.domain.height = 0.04;
  scenario.grains.rows = scenario.grains.columns = 1;
  scenario.grains.lowest_y = 0.03;
  const auto simulation = started(scenario);
  simulation->advance();
  const std::vector<double> eps = simulation->fluid_report().porosity;
  const std::vector<double> x = field(*simulation, "fluid.position");
  for (std::size_t a = 0; a < eps.size(); ++a) {
    if (x[2 * a + 1] >= 0.024) continue;
    ASSERT_EQ(eps[a], 1.0) << "particle " << a;
  }
}

TEST(EngineModules, AGrainWithoutFluidFallsFreely) {
  Scenario scenario = small_column();
  scenario.fluid.present = false;
  scenario.grains.rows = scenario.grains.columns = 1;
  scenario.grains.lowest_y = 0.015;
  scenario.grains.velocity_x = scenario.grains.velocity_y = 0;
  const auto simulation = started(scenario);
  const int steps = 500;
  for (int n = 0; n < steps; ++n) simulation->advance();
  EXPECT_NEAR(field(*simulation, "grains.velocity")[1], -9.81 * simulation->clock().time, 1e-12);
}

}  // namespace
}  // namespace varve::core::test
