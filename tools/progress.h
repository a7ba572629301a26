// Where a run stands: a bar on a terminal, plain lines elsewhere, JSON lines on request. All of it
// goes to stderr.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "tools/cli.h"

namespace varve::tools {

/// What is known of a run while it goes on.
struct ProgressPoint {
  std::uint64_t step = 0;
  double time = 0;              ///< [s] simulated
  double dt = 0;                ///< [s] of the last step; 0 if none was done
  std::uint64_t log_bytes = 0;  ///< 0: not shown
};

/// Where it is to end; either may be missing.
struct ProgressGoal {
  std::optional<std::uint64_t> last_step;
  std::optional<double> until;  ///< [s] simulated
};

/// "3.4 MB": three digits, decimal multiples.
std::string human_bytes(std::uint64_t bytes);
/// "1:02:03", "2:03" or "4 s".
std::string human_duration(double seconds);

class Progress {
 public:
  Progress(const Globals& globals, std::string title, ProgressGoal goal, ProgressPoint start);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Shows `point` if it is time to (10 times a second for a bar, once a second as JSON, every ten
  /// seconds as lines).
  void update(const ProgressPoint& point);
  /// Whether the next update() would show anything; spares the caller from gathering a point.
  bool due() const;
  /// Takes the bar off the terminal.
  void finish();

  ProgressMode mode() const { return mode_; }
  /// Line as shown in mode `lines`, after `wall_s` seconds.
  std::string line(const ProgressPoint& point, double wall_s) const;

 private:
  using Clock = std::chrono::steady_clock;
  std::optional<double> total_steps(const ProgressPoint& point) const;
  void show(const ProgressPoint& point, double wall_s);
  std::string bar(const ProgressPoint& point, double wall_s) const;
  std::string json(const ProgressPoint& point, double wall_s) const;

  ProgressMode mode_;
  std::string title_;
  ProgressGoal goal_;
  ProgressPoint start_;
  Clock::time_point began_, next_;
  bool shown_ = false;
};

}  // namespace varve::tools
