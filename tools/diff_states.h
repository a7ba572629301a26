// Looking into the states of two logs: at the first differing step, along the way, and after it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/log_reader.h"
#include "tools/diff_report.h"

namespace varve::tools {

/// Two logs whose states can be compared: which field is which, and what is accepted.
struct StatePair {
  const io::LogReader* a;
  const io::LogReader* b;
  io::SchemaMatch match;  ///< reduced to the fields asked for
  io::Tolerances tolerances;

  io::FrameDifference compare(const io::FrameView& x, const io::FrameView& y) const;
  /// Nothing where one side stores no state of this step.
  std::optional<io::FrameDifference> at(std::uint64_t step) const;
};

/// True if the log stores the state of `step`, not only its digest.
bool stores_state(const io::LogReader& log, std::uint64_t step);

/// Why neither can name a field: "a stores no state of this step (tier digests)".
std::string why_no_state(const io::LogReader& a, const io::LogReader& b, std::uint64_t step);

/// Keeps the pairs of the named fields or populations. Throws UsageError naming what there is.
io::SchemaMatch select_fields(const io::Schema& schema, io::SchemaMatch match,
                              const std::vector<std::string>& names);

/// What a walk over states found.
struct StateScan {
  std::uint64_t compared = 0;  ///< steps whose states were looked at
  std::uint64_t without_state = 0;
  std::optional<std::uint64_t> first_unequal, first_beyond;
};

/// Compares the states of every step of [from, to] that both logs store, one after the other;
/// stops at the first one beyond tolerance.
StateScan scan_states(const StatePair& pair, std::uint64_t from, std::uint64_t to);

/// Differences at the first step, 1, 10, 100, ... steps later (`fine`: also 2, 5, 20, 50, ...) and
/// at the last one; where a state is not stored, at the nearest earlier one that both store.
std::vector<GrowthSample> sample_growth(const StatePair& pair, std::uint64_t first,
                                        std::uint64_t last, bool fine);

/// Steps in (first, last] at which the state digests are equal.
Reconvergence find_reconvergence(const io::LogReader& a, const io::LogReader& b,
                                 std::uint64_t first, std::uint64_t last);

/// Sentences on event tables and events that differ; `step`: where the tables are compared.
std::vector<std::string> compare_tables(const io::LogReader& a, const io::LogReader& b,
                                        std::uint64_t step);
std::vector<std::string> compare_events(const io::LogReader& a, const io::LogReader& b,
                                        std::uint64_t from, std::uint64_t to);

}  // namespace varve::tools
