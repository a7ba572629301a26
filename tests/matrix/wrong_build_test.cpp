// What a wrong build or a spoilt process must run into: replay names the stage, step, field and
// particle where fused arithmetic parts from the record; a process that flushes subnormals is
// refused before it computes anything.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

class WrongBuild : public ::testing::Test {
 protected:
  void SetUp() override {
    if (__builtin_cpu_supports("fma") == 0) GTEST_SKIP() << "this CPU has no fused multiply-add";
    const std::string scene = folder_.write("crowd.cfg", crowd_scene("stage_digests = on\n"));
    verb(0, {"run", scene, "-o", run_, "-q", "--steps", "40"});
  }

  /// What a wrong build of varve-replay says of the run: exit code 1 and the first difference.
  Json locate(const std::string& program) {
    const CommandResult result = run_command({program, run_, "--locate", "--json"});
    EXPECT_EQ(result.code, 1) << result.output << result.errors;
    const Json object = Json::parse(result.output, nullptr, false);
    if (object.is_discarded()) return Json::object();
    EXPECT_EQ(object["verdict"], "different");
    return object["first"];
  }

  TemporaryFolder folder_;
  std::string run_ = folder_ / "crowd.varve";
};

void expect_located(const Json& first, const std::vector<std::string>& stages) {
  ASSERT_TRUE(first.contains("stage")) << first;
  EXPECT_NE(std::find(stages.begin(), stages.end(), first["stage"]), stages.end()) << first;
  EXPECT_EQ(whole(first["step"]), 1u) << "fused from the first step on";
  EXPECT_EQ(first["field"].get<std::string>().substr(0, 6), "fluid.");
  EXPECT_FALSE(first["particle"].is_null());
  EXPECT_NE(first["a"], first["b"]);
  EXPECT_GE(whole(first["ulp"]), 1u);
}

TEST_F(WrongBuild, TheRightBuildAgreesWithTheRecord) {
  EXPECT_EQ(json_verb(0, {"replay", run_, "--locate"})["verdict"], "identical");
}

// Fluid that begins at rest has no divergence to sum: then the walls' values are the first sums of
// pairs in which fusing shows.
TEST_F(WrongBuild, FusedPairSumsAreFoundInTheFirstStageThatSumsPairs) {
  expect_located(locate(VARVE_REPLAY_FUSED_SWEEPS), {"pressure", "walls"});
}

TEST_F(WrongBuild, FusedTimeIntegrationIsFoundInTheStageThatIntegrates) {
  expect_located(locate(VARVE_REPLAY_FUSED_STEP), {"integration"});
}

TEST_F(WrongBuild, TheTextNamesTheStageToo) {
  const CommandResult result = run_command({VARVE_REPLAY_FUSED_SWEEPS, run_, "--locate"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.output.find("first differing stage of the step: "), std::string::npos)
      << result.output;
}

TEST(SpoiltProcess, EveryVerbThatComputesRefusesToFlushSubnormals) {
  const TemporaryFolder folder;
  const std::string scene = folder.write("crowd.cfg", crowd_scene());
  const std::string run = folder / "crowd.varve";
  verb(0, {"run", scene, "-o", run, "-q", "--steps", "20"});
  const std::string digests = folder / "digests.varve";
  verb(0, {"run", scene, "-o", digests, "-q", "--steps", "20", "--tier", "digests"});
  const std::string made = folder / "made.varve";
  const std::vector<std::vector<std::string>> commands{
      {"varve-run", scene, "-o", made, "--steps", "20"},
      {"varve-replay", run, "--threads", "2"},
      {"varve-replay", run, "--from", "5"},
      {"varve-resume", run, "--steps", "5"},
      {"varve-fork", run, "--at", "10", "-o", made},
      {"varve-show", digests, "--at", "10"}};
  for (const std::vector<std::string>& command : commands) {
    CommandOptions options;
    options.environment = {{"LD_PRELOAD", VARVE_FLUSH_TO_ZERO}};
    const CommandResult result = run_command(command, options);
    EXPECT_EQ(result.code, 70) << command[0] << "\n" << result.output << result.errors;
    EXPECT_NE(result.errors.find("subnormal numbers are flushed to zero"), std::string::npos)
        << result.errors;
    EXPECT_FALSE(std::filesystem::exists(made)) << command[0];
  }
  verb(0, {"replay", run});
}

}  // namespace
}  // namespace varve::test
