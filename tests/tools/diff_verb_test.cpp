// varve diff as a user runs it: exit codes, outputs, damaged inputs, runs of the real engine.
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"

namespace varve::tools {
namespace {

using test::flip;
using test::run_command;
using test::TemporaryFolder;
using test::toy_frames;
using test::toy_genesis;
using test::toy_schema;
using test::write_log;
using testing::HasSubstr;
using testing::StartsWith;

bool is_long() { return std::getenv("VARVE_LONG") != nullptr; }

class DiffVerb : public testing::Test {
 protected:
  void SetUp() override {
    frames_ = toy_frames({});
    write_log(a_, toy_genesis(), frames_);
    flip(frames_, toy_schema(), {.frame = 12, .field = 5, .particle = 2, .bit = 0});
    write_log(b_, toy_genesis(), frames_);
  }
  test::CommandResult diff(std::vector<std::string> words) {
    words.insert(words.begin(), "varve-diff");
    return run_command(words);
  }

  TemporaryFolder folder_;
  std::string a_ = folder_ / "a.varve", b_ = folder_ / "b.varve";
  std::vector<io::Frame> frames_;
};

TEST_F(DiffVerb, ExitCodesAreThoseOfPosixDiffAndDamageIsNeverOne) {
  EXPECT_EQ(diff({a_, a_}).code, 0);
  EXPECT_EQ(diff({a_, b_}).code, 1);
  EXPECT_EQ(diff({a_, b_, "--ulp", "1"}).code, 0);
  EXPECT_EQ(diff({a_}).code, 2);
  EXPECT_EQ(diff({a_, b_, "--ulp", "-1"}).code, 2);
  EXPECT_EQ(diff({a_, b_, "--abs", "bead.velocity="}).code, 2);
  EXPECT_EQ(diff({a_, b_, "--fields", "nothing"}).code, 2);
  EXPECT_EQ(diff({a_, b_, "--from", "41"}).code, 2);
  EXPECT_EQ(diff({a_, b_, "--annotate", "gitlab"}).code, 2);
  EXPECT_EQ(diff({a_, folder_ / "missing.varve"}).code, 2);
  EXPECT_EQ(diff({a_, folder_.path()}).code, 2);
  EXPECT_EQ(diff({a_, folder_.write("empty.varve", "")}).code, 4);
  EXPECT_EQ(diff({a_, folder_.write("text.varve", "no log at all, but long enough to look")}).code,
            4);
  EXPECT_EQ(diff({folder_.write("cut.digest", "varve-digest 1\nengine toy 1\n"), a_}).code, 4);
}

TEST_F(DiffVerb, AnyFlippedBitOfALogIsNeverCalledADifference) {
  std::ifstream file(a_, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::mt19937_64 random(11);
  const int rounds = is_long() ? 2000 : 60;
  for (int n = 0; n < rounds; ++n) {
    std::string spoilt = bytes;
    const std::size_t at = random() % spoilt.size();
    spoilt[at] = static_cast<char>(spoilt[at] ^ (1 << (random() % 8)));
    const auto result = diff({folder_.write("spoilt.varve", spoilt), a_});
    // 0 where the flipped byte is not needed for the comparison (index, a blob of equal chains).
    EXPECT_THAT(result.code, testing::AnyOf(0, 2, 4)) << "byte " << at << ": " << result.output;
  }
}

TEST_F(DiffVerb, ALogCutShortAnywhereIsNeverCalledADifference) {
  std::ifstream file(a_, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::mt19937_64 random(12);
  bool torn = false;
  for (int n = 0; n < (is_long() ? 1000 : 30); ++n) {
    const std::size_t length = random() % bytes.size();
    const auto result = diff({a_, folder_.write("cut.varve", bytes.substr(0, length))});
    EXPECT_THAT(result.code, testing::AnyOf(0, 4)) << length << ": " << result.output;
    if (result.code != 0) continue;
    torn = torn || result.errors.find("torn") != std::string::npos;
    EXPECT_THAT(result.output, StartsWith("IDENTICAL steps 0.."));
  }
  EXPECT_TRUE(torn);
}

TEST_F(DiffVerb, TheFirstLineIsTheFinding) {
  const auto result = diff({a_, b_});
  EXPECT_THAT(result.output, StartsWith("DIFFER first at step 12 (t=0.012 s), field "
                                        "bead.velocity.x, particle 7: a="));
  EXPECT_THAT(result.output.substr(0, result.output.find('\n')), testing::EndsWith("(1 ULP)"));
  EXPECT_EQ(result.errors, "");
  EXPECT_THAT(diff({a_, a_}).output, StartsWith("IDENTICAL steps 0..40 (41 compared), chain "));
}

TEST_F(DiffVerb, JsonAndJunitAndAnnotations) {
  const std::string junit = folder_ / "diff.xml";
  const auto result = diff({a_, b_, "--json", "--junit", junit, "--annotate", "github"});
  EXPECT_EQ(result.code, 1);
  const auto json = nlohmann::json::parse(result.output);
  EXPECT_EQ(json["verdict"], "different");
  EXPECT_EQ(json["first"]["step"], "12");
  EXPECT_EQ(json["first"]["particle"], "7");
  EXPECT_THAT(result.errors, StartsWith("::error title="));
  std::ifstream file(junit);
  const std::string xml((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(xml, HasSubstr("<failure type=\"different\""));
  EXPECT_EQ(diff({a_, b_, "--junit", "/dev/full"}).code, 74);
}

TEST_F(DiffVerb, ADigestFileStandsForARun) {
  const std::string digest = folder_ / "a.digest";
  ASSERT_EQ(run_command({"varve-digest", a_, "--every", "10", "-o", digest}).code, 0);
  EXPECT_EQ(diff({a_, digest}).code, 0);
  EXPECT_EQ(diff({digest, digest}).code, 0);
  const auto result = diff({b_, digest});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.output, StartsWith("DIFFER first at a step in 11..20 (t<=0.02 s)"));
  EXPECT_EQ(diff({digest, b_}).code, 1);
  EXPECT_EQ(diff({digest, b_, "--ulp", "1"}).code, 2);
}

TEST_F(DiffVerb, TheSelfTestProvesThatItCanFail) {
  const auto result = diff({"--self-test", a_, "--plants", "5"});
  EXPECT_EQ(result.code, 0) << result.output << result.errors;
  EXPECT_THAT(result.output, StartsWith("self-test passed: 5 of 5 planted"));
}

// Runs of the real engine that store digests only: states are executed again where they are needed.
class DiffOfDigestRuns : public testing::Test {
 protected:
  std::string run(const std::string& name, const std::string& viscosity, const std::string& tier) {
    const std::string scene = folder_.write(
        name + ".cfg",
        "[domain]\nwidth = 2 cm\nheight = 3 cm\n[fluid]\nspacing = 2 mm\nsound_speed = 1 m/s\n"
        "viscosity = " +
            viscosity + "\nbody_force_x = 0.5\n[time]\nsteps = 20\n[record]\ntier = " + tier +
            "\n");
    const std::string log = folder_ / (name + ".varve");
    const auto result = run_command({"varve-run", scene, "-o", log, "--progress", "none", "-q"});
    EXPECT_EQ(result.code, 0) << result.errors;
    return log;
  }
  test::CommandResult diff(std::vector<std::string> words) {
    words.insert(words.begin(), "varve-diff");
    return run_command(words);
  }
  TemporaryFolder folder_;
};

TEST_F(DiffOfDigestRuns, TheFieldIsNamedAllTheSame) {
  const std::string a = run("a", "0.01 Pa.s", "digests"), b = run("b", "0.02 Pa.s", "deltas");
  const std::string c = run("c", "0.01 Pa.s", "deltas");
  const auto result = diff({a, b});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.output,
              testing::ContainsRegex("^DIFFER first at step [0-9]+ .*, field fluid\\."));
  EXPECT_THAT(result.output, HasSubstr("parameter fluid.viscosity: a=0.01 b=0.02"));
  EXPECT_THAT(result.output, HasSubstr("they were executed again"));
  // The same finding as where the states are stored.
  const auto stored = diff({c, b});
  EXPECT_EQ(result.output.substr(0, result.output.find('\n')),
            stored.output.substr(0, stored.output.find('\n')));
  EXPECT_EQ(diff({a, c}).code, 0) << "tiers do not matter";
}

TEST_F(DiffOfDigestRuns, TolerancesWork) {
  const std::string a = run("a", "0.01 Pa.s", "digests"), b = run("b", "0.010000000001", "digests");
  EXPECT_EQ(diff({a, b}).code, 1);
  const auto within = diff({a, b, "--abs", "1e-6"});
  EXPECT_EQ(within.code, 0);
  EXPECT_THAT(within.output, StartsWith("WITHIN TOLERANCE, not bitwise: steps 0..20"));
}

}  // namespace
}  // namespace varve::tools
