#include "core/observe/series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace varve::core {

Spread spread_of(std::span<const double> values) {
  if (values.empty()) return {std::numeric_limits<double>::quiet_NaN(), 0};
  double sum = 0;
  for (const double each : values) sum += each;
  const double mean = sum / static_cast<double>(values.size());
  if (values.size() < 2) return {mean, 0};
  double squares = 0;
  for (const double each : values) squares += (each - mean) * (each - mean);
  return {mean, std::sqrt(squares / static_cast<double>(values.size() - 1))};
}

Quartiles quartiles_of(std::span<const double> values) {
  if (values.empty()) return {};
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&](double part) {
    const double place = part * static_cast<double>(sorted.size() - 1);
    const auto below = static_cast<std::size_t>(place);
    if (below + 1 >= sorted.size()) return sorted.back();
    const double rest = place - static_cast<double>(below);
    return sorted[below] + rest * (sorted[below + 1] - sorted[below]);
  };
  return {sorted.front(), at(0.25), at(0.5), at(0.75), sorted.back()};
}

double student_t95(std::size_t degrees) {
  static constexpr std::array<double, 30> table = {
      12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
      2.201,  2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
      2.080,  2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042};
  if (degrees == 0) return std::numeric_limits<double>::infinity();
  if (degrees <= table.size()) return table[degrees - 1];
  const double z = 1.959964, n = static_cast<double>(degrees), z3 = z * z * z;
  return z + (z3 + z) / (4 * n) + (5 * z3 * z * z + 16 * z3 + 3 * z) / (96 * n * n);
}

std::optional<LinearFit> linear_fit(std::span<const double> x, std::span<const double> y) {
  const std::size_t n = std::min(x.size(), y.size());
  if (n < 2) return std::nullopt;
  const double count = static_cast<double>(n);
  const double mean_x = spread_of(x.first(n)).mean, mean_y = spread_of(y.first(n)).mean;
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double a = x[k] - mean_x, b = y[k] - mean_y;
    xx += a * a;
    xy += a * b;
    yy += b * b;
  }
  if (!(xx > 0)) return std::nullopt;
  LinearFit fit;
  fit.points = n;
  fit.slope = xy / xx;
  fit.intercept = mean_y - fit.slope * mean_x;
  fit.correlation = yy > 0 ? xy / std::sqrt(xx * yy) : 0;
  if (n > 2) {
    const double residual = std::max(0.0, yy - fit.slope * xy) / (count - 2);
    const double t = student_t95(n - 2);
    fit.slope_half_width = t * std::sqrt(residual / xx);
    fit.intercept_half_width = t * std::sqrt(residual * (1 / count + mean_x * mean_x / xx));
  }
  return fit;
}

void FitSums::add(double at_x, double at_y) {
  const double a = at_x - origin_x, b = at_y - origin_y;
  ++n;
  x += a;
  y += b;
  xx += a * a;
  xy += a * b;
  yy += b * b;
}

void FitSums::add(const FitSums& other) {
  n += other.n;
  x += other.x;
  y += other.y;
  xx += other.xx;
  xy += other.xy;
  yy += other.yy;
}

std::optional<LinearFit> FitSums::fit(double independent) const {
  if (n < 2) return std::nullopt;
  const double mean_x = x / n, mean_y = y / n;
  const double sxx = xx - n * mean_x * mean_x, sxy = xy - n * mean_x * mean_y,
               syy = yy - n * mean_y * mean_y;
  // What is left of x alike but for rounding.
  if (!(sxx > 1e-12 * xx)) return std::nullopt;
  LinearFit fit;
  fit.points = static_cast<std::size_t>(n);
  fit.slope = sxy / sxx;
  fit.intercept = origin_y + mean_y - fit.slope * (origin_x + mean_x);
  fit.correlation = syy > 0 ? sxy / std::sqrt(sxx * syy) : 0;
  const double points = std::min(independent, n);
  if (points > 2) {
    // Spreads are those of all points, their number that of the independent ones.
    const double scale = points / n, at = origin_x + mean_x;
    const double residual = std::max(0.0, syy - fit.slope * sxy) * scale / (points - 2);
    const double t = student_t95(static_cast<std::size_t>(points) - 2);
    fit.slope_half_width = t * std::sqrt(residual / (sxx * scale));
    fit.intercept_half_width = t * std::sqrt(residual * (1 / points + at * at / (sxx * scale)));
  }
  return fit;
}

void RoughQuantiles::add(double value) {
  if (!(value > 0) || !std::isfinite(value)) return;
  int exponent = 0;
  const double part = std::frexp(value, &exponent);  // 0.5 <= part < 1
  ++bins_[exponent * 64 + static_cast<int>((2 * part - 1) * 64)];
  ++count_;
}

double RoughQuantiles::at(double part) const {
  const double wanted = part * static_cast<double>(count_);
  std::uint64_t seen = 0;
  for (const auto& [bin, count] : bins_) {
    seen += count;
    if (static_cast<double>(seen) < wanted) continue;
    const int exponent = bin >= 0 ? bin / 64 : -((63 - bin) / 64);
    return std::ldexp(0.5 * (1 + (static_cast<double>(bin - 64 * exponent) + 0.5) / 64), exponent);
  }
  return 0;
}

std::optional<Window> window_of(std::span<const double> t, std::span<const double> y, double from,
                                double to) {
  std::vector<double> times, values;
  for (std::size_t k = 0; k < t.size(); ++k)
    if (t[k] >= from && t[k] <= to) {
      times.push_back(t[k]);
      values.push_back(y[k]);
    }
  if (times.empty()) return std::nullopt;
  Window window;
  const Spread spread = spread_of(values);
  window.from = times.front();
  window.to = times.back();
  window.mean = spread.mean;
  window.deviation = spread.deviation;
  window.points = times.size();
  if (const auto fit = linear_fit(times, values))
    window.drift = fit->slope * (times.back() - times.front());
  window.stationary =
      window.points > 2 && std::abs(window.drift) <= 0.05 * std::abs(window.mean);
  return window;
}

std::optional<double> rise_time(std::span<const double> t, std::span<const double> y,
                                double target, double part) {
  const double level = part * std::abs(target);
  for (std::size_t k = 0; k < t.size(); ++k) {
    const double here = std::abs(y[k]);
    if (here < level) continue;
    if (k == 0) return t[0];
    const double before = std::abs(y[k - 1]);
    return t[k - 1] + (t[k] - t[k - 1]) * (level - before) / (here - before);
  }
  return std::nullopt;
}

std::vector<TurningPoint> turning_points(std::span<const double> t, std::span<const double> y,
                                         double step) {
  std::vector<TurningPoint> turns;
  if (t.size() < 3) return turns;
  // The extremes since the last turn, until one of them is left by `step`.
  std::size_t high = 0, low = 0;
  int rising = 0;  // 1: looking for a maximum, -1: for a minimum, 0: for either
  for (std::size_t k = 1; k < t.size(); ++k) {
    if (y[k] > y[high]) high = k;
    if (y[k] < y[low]) low = k;
    if (rising >= 0 && y[high] - y[k] >= step) {
      if (high > 0) turns.push_back({t[high], y[high], true});
      rising = -1;
      low = k;
      high = k;
    } else if (rising <= 0 && y[k] - y[low] >= step) {
      if (low > 0) turns.push_back({t[low], y[low], false});
      rising = 1;
      low = k;
      high = k;
    }
  }
  return turns;
}

std::optional<Oscillation> oscillation_of(std::span<const TurningPoint> turns) {
  if (turns.size() < 3) return std::nullopt;
  double height = 0;
  for (std::size_t k = 1; k < turns.size(); ++k)
    height += std::abs(turns[k].value - turns[k - 1].value);
  const double intervals = static_cast<double>(turns.size() - 1);
  return Oscillation{0.5 * height / intervals,
                     2 * (turns.back().time - turns.front().time) / intervals};
}

std::optional<double> rest_time(std::span<const double> t, std::span<const double> y,
                                double limit) {
  std::optional<double> since;
  for (std::size_t k = 0; k < t.size(); ++k) {
    if (!(std::abs(y[k]) <= limit))
      since.reset();
    else if (!since)
      since = t[k];
  }
  return since;
}

}  // namespace varve::core
