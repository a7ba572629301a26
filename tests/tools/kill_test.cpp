// A run killed without warning loses no step that was whole on disk, and ends bit-equal.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

int kills_wanted() {
  const char* text = std::getenv("VARVE_KILLS");
  return text != nullptr ? std::max(20, std::atoi(text)) : 20;
}

/// Kills 20 runs (VARVE_KILLS: more), each tenth one around its start and the others once the log has
/// grown to a random part of the whole one's size; resumes each and compares it with the whole one.
TEST(Kill, AtRandomMomentsThenResumedIsBitEqual) {
  TemporaryFolder folder;
  const std::string scene = folder.write("long.cfg", long_scene());
  const std::string whole_run = folder / "whole";
  constexpr std::uint64_t steps = 1500;
  const std::string steps_text = std::to_string(steps);
  verb(0, {"run", scene, "-o", whole_run, "--steps", steps_text, "-q"});
  const auto whole_size = static_cast<double>(fs::file_size(whole_run));
  const std::string chain = chain_at(whole_run, steps);

  std::mt19937_64 random(20240917);
  std::uniform_real_distribution<double> part(0.01, 0.9);
  const int kills = kills_wanted();
  int within = 0;
  for (int k = 0; k < kills; ++k) {
    const std::string run = folder / ("killed-" + std::to_string(k));
    Background background({"run", scene, "-o", run, "--steps", steps_text, "-q"});
    const double moment = part(random);
    if (k % 10 == 0) {
      std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(20 * moment));
    } else {
      const auto size = [&] {
        std::error_code missing;
        const auto bytes = fs::file_size(run, missing);
        return missing ? 0.0 : static_cast<double>(bytes);
      };
      while (size() < moment * whole_size && !background.ended())
        std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    background.signal(SIGKILL);
    background.wait();

    const CommandResult there = run_command({"varve-show", run, "--at", "last", "--json"});
    if (there.code != 0) {  // killed before genesis was whole: the user starts again
      verb(0, {"run", scene, "-o", run, "--steps", steps_text, "-q", "--overwrite"});
      continue;
    }
    const std::uint64_t last = whole(Json::parse(there.output)["step"]);
    if (last > 0 && last < steps) ++within;
    verb(0, {"resume", run, "-q"});
    EXPECT_EQ(chain_at(run, steps), chain) << "killed at step " << last;
    verb(0, {"verify", run});
    EXPECT_EQ(json_verb(0, {"diff", whole_run, run})["verdict"], "identical");
    fs::remove(run);
  }
  std::printf("%d of %d kills fell between the first and the last recorded step\n", within, kills);
  EXPECT_GE(within * 20, kills * 15);
}

}  // namespace
}  // namespace varve::test
