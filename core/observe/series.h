// What can be said of a curve over time: fits, windows, turning points. Pure functions; curves are
// two spans of one length, the first ascending.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace varve::core {

/// Mean, and standard deviation about it (0 for fewer than two values); NaN mean of no values.
struct Spread {
  double mean = 0, deviation = 0;
};
Spread spread_of(std::span<const double> values);

/// Least, quartiles (linear between order statistics) and greatest; all 0 without values.
struct Quartiles {
  double least = 0, lower = 0, median = 0, upper = 0, greatest = 0;
};
Quartiles quartiles_of(std::span<const double> values);

/// Least squares y = intercept + slope x with 95 % intervals from Student's t with n - 2 degrees of
/// freedom; half-widths are 0 for fewer than three points. Nothing for fewer than two points or x
/// all alike.
struct LinearFit {
  double intercept = 0, slope = 0;
  double slope_half_width = 0, intercept_half_width = 0;
  double correlation = 0;
  std::size_t points = 0;
};
std::optional<LinearFit> linear_fit(std::span<const double> x, std::span<const double> y);

/// Sums from which the same fit follows, for more points than one keeps. `origin_x`, `origin_y`:
/// values near all points, so that nothing cancels.
struct FitSums {
  double origin_x = 0, origin_y = 0;
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  void add(double at_x, double at_y);
  /// Of sums with the same origin.
  void add(const FitSums& other);
  /// `independent`: how many of the points are independent of each other, at most n: what the
  /// intervals rest on.
  std::optional<LinearFit> fit(double independent) const;
};

/// Quantiles of any number of positive values from a histogram with 64 bins per octave: within
/// 0.6 %. Values that are not positive are left out.
class RoughQuantiles {
 public:
  void add(double value);
  std::uint64_t count() const { return count_; }
  /// 0 <= part <= 1; 0 without values.
  double at(double part) const;

 private:
  std::map<int, std::uint64_t> bins_;
  std::uint64_t count_ = 0;
};

/// Two-sided 95 % quantile of Student's t with `degrees` >= 1 degrees of freedom: tabulated to 30
/// (Abramowitz and Stegun 1972, table 26.10), beyond by the expansion in 1/degrees (26.7.5).
double student_t95(std::size_t degrees);

/// A stretch of time with what a curve does there.
struct Window {
  double from = 0, to = 0;  ///< times
  double mean = 0, deviation = 0;
  double drift = 0;         ///< change of a straight line through the window, end less start
  bool stationary = false;  ///< |drift| is at most 5 % of |mean|
  std::size_t points = 0;
};
/// The curve between two times, both included. Nothing where no point lies there.
std::optional<Window> window_of(std::span<const double> t, std::span<const double> y, double from,
                                double to);

/// First time at which |y| reaches `part` of |target|, linear between points; nothing if never.
std::optional<double> rise_time(std::span<const double> t, std::span<const double> y,
                                double target, double part);

/// A place where a curve turns, larger or smaller than its neighbours by at least `step` since the
/// last turn: noise below it is no turn.
struct TurningPoint {
  double time = 0, value = 0;
  bool maximum = false;
};
std::vector<TurningPoint> turning_points(std::span<const double> t, std::span<const double> y,
                                         double step);

/// Mean half-difference of successive turns and twice their mean distance in time; nothing for
/// fewer than three turns.
struct Oscillation {
  double amplitude = 0, period = 0;
};
std::optional<Oscillation> oscillation_of(std::span<const TurningPoint> turns);

/// First time from which on |y| stays at or below `limit`; nothing if it is above at the end.
std::optional<double> rest_time(std::span<const double> t, std::span<const double> y,
                                double limit);

}  // namespace varve::core
