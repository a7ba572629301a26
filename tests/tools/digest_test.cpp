#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"
#include "tools/digest_check.h"
#include "tools/digest_file.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using test::run_command;
using test::toy_frames;
using test::toy_genesis;
using test::write_log;
using testing::HasSubstr;

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(file)), {});
}

class DigestVerb : public testing::Test {
 protected:
  void SetUp() override { write_log(path_, toy_genesis(), frames_); }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "a.varve";
  std::vector<io::Frame> frames_ = toy_frames({});
};

TEST_F(DigestVerb, ListsEveryNthStepAndAlwaysTheLast) {
  const std::string out = folder_ / "a.digest";
  ASSERT_EQ(run_command({"varve-digest", path_, "--every", "15", "-o", out}).code, 0);
  const DigestFile file = read_digest_file(out);
  std::vector<std::uint64_t> steps;
  for (const DigestLine& line : file.lines) steps.push_back(line.step);
  EXPECT_THAT(steps, testing::ElementsAre(0, 15, 30, 40));
  EXPECT_EQ(file.engine, "toy");
  EXPECT_EQ(file.engine_revision, 1u);
  EXPECT_EQ(file.scenario, io::digest_text(toy_genesis().scenario));
  EXPECT_EQ(file.parameters, toy_genesis().parameters);
  EXPECT_LT(fs::file_size(out), 2000u);
}

TEST_F(DigestVerb, WithoutAFileItGoesToStandardOutput) {
  const auto result = run_command({"varve-digest", path_});
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(parse_digest_file(result.output, "-").lines.size(), 41u) << "41 steps fit in";
}

TEST_F(DigestVerb, NothingIsReplacedUnasked) {
  const std::string out = folder_.write("a.digest", "mine");
  EXPECT_EQ(run_command({"varve-digest", path_, "-o", out}).code, 2);
  EXPECT_EQ(read_file(out), "mine");
  EXPECT_EQ(run_command({"varve-digest", path_, "-o", out, "--overwrite"}).code, 0);
  EXPECT_TRUE(is_digest_file(out));
}

TEST_F(DigestVerb, WrongUseHasItsExitCodes) {
  EXPECT_EQ(run_command({"varve-digest"}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", path_, "--every", "0"}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", path_, "--every", "x"}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", path_, "--bless", "why"}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", "--check", folder_.path(), "--bless", ""}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", "--check", folder_.path()}).code, 2) << "no digest file";
  EXPECT_EQ(run_command({"varve-digest", folder_ / "missing"}).code, 2);
  EXPECT_EQ(run_command({"varve-digest", folder_.write("empty", "")}).code, 4);
  EXPECT_EQ(run_command({"varve-digest", path_, "-o", "/dev/full"}).code, 74);
}

// The folder check with the real varve-run, on a scene that takes a moment.
class DigestCheck : public testing::Test {
 protected:
  static constexpr const char* scene_text =
      "[domain]\nwidth = 2 cm\nheight = 3 cm\n[fluid]\nspacing = 2 mm\nsound_speed = 1 m/s\n"
      "viscosity = 0.01 Pa.s\nbody_force_x = 0.5\n[time]\nsteps = 30\n";

  void SetUp() override {
    const std::string scene = folder_.write("tank.cfg", scene_text);
    const auto run = run_command({"varve-run", scene, "-o", log_, "--progress", "none"});
    ASSERT_EQ(run.code, 0) << run.errors;
    ASSERT_EQ(run_command({"varve-digest", log_, "--every", "10", "-o", digest_}).code, 0);
  }
  test::CommandResult check(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"varve-digest", "--check", folder_.path()});
    return run_command(more);
  }
  /// The digest file with another chain at its last step, whole in itself.
  void spoil() {
    DigestFile file = read_digest_file(digest_);
    file.lines.back().chain.bytes[3] ^= 1;
    write_digest_file(file, digest_, true);
  }

  test::TemporaryFolder folder_;
  std::string log_ = folder_ / "tank.varve", digest_ = folder_ / "tank.digest";
};

TEST_F(DigestCheck, AgreesWithARunOfTheSameScene) {
  const std::string junit = folder_ / "check.xml";
  const auto result = check({"--junit", junit, "--threads", "2"});
  EXPECT_EQ(result.code, 0) << result.output << result.errors;
  EXPECT_THAT(result.output, HasSubstr("1 of 1 scenes agree"));
  EXPECT_THAT(read_file(junit), HasSubstr("tests=\"1\" failures=\"0\""));
}

TEST_F(DigestCheck, ADifferenceIsExitOneAndAFailedCase) {
  spoil();
  const std::string junit = folder_ / "check.xml";
  const auto result = check({"--junit", junit});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.output, HasSubstr("DIFFER first at a step in 21..30"));
  EXPECT_THAT(read_file(junit), HasSubstr("<failure type=\"different\" message=\"DIFFER first"));
}

TEST_F(DigestCheck, AChangedSceneIsNotComparableAndNamesTheKey) {
  std::string text = scene_text;
  text.replace(text.find("0.01 Pa.s"), 9, "0.02 Pa.s");
  folder_.write("tank.cfg", text);
  const auto result = check({"--json"});
  EXPECT_EQ(result.code, 2);
  const auto json = nlohmann::json::parse(result.output);
  EXPECT_EQ(json["verdict"], "not_comparable");
  EXPECT_THAT(json["scenes"][0]["text"].get<std::string>(),
              HasSubstr("fluid.viscosity: a=0.02 b=0.01"));
}

TEST_F(DigestCheck, BlessingRewritesAndKeepsTheReason) {
  spoil();
  const auto result = check({"--bless", "the old digests were spoilt"});
  EXPECT_EQ(result.code, 0) << result.output;
  EXPECT_EQ(read_digest_file(digest_).reason, "the old digests were spoilt");
  EXPECT_EQ(read_digest_file(digest_).every, 10u);
  EXPECT_EQ(check().code, 0);
}

TEST_F(DigestCheck, AMissingOrBrokenSceneIsNotSkipped) {
  folder_.write("broken.cfg", "[fluid]\nviscosity = thick\n");
  fs::copy_file(digest_, folder_ / "broken.digest");
  fs::copy_file(digest_, folder_ / "lost.digest");
  const auto result = check();
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.output, HasSubstr("the run ended with exit code 3"));
  EXPECT_THAT(result.output, HasSubstr("lost.cfg is missing"));
  EXPECT_THAT(result.output, HasSubstr("1 of 3 scenes agree"));
}

}  // namespace
}  // namespace varve::tools
