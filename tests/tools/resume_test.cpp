// varve resume: stopped, torn or finished, the run goes on to the bits of one that never stopped.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

class Resume : public ::testing::Test {
 protected:
  void SetUp() override {
    scene_ = folder_.write("crowd.cfg", crowd_scene());
    verb(0, {"run", scene_, "-o", folder_ / "whole", "-q"});
  }
  void expect_equal_to_whole(const std::string& run) {
    const Json diff = json_verb(0, {"diff", folder_ / "whole", run});
    EXPECT_EQ(diff["verdict"], "identical");
    EXPECT_EQ(chain_at(run, 120), chain_at(folder_ / "whole", 120));
    verb(0, {"verify", run});
  }
  TemporaryFolder folder_;
  std::string scene_;
};

TEST_F(Resume, AfterSteps) {
  for (const std::string stop : {"0", "1", "31", "32", "33", "77", "119"}) {
    const std::string run = folder_ / ("part-" + stop);
    verb(0, {"run", scene_, "-o", run, "--steps", stop});
    const Json result =
        json_verb(0, {"resume", run, "--steps", std::to_string(120 - std::stoi(stop))});
    EXPECT_EQ(whole(result["first_step"]), std::stoull(stop));
    EXPECT_EQ(result["stop_reason"], "end");
    EXPECT_EQ(chain_at(run, 120), chain_at(folder_ / "whole", 120));
  }
}

TEST_F(Resume, InEveryTier) {
  for (const std::vector<std::string>& tier :
       {std::vector<std::string>{"--tier", "digests"}, {"--every", "9"}}) {
    const std::string run = folder_ / tier.front();
    std::vector<std::string> words{"run", scene_, "-o", run, "--steps", "50"};
    words.insert(words.end(), tier.begin(), tier.end());
    verb(0, words);
    json_verb(0, {"resume", run, "--steps", "70"});
    expect_equal_to_whole(run);
  }
}

TEST_F(Resume, AfterASignal) {
  for (const int number : {SIGINT, SIGTERM}) {
    const std::string run = folder_ / std::to_string(number);
    const std::string scene = folder_.write("long.cfg", long_scene());
    Background background({"run", scene, "-o", run, "--steps", "1000000"});
    while (!fs::exists(run) || fs::file_size(run) < 20000) {
      ASSERT_FALSE(background.ended());
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    background.signal(number);
    EXPECT_EQ(background.wait(), 75);
    verb(0, {"verify", run});
    const std::uint64_t last = whole(json_verb(0, {"show", run, "--at", "last"})["step"]);
    EXPECT_GT(last, 0u);
    json_verb(0, {"resume", run, "--steps", "50"});
    const std::string whole = folder_ / ("whole-" + std::to_string(number));
    verb(0, {"run", scene, "-o", whole, "-q", "--steps", std::to_string(last + 50)});
    EXPECT_EQ(json_verb(0, {"diff", run, whole})["verdict"], "identical");
    EXPECT_EQ(chain_at(run, last + 50), chain_at(whole, last + 50));
  }
}

TEST_F(Resume, AfterStopAfter) {
  const std::string run = folder_ / "stopped";
  const Json stopped = json_verb(75, {"run", scene_, "-o", run, "--stop-after", "1ms"});
  EXPECT_EQ(stopped["stop_reason"], "stop_after");
  EXPECT_LT(whole(stopped["last_step"]), 120u);
  json_verb(0, {"resume", run});
  expect_equal_to_whole(run);
}

TEST_F(Resume, CutsATornTailAndSaysSo) {
  const std::string run = folder_ / "torn";
  fs::copy_file(folder_ / "whole", run);
  fs::resize_file(run, fs::file_size(run) - 1000);
  { std::ofstream(run, std::ios::binary | std::ios::app) << "garbage from a crash"; }
  verb(4, {"verify", run});
  const CommandResult result = verb(0, {"resume", run, "--progress", "none"});
  EXPECT_NE(result.errors.find("cut a torn tail of"), std::string::npos) << result.errors;
  expect_equal_to_whole(run);
}

TEST_F(Resume, RefusesRotAndTouchesNothing) {
  const std::string run = folder_ / "rotten";
  fs::copy_file(folder_ / "whole", run);
  {
    std::fstream file(run, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(fs::file_size(run) / 2));
    file.put('\x5a').put('\xa5').put('\x5a');
  }
  std::ifstream before(run, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(before), {});
  verb(4, {"resume", run, "--steps", "5"});
  std::ifstream after(run, std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(after), {}), bytes);
  // What lies before the damage can still be forked.
  verb(0, {"fork", run, "--at", "10", "--steps", "110", "-o", folder_ / "child"});
  EXPECT_EQ(chain_at(folder_ / "child", 120), chain_at(folder_ / "whole", 120));
}

TEST_F(Resume, AtItsEndSaysSoAndChangesNothing) {
  const auto size = fs::file_size(folder_ / "whole");
  const CommandResult result = verb(0, {"resume", folder_ / "whole"});
  EXPECT_NE(result.output.find("already at its end (step 120"), std::string::npos) << result.output;
  EXPECT_EQ(fs::file_size(folder_ / "whole"), size);
}

TEST_F(Resume, GoesFurtherOnRequest) {
  json_verb(0, {"resume", folder_ / "whole", "--steps", "15"});
  verb(0, {"run", scene_, "-o", folder_ / "long", "--steps", "135"});
  EXPECT_EQ(chain_at(folder_ / "whole", 135), chain_at(folder_ / "long", 135));
  verb(0, {"replay", folder_ / "whole"});
}

TEST_F(Resume, RefusesWhatIsNoRun) {
  verb(2, {"resume", folder_ / "missing"});
  verb(2, {"resume", folder_.path()});
  verb(4, {"resume", folder_.write("empty", "")});
  verb(4, {"resume", scene_});
  const std::string endless = folder_.write("long.cfg", long_scene());
  Background holder({"run", endless, "-o", folder_ / "held", "--steps", "1000000"});
  while (!fs::exists(folder_ / "held") || fs::file_size(folder_ / "held") < 20000) {
    ASSERT_FALSE(holder.ended());
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  verb(2, {"resume", folder_ / "held"});
}

}  // namespace
}  // namespace varve::test
