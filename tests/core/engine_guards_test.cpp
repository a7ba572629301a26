// Where physics cannot go on the run stops: with criterion, step, field, particle, value, limit and
// advice, and with the last good state untouched.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

std::unique_ptr<Simulation> running(unsigned threads = 1, int steps = 40) {
  auto simulation = started(small_column(), {.threads = threads});
  for (int n = 0; n < steps; ++n) simulation->advance();
  return simulation;
}

/// Advances `simulation`, which must fail, and checks what every failure has to say.
NumericalFailure failure_of(Simulation& simulation) {
  const Snapshot before(simulation);
  const io::Digest tables = tables_digest(simulation);
  const Clock clock = simulation.clock();
  try {
    simulation.advance();
  } catch (const NumericalFailure& failure) {
    EXPECT_EQ(failure.step, clock.step + 1);
    EXPECT_FALSE(failure.advice.empty());
    EXPECT_FALSE(std::abs(failure.value) <= failure.limit);
    const std::string text = failure.what();
    for (const std::string& part :
         {"step " + std::to_string(failure.step), failure.criterion, failure.field,
          "particle " + std::to_string(failure.id), failure.advice})
      EXPECT_THAT(text, testing::HasSubstr(part));
    EXPECT_EQ(Snapshot(simulation), before) << "the state moved";
    EXPECT_EQ(tables_digest(simulation), tables);
    EXPECT_EQ(simulation.clock().step, clock.step);
    EXPECT_EQ(simulation.clock().time, clock.time);
    return failure;
  }
  ADD_FAILURE() << "no guard stopped the run";
  throw std::logic_error("no failure");
}

/// One number of a field replaced by `value`.
void poison(Simulation& simulation, const std::string& name, std::size_t index, double value) {
  std::vector<double> values = field(simulation, name);
  values.at(index) = value;
  set_field(simulation, name, values);
}

TEST(EngineGuards, NumbersThatAreNotFiniteAreNamedWithTheirField) {
  for (const double bad : {nan, infinity, -infinity}) {
    for (const char* name : {"fluid.velocity", "fluid.position", "fluid.superficial_density",
                             "fluid.mass", "grains.velocity", "grains.position", "grains.spin"}) {
      SCOPED_TRACE(std::string(name) + " = " + std::to_string(bad));
      const auto simulation = running();
      // Fluid far from the grains, which would catch it within the step and be named instead.
      const unsigned components = simulation->fields()[field_index(*simulation, name)].components;
      poison(*simulation, name, name[0] == 'f' ? 390 * components : 4, bad);
      const NumericalFailure failure = failure_of(*simulation);
      if (failure.field == "grains.position" && std::isinf(bad)) continue;  // an infinite overlap
      EXPECT_EQ(failure.criterion, "not a finite number");
      EXPECT_EQ(failure.field.substr(0, 5), std::string(name).substr(0, 5));
    }
  }
}

TEST(EngineGuards, ALoneNanIsFoundAtItsParticle) {
  // In one step a NaN reaches the neighbours too; grains are checked first and name the grain
  // itself.
  const auto simulation = running();
  poison(*simulation, "grains.velocity", 2 * 8 + 1, nan);
  const NumericalFailure grain = failure_of(*simulation);
  EXPECT_EQ(grain.field, "grains.velocity");
  EXPECT_EQ(grain.id, 8u);
  EXPECT_TRUE(std::isnan(grain.value));
  // A point without a place has no neighbours to infect.
  const auto other = running();
  poison(*other, "fluid.position", 2 * 399, nan);
  const NumericalFailure fluid = failure_of(*other);
  EXPECT_EQ(fluid.criterion, "not a finite number");
  EXPECT_EQ(fluid.id, 399u);
}

TEST(EngineGuards, OverlapOfTwoGrains) {
  const auto simulation = running();
  std::vector<double> x = field(*simulation, "grains.position");
  const double d = simulation->scenario().grains.diameter;
  x[2 * 7] = x[2 * 8] - 0.7 * d;
  x[2 * 7 + 1] = x[2 * 8 + 1];
  set_field(*simulation, "grains.position", x);
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "overlap with grain 8");
  EXPECT_EQ(failure.field, "grains.position");
  EXPECT_EQ(failure.id, 7u);
  EXPECT_NEAR(failure.value, 0.3 * d, 1e-12);
  EXPECT_NEAR(failure.limit, 0.2 * d, 1e-12);
}

TEST(EngineGuards, OverlapWithAWall) {
  const auto simulation = running();
  std::vector<double> x = field(*simulation, "grains.position");
  const double d = simulation->scenario().grains.diameter;
  x[2 * 8] = 0.02 - 0.2 * d;
  set_field(*simulation, "grains.position", x);
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "overlap with wall 1");
  EXPECT_EQ(failure.id, 8u);
  EXPECT_NEAR(failure.value, 0.3 * d, 1e-12);
}

TEST(EngineGuards, SpeedOfAGrain) {
  const auto simulation = running();
  poison(*simulation, "grains.velocity", 2 * 8 + 1, 3.0);  // sound speed 2.5 m/s
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "grain speed");
  EXPECT_EQ(failure.id, 8u);
  EXPECT_NEAR(failure.value, 3.0, 0.2);
  EXPECT_EQ(failure.limit, 2.5);
}

TEST(EngineGuards, SpeedOfTheFluid) {
  Scenario scenario = small_column();
  scenario.guards.density_deviation = 100;
  const auto simulation = started(scenario);
  poison(*simulation, "fluid.velocity", 2 * 350, 3.0);
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "fluid speed");
  EXPECT_EQ(failure.field, "fluid.velocity");
  EXPECT_EQ(failure.id, 350u);
  EXPECT_GT(failure.value, 2.5);
}

TEST(EngineGuards, DensityOfTheFluid) {
  const auto simulation = running();
  std::vector<double> rhob = field(*simulation, "fluid.superficial_density");
  rhob[390] *= 2.5;
  set_field(*simulation, "fluid.superficial_density", rhob);
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "density deviation");
  EXPECT_EQ(failure.field, "fluid.superficial_density");
  EXPECT_EQ(failure.id, 390u);
  EXPECT_GT(failure.value, 0.8);
  EXPECT_EQ(failure.limit, 0.8);
}

TEST(EngineGuards, FluidThatLeftThroughAWall) {
  const auto simulation = running();
  std::vector<double> x = field(*simulation, "fluid.position");
  x[2 * 200] = -2.5e-3;
  set_field(*simulation, "fluid.position", x);
  const NumericalFailure failure = failure_of(*simulation);
  EXPECT_EQ(failure.criterion, "fluid beyond a wall");
  EXPECT_EQ(failure.field, "fluid.position");
  EXPECT_EQ(failure.id, 200u);
  EXPECT_NEAR(failure.value, 2.5e-3, 2e-4);
  EXPECT_EQ(failure.limit, 1e-3);
}

TEST(EngineGuards, AGrainWithoutFluidIsStoppedBeforeItCrossesItself) {
  Scenario dry = small_column();
  dry.fluid.present = false;
  const auto simulation = started(dry);
  const double dt = simulation->clock().dt;
  poison(*simulation, "grains.velocity", 2 * 8 + 1, 3e-3 / dt);
  EXPECT_EQ(failure_of(*simulation).criterion, "grain speed");
}

TEST(EngineGuards, TheLowestIdIsReportedWhateverTheNumberOfThreads) {
  std::vector<std::string> texts;
  for (const unsigned threads : {1u, 2u, 3u, 4u}) {
    const auto simulation = running(threads);
    std::vector<double> rhob = field(*simulation, "fluid.superficial_density");
    for (const std::size_t a : {120, 250, 399}) rhob[a] *= 3;
    set_field(*simulation, "fluid.superficial_density", rhob);
    texts.push_back(failure_of(*simulation).what());
  }
  EXPECT_THAT(texts, testing::Each(texts[0]));
}

TEST(EngineGuards, AfterAFailureTheRunGoesOnFromASoundStateWithTheSameBits) {
  const auto simulation = running();
  const Snapshot sound(*simulation);
  poison(*simulation, "grains.velocity", 3, nan);
  EXPECT_THROW(simulation->advance(), NumericalFailure);
  EXPECT_THROW(simulation->advance(), NumericalFailure);
  simulation->set_state(sound.spans());
  const Trace after = traced(*simulation, 30);
  const auto undisturbed = running();
  EXPECT_EQ(traced(*undisturbed, 30).states, after.states);
}

TEST(EngineGuards, AStepFarBeyondItsLimitIsStoppedNotSilent) {
  Scenario scenario = small_column();
  scenario.fluid.jitter = 0.2;
  scenario = resolved(scenario);
  scenario.time.dt *= 20;  // past what resolve() lets through
  const auto simulation = Simulation::create(scenario, {});
  bool stopped = false;
  for (int n = 0; n < 500 && !stopped; ++n) {
    try {
      simulation->advance();
    } catch (const NumericalFailure& failure) {
      stopped = true;
      EXPECT_EQ(failure.step, simulation->clock().step + 1);
    }
  }
  EXPECT_TRUE(stopped);
  for (const FieldInfo& info : simulation->fields()) {
    if (info.type != FieldType::f64) continue;
    for (const double value : field(*simulation, info.name))
      ASSERT_TRUE(std::isfinite(value)) << info.name;
  }
}

}  // namespace
}  // namespace varve::core::test
