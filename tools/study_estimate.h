// How long a study will take and how much it will store, before it is run: from its members that
// have ended, else from a few steps of one member of each case.
#pragma once

#include <set>
#include <vector>

#include "tools/study_plan.h"
#include "tools/study_store.h"

namespace varve::tools {

struct Estimate {
  std::size_t index = 0;  ///< of the member
  double steps = 0, particles = 0;
  double seconds = 0, bytes = 0;  ///< of this member alone; bytes of its log while it is there
  bool ended = false;             ///< seconds and bytes are what it took
};

/// One per id of the selection. Computes some steps of members where nothing else is known.
std::vector<Estimate> estimate_members(const StudyPlan& plan, const StudyStore& store,
                                       const std::set<std::size_t>& selection);

}  // namespace varve::tools
