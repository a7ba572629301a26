// Reductions: what the functions of a measure make of a table's column.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "tools/expression.h"

namespace varve::tools {

/// Rows of a table in the order of the log: times ascending, several rows may share one.
struct Rows {
  std::vector<double> time, value;  ///< [s]
};

std::span<const FunctionRule> reductions();
/// The rule of a reduction by its name, or nullptr.
const FunctionRule* reduction_rule(std::string_view name);

/// Value of a reduction, NaN where the rows give none. `arguments` are those behind the rows, as
/// many as the rule allows; rows whose value is NaN are passed over.
double reduce_rows(std::string_view name, const Rows& rows, std::span<const double> arguments);

/// Linear between rows; NaN before the first and behind the last.
double value_at(const Rows& rows, double time);

}  // namespace varve::tools
