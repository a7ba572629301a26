#include "tools/measure.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/observe/series.h"
#include "core/parameters.h"
#include "tools/analysis.h"
#include "tools/analysis_json.h"
#include "tools/cli.h"
#include "tools/measure_reduce.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

using Json = nlohmann::ordered_json;
using Scalars = std::map<std::string, double>;

/// Every number of a JSON object by its path; flags are 0 or 1, null has no value.
void flatten(const Json& value, const std::string& path, Scalars& scalars) {
  const auto inner = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (value.is_object()) {
    for (const auto& [key, item] : value.items()) flatten(item, inner(key), scalars);
  } else if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i)
      flatten(value[i], inner(std::to_string(i)), scalars);
  } else if (value.is_number()) {
    scalars[path] = value.get<double>();
  } else if (value.is_boolean()) {
    scalars[path] = value.get<bool>() ? 1 : 0;
  } else if (value.is_null()) {
    scalars[path] = none;
  } else if (value.is_string()) {
    double number = 0;
    const std::string text = value.get<std::string>();
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error == std::errc{} && end == text.data() + text.size()) scalars[path] = number;
  }
}

bool is_inside(const std::string& name, const std::string& parent) {
  return name.size() > parent.size() && name.starts_with(parent) && name[parent.size()] == '.';
}

/// A scalar by its path. What lies inside a part of the summary that this run has not has no value.
std::optional<double> find_scalar(const Scalars& scalars, const std::string& name) {
  if (const auto found = scalars.find(name); found != scalars.end()) return found->second;
  for (const auto& [path, value] : scalars)
    if (std::isnan(value) && is_inside(name, path)) return none;
  return std::nullopt;
}

// ---- names -------------------------------------------------------------------------------------

struct ColumnName {
  std::string table, column;
};
/// "settling.mean_vy_m_s": parts of a table's name, nothing where there is no such table.
std::optional<ColumnName> column_name(const std::string& name) {
  const std::size_t dot = name.find('.');
  if (dot == std::string::npos) return std::nullopt;
  const std::string table = name.substr(0, dot);
  for (const Observable& each : observables())
    if (each.name == table) return ColumnName{table, name.substr(dot + 1)};
  return std::nullopt;
}

/// Columns that a table can have: in 2D, in 3D, with and without spin.
std::vector<std::string> possible_columns(const Observable& table) {
  std::vector<std::string> all;
  for (const int dimension : {2, 3}) {
    core::Scenario scenario;
    scenario.domain.dimension = dimension;
    scenario.contact.rotation = true;
    for (std::string& each : table.columns(scenario))
      if (std::find(all.begin(), all.end(), each) == all.end()) all.push_back(std::move(each));
  }
  return all;
}

/// Whether a reference names a column that some run has; a number of the summary may have the same
/// first word.
bool is_column(const Expression& node) {
  const auto name = node.kind == Expression::Kind::reference ? column_name(node.name)
                                                             : std::nullopt;
  if (!name) return false;
  const std::vector<std::string> columns = possible_columns(find_observable(name->table));
  return std::find(columns.begin(), columns.end(), name->column) != columns.end();
}

/// Paths of the summary, as far as they do not depend on the run.
const Scalars& known_scalars() {
  static const Scalars all = [] {
    AnalysisSummary sample;
    sample.settling.emplace();
    sample.oscillation.emplace();
    Scalars scalars;
    flatten(summary_json("", sample), "", scalars);
    return scalars;
  }();
  return all;
}

std::string suggestion(std::string_view name, const std::vector<std::string_view>& names) {
  const std::string_view nearest = nearest_name(name, names);
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
}

[[noreturn]] void refuse_name(const Expression& node) {
  std::vector<std::string> columns;
  for (const Observable& table : observables())
    for (const std::string& column : possible_columns(table))
      columns.push_back(table.name + "." + column);
  std::vector<std::string_view> names(columns.begin(), columns.end());
  for (const auto& [path, value] : known_scalars()) names.push_back(path);
  throw ExpressionError(node.column, fmt::format("unknown name '{}'{}", node.name,
                                                 suggestion(node.name, names)));
}

void check_column(const Expression& node, const ColumnName& name) {
  const std::vector<std::string> columns = possible_columns(find_observable(name.table));
  const std::vector<std::string_view> names(columns.begin(), columns.end());
  const auto check = [&](const std::string& column) {
    if (std::find(columns.begin(), columns.end(), column) == columns.end())
      throw ExpressionError(node.column, fmt::format("table '{}' has no column '{}'{}", name.table,
                                                     column, suggestion(column, names)));
  };
  check(name.column);
  for (const Filter& filter : node.filters) check(filter.key);
  if (!node.word.empty())
    throw ExpressionError(node.column,
                          fmt::format("expected KEY=VALUE in brackets, got '{}'", node.word));
}

void check_call(const Expression& node, bool in_rows);

void check_key(const Expression& node) {
  if (node.arguments.size() != 1 || node.arguments[0].kind != Expression::Kind::reference)
    throw ExpressionError(node.column, "key: expected one key of the scenario");
  const std::string& key = node.arguments[0].name;
  if (core::find_parameter(key)) return;
  const std::string_view near = core::nearest_key(key);
  throw ExpressionError(
      node.arguments[0].column,
      fmt::format("unknown key '{}'{}", key,
                  near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
}

/// `in_rows`: inside a reduction's first argument, where columns may stand.
void check_names(const Expression& node, bool in_rows) {
  if (node.kind == Expression::Kind::reference) {
    const auto column = column_name(node.name);
    if (in_rows && is_column(node)) return check_column(node, *column);
    if (find_scalar(known_scalars(), node.name) && node.filters.empty() && node.word.empty())
      return;
    if (in_rows && column) return check_column(node, *column);
    if (is_column(node))
      throw ExpressionError(
          node.column, fmt::format("'{}' is a column; expected it in mean(...), max(...) or the "
                                   "like", node.name));
    refuse_name(node);
  }
  if (node.kind == Expression::Kind::call && node.name == "key") return check_key(node);
  if (node.kind == Expression::Kind::call) return check_call(node, in_rows);
  for (const Expression& each : node.arguments) check_names(each, in_rows);
}

std::string argument_counts(const FunctionRule& rule) {
  if (rule.arguments_min == rule.arguments_max) return std::to_string(rule.arguments_min);
  if (rule.arguments_max == std::numeric_limits<std::size_t>::max())
    return fmt::format("at least {}", rule.arguments_min);
  return fmt::format("{} to {}", rule.arguments_min, rule.arguments_max);
}

void check_call(const Expression& node, bool in_rows) {
  const FunctionRule* rule = reduction_rule(node.name);
  const auto rules = arithmetic_functions();
  const auto found = std::find_if(rules.begin(), rules.end(),
                                  [&](const FunctionRule& each) { return each.name == node.name; });
  if (!rule && found != rules.end()) rule = &*found;
  if (!rule) {
    std::vector<std::string_view> names{"key"};
    for (const FunctionRule& each : reductions()) names.push_back(each.name);
    for (const FunctionRule& each : rules) names.push_back(each.name);
    throw ExpressionError(node.column, fmt::format("unknown function '{}'{}", node.name,
                                                   suggestion(node.name, names)));
  }
  const std::size_t count = node.arguments.size();
  if (count < rule->arguments_min || count > rule->arguments_max)
    throw ExpressionError(node.column,
                          fmt::format("{}: expected {} arguments, got {}", node.name,
                                      argument_counts(*rule), count));
  const bool reduces = reduction_rule(node.name) != nullptr;
  if (reduces && in_rows)
    throw ExpressionError(node.column, fmt::format("'{}' inside another reduction", node.name));
  for (std::size_t i = 0; i < count; ++i)
    check_names(node.arguments[i], reduces ? i == 0 : in_rows);
}

/// Columns in the rows of one reduction; there must be one, and of one table.
void check_rows(const Expression& rows) {
  std::string table;
  for_each_node(rows, [&](const Expression& node) {
    if (!is_column(node)) return;
    const auto name = column_name(node.name);
    if (!table.empty() && table != name->table)
      throw ExpressionError(node.column, fmt::format("rows of '{}' and of '{}' in one expression",
                                                     table, name->table));
    table = name->table;
  });
  if (table.empty())
    throw ExpressionError(rows.column,
                          "expected TABLE.COLUMN; varve analyze RUN --list names them");
}

Expression checked(std::string_view text, bool is_rows) {
  Expression expression = parse_expression(text);
  check_names(expression, is_rows);
  if (is_rows) {
    check_rows(expression);
  } else {
    for_each_node(expression, [](const Expression& node) {
      if (node.kind == Expression::Kind::call && reduction_rule(node.name))
        check_rows(node.arguments.at(0));
    });
  }
  return expression;
}

// ---- evaluation --------------------------------------------------------------------------------

std::optional<double> number_in(const std::string& cell) {
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || end != cell.data() + cell.size()) return std::nullopt;
  return value;
}

/// One column under one choice of filters, as it is read.
struct Series {
  const Observable* table = nullptr;
  std::string column;
  std::vector<Filter> filters;
  std::size_t node_column = 1;
  std::vector<double> time, value;

  void take_header(const std::vector<std::string>& names) {
    const auto place = [&](const std::string& name) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end())
        throw ExpressionError(node_column, fmt::format("this run's table '{}' has no column '{}'",
                                                       table->name, name));
      return static_cast<std::size_t>(found - names.begin());
    };
    time_place_ = place("time_s");
    value_place_ = place(column);
    for (const Filter& filter : filters) {
      filter_places_.push_back(place(filter.key));
      filter_numbers_.push_back(number_in(filter.value));
    }
  }
  void take_row(const std::vector<std::string>& cells) {
    for (std::size_t i = 0; i < filters.size(); ++i) {
      const std::string& cell = cells[filter_places_[i]];
      if (cell == filters[i].value) continue;
      if (!filter_numbers_[i] || number_in(cell) != filter_numbers_[i]) return;
    }
    const auto number = number_in(cells[value_place_]);
    if (!number)
      throw ExpressionError(node_column, fmt::format("'{}.{}' holds '{}', which is no number",
                                                     table->name, column, cells[value_place_]));
    time.push_back(number_in(cells[time_place_]).value_or(none));
    value.push_back(*number);
  }

 private:
  std::size_t time_place_ = 0, value_place_ = 0;
  std::vector<std::size_t> filter_places_;
  std::vector<std::optional<double>> filter_numbers_;
};

/// What is read in one walk: all with one stride and the same points.
class WalkGroup {
 public:
  void add(const Expression& expression) {
    for_each_node(expression, [&](const Expression& node) {
      if (!is_column(node)) return;
      const auto name = column_name(node.name);
      Series& series = series_[text_of(node)];
      series.table = &find_observable(name->table);
      series.column = name->column;
      series.filters = node.filters;
      series.node_column = node.column;
    });
  }

  void walk(const io::LogReader& log, const core::Scenario& scenario, std::uint64_t every,
            const std::vector<double>& points) {
    AnalysisRequest request;
    request.range = {log.first_step(), log.last_step(), every};
    request.points = points;
    std::map<const Observable*, std::vector<Series*>> by_table;
    for (auto& [text, series] : series_) by_table[series.table].push_back(&series);
    for (const Observable& table : observables())
      if (by_table.count(&table) > 0) request.tables.push_back(&table);
    std::map<const Observable*, bool> begun;
    const AnalysisSummary summary = analyze(
        log, scenario, request, [&](const Observable& table, const std::vector<std::string>& row) {
          const bool header = !std::exchange(begun[&table], true);
          for (Series* series : by_table[&table])
            header ? series->take_header(row) : series->take_row(row);
        });
    flatten(summary_json("", summary), "", scalars_);
  }

  /// Values of `rows`, an expression over columns, row by row.
  Rows rows(const Expression& rows, const core::Scenario& scenario) const {
    std::vector<const Series*> used;
    std::map<std::string, std::size_t> places;
    for_each_node(rows, [&](const Expression& node) {
      const auto found = series_.find(text_of(node));
      if (found == series_.end() || !places.emplace(found->first, used.size()).second) return;
      used.push_back(&found->second);
    });
    Rows result;
    for (const Series* series : used)
      if (series->time != used.front()->time)
        throw ExpressionError(rows.column, fmt::format("'{}' and '{}' have rows at other times",
                                                       used.front()->column, series->column));
    result.time = used.front()->time;
    if (rows.kind == Expression::Kind::reference) {
      result.value = used.front()->value;
      return result;
    }
    std::map<const Expression*, const Series*> by_node;
    for_each_node(rows, [&](const Expression& node) {
      if (const auto found = places.find(text_of(node)); found != places.end())
        by_node[&node] = used[found->second];
    });
    std::size_t row = 0;
    const NodeValue value_of = [&](const Expression& node) -> std::optional<double> {
      if (const auto found = by_node.find(&node); found != by_node.end())
        return found->second->value[row];
      return scalar(node, scenario);
    };
    for (; row < result.time.size(); ++row) result.value.push_back(evaluate(rows, value_of));
    return result;
  }

  double value(const Expression& expression, const core::Scenario& scenario) const {
    const NodeValue value_of = [&](const Expression& node) -> std::optional<double> {
      if (node.kind != Expression::Kind::call || !reduction_rule(node.name))
        return scalar(node, scenario);
      std::vector<double> arguments;
      for (std::size_t i = 1; i < node.arguments.size(); ++i)
        arguments.push_back(evaluate(node.arguments[i], value_of_copy(scenario)));
      return reduce_rows(node.name, rows(node.arguments.at(0), scenario), arguments);
    };
    return evaluate(expression, value_of);
  }

 private:
  /// Arguments behind the rows may hold reductions themselves.
  NodeValue value_of_copy(const core::Scenario& scenario) const {
    return [this, &scenario](const Expression& node) -> std::optional<double> {
      if (node.kind == Expression::Kind::call && reduction_rule(node.name))
        return value(node, scenario);
      return scalar(node, scenario);
    };
  }

  std::optional<double> scalar(const Expression& node, const core::Scenario& scenario) const {
    if (node.kind == Expression::Kind::call) {
      if (node.name != "key") return std::nullopt;
      const core::Parameter* parameter = core::find_parameter(node.arguments.at(0).name);
      const std::string text = core::get_parameter(scenario, *parameter);
      return number_in(text).value_or(text == "on" ? 1 : text == "off" ? 0 : none);
    }
    return find_scalar(scalars_, node.name);
  }

  std::map<std::string, Series> series_;
  Scalars scalars_;
};

/// Evenly spaced samples, linear between rows.
Measured::Samples samples_of(const Curve& curve, const Rows& rows) {
  Measured::Samples samples;
  if (rows.time.empty() || curve.points == 0) return samples;
  const double from = std::isnan(curve.from) ? rows.time.front() : curve.from;
  const double to = std::isnan(curve.to) ? rows.time.back() : curve.to;
  for (std::size_t k = 0; k < curve.points; ++k) {
    const double part =
        curve.points < 2 ? 0 : static_cast<double>(k) / static_cast<double>(curve.points - 1);
    const double time = k + 1 == curve.points && k > 0 ? to : from + part * (to - from);
    const double value = value_at(rows, time);
    if (std::isnan(value)) continue;
    samples.time.push_back(time);
    samples.value.push_back(value);
  }
  return samples;
}

}  // namespace

Measure make_measure(std::string name, std::string_view text) {
  Measure measure;
  measure.name = std::move(name);
  measure.expression = checked(text, false);
  return measure;
}

Curve make_curve(std::string name, std::string_view text) {
  Curve curve;
  curve.name = std::move(name);
  curve.expression = checked(text, true);
  curve.from = curve.to = none;
  return curve;
}

void check_point(const Expression& expression, std::span<const double> at_point) {
  for_each_node(expression, [&](const Expression& node) {
    if (!is_column(node) || !at_point.empty()) return;
    const auto name = column_name(node.name);
    if (find_observable(name->table).points)
      throw ExpressionError(node.column,
                            fmt::format("table '{}' needs at_point = X, Y", name->table));
  });
}

Measured evaluate_measures(const io::LogReader& log, const core::Scenario& scenario,
                           std::span<const Measure> measures, std::span<const Curve> curves) {
  using Key = std::pair<std::uint64_t, std::vector<double>>;
  std::map<Key, WalkGroup> groups;
  for (const Measure& each : measures) groups[{each.every, each.at_point}].add(each.expression);
  for (const Curve& each : curves) groups[{each.every, each.at_point}].add(each.expression);
  for (auto& [key, group] : groups) group.walk(log, scenario, key.first, key.second);
  Measured measured;
  for (const Measure& each : measures)
    measured.values.push_back(
        groups.at({each.every, each.at_point}).value(each.expression, scenario));
  for (const Curve& each : curves)
    measured.curves.push_back(samples_of(
        each, groups.at({each.every, each.at_point}).rows(each.expression, scenario)));
  return measured;
}

}  // namespace varve::tools
