// Processes of a study: they end with the one that started them, however it ends, so that a killed
// study leaves nobody behind who still writes to its logs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace varve::tools {

/// Runs the program `words[0]` in `folder` with its outputs in two files of that folder; waits.
/// Returns the exit code, 128 + signal, or 127 where it could not be started.
int run_child(const std::vector<std::string>& words, const std::string& folder,
              const std::string& output, const std::string& errors);

/// Runs `task` in a process of its own, at the head of a process group; its return value is the
/// exit code (70 where it throws). Throws ToolError where no process can be made.
pid_t start_task(const std::function<int()>& task);

/// Signal to a task and everything that it started.
void signal_task(pid_t task, int number);

/// Exit code (or 128 + signal) of a task that has ended, -1 while it runs.
int poll_task(pid_t task);

/// While it lives, SIGINT and SIGTERM pass this process by: it waits for a child that they reach
/// too and that closes its log.
class PassSignals {
 public:
  PassSignals();
  ~PassSignals();
  PassSignals(const PassSignals&) = delete;
  PassSignals& operator=(const PassSignals&) = delete;
};

}  // namespace varve::tools
