// Proof that a comparison can fail: differences of one bit, planted into copies of a run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/log_reader.h"

namespace varve::tools {

struct SelfTest {
  std::uint64_t planted = 0;  ///< single bits flipped, one per copy
  std::uint64_t located = 0;  ///< found at exactly their step, field and particle
  std::uint64_t equal_pairs = 0, false_alarms = 0;
  std::vector<std::string> failures;  ///< what was planted and what was found instead
  bool passed() const { return located == planted && false_alarms == 0; }
};

/// Copies windows of `run` (at most `window_steps` steps that it stores states of) to temporary
/// files, flips one bit at a random step, field and particle in each of `plants` copies, and
/// compares. The run itself is only read. Throws UsageError if the run stores too few states.
SelfTest run_self_test(const io::LogReader& run, std::uint64_t plants, std::uint64_t window_steps,
                       std::uint64_t seed);

}  // namespace varve::tools
