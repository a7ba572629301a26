// SIGINT and SIGTERM as a wish to stop: the first finishes the step and closes the log, a second
// ends the process at once.
#pragma once

namespace varve::tools {

/// Catches SIGINT and SIGTERM while it lives (at most one at a time).
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Number of the signal that came, 0 if none did.
  int received() const;
};

}  // namespace varve::tools
