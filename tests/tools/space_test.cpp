// Disks that fill up under the verbs, and readers beside a running writer: real ones, both.
#include <sched.h>
#include <sys/mount.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

/// A small file system of its own, in a mount namespace that ends with this process.
class SmallDisk {
 public:
  static constexpr std::uint64_t bytes = 4 << 20;
  explicit SmallDisk(const std::string& folder) : folder_(folder) {
    if (::geteuid() != 0) {
      why_not_ = "mounting a tmpfs needs root";
    } else if (::unshare(CLONE_NEWNS) != 0 ||
               ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
               ::mount("tmpfs", folder.c_str(), "tmpfs", 0, "size=4m") != 0) {
      why_not_ = std::string("no tmpfs can be mounted here: ") + std::strerror(errno);
    } else {
      mounted_ = true;
    }
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  /// Empty where there is such a disk.
  const std::string& why_not() const { return why_not_; }
  /// Leaves room for about `left` bytes more.
  void fill_up(std::uint64_t left) const {
    const std::uint64_t size = fs::space(folder_).available - left;
    std::ofstream(folder_ + "/filler", std::ios::binary | std::ios::app) << std::string(size, 'x');
  }
  void make_room() const { fs::remove(folder_ + "/filler"); }

 private:
  std::string folder_, why_not_;
  bool mounted_ = false;
};

class FullDisk : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!disk_.why_not().empty()) GTEST_SKIP() << disk_.why_not();
  }
  TemporaryFolder elsewhere_, mounted_;
  SmallDisk disk_{mounted_.path()};
  std::string scene_ = elsewhere_.write("crowd.cfg", crowd_scene());
};

TEST_F(FullDisk, RunStopsAtAStepBoundaryAndResumesOnceThereIsRoom) {
  const std::string log = mounted_ / "crowd.varve", whole_log = elsewhere_ / "whole.varve";
  verb(0, {"run", scene_, "-o", whole_log});
  disk_.fill_up(128 << 10);
  const CommandResult full = verb(74, {"run", scene_, "-o", log});
  for (const char* part : {"No space left on device", "bytes", "the last step known to be on disk"})
    EXPECT_NE(full.errors.find(part), std::string::npos) << full.errors;
  const Json info = json_verb(0, {"info", log});
  const std::uint64_t steps = whole(info["steps"]);
  EXPECT_GT(steps, 0u);
  EXPECT_LT(steps, 120u);
  EXPECT_EQ(info["final_chain"], chain_at(whole_log, steps)) << "the last whole step is a true one";

  verb(74, {"resume", log});  // there is still no room
  disk_.make_room();
  const Json rest = json_verb(0, {"resume", log});
  EXPECT_EQ(whole(rest["last_step"]), 120u);
  EXPECT_EQ(rest["final_chain"], chain_at(whole_log, 120));
  verb(0, {"verify", log});
  verb(0, {"replay", log});
}

TEST_F(FullDisk, ForkAndRecoverEndWith74AndLeaveTheirInputAlone) {
  const std::string log = elsewhere_ / "parent.varve";
  verb(0, {"run", scene_, "-o", log});
  const auto size = fs::file_size(log);
  disk_.fill_up(64 << 10);
  verb(74, {"fork", log, "--at", "10", "-o", mounted_ / "child.varve"});
  verb(74, {"recover", log, "-o", mounted_ / "saved.varve"});
  EXPECT_FALSE(fs::exists(mounted_ / "saved.varve")) << "half a copy would look like a whole one";
  fs::remove(mounted_ / "child.varve");
  disk_.fill_up(0);
  verb(74, {"run", scene_, "-o", mounted_ / "none.varve"});
  EXPECT_FALSE(fs::exists(mounted_ / "none.varve"));
  EXPECT_EQ(fs::file_size(log), size);
  verb(0, {"verify", log});
}

TEST(FullDevice, ALostSummaryIsSaidAndTheLogIsWhole) {
  const TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene()), log = folder / "disc.varve";
  const CommandResult lost =
      run_command({"/bin/sh", "-c",
                   bin_folder() + "/varve-run " + scene + " -o " + log + " --json > /dev/full"});
  EXPECT_EQ(lost.code, 74) << lost.errors;
  EXPECT_NE(lost.errors.find("standard output: could not be written"), std::string::npos);
  EXPECT_EQ(json_verb(0, {"verify", log})["verdict"], "complete");
  verb(2, {"run", scene, "-o", "/dev/full"});
  verb(2, {"run", scene, "-o", "/dev/full", "--overwrite"});
}

TEST(Follow, InfoAndShowReadALogThatIsBeingWritten) {
  const TemporaryFolder folder;
  const std::string log = folder / "disc.varve";
  Background run({"run", "single_disc", "-o", log, "--threads", "1"});
  for (int n = 0; n < 1000 && !fs::exists(log); ++n)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CommandResult followed;
  std::thread follower([&] {
    followed = run_command({"varve-info", log, "--follow", "--json", "--patience", "60"});
  });
  std::vector<std::uint64_t> seen;
  while (!run.ended()) {
    const Json shown = json_verb(0, {"show", log, "--at", "last", "--fields", "grains.position"});
    ASSERT_TRUE(shown.contains("step")) << shown;
    seen.push_back(whole(shown["step"]));
  }
  EXPECT_EQ(run.wait(), 0);
  follower.join();
  EXPECT_EQ(followed.code, 0) << followed.errors;
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  ASSERT_FALSE(seen.empty());

  // One JSON object per line; the last one is the log's end.
  std::vector<Json> lines;
  for (std::size_t begin = 0, end; (end = followed.output.find('\n', begin)) != std::string::npos;
       begin = end + 1)
    lines.push_back(Json::parse(followed.output.substr(begin, end - begin)));
  ASSERT_FALSE(lines.empty());
  for (std::size_t n = 1; n < lines.size(); ++n)
    EXPECT_GT(whole(lines[n]["step"]), whole(lines[n - 1]["step"]));
  const Json end = json_verb(0, {"show", log, "--at", "last"});
  EXPECT_EQ(lines.back()["step"], "4800");
  EXPECT_EQ(lines.back()["chain"], end["chain"]);
  // Each line is true of the finished log as well.
  EXPECT_EQ(lines.front()["chain"], chain_at(log, whole(lines.front()["step"])));
}

}  // namespace
}  // namespace varve::test
