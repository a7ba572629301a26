// Every recorded step is a restart point: the stored state and a fresh engine give the original's
// digests, event tables and events, through rebuilds of every list kept between steps.
#include <cstdlib>
#include <ostream>
#include <string>
#include <vector>

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
[record]
keyframe_steps = 64
)";
}

/// The five kinds of scene; 1,000 steps of each in the long form.
struct RestartScene {
  const char* name;
  std::string text;
  bool fluid, contacts;
  friend void PrintTo(const RestartScene& scene, std::ostream* out) { *out << scene.name; }
};

std::vector<RestartScene> restart_scenes() {
  const std::string box = "[domain]\nwidth = 1.2 cm\nheight = 1.2 cm\n";
  const std::string water = "[fluid]\nviscosity = 0.02 Pa.s\nspacing = 1 mm\njitter = 0.05\n";
  const std::string record = "[record]\nkeyframe_steps = 64\n";
  const std::string slosh = "top = free\n[gravity]\ntilt = 20 deg\n";
  const std::string pair =
      "[grains]\nrows = 1\ncolumns = 2\ngap = 0.01\nlowest_y = 1.3 mm\n"
      "velocity_y = -20 mm/s\nvelocity_x = 40 mm/s\n";
  const std::string many =
      "[grains]\nrows = 4\ncolumns = 4\ngap = 0.004\njitter = 0.001\nlowest_y = 1.26 mm\n"
      "velocity_y = -0.1 m/s\nvelocity_x = 30 mm/s\n";
  return {{"contact_dense", heap_scene(), true, true},
          {"free_surface", box + slosh + water + "level = 8 mm\nsound_speed = 4 m/s\n" + record,
           true, false},
          {"periodic", box + "sides = periodic\n" + water +
                           "sound_speed = 4 m/s\nbody_force_x = 2\n" + pair + record,
           true, true},
          {"fluid_only", box + water + "sound_speed = 1 m/s\nbody_force_x = 2\n" + record, true,
           false},
          {"grains_only", box + "[fluid]\npresent = off\n" + many + record, false, true}};
}

bool is_long() { return std::getenv("VARVE_LONG") != nullptr; }

/// How far to continue: to the end in the long form and from every fiftieth step.
std::uint64_t last_of(std::uint64_t from, std::uint64_t end) {
  return is_long() || from % 50 == 0 ? end : std::min(end, from + 40);
}

class RestartOf : public ::testing::TestWithParam<RestartScene> {};

TEST_P(RestartOf, EveryStepIsARestartPoint) {
  const RestartScene& scene = GetParam();
  const std::uint64_t steps = is_long() ? 1000 : 300;
  // A step that shares no factor with the keyframes' spacing meets every distance from them.
  const std::uint64_t stride = is_long() ? 1 : 7;
  test::TemporaryFolder folder;
  const core::Scenario scenario =
      read_scenario_text(scene.text + "[time]\nsteps = " + std::to_string(steps) + "\n",
                         scene.name).scenario;
  const auto engine = SimulationEngine::fresh(scenario, {});
  {
    auto writer = io::LogWriter::create(folder / "run", make_genesis(scenario, engine->schema(), 1),
                                        engine->frame(), {});
    ASSERT_EQ(record(*engine, *writer, target_of(scenario), always).last_step, steps);
  }
  const auto log = io::LogReader::open(folder / "run");
  std::uint64_t contact_steps = 0, rebuilds = 0, restarts = 0;
  for (std::uint64_t step = 0; step <= steps; step += stride) {
    if (scene.contacts && log->tables(step)->rows.at(0) > 0) ++contact_steps;
    core::RunOptions options;
    options.threads = static_cast<unsigned>(1 + step % 3);
    auto again = SimulationEngine::of_genesis(log->genesis(), log->path(), options);
    const std::uint64_t last = last_of(step, steps);
    const ReplayResult result = replay(*log, *again, step, last, always);
    ASSERT_FALSE(result.first) << "from step " << step << ": " << describe(*result.first);
    EXPECT_EQ(result.started_at, step);
    EXPECT_EQ(result.steps_checked, last - step + 1);
    rebuilds += again->simulation().counters().list_rebuilds;
    ++restarts;
  }
  if (scene.contacts) {
    EXPECT_GT(contact_steps, restarts / 4) << "not rich in contacts";
  }
  if (scene.fluid) {
    EXPECT_GT(rebuilds, restarts) << "no continuation went through a rebuild";
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, RestartOf, ::testing::ValuesIn(restart_scenes()),
                         [](const auto& scene) { return std::string(scene.param.name); });

TEST(Restart, ThreadsDoWorkAndChangeNothing) {
  const core::Scenario scenario =
      read_scenario_text(heap_scene() + "[time]\nsteps = 200\n", "heap").scenario;
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
