// One member of a study from whatever is there of it to its row: run or forked, resumed where it
// was interrupted, measured.
#pragma once

#include "tools/study_plan.h"
#include "tools/study_store.h"

namespace varve::tools {

/// Returns 0 (there is a row of a member that ended well), 6 (a row of one that failed), 75 (it was
/// stopped or killed and can be resumed) or 74 (output could not be written; resumable).
int execute_member(const StudyPlan& plan, const StudyStore& store, const StudyMember& member,
                   unsigned threads);

}  // namespace varve::tools
