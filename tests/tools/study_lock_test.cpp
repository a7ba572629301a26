// The lock of a study's folder: whom it refuses and for whom it waits.
#include <chrono>
#include <csignal>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/tools/verbs.h"
#include "tools/cli.h"
#include "tools/study_lock.h"

namespace varve::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using tools::FolderLock;

/// A process that takes the lock of `folder`, starts another one by exec that sleeps for
/// `seconds`, says in the pipe `ready` that it did, and waits to be killed.
pid_t start_holder(const std::string& folder, int ready, const char* seconds) {
  const pid_t holder = fork();
  if (holder != 0) return holder;
  const FolderLock lock(folder);
  if (fork() == 0) {
    execlp("sleep", "sleep", seconds, static_cast<char*>(nullptr));
    _exit(127);
  }
  if (write(ready, "x", 1) != 1) _exit(1);
  for (;;) pause();
}

struct Holder {
  Holder(const std::string& folder, const char* seconds) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    pid = start_holder(folder, ends[1], seconds);
    close(ends[1]);
    char byte = 0;
    if (pid < 0 || read(ends[0], &byte, 1) != 1) throw std::runtime_error("no holder");
    close(ends[0]);
  }
  void end() const {
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
  }
  pid_t pid = -1;
};

TEST(StudyLock, NamesAHolderThatLives) {
  const TemporaryFolder folder;
  const Holder holder(folder.path(), "0");
  try {
    const FolderLock lock(folder.path());
    ADD_FAILURE() << "two hold one folder";
  } catch (const tools::UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr(fmt::format("at work here (process {})", holder.pid)));
  }
  holder.end();
}

TEST(StudyLock, WaitsForWhatAKilledHolderStarted) {
  const TemporaryFolder folder;
  const Holder holder(folder.path(), "1");
  holder.end();
  // Its child goes on for a second, and may write to logs of the folder until then.
  EXPECT_THROW(FolderLock(folder.path(), 50ms), tools::UsageError);
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_NO_THROW(FolderLock(folder.path(), 60s));
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 50s);
}

TEST(StudyLock, IsFreeOnceGivenBack) {
  const TemporaryFolder folder;
  for (int k = 0; k < 3; ++k) EXPECT_NO_THROW(FolderLock(folder.path(), 0ms));
}

}  // namespace
}  // namespace varve::test
