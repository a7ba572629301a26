// The scenes in scenarios/ through the verbs: each is run, replayed, forked and diffed.
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

std::string scene_file(const std::string& name) {
  return std::string(VARVE_SCENARIOS) + "/" + name + ".cfg";
}

class ShippedScene : public testing::TestWithParam<const char*> {};

TEST_P(ShippedScene, RunsReplaysForksAndDiffs) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.varve", same = folder / "same.varve",
                    other = folder / "other.varve";
  verb(0, {"run", scene_file(GetParam()), "-o", run, "--steps", "120"});
  EXPECT_EQ(json_verb(0, {"replay", run, "--threads", "3"})["verdict"], "identical");
  EXPECT_EQ(json_verb(0, {"verify", run})["verdict"], "complete");
  verb(0, {"fork", run, "--at", "60", "-o", same});
  const Json equal = json_verb(0, {"diff", run, same});
  EXPECT_EQ(equal["verdict"], "identical");
  EXPECT_EQ(chain_at(run, 120), chain_at(same, 120));
  verb(0, {"fork", run, "--at", "60", "-s", "fluid.viscosity=0.012", "-o", other});
  const Json differs = json_verb(1, {"diff", run, other});
  EXPECT_EQ(differs["verdict"], "different");
  EXPECT_EQ(whole(differs["first"]["step"]), 61u);
  verb(0, {"replay", other});
}

INSTANTIATE_TEST_SUITE_P(Scenarios, ShippedScene, testing::Values("pipe3d", "inclined"),
                         [](const auto& one) { return std::string(one.param); });

TEST(ShippedScenes, AllOfThemCheckOutAndStart) {
  for (const auto& entry : std::filesystem::directory_iterator(VARVE_SCENARIOS)) {
    if (entry.path().extension() != ".cfg") continue;
    const TemporaryFolder folder;
    verb(0, {"check", entry.path().string()});
    verb(0, {"run", entry.path().string(), "-o", folder / "a.varve", "--steps", "3"});
  }
}

TEST(ShippedScenes, TheThirdComponentIsShownComparedAndDescribed) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.varve", other = folder / "other.varve";
  verb(0, {"run", scene_file("pipe3d"), "-o", run, "--steps", "12"});
  const Json shown = json_verb(0, {"show", run, "--at", "12", "--fields", "grains"});
  ASSERT_EQ(shown["fields"]["grains.position"].size(), 8u);
  EXPECT_EQ(shown["fields"]["grains.position"][0].size(), 3u);
  EXPECT_EQ(shown["fields"]["grains.spin"][0].size(), 3u);
  const Json facts = json_verb(0, {"info", run});
  EXPECT_EQ(facts["particles"]["grains"], "8");
  EXPECT_EQ(facts["particles"]["fluid"], std::to_string(112 * 24));
  // Grains thrown along z differ in that component, and in no other, from the first state on.
  verb(0, {"run", scene_file("pipe3d"), "-o", other, "--steps", "12", "-s",
           "grains.velocity_z=1e-6"});
  const Json differs = json_verb(1, {"diff", run, other});
  EXPECT_EQ(whole(differs["first"]["step"]), 0u);
  EXPECT_EQ(differs["first"]["field"], "grains.velocity.z");
}

TEST(ShippedScenes, TheWidthOfABoxMayChangeInAForkThatOfAPipeMayNot) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.varve", pipe = folder / "pipe.varve";
  verb(0, {"run", scene_file("inclined"), "-o", run, "--steps", "20"});
  verb(0, {"fork", run, "--at", "10", "--width", "3.2 cm", "-o", folder / "wide.varve"});
  verb(0, {"run", scene_file("pipe3d"), "-o", pipe, "--steps", "4"});
  const CommandResult refused =
      verb(2, {"fork", pipe, "--at", "2", "--width", "1.4 cm", "-o", folder / "no.varve"});
  EXPECT_NE(refused.errors.find("pipe"), std::string::npos) << refused.errors;
  EXPECT_FALSE(std::filesystem::exists(folder / "no.varve"));
}

}  // namespace
}  // namespace varve::test
