// What the tables of `varve analyze` are made with, and the themes they come in.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/analysis.h"

namespace varve::tools {

using TableRow = std::vector<std::string>;
using EmitRow = std::function<void(TableRow)>;

/// Shortest decimal that reads back as the same bits.
std::string cell(double value);
std::string cell(std::uint64_t value);
std::string cell(std::int64_t value);

/// Step and time.
TableRow row_beginning(const ObservedStep& now);
std::size_t dimension_of(const core::Scenario& scenario);
/// Appends "<before>x<unit>", "<before>y<unit>" and in 3D "<before>z<unit>".
void add_axes(TableRow& row, const core::Scenario& scenario, const std::string& before,
              const std::string& unit);
void add_values(TableRow& row, const double* values, std::size_t count);
void add_values(TableRow& row, const std::vector<double>& values);
/// Grain, row and column, as `grain_columns()` names them.
void add_grain(TableRow& row, const core::Scenario& scenario, std::uint64_t id);
TableRow grain_columns();

/// Themes, each in a file of its own; observables() puts them together.
std::vector<Observable> grain_tables();
std::vector<Observable> contact_tables();
std::vector<Observable> force_tables();
std::vector<Observable> fluid_tables();

}  // namespace varve::tools
