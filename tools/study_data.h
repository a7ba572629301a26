// Numbers of a study as the report looks at them: ensembles over seeds, what a key does to a
// measure.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/study_plan.h"
#include "tools/study_store.h"

namespace varve::tools {

/// Rows of all members, those that have ended.
class StudyData {
 public:
  StudyData(const StudyPlan& plan, const StudyStore& store);
  /// From rows that are at hand; as many as there are members.
  StudyData(const StudyPlan& plan, std::vector<std::optional<StudyRow>> rows);

  const StudyPlan& plan() const { return plan_; }
  const std::optional<StudyRow>& row(std::size_t member) const { return rows_[member]; }
  bool ended_well(std::size_t member) const {
    return rows_[member].has_value() && !rows_[member]->failed;
  }
  /// NaN where it is not taken of this member's case, has no value or has not been measured.
  double value(std::size_t member, const StudyMeasure& measure) const;
  /// nullptr likewise.
  const Measured::Samples* curve(std::size_t member, const StudyCurve& curve) const;

 private:
  const StudyPlan& plan_;
  std::vector<std::optional<StudyRow>> rows_;
};

/// Members of one case that differ in nothing but their seed.
struct Ensemble {
  std::size_t case_index = 0;
  std::vector<StudyPair> varied;
  std::vector<std::size_t> members;
  std::string label(const StudyPlan& plan) const;
};
/// Ensembles of the cases in a list, in order of the plan.
std::vector<Ensemble> ensembles_of(const StudyPlan& plan, const CaseList& cases);

/// Mean and standard deviation (0 of fewer than two) of the values that there are.
struct EnsembleValue {
  double mean = 0, deviation = 0;
  std::size_t count = 0;
  double least = 0, greatest = 0;
};
std::optional<EnsembleValue> value_of(const StudyData& data, const Ensemble& ensemble,
                                      const StudyMeasure& measure);

/// The number that a varied key has in a member, or any key of its scenario; NaN where it is none.
double key_number(const StudyMember& member, const std::string& key);

/// What one key of a case does to one measure, other varied keys held.
struct Sensitivity {
  std::size_t case_index = 0;
  std::string key;
  std::size_t members = 0;
  bool numeric = false;          ///< else only `effect` and `spread` mean something
  double slope = 0, half_width = 0;  ///< of a straight line, 95 % (Student t); NaN: no interval
  double elasticity = 0;         ///< slope times mean key over mean measure; NaN: no slope
  double effect = 0;             ///< slope times range; of words: range of the means
  double spread = 0;             ///< over seeds, pooled over points; NaN: no seeds
  std::size_t rank = 0;          ///< by |elasticity| among the numeric keys of all cases, from 1
  bool below_noise() const { return effect <= 2 * spread; }
};
/// Of one measure over all cases that vary anything; the keys that contact damping and the domain's
/// width go by come first.
std::vector<Sensitivity> sensitivities_of(const StudyData& data, const StudyMeasure& measure);

/// A straight line through points in groups, each group with a height of its own: what is left of
/// x and y once the groups' means are taken away. Nothing where x does not vary within groups.
struct GroupedFit {
  double slope = 0, half_width = 0;  ///< NaN: fewer than one degree of freedom
  std::size_t points = 0;
};
std::optional<GroupedFit> grouped_fit(std::span<const double> x, std::span<const double> y,
                                      std::span<const std::size_t> group);

}  // namespace varve::tools
