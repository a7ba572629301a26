#include "tools/analysis_tables.h"

#include <iterator>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {

std::string cell(double value) { return fmt::format("{}", value); }
std::string cell(std::uint64_t value) { return fmt::format("{}", value); }
std::string cell(std::int64_t value) { return fmt::format("{}", value); }

TableRow row_beginning(const ObservedStep& now) { return {cell(now.step), cell(now.time)}; }

std::size_t dimension_of(const core::Scenario& scenario) {
  return static_cast<std::size_t>(scenario.domain.dimension);
}

void add_axes(TableRow& row, const core::Scenario& scenario, const std::string& before,
              const std::string& unit) {
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < dimension_of(scenario); ++k) row.push_back(before + axes[k] + unit);
}

void add_values(TableRow& row, const double* values, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) row.push_back(cell(values[k]));
}

void add_values(TableRow& row, const std::vector<double>& values) {
  add_values(row, values.data(), values.size());
}

void add_grain(TableRow& row, const core::Scenario& scenario, std::uint64_t id) {
  const core::GrainLabel label = core::label_of(scenario, id);
  row.push_back(cell(id));
  row.push_back(cell(label.row));
  row.push_back(cell(label.column));
}

TableRow grain_columns() { return {"step", "time_s", "grain", "row", "column"}; }

const std::vector<Observable>& observables() {
  static const std::vector<Observable> all = [] {
    std::vector<Observable> tables;
    for (auto theme : {grain_tables(), contact_tables(), force_tables(), fluid_tables()})
      tables.insert(tables.end(), std::make_move_iterator(theme.begin()),
                    std::make_move_iterator(theme.end()));
    return tables;
  }();
  return all;
}

const Observable& find_observable(const std::string& name) {
  std::vector<std::string_view> names;
  for (const Observable& each : observables()) {
    if (each.name == name) return each;
    names.push_back(each.name);
  }
  const std::string_view nearest = nearest_name(name, names);
  throw UsageError(nearest.empty()
                       ? fmt::format("--observable: '{}' is not known; expected {}", name,
                                     fmt::join(names, ", "))
                       : fmt::format("--observable: '{}' is not known; did you mean '{}'?", name,
                                     nearest));
}

}  // namespace varve::tools
