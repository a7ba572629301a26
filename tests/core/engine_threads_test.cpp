// What must not reach a bit: the number of threads, when lists are rebuilt, the instruction set.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pair_sweeps.h"
#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

constexpr std::uint64_t run_steps = 120;

struct Named {
  std::string name;
  Scenario scenario;
};

/// Scenes that run all the code there is: contacts, two-way coupling, seams, a free surface,
/// precisions.
std::vector<Named> scenes() {
  Scenario column = small_column();
  Scenario seam = small_column();
  seam.domain.sides = Boundary::periodic;
  seam.fluid.body_force_x = 2;
  seam.grains.centre_x = 4e-3;
  Scenario open = small_column();
  open.domain.top = Boundary::free;
  open.fluid.level = 0.016;
  open.fluid.sound_speed = 8;
  Scenario single = small_column();
  single.precision = Precision::float_;
  Scenario mixed = small_column();
  mixed.precision = Precision::mixed;
  Scenario quintic = small_column();
  quintic.fluid.kernel = Kernel::quintic;
  Scenario one_way = small_column();
  one_way.coupling.mode = CouplingMode::one_way;
  return {{"column", column}, {"seam", seam},       {"free surface", open}, {"float", single},
          {"mixed", mixed},   {"quintic", quintic}, {"one way", one_way}};
}

Trace run(const Scenario& scenario, const RunOptions& options) {
  const auto simulation = started(scenario, options);
  return traced(*simulation, run_steps);
}

TEST(EngineThreads, AnyNumberGivesTheSameBitsAndEachDoesWork) {
  for (const Named& scene : scenes()) {
    const Trace alone = run(scene.scenario, {.threads = 1});
    EXPECT_GT(alone.contact_rows, 0u) << scene.name;
    for (const unsigned threads : {2u, 3u, 4u, 8u}) {
      SCOPED_TRACE(scene.name + ", " + std::to_string(threads) + " threads");
      EXPECT_EQ(first_difference(alone, run(scene.scenario, {.threads = threads})), -1);
      const auto simulation =
          started(scene.scenario, {.threads = threads, .own_parts_only = true});
      EXPECT_EQ(first_difference(alone, traced(*simulation, run_steps)), -1);
      const std::vector<std::uint64_t>& items = simulation->counters().items_per_thread;
      EXPECT_EQ(items.size(), threads);
      EXPECT_THAT(items, testing::Each(testing::Gt(run_steps)));
    }
  }
}

TEST(EngineThreads, TwoRunsGiveTheSameBits) {
  for (const Named& scene : scenes())
    EXPECT_EQ(first_difference(run(scene.scenario, {}), run(scene.scenario, {})), -1) << scene.name;
}

TEST(EngineLists, RebuiltAtRandomGiveTheSameBits) {
  for (const Named& scene : scenes()) {
    const auto rarely = started(scene.scenario);
    const Trace expected = traced(*rarely, run_steps);
    for (const std::uint64_t seed : {1, 2, 77}) {
      SCOPED_TRACE(scene.name + ", seed " + std::to_string(seed));
      const auto often = started(scene.scenario, {.threads = 2, .rebuild_seed = seed});
      EXPECT_EQ(first_difference(expected, traced(*often, run_steps)), -1);
      EXPECT_GT(often->counters().list_rebuilds, rarely->counters().list_rebuilds);
      EXPECT_LT(often->counters().list_rebuilds, run_steps);
    }
    EXPECT_LT(rarely->counters().list_rebuilds, run_steps / 3) << "lists are used several times";
  }
}

TEST(EngineInstructionSets, AllGiveTheSameBits) {
  const int widest = static_cast<int>(best_instruction_set());
  RecordProperty("widest", std::string(name_of(best_instruction_set())));
  if (widest == 0) GTEST_SKIP() << "this processor has the baseline only";
  for (const Named& scene : scenes()) {
    const Trace baseline = run(scene.scenario, {.instruction_set = 0});
    for (int set = 1; set <= widest; ++set)
      EXPECT_EQ(first_difference(baseline, run(scene.scenario, {.instruction_set = set})), -1)
          << scene.name << ", set " << set;
  }
}

TEST(EngineThreads, ScenesOfFewParticlesLeaveNobodyWaiting) {
  // Fewer groups than threads: some have nothing to do, and that must not hang.
  Scenario tiny = small_column();
  tiny.domain.width = tiny.domain.height = 6e-3;
  tiny.grains.rows = tiny.grains.columns = 1;
  EXPECT_EQ(first_difference(run(tiny, {.threads = 1}), run(tiny, {.threads = 8})), -1);
}

}  // namespace
}  // namespace varve::core::test
