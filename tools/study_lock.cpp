#include "tools/study_lock.h"

#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto pause = std::chrono::milliseconds(10);
/// A holder that has just taken the lock has not yet said who it is.
constexpr auto grace = std::chrono::milliseconds(200);

/// The process that says in the file that it took the lock; 0 where none says so.
pid_t holder_of(int file) {
  char text[32] = {};
  const ssize_t got = pread(file, text, sizeof(text) - 1, 0);
  pid_t pid = 0;
  if (got > 0) std::from_chars(text, text + got, pid);
  return pid > 0 ? pid : 0;
}

bool alive(pid_t pid) { return pid > 0 && (kill(pid, 0) == 0 || errno == EPERM); }

bool write_text(int file, std::string_view text) {
  return ftruncate(file, 0) == 0 &&
         pwrite(file, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
}

}  // namespace

FolderLock::FolderLock(const std::string& folder, std::chrono::milliseconds patience)
    : path_((fs::path(folder) / "lock").string()) {
  fs::create_directories(folder);
  // No O_CLOEXEC: a member's run that outlives its study for a moment keeps the folder.
  file_ = open(path_.c_str(), O_RDWR | O_CREAT, 0666);
  if (file_ < 0) throw ToolError(exit_output, fmt::format("{}: {}", path_, std::strerror(errno)));
  const auto begun = Clock::now();
  while (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const pid_t holder = holder_of(file_);
    const auto waited = Clock::now() - begun;
    if (waited > patience || (alive(holder) && waited > grace)) {
      close(file_);
      throw UsageError(fmt::format("{}: another varve study is at work here (process {})", folder,
                                   holder > 0 ? std::to_string(holder) : "unknown"));
    }
    std::this_thread::sleep_for(pause);
  }
  if (!write_text(file_, fmt::format("{}\n", getpid()))) {
    const int error = errno;
    close(file_);
    throw ToolError(exit_output, fmt::format("{}: {}", path_, std::strerror(error)));
  }
}

FolderLock::~FolderLock() {
  // The name of the holder goes with it; if it stays, the next one replaces it.
  static_cast<void>(write_text(file_, ""));
  close(file_);
}

}  // namespace varve::tools
