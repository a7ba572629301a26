// What a study file comes to: its members, one run or fork each, with ids that say what defines
// them.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/scenario.h"
#include "tools/study_file.h"

namespace varve::tools {

using StudyPair = std::pair<std::string, std::string>;

struct StudyMember {
  std::size_t case_index = 0;
  std::vector<StudyPair> varied;  ///< key, canonical value
  std::uint64_t seed = 0;
  std::string id;    ///< 24 hex digits: hash of all that defines the member's bits
  Keep keep = Keep::log;
  bool quick = false;

  /// Resolved; of a fork: the parent's with the changes made.
  core::Scenario scenario;
  std::string text;               ///< of a run: canonical scenario
  std::vector<StudyPair> files;   ///< that the scenario names: name, content

  bool is_fork = false;
  std::optional<std::size_t> parent;  ///< index of the member forked from, or
  std::string parent_path;            ///< a log of its own
  std::vector<StudyPair> changes;     ///< of a fork: key, value as written
  std::string perturb;                ///< of a fork: amplitude; "" none

  /// The value of a varied key, or nullptr.
  const std::string* value_of(const std::string& key) const;
};

struct StudyPlan {
  StudyFile file;
  std::vector<StudyMember> members;  ///< in order of cases, points, seeds
  std::vector<std::string> keys;     ///< that vary in any case, in order of appearance

  const StudyCase& case_of(const StudyMember& member) const {
    return file.cases[member.case_index];
  }
};

/// Resolves every scenario, with its position in the study file where a setting of it is wrong.
/// Adds to `found`; the plan is usable only if that stays empty.
StudyPlan make_plan(StudyFile file, std::vector<Diagnostic>& found);

/// Reads and plans; prints every error and throws Exit{3} where there is one.
StudyPlan load_plan(const std::string& path);

/// Members of --quick and --only CASE,... (patterns; none: all cases), and the parents they need.
/// UsageError for a pattern that no case fits.
std::set<std::size_t> selected_members(const StudyPlan& plan, bool quick,
                                       const std::vector<std::string>& only);

/// "n16 domain.width=0.03 seed 2"
std::string label_of(const StudyPlan& plan, const StudyMember& member);

/// "run", or what the fork comes from: "fork of n16 seed 2 at t=0.3s".
std::string origin_of(const StudyPlan& plan, const StudyMember& member);

/// The value of a key in one spelling ("3 cm" and "0.03 m" are "0.03"); `text` where it is no value
/// of that key.
std::string canonical_value(const std::string& key, const std::string& text);

}  // namespace varve::tools
