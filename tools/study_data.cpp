#include "tools/study_data.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "core/observe/series.h"
#include "core/parameters.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

double number_in(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? value : none;
}

}  // namespace

StudyData::StudyData(const StudyPlan& plan, const StudyStore& store) : plan_(plan) {
  for (const StudyMember& member : plan.members) rows_.push_back(store.read_row(member.id));
}

StudyData::StudyData(const StudyPlan& plan, std::vector<std::optional<StudyRow>> rows)
    : plan_(plan), rows_(std::move(rows)) {}

double StudyData::value(std::size_t member, const StudyMeasure& measure) const {
  if (!ended_well(member)) return none;
  if (!measure.cases.contains(plan_.case_of(plan_.members[member]).name)) return none;
  const auto found = rows_[member]->values.find(measure_key(measure.measure));
  return found == rows_[member]->values.end() ? none : found->second;
}

const Measured::Samples* StudyData::curve(std::size_t member, const StudyCurve& curve) const {
  if (!ended_well(member)) return nullptr;
  if (!curve.cases.contains(plan_.case_of(plan_.members[member]).name)) return nullptr;
  const auto found = rows_[member]->curves.find(curve_key(curve.curve));
  return found == rows_[member]->curves.end() ? nullptr : &found->second;
}

std::string Ensemble::label(const StudyPlan& plan) const {
  std::string text = plan.file.cases[case_index].name;
  for (const auto& [key, value] : varied) text += fmt::format(" {}={}", key, value);
  return text;
}

std::vector<Ensemble> ensembles_of(const StudyPlan& plan, const CaseList& cases) {
  std::vector<Ensemble> ensembles;
  for (std::size_t i = 0; i < plan.members.size(); ++i) {
    const StudyMember& member = plan.members[i];
    if (!cases.contains(plan.case_of(member).name)) continue;
    if (ensembles.empty() || ensembles.back().case_index != member.case_index ||
        ensembles.back().varied != member.varied)
      ensembles.push_back({member.case_index, member.varied, {}});
    ensembles.back().members.push_back(i);
  }
  return ensembles;
}

std::optional<EnsembleValue> value_of(const StudyData& data, const Ensemble& ensemble,
                                      const StudyMeasure& measure) {
  std::vector<double> values;
  for (const std::size_t member : ensemble.members)
    if (const double value = data.value(member, measure); !std::isnan(value))
      values.push_back(value);
  if (values.empty()) return std::nullopt;
  const core::Spread spread = core::spread_of(values);
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  return EnsembleValue{spread.mean, spread.deviation, values.size(), *least, *most};
}

double key_number(const StudyMember& member, const std::string& key) {
  if (const std::string* value = member.value_of(key)) return number_in(*value);
  const core::Parameter* parameter = core::find_parameter(key);
  return parameter ? number_in(core::get_parameter(member.scenario, *parameter)) : none;
}

std::optional<GroupedFit> grouped_fit(std::span<const double> x, std::span<const double> y,
                                      std::span<const std::size_t> group) {
  struct Sums {
    double x = 0, y = 0, count = 0;
  };
  std::map<std::size_t, Sums> groups;
  for (std::size_t i = 0; i < x.size(); ++i) {
    Sums& sums = groups[group[i]];
    sums.x += x[i];
    sums.y += y[i];
    sums.count += 1;
  }
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Sums& sums = groups[group[i]];
    const double a = x[i] - sums.x / sums.count, b = y[i] - sums.y / sums.count;
    xx += a * a;
    xy += a * b;
    yy += b * b;
  }
  if (!(xx > 0)) return std::nullopt;
  GroupedFit fit;
  fit.points = x.size();
  fit.slope = xy / xx;
  fit.half_width = none;
  if (x.size() > groups.size() + 1) {
    const std::size_t degrees = x.size() - groups.size() - 1;
    const double residual = std::max(0.0, yy - fit.slope * xy) / static_cast<double>(degrees);
    fit.half_width = core::student_t95(degrees) * std::sqrt(residual / xx);
  }
  return fit;
}

namespace {

/// One member's place in a sensitivity: the key, the measure, and which others it is held with.
struct Sample {
  double x = 0, y = 0;
  std::string word;       ///< the key's value as text
  std::size_t group = 0;  ///< of equal other keys
};

/// Standard deviation within points, pooled over them.
double pooled_spread(const std::map<std::pair<std::size_t, std::string>, std::vector<double>>& y) {
  double squares = 0, degrees = 0;
  for (const auto& [point, values] : y) {
    const core::Spread spread = core::spread_of(values);
    squares += spread.deviation * spread.deviation * static_cast<double>(values.size() - 1);
    degrees += static_cast<double>(values.size() - 1);
  }
  return degrees > 0 ? std::sqrt(squares / degrees) : none;
}

std::optional<Sensitivity> sensitivity_of(const std::vector<Sample>& samples) {
  std::map<std::pair<std::size_t, std::string>, std::vector<double>> points;
  std::vector<double> x, y;
  std::vector<std::size_t> group;
  bool numeric = true;
  for (const Sample& each : samples) {
    points[{each.group, each.word}].push_back(each.y);
    x.push_back(each.x);
    y.push_back(each.y);
    group.push_back(each.group);
    numeric = numeric && !std::isnan(each.x);
  }
  Sensitivity result;
  result.members = samples.size();
  result.numeric = numeric;
  result.spread = pooled_spread(points);
  if (numeric) {
    const auto fit = grouped_fit(x, y, group);
    if (!fit) return std::nullopt;
    const auto [least, most] = std::minmax_element(x.begin(), x.end());
    const double mean_x = core::spread_of(x).mean, mean_y = core::spread_of(y).mean;
    result.slope = fit->slope;
    result.half_width = fit->half_width;
    result.effect = std::abs(fit->slope) * (*most - *least);
    result.elasticity = mean_y == 0 || fit->slope == 0 ? none : fit->slope * mean_x / mean_y;
    return result;
  }
  std::map<std::string, std::vector<double>> by_word;
  for (const Sample& each : samples) by_word[each.word].push_back(each.y);
  if (by_word.size() < 2) return std::nullopt;
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const auto& [word, values] : by_word) {
    const double mean = core::spread_of(values).mean;
    least = std::min(least, mean);
    most = std::max(most, mean);
  }
  result.effect = most - least;
  result.slope = result.half_width = result.elasticity = none;
  return result;
}

/// Keys that change together count as one.
std::string key_of(const StudyVaried& varied) {
  return fmt::format("{}", fmt::join(varied.keys, " & "));
}

std::vector<Sample> samples_of(const StudyData& data, std::size_t case_index,
                               const StudyVaried& varied, const StudyMeasure& measure) {
  std::vector<Sample> samples;
  std::map<std::vector<StudyPair>, std::size_t> groups;
  const StudyPlan& plan = data.plan();
  for (std::size_t i = 0; i < plan.members.size(); ++i) {
    const StudyMember& member = plan.members[i];
    if (member.case_index != case_index) continue;
    Sample sample;
    sample.y = data.value(i, measure);
    if (std::isnan(sample.y)) continue;
    std::vector<StudyPair> others;
    for (const auto& [key, value] : member.varied) {
      if (std::find(varied.keys.begin(), varied.keys.end(), key) == varied.keys.end())
        others.emplace_back(key, value);
      else
        sample.word += (sample.word.empty() ? "" : " & ") + value;
    }
    sample.x = varied.keys.size() == 1 ? key_number(member, varied.keys[0]) : none;
    sample.group = groups.emplace(others, groups.size()).first->second;
    samples.push_back(std::move(sample));
  }
  return samples;
}

int importance(const std::string& key) {
  if (key == "contact.damping") return 0;
  return key == "domain.width" ? 1 : 2;
}

}  // namespace

std::vector<Sensitivity> sensitivities_of(const StudyData& data, const StudyMeasure& measure) {
  std::vector<Sensitivity> all;
  const std::vector<StudyCase>& cases = data.plan().file.cases;
  for (std::size_t c = 0; c < cases.size(); ++c)
    for (const StudyVaried& varied : cases[c].varied) {
      auto found = sensitivity_of(samples_of(data, c, varied, measure));
      if (!found) continue;
      found->case_index = c;
      found->key = key_of(varied);
      all.push_back(std::move(*found));
    }
  std::vector<Sensitivity*> ranked;
  for (Sensitivity& each : all)
    if (each.numeric && !std::isnan(each.elasticity)) ranked.push_back(&each);
  std::stable_sort(ranked.begin(), ranked.end(), [](const Sensitivity* a, const Sensitivity* b) {
    return std::abs(a->elasticity) > std::abs(b->elasticity);
  });
  for (std::size_t i = 0; i < ranked.size(); ++i) ranked[i]->rank = i + 1;
  std::stable_sort(all.begin(), all.end(), [](const Sensitivity& a, const Sensitivity& b) {
    if (importance(a.key) != importance(b.key)) return importance(a.key) < importance(b.key);
    // Keys without a rank (words) last.
    return a.rank - 1 < b.rank - 1;
  });
  return all;
}

}  // namespace varve::tools
