// The three tiers, chosen on the command line or in the scenario: every step can be reached in each
// of them, and info says what they cost.
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

constexpr std::uint64_t steps = 70;

/// Six grains in a box that becomes wider on the way: the fluid's count changes. `kind` is a
/// precision, or "3D": spheres in a box four of them deep, in doubles.
std::string widening_scene(const std::string& kind, const std::string& tier_keys) {
  const std::string wider = "[event.wider]\nat_step = 40\ndomain.width = 1.6 cm\n";
  if (kind != "3D")
    return "[scenario]\nprecision = " + kind + "\n" + crowd_scene(tier_keys + wider);
  std::string scene = crowd_scene(tier_keys + wider);
  const std::string head = "[domain]\n";
  scene.replace(scene.find(head), head.size(), head + "dimension = 3\ndepth = 1 cm\n");
  return scene;
}

class Tiers : public ::testing::TestWithParam<const char*> {
 protected:
  std::string record(const std::string& name, const std::string& tier_keys,
                     const std::vector<std::string>& options = {}) {
    const std::string scene =
        folder_.write(name + ".cfg", widening_scene(GetParam(), tier_keys));
    std::vector<std::string> words = {"run", scene, "-o", folder_ / (name + ".varve"), "--steps",
                                      std::to_string(steps)};
    words.insert(words.end(), options.begin(), options.end());
    verb(0, words);
    return folder_ / (name + ".varve");
  }
  TemporaryFolder folder_;
};

TEST_P(Tiers, EveryStepIsReachedInAllOfThem) {
  const std::string deltas = record("deltas", "");
  const std::string digests = record("digests", "tier = digests\n");
  const std::string every = record("every", "", {"--every", "7"});
  EXPECT_EQ(json_verb(0, {"info", deltas})["tier"], "deltas");
  EXPECT_EQ(json_verb(0, {"info", digests})["tier"], "digests");
  EXPECT_NE(verb(0, {"info", every}).output.find("tier deltas every 7"), std::string::npos);

  const Json before = json_verb(0, {"show", deltas, "--at", "39"});
  const Json after = json_verb(0, {"show", deltas, "--at", "40"});
  EXPECT_GT(after["fields"]["fluid.id"].size(), before["fields"]["fluid.id"].size());

  // All of a few kinds: first, before and at a keyframe, around the change, in between, last.
  for (const std::uint64_t step : {0, 1, 7, 31, 32, 33, 38, 39, 40, 41, 47, 63, 64, 69, 70}) {
    const Json shown = json_verb(0, {"show", deltas, "--at", std::to_string(step)});
    for (const std::string& log : {digests, every}) {
      const Json other = json_verb(0, {"show", log, "--at", std::to_string(step)});
      EXPECT_EQ(other["digest"], shown["digest"]) << log << " step " << step;
      EXPECT_EQ(other["fields"], shown["fields"]) << log << " step " << step;
    }
  }
  for (const std::string& log : {deltas, digests, every}) {
    EXPECT_EQ(json_verb(0, {"replay", log})["steps_checked"], std::to_string(steps + 1));
    EXPECT_EQ(json_verb(0, {"verify", log})["steps"], std::to_string(steps + 1));
    EXPECT_EQ(json_verb(0, {"diff", deltas, log})["verdict"], "identical");
  }
}

TEST_P(Tiers, TheScenarioAndTheCommandLineSayTheSame) {
  const std::string written = record("written", "every = 7\n");
  const std::string asked = record("asked", "", {"--every", "7"});
  const Json a = json_verb(0, {"info", written}), b = json_verb(0, {"info", asked});
  EXPECT_EQ(a["parameters"], b["parameters"]);
  EXPECT_EQ(a["bytes"]["by_field"], b["bytes"]["by_field"]);
  const std::string over = record("over", "tier = digests\n", {"--tier", "deltas"});
  EXPECT_EQ(json_verb(0, {"info", over})["tier"], "deltas");
}

TEST_P(Tiers, InfoAccountsForEveryByteAndSaysTheRatio) {
  for (const char* tier : {"deltas", "digests"}) {
    const std::string log = record(tier, "", {"--tier", tier});
    const Json bytes = json_verb(0, {"info", log})["bytes"];
    std::uint64_t stored = 0;
    for (const auto& [kind, row] : bytes["by_kind"].items()) stored += whole(row["stored"]);
    EXPECT_EQ(stored, std::filesystem::file_size(log));
    std::uint64_t fields = 0, raw = 0;
    for (const auto& [field, row] : bytes["by_field"].items()) {
      fields += whole(row["stored"]);
      raw += whole(row["raw"]);
    }
    EXPECT_EQ(whole(bytes["raw"]), raw);
    EXPECT_LT(fields, stored);
    EXPECT_LT(fields, raw);
    for (const char* field : {"fluid.position", "fluid.velocity", "grains.position"})
      EXPECT_TRUE(bytes["by_field"].contains(field)) << field;
    const std::string text = verb(0, {"info", log}).output;
    for (const char* part : {"times smaller than raw", "bytes per particle-step",
                             "bytes by record kind", "bytes by field", "ratio", "fluid.velocity"})
      EXPECT_NE(text.find(part), std::string::npos) << part;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Tiers, ::testing::Values("double", "float", "mixed", "3D"));

}  // namespace
}  // namespace varve::test
