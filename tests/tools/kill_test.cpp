// Killed without warning at any moment, a verb that writes loses no step that was whole on disk,
// and the run ends bit-equal.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

/// 20 kills of runs and a few of the other verbs; VARVE_LONG: 10,000 in all; VARVE_KILLS: as given.
int kills(int usual, int in_long_form) {
  if (const char* text = std::getenv("VARVE_KILLS")) return std::max(usual, std::atoi(text));
  return std::getenv("VARVE_LONG") != nullptr ? in_long_form : usual;
}

class Kill : public ::testing::Test {
 protected:
  static constexpr std::uint64_t steps = 1200;

  void SetUp() override {
    scene_ = folder_.write("long.cfg", long_scene());
    whole_ = folder_ / "whole";
    verb(0, {"run", scene_, "-o", whole_, "--steps", std::to_string(steps), "-q"});
    chain_ = chain_at(whole_, steps);
    whole_size_ = static_cast<double>(fs::file_size(whole_));
  }

  static double size_of(const std::string& path) {
    std::error_code missing;
    const auto bytes = fs::file_size(path, missing);
    return missing ? 0.0 : static_cast<double>(bytes);
  }

  /// Runs a verb and kills it once `path` has grown by `part` of what it lacks to the whole run's
  /// size; with `early`, around its start.
  void kill_verb(const std::vector<std::string>& words, const std::string& path, double part,
                 bool early) {
    const double there = size_of(path);
    Background background(words);
    if (early) {
      std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(20 * part));
    } else {
      while (size_of(path) < there + part * (whole_size_ - there) && !background.ended())
        std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    background.signal(SIGKILL);
    background.wait();
  }

  /// Last whole step of a log; nothing where not even its genesis is whole.
  static std::optional<std::uint64_t> last_step(const std::string& run) {
    const CommandResult there = run_command({"varve-show", run, "--at", "last", "--json"});
    if (there.code != 0) return std::nullopt;
    return whole(Json::parse(there.output)["step"]);
  }

  void expect_whole(const std::string& run, std::optional<std::uint64_t> killed_at) {
    EXPECT_EQ(chain_at(run, steps), chain_) << "killed at step " << killed_at.value_or(0);
    verb(0, {"verify", run});
    EXPECT_EQ(json_verb(0, {"diff", whole_, run})["verdict"], "identical");
  }

  TemporaryFolder folder_;
  std::string scene_, whole_, chain_;
  double whole_size_ = 0;
  std::mt19937_64 random_{20240917};
  std::uniform_real_distribution<double> part_{0.01, 0.9};
};

TEST_F(Kill, RunsAtRandomMomentsThenResumedAreBitEqual) {
  const int all = kills(20, 7000);
  int within = 0;
  for (int k = 0; k < all; ++k) {
    const std::string run = folder_ / "killed";
    const std::vector<std::string> words{"run", scene_, "-o", run, "--steps",
                                         std::to_string(steps), "-q"};
    kill_verb(words, run, part_(random_), k % 10 == 0);
    const auto last = last_step(run);
    if (last) {
      if (*last > 0 && *last < steps) ++within;
      verb(0, {"resume", run, "-q"});
    } else {  // killed before genesis was whole: the user starts again
      std::vector<std::string> again = words;
      again.push_back("--overwrite");
      verb(0, again);
    }
    expect_whole(run, last);
    fs::remove(run);
  }
  std::printf("%d of %d kills fell between the first and the last recorded step\n", within, all);
  EXPECT_GE(within * 20, all * 15);
}

TEST_F(Kill, ResumesAndForksTooThenResumedAreBitEqual) {
  const int all = kills(3, 1000);
  for (int k = 0; k < all; ++k) {
    const std::string run = folder_ / "killed", child = folder_ / "child";
    kill_verb({"run", scene_, "-o", run, "--steps", std::to_string(steps), "-q"}, run, 0.3, false);
    const auto first = last_step(run);
    ASSERT_TRUE(first);
    kill_verb({"resume", run, "-q"}, run, part_(random_), k % 3 == 0);
    const auto second = last_step(run);
    ASSERT_TRUE(second);
    EXPECT_GE(*second, *first);  // what was whole before stays

    const std::string at = std::to_string(*second / 2);
    kill_verb({"fork", run, "--at", at, "--until", "1 h", "-o", child, "-q"}, child,
              part_(random_), false);
    const auto third = last_step(child);
    ASSERT_TRUE(third);
    if (*third < steps) verb(0, {"resume", child, "-q", "--steps", std::to_string(steps - *third)});
    EXPECT_EQ(chain_at(child, steps), chain_);
    verb(0, {"verify", child});

    verb(0, {"resume", run, "-q"});
    expect_whole(run, second);
    fs::remove(run);
    fs::remove(child);
  }
}

TEST_F(Kill, RecoverNeverTouchesItsInput) {
  const std::string damaged = folder_ / "damaged", saved = folder_ / "saved";
  fs::copy_file(whole_, damaged);
  fs::resize_file(damaged, fs::file_size(damaged) - 777);
  const std::string before = verb(4, {"verify", damaged}).output;
  const int all = kills(4, 1000);
  for (int k = 0; k < all; ++k) {
    Background background({"recover", damaged, "-o", saved, "--overwrite"});
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(60 * part_(random_)));
    background.signal(SIGKILL);
    background.wait();
    EXPECT_EQ(verb(4, {"verify", damaged}).output, before);
    run_command({"varve-recover", damaged, "-o", saved, "--overwrite"});
    verb(0, {"verify", saved});
    EXPECT_EQ(json_verb(0, {"diff", whole_, saved})["verdict"], "identical");
  }
}

}  // namespace
}  // namespace varve::test
