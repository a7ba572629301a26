#include "tools/measure_reduce.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "core/observe/series.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Arguments count the rows: S, or S and a window, and what stands between.
constexpr std::array<FunctionRule, 18> rules = {{
    {"mean", 1, 3},        {"min", 1, 3},         {"max", 1, 3},        {"sd", 1, 3},
    {"sum", 1, 3},         {"count", 1, 3},       {"median", 1, 3},     {"first", 1, 3},
    {"last", 1, 3},        {"quantile", 2, 4},    {"slope", 1, 3},      {"integral", 1, 3},
    {"at", 2, 2},          {"time_of_max", 1, 3}, {"time_of_min", 1, 3}, {"first_time", 1, 3},
    {"last_time", 1, 3},   {"fraction", 1, 3},
}};

double total(const std::vector<double>& values) {
  double sum = 0;
  for (const double each : values) sum += each;
  return sum;
}

double quantile(std::vector<double> values, double part) {
  if (values.empty() || !(part >= 0 && part <= 1)) return none;
  std::sort(values.begin(), values.end());
  const double place = part * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  if (below + 1 >= values.size()) return values.back();
  return values[below] + (place - static_cast<double>(below)) * (values[below + 1] - values[below]);
}

double integral(const Rows& rows) {
  if (rows.time.size() < 2) return none;
  double sum = 0;
  for (std::size_t i = 1; i < rows.time.size(); ++i)
    sum += 0.5 * (rows.value[i] + rows.value[i - 1]) * (rows.time[i] - rows.time[i - 1]);
  return sum;
}

double slope(const Rows& rows) {
  const auto fit = core::linear_fit(rows.time, rows.value);
  return fit ? fit->slope : none;
}

double time_of(const Rows& rows, bool greatest) {
  if (rows.value.empty()) return none;
  const auto [least, most] = std::minmax_element(rows.value.begin(), rows.value.end());
  return rows.time[static_cast<std::size_t>(
      (greatest ? std::find(rows.value.begin(), rows.value.end(), *most) : least) -
      rows.value.begin())];
}

double first_time(const Rows& rows) {
  for (std::size_t i = 0; i < rows.time.size(); ++i)
    if (rows.value[i] != 0) return rows.time[i];
  return none;
}

double last_time(const Rows& rows) {
  for (std::size_t i = rows.time.size(); i > 0; --i)
    if (rows.value[i - 1] != 0) return rows.time[i - 1];
  return none;
}

double fraction(const Rows& rows) {
  if (rows.value.empty()) return none;
  const auto held = std::count_if(rows.value.begin(), rows.value.end(),
                                  [](double each) { return each != 0; });
  return static_cast<double>(held) / static_cast<double>(rows.value.size());
}

/// Reductions that take rows alone.
const std::map<std::string_view, std::function<double(const Rows&)>>& plain() {
  const auto spread = [](const Rows& rows) { return core::spread_of(rows.value); };
  static const std::map<std::string_view, std::function<double(const Rows&)>> all{
      {"mean", [=](const Rows& r) { return spread(r).mean; }},
      {"sd", [=](const Rows& r) { return r.value.empty() ? none : spread(r).deviation; }},
      {"min", [](const Rows& r) {
         return r.value.empty() ? none : *std::min_element(r.value.begin(), r.value.end());
       }},
      {"max", [](const Rows& r) {
         return r.value.empty() ? none : *std::max_element(r.value.begin(), r.value.end());
       }},
      {"sum", [](const Rows& r) { return total(r.value); }},
      {"count", [](const Rows& r) { return static_cast<double>(r.value.size()); }},
      {"median", [](const Rows& r) { return quantile(r.value, 0.5); }},
      {"first", [](const Rows& r) { return r.value.empty() ? none : r.value.front(); }},
      {"last", [](const Rows& r) { return r.value.empty() ? none : r.value.back(); }},
      {"slope", slope},
      {"integral", integral},
      {"time_of_max", [](const Rows& r) { return time_of(r, true); }},
      {"time_of_min", [](const Rows& r) { return time_of(r, false); }},
      {"first_time", first_time},
      {"last_time", last_time},
      {"fraction", fraction},
  };
  return all;
}

}  // namespace

std::span<const FunctionRule> reductions() { return rules; }

const FunctionRule* reduction_rule(std::string_view name) {
  for (const FunctionRule& each : rules)
    if (each.name == name) return &each;
  return nullptr;
}

double value_at(const Rows& rows, double time) {
  const auto after = std::lower_bound(rows.time.begin(), rows.time.end(), time);
  if (after == rows.time.end()) return none;
  const auto i = static_cast<std::size_t>(after - rows.time.begin());
  if (rows.time[i] == time) return rows.value[i];
  if (i == 0) return none;
  const double part = (time - rows.time[i - 1]) / (rows.time[i] - rows.time[i - 1]);
  return rows.value[i - 1] + part * (rows.value[i] - rows.value[i - 1]);
}

double reduce_rows(std::string_view name, const Rows& rows, std::span<const double> arguments) {
  const std::size_t own = name == "quantile" || name == "at" ? 1 : 0;
  for (const double each : arguments)
    if (std::isnan(each)) return none;
  // A window of times, both included; one bound alone is the first.
  const double infinite = std::numeric_limits<double>::infinity();
  const double from = arguments.size() > own ? arguments[own] : -infinite;
  const double to = arguments.size() > own + 1 ? arguments[own + 1] : infinite;
  Rows taken;
  for (std::size_t i = 0; i < rows.time.size(); ++i) {
    if (std::isnan(rows.value[i]) || !(rows.time[i] >= from && rows.time[i] <= to)) continue;
    taken.time.push_back(rows.time[i]);
    taken.value.push_back(rows.value[i]);
  }
  if (name == "at") return value_at(taken, arguments[0]);
  if (name == "quantile") return quantile(std::move(taken.value), arguments[0]);
  return plain().at(name)(taken);
}

}  // namespace varve::tools
