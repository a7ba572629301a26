// Measures: one number of a run as an expression over what `varve analyze` gives of its log, the
// numbers of the summary and the columns of the tables. Curves: a column over time. All that are
// asked for together are taken in one walk over the log (one more for every other stride or point).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/scenario.h"
#include "io/log_reader.h"
#include "tools/expression.h"

namespace varve::tools {

struct Measure {
  std::string name;
  Expression expression;
  std::uint64_t every = 1;       ///< tables are read every so many steps
  std::vector<double> at_point;  ///< [m] of the table flow
};

/// A column over time, at `points` times from `from` to `to`, linear between rows.
struct Curve {
  std::string name;
  Expression expression;  ///< over rows of one table
  double from, to;        ///< [s] NaN: the first, the last row
  std::size_t points = 200;
  std::uint64_t every = 1;
  std::vector<double> at_point;
};

struct Measured {
  std::vector<double> values;  ///< in the order of the measures; NaN where there is none
  struct Samples {
    std::vector<double> time, value;  ///< [s]; empty where there is no row
  };
  std::vector<Samples> curves;
};

/// Parses and checks every name, with a suggestion where one is near. The grammar is that of
/// `varve study --help-format`. Throws ExpressionError.
Measure make_measure(std::string name, std::string_view text);
Curve make_curve(std::string name, std::string_view text);
/// Throws ExpressionError where a table that the expression reads needs a point and has none.
void check_point(const Expression& expression, std::span<const double> at_point);

/// Throws LogError, UsageError (no state is stored) and, where a column holds words or a name is
/// not in this run's tables, ExpressionError.
Measured evaluate_measures(const io::LogReader& log, const core::Scenario& scenario,
                           std::span<const Measure> measures, std::span<const Curve> curves = {});

}  // namespace varve::tools
