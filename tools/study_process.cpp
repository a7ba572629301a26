#include "tools/study_process.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

/// In a child: ends when its parent ends, at once if that has happened already.
void end_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(128 + SIGKILL);
}

int code_of(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void redirect(const std::string& path, int to) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0) _exit(127);
  dup2(file, to);
  close(file);
}

}  // namespace

int run_child(const std::vector<std::string>& words, const std::string& folder,
              const std::string& output, const std::string& errors) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  std::fflush(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) return 127;
  if (child == 0) {
    end_with(parent);
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
    if (chdir(folder.c_str()) != 0) _exit(127);
    const int nothing = open("/dev/null", O_RDONLY);
    if (nothing >= 0) dup2(nothing, STDIN_FILENO);
    redirect(output, STDOUT_FILENO);
    redirect(errors, STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  return code_of(status);
}

pid_t start_task(const std::function<int()>& task) {
  std::fflush(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0)
    throw ToolError(exit_internal, fmt::format("no process can be made: {}", std::strerror(errno)));
  if (child > 0) {
    setpgid(child, child);
    return child;
  }
  setpgid(0, 0);
  end_with(parent);
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  int code = exit_internal;
  try {
    code = task();
  } catch (const ToolError& error) {
    fmt::print(stderr, "varve study: {}\n", error.what());
    code = error.code();
  } catch (const std::exception& error) {
    fmt::print(stderr, "varve study: {}\n", error.what());
  }
  std::fflush(nullptr);
  _exit(code);
}

void signal_task(pid_t task, int number) { kill(-task, number); }

int poll_task(pid_t task) {
  int status = 0;
  const pid_t ended = waitpid(task, &status, WNOHANG);
  if (ended == task) return code_of(status);
  return ended < 0 && errno == ECHILD ? 128 + SIGKILL : -1;
}

PassSignals::PassSignals() {
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
}
PassSignals::~PassSignals() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

}  // namespace varve::tools
