// What a study says of a claim: its expression over members, the spread over seeds, a verdict.
#pragma once

#include <string>
#include <vector>

#include "tools/study_data.h"

namespace varve::tools {

enum class Verdict {
  reproduced,
  direction_only,
  below_noise,
  not_reproduced,
  contradicts_itself,
  not_testable,
  not_run,
};
std::string_view name_of(Verdict verdict);

struct ClaimResult {
  Verdict verdict = Verdict::not_run;
  double ours = 0;    ///< over all members; NaN: none
  double spread = 0;  ///< standard deviation over seeds; NaN: fewer than two
  std::size_t seeds = 0;    ///< evaluations that the spread is of
  std::size_t holding = 0;  ///< of them those that are true, for `expected = true`
};
ClaimResult judge(const StudyData& data, const StudyClaim& claim);

/// Throws ExpressionError where the expression is none over references to members.
void check_claim(const Expression& expression);

}  // namespace varve::tools
