// Every recorded step is a restart point: state_at + continue gives the original's digests, event
// tables and events, through rebuilds of every list that the engine keeps between steps.
#include <cstdlib>

#include <gtest/gtest.h>

#include "tests/tools/process.h"
#include "tests/tools/verbs.h"
#include "tools/recording.h"
#include "tools/scenario_file.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

bool always(const io::FrameView&) { return true; }

/// Six grains that fall on each other and on the floor, with friction, in fluid that moves.
std::string heap_scene() {
  return R"([domain]
width = 1.6 cm
height = 1.6 cm
[fluid]
viscosity = 0.05 Pa.s
spacing = 1 mm
sound_speed = 1 m/s
[grains]
rows = 2
columns = 3
diameter = 2.5 mm
density = 2500 kg/m3
gap = 0.02
jitter = 0.01
lowest_y = 1.4 mm
velocity_x = 20 mm/s
velocity_y = -20 mm/s
[time]
steps = 300
[record]
keyframe_steps = 64
)";
}

/// How far to continue: to the end in the long form and from every tenth step.
std::uint64_t last_of(std::uint64_t from, std::uint64_t end) {
  const bool whole = std::getenv("VARVE_LONG") != nullptr || from % 10 == 0;
  return whole ? end : std::min(end, from + 40);
}

TEST(Restart, EveryStepOfAHeapIsARestartPoint) {
  test::TemporaryFolder folder;
  const core::Scenario scenario = read_scenario_text(heap_scene(), "heap").scenario;
  const auto engine = SimulationEngine::fresh(scenario, {});
  const io::Genesis genesis = make_genesis(scenario, engine->schema(), 1);
  {
    auto writer = io::LogWriter::create(folder / "heap", genesis, engine->frame(), {});
    ASSERT_EQ(record(*engine, *writer, target_of(scenario), always).last_step, 300u);
  }
  EXPECT_GT(engine->simulation().counters().list_rebuilds, 2u);

  const auto log = io::LogReader::open(folder / "heap");
  std::uint64_t contact_steps = 0, rebuilds = 0;
  for (std::uint64_t step = 0; step <= 300; ++step) {
    const auto rows = log->tables(step)->rows;
    if (rows.at(0) > 0) ++contact_steps;
    auto again = SimulationEngine::of_genesis(log->genesis(), log->path(), {});
    const ReplayResult result = replay(*log, *again, step, last_of(step, 300), always);
    ASSERT_FALSE(result.first) << "from step " << step << ": " << describe(*result.first);
    EXPECT_EQ(result.started_at, step);
    EXPECT_EQ(result.steps_checked, last_of(step, 300) - step + 1);
    rebuilds += again->simulation().counters().list_rebuilds;
  }
  EXPECT_GT(contact_steps, 150u) << "the scene is not rich in contacts";
  EXPECT_GT(rebuilds, 301u) << "no continuation went through a rebuild";
}

TEST(Restart, ThreadsDoWorkAndChangeNothing) {
  const core::Scenario scenario = read_scenario_text(heap_scene(), "heap").scenario;
  std::vector<io::Digest> expected;
  for (const unsigned threads : {1u, 2u, 3u, 4u}) {
    core::RunOptions options;
    options.threads = threads;
    options.rebuild_seed = threads - 1;  // and lists rebuilt at other steps each time
    const auto engine = SimulationEngine::fresh(scenario, options);
    std::vector<io::Digest> digests;
    for (int step = 0; step < 200; ++step) {
      engine->advance();
      digests.push_back(io::digest_frame(engine->schema(), engine->frame()));
    }
    if (expected.empty()) expected = digests;
    EXPECT_EQ(digests, expected) << threads << " threads";
    const auto& items = engine->simulation().counters().items_per_thread;
    ASSERT_EQ(items.size(), threads);
    for (const std::uint64_t each : items) EXPECT_GT(each, 0u);
  }
}

}  // namespace
}  // namespace varve::tools
