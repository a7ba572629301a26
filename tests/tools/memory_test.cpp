// Peak memory of the verbs that go through whole logs: it must not grow with the number of steps.
#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

constexpr double mebibyte = 1 << 20;

/// Runs a verb; returns the most memory that it held at once. [bytes]
double peak_of(int code, std::vector<std::string> words) {
  words[0] = bin_folder() + "/varve-" + words[0];
  words.insert(words.end(), {"--progress", "none"});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = vfork();  // no copy of this process that would be counted as the child's
  if (child == 0) {
    execv(argv[0], argv.data());
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  EXPECT_EQ(wait4(child, &status, 0, &usage), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), code) << words[0];
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// Four grains that fall, bounce and come to rest: nothing is quicker to compute.
std::string four_grains(std::uint64_t steps) {
  return "[domain]\nwidth = 2 cm\nheight = 2 cm\n[fluid]\npresent = off\n[grains]\nrows = 2\n"
         "columns = 2\ndiameter = 2.5 mm\ndensity = 2000 kg/m3\ngap = 0.5\nlowest_y = 3 mm\n"
         "[time]\nsteps = " + std::to_string(steps) + "\n";
}

struct Peaks {
  double run, fork, replay, diff_equal, diff, verify;  // [bytes]
};

/// Of all verbs over a run of `scene`, a fork of it in the middle, and a repetition.
Peaks measure(const std::string& scene, const std::string& change, const TemporaryFolder& folder) {
  const std::string log = folder / "run.varve", fork = folder / "fork.varve";
  Peaks peaks{};
  peaks.run = peak_of(0, {"run", scene, "-o", log, "-q"});
  peaks.fork = peak_of(0, {"fork", log, "--at", "50%", "-s", change, "-o", fork, "-q"});
  peaks.replay = peak_of(0, {"replay", log, "-q"});
  peaks.diff_equal = peak_of(0, {"diff", log, log, "-q"});
  peaks.diff = peak_of(1, {"diff", log, fork, "-q"});
  peaks.verify = peak_of(0, {"verify", log, "-q"});
  std::filesystem::remove(log);
  std::filesystem::remove(fork);
  return peaks;
}

void expect_below(const Peaks& peaks, double state_bytes, const std::string& what) {
  const double limit = 64 * mebibyte + 16 * state_bytes;
  std::printf("%s: limit %.1f MiB;", what.c_str(), limit / mebibyte);
  for (const auto& [name, bytes] :
       {std::pair{"run", peaks.run}, {"fork", peaks.fork}, {"replay", peaks.replay},
        {"diff of equals", peaks.diff_equal}, {"diff", peaks.diff}, {"verify", peaks.verify}}) {
    EXPECT_LE(bytes, limit) << what << ": " << name;
    EXPECT_GT(bytes, 1 * mebibyte) << what << ": " << name << " can't have been measured";
    std::printf(" %s %.1f", name, bytes / mebibyte);
  }
  std::printf(" MiB\n");
}

/// Sanitizers keep memory of their own.
class Memory : public ::testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer's memory would be measured";
#endif
  }
};

TEST_F(Memory, IsTheSameForTenTimesTheSteps) {
  const std::uint64_t most = std::getenv("VARVE_LONG") != nullptr ? 1'000'000 : 100'000;
  const TemporaryFolder folder;
  std::vector<Peaks> peaks;
  for (const std::uint64_t steps : {std::uint64_t{10'000}, most}) {
    const std::string scene = folder.write("grains.cfg", four_grains(steps));
    peaks.push_back(measure(scene, "gravity.magnitude=9.7", folder));
    expect_below(peaks.back(), 4 * 64, std::to_string(steps) + " steps");
  }
  // An index record for 512 steps may stay; states, digests or headers may not.
  EXPECT_LT(peaks[1].run, peaks[0].run + 4 * mebibyte);
  EXPECT_LT(peaks[1].replay, peaks[0].replay + 4 * mebibyte);
  EXPECT_LT(peaks[1].diff, peaks[0].diff + 4 * mebibyte);
  EXPECT_LT(peaks[1].verify, peaks[0].verify + 4 * mebibyte);
}

TEST_F(Memory, HoldsAFewStatesWhereStatesAreLarge) {
  const TemporaryFolder folder;
  const std::string scene = folder.write("wide.cfg", R"([domain]
width = 20 cm
height = 12 cm
[fluid]
spacing = 1 mm
sound_speed = 1 m/s
[grains]
rows = 1
columns = 2
diameter = 2.5 mm
density = 1500 kg/m3
[time]
steps = 60
[record]
keyframe_steps = 32
)");
  const Json check = json_verb(0, {"check", scene});
  const auto state = static_cast<double>(whole(check["log_bytes"]["state"]));
  EXPECT_GT(state, 1 * mebibyte);
  expect_below(measure(scene, "fluid.viscosity=0.011", folder), state, "24,002 particles");
}

}  // namespace
}  // namespace varve::test
