// Comparing two inputs, each a run or a digest file, from opening them to the report.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/frame_diff.h"
#include "tools/diff_report.h"

namespace varve::tools {

struct DiffOptions {
  std::optional<std::string> from, to;  ///< steps as in tools/steps.h, read by the first log
  std::vector<std::string> fields;  ///< names or populations; empty: all
  io::Tolerances tolerances;
  bool reconverge = false;  ///< look at all later digests
  bool all_tables = false;  ///< compare event tables of every step, not only near the difference
  bool fine_growth = false;
};

/// Compares. Throws LogError where an input is missing or damaged, UsageError for options that do
/// not fit the inputs. Warnings about torn logs go to standard error.
DiffReport compare_inputs(const std::string& path_a, const std::string& path_b,
                          const DiffOptions& options);

/// Compares two open logs.
DiffReport compare_logs(const io::LogReader& a, const io::LogReader& b, const DiffOptions& options);

/// Compares a run with a digest file; the report's a is the run.
DiffReport compare_with_digests(const io::LogReader& run, const DigestFile& file,
                                const DiffOptions& options);

/// Throws LogError(damaged) if damage is known of.
void require_whole(const io::LogReader& log);

/// Opens a log for comparison; a damaged one is an error, a torn one a warning.
std::unique_ptr<io::LogReader> open_whole(const std::string& path);

}  // namespace varve::tools
