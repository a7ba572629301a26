// What two runs were told and what ran them: differences that explain, and never decide.
#pragma once

#include <string>
#include <vector>

#include "io/log_reader.h"
#include "tools/diff_report.h"

namespace varve::tools {

/// Parameters, models, embedded files, engine and revision, tier and keyframes, build facts.
std::vector<GenesisDifference> compare_geneses(const io::Genesis& a, const io::Genesis& b);

/// "b is a fork of a at step 600 (contact.damping 0.2 -> 0.25): ...", or "" if the two logs are not
/// known to be related.
std::string describe_relation(const io::Genesis& a, const io::Genesis& b);

}  // namespace varve::tools
