// Members of a study side by side on this machine.
#pragma once

#include <set>

#include "tools/cli.h"
#include "tools/study_plan.h"
#include "tools/study_store.h"

namespace varve::tools {

struct PoolOptions {
  unsigned jobs = 1;
  unsigned threads = 1;  ///< of each member's engine
  Globals globals;
};

struct PoolResult {
  std::size_t done = 0, failed = 0, skipped = 0;  ///< skipped: were there already
  std::size_t interrupted = 0;  ///< killed or stopped: they can be resumed
  bool stopped = false;        ///< by a signal: nothing more was started
  bool output_failed = false;  ///< disk full or the like
};

/// Executes what the selection lacks, forks after their parents; writes results.csv whenever a
/// member has ended. SIGINT and SIGTERM let every member close its log first, a second one ends
/// them at once.
PoolResult run_members(const StudyPlan& plan, const StudyStore& store,
                       const std::set<std::size_t>& selection, const PoolOptions& options);

}  // namespace varve::tools
