// varve replay: really executes the steps again, and says where a record is not what they give.
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

class Replay : public ::testing::Test {
 protected:
  void SetUp() override {
    scene_ = folder_.write("crowd.cfg", crowd_scene());
    run_ = folder_ / "crowd.varve";
    verb(0, {"run", scene_, "-o", run_, "-q"});
  }
  TemporaryFolder folder_;
  std::string scene_, run_;
};

TEST_F(Replay, ChecksEveryDigestWithAnyNumberOfThreads) {
  for (const int threads : {1, 2, 5}) {
    const Json result = json_verb(0, {"replay", run_, "--threads", std::to_string(threads)});
    EXPECT_EQ(result["verdict"], "identical");
    EXPECT_EQ(whole(result["steps_checked"]), 121u);
    EXPECT_EQ(result["threads"], threads);
    EXPECT_TRUE(result["first"].is_null());
  }
}

TEST_F(Replay, StartsFromAStoredState) {
  const Json part = json_verb(0, {"replay", run_, "--from", "50", "--to", "last-20"});
  EXPECT_EQ(whole(part["first_step"]), 50u);
  EXPECT_EQ(whole(part["last_step"]), 100u);
  EXPECT_EQ(whole(part["steps_checked"]), 51u);
  verb(0, {"run", scene_, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  const Json far = json_verb(0, {"replay", folder_ / "digests", "--from", "50", "--to", "60"});
  EXPECT_EQ(whole(far["first_step"]), 32u);  // the keyframe before it
  verb(2, {"replay", run_, "--from", "60", "--to", "50"});
  verb(2, {"replay", run_, "--from", "121"});
}

TEST_F(Replay, CrossesScheduledChanges) {
  const std::string scene = folder_.write(
      "events.cfg", crowd_scene("[event.soft]\nat_step = 40\ncontact.damping = 0.6\n"
                                "[event.wide]\nat_step = 70\ndomain.width = 1.6 cm\n"));
  const std::string run = folder_ / "events.varve";
  verb(0, {"run", scene, "-o", run, "-q"});
  verb(0, {"replay", run});
  verb(0, {"replay", run, "--from", "35"});
  verb(0, {"replay", run, "--from", "41"});
  verb(0, {"replay", run, "--from", "75"});
  EXPECT_NE(chain_at(run, 69), chain_at(run_, 69));
  const Json info = json_verb(0, {"info", run});
  verb(0, {"run", scene, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  EXPECT_EQ(chain_at(run, 120), chain_at(folder_ / "digests", 120));
  EXPECT_EQ(json_verb(0, {"show", run, "--at", "90"})["fields"],
            json_verb(0, {"show", folder_ / "digests", "--at", "90"})["fields"]);
  for (const std::string stop : {"39", "40", "41", "70", "80"}) {
    const std::string part = folder_ / ("part-" + stop);
    verb(0, {"run", scene, "-o", part, "-q", "--steps", stop});
    json_verb(0, {"resume", part, "--steps", std::to_string(120 - std::stoi(stop))});
    EXPECT_EQ(chain_at(part, 120), chain_at(run, 120)) << stop;
  }
}

TEST_F(Replay, EmitsStatesThatWereNotStored) {
  verb(0, {"run", scene_, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  const std::string states = folder_ / "states";
  verb(0, {"replay", folder_ / "digests", "--emit", "40:60", "-o", states});
  EXPECT_EQ(chain_at(states, 40), chain_at(run_, 40));
  EXPECT_EQ(chain_at(states, 60), chain_at(run_, 60));
  EXPECT_EQ(json_verb(0, {"diff", run_, states})["verdict"], "identical");
  verb(0, {"replay", states});
}

TEST_F(Replay, RefusesWhatIsNoRun) {
  verb(2, {"replay", folder_ / "missing"});
  verb(4, {"replay", scene_});
  verb(2, {"replay", run_, "--to", "nonsense"});
}

}  // namespace
}  // namespace varve::test
