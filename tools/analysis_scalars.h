// The numbers of a whole run, by name: collected while the log is walked, with bounded memory.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/observe/series.h"
#include "tools/analysis.h"

namespace varve::tools {

/// Several curves over the same times. When they are full, every second sample goes and from then
/// on every second one is taken.
class CurveSet {
 public:
  CurveSet(std::size_t curves, std::size_t samples_max)
      : samples_max_(samples_max), curves_(curves) {}
  /// False where this sample is not due: `values` need not be worked out then.
  bool due() const { return count_ % every_ == 0; }
  void skip() { ++count_; }
  void take(double time, const std::vector<double>& values);
  const std::vector<double>& time() const { return time_; }
  const std::vector<double>& curve(std::size_t index) const { return curves_[index]; }
  /// Finite values between two times, both included.
  std::vector<double> between(std::size_t index, double from, double to) const;
  std::optional<double> mean(std::size_t index, double from, double to) const;
  std::optional<double> greatest(std::size_t index, double from, double to) const;
  std::optional<double> first(std::size_t index) const;
  std::optional<double> last(std::size_t index, double to) const;

 private:
  void halve();
  std::size_t samples_max_;
  std::uint64_t count_ = 0, every_ = 1;
  std::vector<double> time_;
  std::vector<std::vector<double>> curves_;
};

class ScalarCollector {
 public:
  explicit ScalarCollector(const core::Scenario& scenario);
  /// Contacts of every step.
  void take_step(const ObservedStep& now);
  /// Every state of grains.
  void take_grains(const ObservedStep& now);
  /// Every state decoded whole; `forces` where the engine evaluated it.
  void take_fluid(const ObservedStep& now, bool forces, const core::Counters& clamps);
  /// Window of the terminal speed, from the summary.
  std::vector<Scalar> finish(const AnalysisSummary& summary, double from, double to) const;

 private:
  class Results;
  void finish_contacts(Results& results, const AnalysisSummary& summary) const;
  void finish_grains(Results& results, const AnalysisSummary& summary, double from,
                     double to) const;
  void finish_fits(Results& results, double from, double to) const;
  void finish_fluid(Results& results, double from, double to) const;
  std::vector<double> speeds_against(const ObservedStep& now) const;
  void take_drag(const ObservedStep& now, std::vector<double>& row);

  const core::Scenario& scenario_;
  CurveSet grains_, fluid_;
  core::RoughQuantiles forces_;
  double force_sum_ = 0;
  std::uint64_t force_count_ = 0, collisions_ = 0, wall_collisions_ = 0;
  std::uint64_t falling_collisions_ = 0;  ///< between grains, before the first floor contact
  bool landed_ = false;
  std::optional<double> first_detachment_, first_time_;
  double last_time_ = 0, landing_time_ = 0;
  std::uint64_t floor_hits_ = 0;
  double re_max_ = 0, contact_pressure_max_ = 0, momentum_max_ = 0, speed_max_ = 0;
  std::size_t chain_max_ = 0, grain_count_ = 0;
  std::uint64_t evaluated_ = 0;
  core::Counters clamps_;
  BudgetRow budget_;
};

}  // namespace varve::tools
