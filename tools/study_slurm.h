// A study as job arrays of Slurm: scripts to be submitted, nothing is run here.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "tools/study_plan.h"
#include "tools/study_store.h"

namespace varve::tools {

struct SlurmOptions {
  std::string program;  ///< the verb's executable
  unsigned threads = 1;
};

/// Writes FOLDER/slurm/: tasks-G.txt (ids of generation G: runs, then their forks, ...), one
/// array-G-K.sh per thousand of them, collect.sh and submit.sh, which submits all in order. Members
/// that are done are left out. Returns the paths of the scripts, submit.sh last; none where nothing
/// is left to do.
std::vector<std::string> write_slurm_scripts(const StudyPlan& plan, const StudyStore& store,
                                             const std::set<std::size_t>& selection,
                                             const SlurmOptions& options);

}  // namespace varve::tools
