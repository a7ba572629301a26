// What the verbs print with --json is what tools/schemas says, for every verdict there is.
#include "tests/tools/json_schema.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/toy_log.h"
#include "tests/tools/verbs.h"
#include "tools/diff_run.h"

namespace varve::tools {
namespace {

using test::flip;
using test::Json;
using test::json_verb;
using test::JsonSchema;
using test::toy_frames;
using test::toy_genesis;
using test::toy_schema;
using test::write_log;
using testing::IsEmpty;

class JsonOf : public testing::Test {
 protected:
  void SetUp() override {
    write_log(a_, toy_genesis(), frames_);
    flip(frames_, toy_schema(), {.frame = 12, .field = 5, .particle = 2, .bit = 0});
    io::Genesis other = toy_genesis();
    other.parameters[0].second = "41";
    other.keyframe_steps = 3;
    write_log(b_, other, frames_);
  }
  /// Runs varve diff; its JSON must fit the schema.
  Json diff(int code, std::vector<std::string> words) {
    words.insert(words.begin(), "diff");
    const Json out = json_verb(code, words);
    EXPECT_THAT(JsonSchema("diff").breaches(out), IsEmpty()) << out.dump(1);
    return out;
  }

  test::TemporaryFolder folder_;
  std::string a_ = folder_ / "a.varve", b_ = folder_ / "b.varve";
  std::vector<io::Frame> frames_ = toy_frames({});
};

TEST_F(JsonOf, DiffFitsItsSchemaWhateverTheVerdict) {
  EXPECT_EQ(diff(0, {a_, a_})["verdict"], "identical");
  const Json different = diff(1, {a_, b_, "--reconverge", "-v"});
  EXPECT_EQ(different["verdict"], "different");
  EXPECT_FALSE(different["genesis"].empty());
  EXPECT_FALSE(different["fields"].empty());
  EXPECT_FALSE(different["growth"].empty());
  EXPECT_TRUE(different.contains("reconvergence"));
  EXPECT_EQ(diff(0, {a_, b_, "--ulp", "1"})["verdict"], "within_tolerance");
  EXPECT_EQ(diff(0, {a_, b_, "--fields", "bead.heat"})["selected_fields"][0], "bead.heat");
}

TEST_F(JsonOf, DiffOfNumbersThatHaveNoDistance) {
  // The top bits of the exponent: infinities and NaNs, whose differences can't be measured.
  for (std::uint64_t bit = 52; bit < 63; ++bit)
    flip(frames_, toy_schema(), {.frame = 12, .field = 5, .particle = 2, .bit = bit});
  write_log(b_, toy_genesis(), frames_);
  diff(1, {a_, b_});
}

TEST_F(JsonOf, DiffWithDigestsAndWithoutCommonSteps) {
  const std::string digest = folder_ / "a.digest";
  json_verb(0, {"digest", a_, "--every", "10", "-o", digest});
  diff(0, {a_, digest});
  EXPECT_TRUE(diff(1, {b_, digest})["first"].contains("last_equal_step"));
  io::Genesis newer = toy_genesis();
  newer.engine_revision = 2;
  write_log(folder_ / "newer.varve", newer, frames_);
  EXPECT_EQ(diff(2, {folder_ / "newer.varve", digest})["verdict"], "not_comparable");
  const std::vector<io::Frame> late(frames_.begin() + 30, frames_.end());
  write_log(folder_ / "late", test::fork_genesis(toy_genesis(), frames_, 30, {}), late);
  frames_.resize(20);
  write_log(folder_ / "early", toy_genesis(), frames_);
  EXPECT_EQ(diff(2, {folder_ / "early", folder_ / "late"})["verdict"], "not_comparable");
}

TEST_F(JsonOf, SelfTestAndReplayAndFolderCheckFitTheirs) {
  EXPECT_THAT(JsonSchema("diff_self_test").breaches(json_verb(0, {"diff", "--self-test", a_})),
              IsEmpty());
  const std::string scene = folder_.write("disc.cfg", test::disc_scene("[record]\n"
                                                                       "stage_digests = on\n"));
  const std::string run = folder_ / "disc.varve";
  json_verb(0, {"run", scene, "-o", run, "--steps", "30"});
  EXPECT_THAT(JsonSchema("replay").breaches(json_verb(0, {"replay", run, "--locate"})), IsEmpty());
  std::filesystem::create_directory(folder_ / "set");
  std::filesystem::copy_file(scene, folder_ / "set/disc.cfg");
  json_verb(0, {"run", scene, "-o", folder_ / "whole.varve"});
  json_verb(0, {"digest", folder_ / "whole.varve", "-o", folder_ / "set/disc.digest"});
  EXPECT_THAT(
      JsonSchema("digest_check").breaches(json_verb(0, {"digest", "--check", folder_ / "set"})),
      IsEmpty());
}

TEST_F(JsonOf, TheSchemaCanBeBroken) {
  const JsonSchema schema("diff");
  const Json good = diff(1, {a_, b_});
  const auto breaches_with = [&](const char* pointer, const Json& value) {
    Json bad = good;
    bad[Json::json_pointer(pointer)] = value;
    return schema.breaches(bad).size();
  };
  EXPECT_EQ(breaches_with("/steps_compared", 41), 1u) << "a number where text is promised";
  EXPECT_EQ(breaches_with("/steps_compared", "4l"), 1u);
  EXPECT_EQ(breaches_with("/verdict", "equal"), 1u);
  EXPECT_EQ(breaches_with("/surprise", 1), 1u);
  EXPECT_EQ(breaches_with("/fields/0/compared", nullptr), 1u);
  EXPECT_EQ(breaches_with("/first", Json::object()), 1u);
  Json lacking = good;
  lacking.erase("notes");
  EXPECT_EQ(schema.breaches(lacking).size(), 1u);
}

}  // namespace
}  // namespace varve::tools
