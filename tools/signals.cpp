#include "tools/signals.h"

#include <array>
#include <atomic>
#include <csignal>

namespace varve::tools {

namespace {

std::atomic<int> received_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "read and written in a signal handler");

constexpr std::array<int, 2> caught{SIGINT, SIGTERM};
std::array<struct sigaction, 2> previous;

// Only async-signal-safe calls. The second signal is raised again under its default action, so that
// the parent process sees what ended this one.
extern "C" void on_stop_signal(int number) {
  if (received_signal.exchange(number) == 0) return;
  std::signal(number, SIG_DFL);
  std::raise(number);
}

}  // namespace

StopSignals::StopSignals() {
  received_signal = 0;
  struct sigaction action = {};
  action.sa_handler = on_stop_signal;
  action.sa_flags = SA_RESTART;  // writes of the log go on
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < caught.size(); ++i) sigaction(caught[i], &action, &previous[i]);
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < caught.size(); ++i) sigaction(caught[i], &previous[i], nullptr);
}

int StopSignals::received() const { return received_signal; }

}  // namespace varve::tools
