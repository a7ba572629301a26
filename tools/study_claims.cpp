#include "tools/study_claims.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>

#include "core/observe/series.h"
#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/study_reader.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Functions of one reference, and of a reference and what it is drawn over.
constexpr std::string_view aggregates[] = {"mean", "sd", "min", "max", "median", "count"};
constexpr std::string_view relations[] = {"slope", "elasticity", "correlation", "monotone"};

bool is_aggregate(std::string_view name) {
  return std::find(std::begin(aggregates), std::end(aggregates), name) != std::end(aggregates);
}
bool is_relation(std::string_view name) {
  return std::find(std::begin(relations), std::end(relations), name) != std::end(relations);
}

/// Values of an expression over the members that a filter lets through.
class Evaluation {
 public:
  Evaluation(const StudyData& data, std::optional<std::uint64_t> seed) : data_(data), seed_(seed) {}

  double value(const Expression& expression) {
    return evaluate(expression, [this](const Expression& node) { return special(node); });
  }
  /// A reference had no member that has ended.
  bool lacks() const { return lacks_; }

 private:
  struct Drawn {
    std::vector<std::size_t> members;
    std::vector<double> values;
  };

  std::vector<std::size_t> members_of(const Expression& node) const {
    const StudyPlan& plan = data_.plan();
    std::vector<std::size_t> members;
    std::map<std::size_t, std::set<std::uint64_t>> seeds;
    for (const StudyMember& member : plan.members) seeds[member.case_index].insert(member.seed);
    for (std::size_t i = 0; i < plan.members.size(); ++i) {
      const StudyMember& member = plan.members[i];
      if (!fits_pattern(plan.case_of(member).name, node.word)) continue;
      const bool fits = std::all_of(
          node.filters.begin(), node.filters.end(), [&](const Filter& filter) {
            const std::string* value = member.value_of(filter.key);
            return value && *value == canonical_value(filter.key, filter.value);
          });
      const bool in_seed =
          !seed_ || member.seed == *seed_ || seeds.at(member.case_index).size() == 1;
      if (fits && in_seed) members.push_back(i);
    }
    return members;
  }

  Drawn draw(const Expression& node) {
    Drawn drawn;
    const StudyMeasure* measure = data_.plan().file.find_measure(node.name);
    if (!measure) throw ExpressionError(node.column, fmt::format("no measure '{}'", node.name));
    bool ended = false;
    for (const std::size_t member : members_of(node)) {
      ended = ended || data_.ended_well(member);
      const double value = data_.value(member, *measure);
      if (std::isnan(value)) continue;
      drawn.members.push_back(member);
      drawn.values.push_back(value);
    }
    lacks_ = lacks_ || !ended;
    return drawn;
  }

  std::optional<double> special(const Expression& node) {
    if (node.kind == Expression::Kind::reference) return aggregate("mean", draw(node).values);
    if (is_aggregate(node.name)) return aggregate(node.name, draw(node.arguments.at(0)).values);
    if (is_relation(node.name)) return relation(node);
    return std::nullopt;
  }

  static double aggregate(std::string_view name, std::vector<double> values) {
    if (name == "count") return static_cast<double>(values.size());
    if (values.empty()) return none;
    if (name == "mean") return core::spread_of(values).mean;
    if (name == "sd") return values.size() < 2 ? none : core::spread_of(values).deviation;
    if (name == "min") return *std::min_element(values.begin(), values.end());
    if (name == "max") return *std::max_element(values.begin(), values.end());
    return core::quartiles_of(values).median;
  }

  double relation(const Expression& node) {
    const Drawn y = draw(node.arguments.at(0));
    const Expression& over = node.arguments.at(1);
    std::map<std::size_t, double> x_of;
    if (over.word.empty()) {
      for (const std::size_t member : y.members)
        x_of[member] = key_number(data_.plan().members[member], over.name);
    } else {
      const Drawn x = draw(over);
      for (std::size_t i = 0; i < x.members.size(); ++i) x_of[x.members[i]] = x.values[i];
    }
    std::vector<double> xs, ys;
    for (std::size_t i = 0; i < y.members.size(); ++i) {
      const auto found = x_of.find(y.members[i]);
      if (found == x_of.end() || std::isnan(found->second)) continue;
      xs.push_back(found->second);
      ys.push_back(y.values[i]);
    }
    if (node.name == "monotone") return monotone(xs, ys);
    const auto fit = core::linear_fit(xs, ys);
    if (!fit) return none;
    if (node.name == "slope") return fit->slope;
    if (node.name == "correlation") return fit->correlation;
    const double mean_y = core::spread_of(ys).mean;
    return mean_y == 0 ? none : fit->slope * core::spread_of(xs).mean / mean_y;
  }

  static double monotone(const std::vector<double>& xs, const std::vector<double>& ys) {
    std::map<double, std::vector<double>> points;
    for (std::size_t i = 0; i < xs.size(); ++i) points[xs[i]].push_back(ys[i]);
    if (points.size() < 2) return none;
    bool rising = true, falling = true;
    std::optional<double> before;
    for (const auto& [x, values] : points) {
      const double mean = core::spread_of(values).mean;
      if (before) {
        rising = rising && mean > *before;
        falling = falling && mean < *before;
      }
      before = mean;
    }
    return rising ? 1 : falling ? -1 : 0;
  }

  const StudyData& data_;
  std::optional<std::uint64_t> seed_;
  bool lacks_ = false;
};

/// Seeds that every referenced case with several seeds has.
std::vector<std::uint64_t> common_seeds(const StudyData& data, const Expression& expression) {
  const StudyPlan& plan = data.plan();
  std::map<std::size_t, std::set<std::uint64_t>> by_case;
  for_each_node(expression, [&](const Expression& node) {
    if (node.kind != Expression::Kind::reference || node.word.empty()) return;
    for (const StudyMember& member : plan.members)
      if (fits_pattern(plan.case_of(member).name, node.word))
        by_case[member.case_index].insert(member.seed);
  });
  std::optional<std::set<std::uint64_t>> common;
  for (const auto& [index, seeds] : by_case) {
    if (seeds.size() < 2) continue;
    if (!common) {
      common = seeds;
    } else {
      std::set<std::uint64_t> both;
      std::set_intersection(common->begin(), common->end(), seeds.begin(), seeds.end(),
                            std::inserter(both, both.begin()));
      common = std::move(both);
    }
  }
  if (!common) return {};
  return {common->begin(), common->end()};
}

Verdict verdict_of(const StudyClaim& claim, const ClaimResult& result) {
  const bool judged_by_seed = result.seeds >= 2;
  const auto margin = [&](const StudyLimit& limit) {
    return limit.greater ? result.ours - limit.value : limit.value - result.ours;
  };
  const auto beyond_noise = [&](const StudyLimit& limit) {
    return margin(limit) > (judged_by_seed ? 2 * result.spread : 0);
  };
  if (claim.expects_true) {
    if (judged_by_seed)
      return result.holding == result.seeds ? Verdict::reproduced : Verdict::not_reproduced;
    return result.ours != 0 ? Verdict::reproduced : Verdict::not_reproduced;
  }
  if (claim.range) {
    if (result.ours >= claim.range->first && result.ours <= claim.range->second)
      return Verdict::reproduced;
    return claim.direction && beyond_noise(*claim.direction) ? Verdict::direction_only
                                                             : Verdict::not_reproduced;
  }
  if (!claim.limit) return Verdict::not_testable;
  if (beyond_noise(*claim.limit)) return Verdict::reproduced;
  return std::abs(margin(*claim.limit)) <= 2 * result.spread ? Verdict::below_noise
                                                             : Verdict::not_reproduced;
}

}  // namespace

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::reproduced: return "reproduced";
    case Verdict::direction_only: return "direction only";
    case Verdict::below_noise: return "below noise";
    case Verdict::not_reproduced: return "not reproduced";
    case Verdict::contradicts_itself: return "the study contradicts itself";
    case Verdict::not_testable: return "not testable";
    case Verdict::not_run: return "not run";
  }
  return "not run";
}

ClaimResult judge(const StudyData& data, const StudyClaim& claim) {
  ClaimResult result;
  result.ours = result.spread = none;
  bool lacks = false;
  if (claim.value) {
    Evaluation all(data, std::nullopt);
    result.ours = all.value(*claim.value);
    lacks = all.lacks();
    std::vector<double> values;
    for (const std::uint64_t seed : common_seeds(data, *claim.value)) {
      Evaluation one(data, seed);
      const double value = one.value(*claim.value);
      if (!std::isnan(value) && !one.lacks()) values.push_back(value);
    }
    result.seeds = values.size();
    result.holding = static_cast<std::size_t>(
        std::count_if(values.begin(), values.end(), [](double each) { return each != 0; }));
    if (values.size() >= 2) result.spread = core::spread_of(values).deviation;
  }
  if (claim.kind == ClaimKind::not_testable)
    result.verdict = Verdict::not_testable;
  else if (claim.kind == ClaimKind::self_contradictory)
    result.verdict = Verdict::contradicts_itself;
  else if (lacks)
    result.verdict = Verdict::not_run;
  else if (std::isnan(result.ours))
    result.verdict = Verdict::not_reproduced;  // what should happen never did
  else
    result.verdict = verdict_of(claim, result);
  return result;
}

void check_claim(const Expression& node) {
  if (node.kind == Expression::Kind::reference) {
    if (node.word.empty())
      throw ExpressionError(node.column, fmt::format("'{}'; expected MEASURE[CASE]", node.name));
    return;
  }
  if (node.kind == Expression::Kind::call && (is_aggregate(node.name) || is_relation(node.name))) {
    const std::size_t expected = is_relation(node.name) ? 2 : 1;
    if (node.arguments.size() != expected)
      throw ExpressionError(node.column, fmt::format("{}: expected {} argument{}", node.name,
                                                     expected, expected == 1 ? "" : "s"));
    for (const Expression& each : node.arguments)
      if (each.kind != Expression::Kind::reference)
        throw ExpressionError(each.column, fmt::format("{}: expected MEASURE[CASE]", node.name));
    check_claim(node.arguments[0]);
    const Expression& last = node.arguments.back();
    if (last.word.empty() && !core::find_parameter(last.name)) {
      const std::string_view near = core::nearest_key(last.name);
      throw ExpressionError(
          last.column, fmt::format("'{}' is no key of a scenario; expected one, or MEASURE[CASE]{}",
                                   last.name,
                                   near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
    }
    return;
  }
  if (node.kind == Expression::Kind::call) {
    std::vector<std::string_view> names(std::begin(aggregates), std::end(aggregates));
    names.insert(names.end(), std::begin(relations), std::end(relations));
    for (const FunctionRule& rule : arithmetic_functions()) names.push_back(rule.name);
    if (std::find(names.begin(), names.end(), node.name) == names.end()) {
      const std::string_view near = nearest_name(node.name, names);
      throw ExpressionError(node.column,
                            fmt::format("unknown function '{}'{}", node.name,
                                        near.empty() ? ""
                                                     : fmt::format("; did you mean '{}'?", near)));
    }
  }
  for (const Expression& each : node.arguments) check_claim(each);
}

}  // namespace varve::tools
