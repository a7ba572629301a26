// Rows, verdicts, and how they are printed.
#include <cmath>
#include <ctime>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/cli.h"
#include "tools/validate.h"

namespace varve::tools {
namespace {

using nlohmann::ordered_json;

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string deviation_text(const ValidationRow& row) {
  const double deviation = row.deviation();
  if (!std::isfinite(deviation)) return "-";
  if (row.scale_name == "absolute") return fmt::format("{:+.1e}", deviation);
  return fmt::format("{:+.2f} %", 100 * deviation);
}

std::string tolerance_text(const ValidationRow& row) {
  if (std::isnan(row.tolerance)) return "-";
  if (row.scale_name == "absolute") return fmt::format("{:.1e}", row.tolerance);
  return fmt::format("{:g} %{}", 100 * row.tolerance,
                     row.scale_name.empty() ? "" : " of " + row.scale_name);
}

ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

std::string_view name_of(CaseKind kind) {
  switch (kind) {
    case CaseKind::fast: return "fast";
    case CaseKind::slow: return "slow";
    case CaseKind::restitution: return "restitution";
    case CaseKind::convergence: return "convergence";
  }
  return "";
}

}  // namespace

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::pass: return "pass";
    case Verdict::fail: return "FAIL";
    case Verdict::missed: return "missed";
    case Verdict::reported: return "reported";
  }
  return "";
}

double ValidationRow::deviation() const {
  return (ours - reference) / (scale == 0 ? reference : scale);
}

Verdict ValidationRow::verdict() const {
  const double size = std::abs(deviation());
  if (std::isnan(tolerance)) return Verdict::reported;
  if (size <= tolerance) return Verdict::pass;
  // Not a number excuses nothing.
  return excuse.empty() || std::isnan(size) ? Verdict::fail : Verdict::missed;
}

ValidationRow relative_row(std::string quantity, std::string unit, double reference, double ours,
                           double tolerance, std::string note) {
  return {std::move(quantity), std::move(unit), reference, ours, tolerance, 0, "",
          std::move(note), ""};
}

ValidationRow scaled_row(std::string quantity, std::string unit, double reference, double ours,
                         double scale, std::string scale_name, double tolerance,
                         std::string note) {
  return {std::move(quantity), std::move(unit),       reference,       ours, tolerance, scale,
          std::move(scale_name), std::move(note),   ""};
}

ValidationRow absolute_row(std::string quantity, std::string unit, double reference, double ours,
                           double tolerance, std::string note) {
  return scaled_row(std::move(quantity), std::move(unit), reference, ours, 1, "absolute",
                    tolerance, std::move(note));
}

Verdict CaseResult::verdict() const {
  Verdict result = rows.empty() ? Verdict::fail : Verdict::reported;
  for (const ValidationRow& row : rows) {
    if (row.verdict() == Verdict::fail) return Verdict::fail;
    if (row.verdict() == Verdict::missed) result = Verdict::missed;
    if (row.verdict() == Verdict::pass && result == Verdict::reported) result = Verdict::pass;
  }
  return result;
}

const std::vector<ValidationCase>& validation_cases() {
  static const std::vector<ValidationCase> all = [] {
    std::vector<ValidationCase> cases;
    add_law_cases(cases);
    add_balance_cases(cases);
    add_flow_cases(cases);
    add_surface_cases(cases);
    add_sphere_cases(cases);
    add_disturbance_cases(cases);
    add_swarm_cases(cases);
    add_disc_cases(cases);
    add_contact_cases(cases);
    add_restitution_cases(cases);
    add_convergence_cases(cases);
    return cases;
  }();
  return all;
}

CaseResult run_case(const ValidationCase& test) {
  CaseResult result;
  result.test = &test;
  const double start = thread_seconds();
  try {
    result.rows = test.run();
  } catch (const std::exception& error) {
    result.rows.push_back(relative_row("the run", "", 1, no_gate, 0, error.what()));
  }
  result.seconds = thread_seconds() - start;
  return result;
}

std::vector<const ValidationCase*> chosen_cases(const std::vector<std::string>& only) {
  for (const std::string& name : only) {
    bool known = false;
    std::vector<std::string_view> names;
    for (const ValidationCase& test : validation_cases()) {
      known = known || test.name == name || test.gate == name;
      names.push_back(test.name);
    }
    if (known) continue;
    const std::string_view nearest = nearest_name(name, names);
    throw UsageError(fmt::format(
        "--only: expected a case or a gate, got '{}'{}", name,
        nearest.empty() ? "; varve validate --list names them"
                        : fmt::format("; did you mean '{}'?", nearest)));
  }
  std::vector<const ValidationCase*> chosen;
  for (const ValidationCase& test : validation_cases())
    for (const std::string& name : only)
      if (test.name == name || test.gate == name) {
        chosen.push_back(&test);
        break;
      }
  return chosen;
}

std::string text_of(const CaseResult& result) {
  const ValidationCase& test = *result.test;
  std::string text = fmt::format("{:<4} {}: {}  ({}, {:.1f} s)\n     held against {}\n", test.gate,
                                 test.name, test.title, name_of(result.verdict()), result.seconds,
                                 test.source);
  for (const ValidationRow& row : result.rows) {
    const std::string unit = row.unit.empty() ? "" : " " + row.unit;
    text += fmt::format("     {:<44} {:>12.6g} {:>12.6g}{:<6} {:>10}  {:<18} {}\n", row.quantity,
                        row.reference, row.ours, unit, deviation_text(row), tolerance_text(row),
                        name_of(row.verdict()));
    if (!row.note.empty()) text += fmt::format("       {}\n", row.note);
    if (row.verdict() == Verdict::missed) text += fmt::format("       {}\n", row.excuse);
  }
  return text;
}

std::string json_of(const std::vector<CaseResult>& results) {
  ordered_json object;
  object["schema"] = "varve-validate-1";
  bool failed = false;
  object["cases"] = ordered_json::array();
  for (const CaseResult& result : results) {
    failed = failed || result.verdict() == Verdict::fail;
    ordered_json test{{"name", result.test->name},
                      {"gate", result.test->gate},
                      {"kind", name_of(result.test->kind)},
                      {"title", result.test->title},
                      {"source", result.test->source},
                      {"verdict", name_of(result.verdict())},
                      {"cpu_s", result.seconds},
                      {"rows", ordered_json::array()}};
    for (const ValidationRow& row : result.rows) {
      ordered_json line{{"quantity", row.quantity},
                        {"unit", row.unit},
                        {"reference", number(row.reference)},
                        {"ours", number(row.ours)},
                        {"deviation", number(row.deviation())},
                        {"tolerance", number(row.tolerance)},
                        {"of", row.scale_name.empty() ? "reference" : row.scale_name},
                        {"verdict", name_of(row.verdict())}};
      if (!row.note.empty()) line["note"] = row.note;
      if (row.verdict() == Verdict::missed) line["excuse"] = row.excuse;
      test["rows"].push_back(line);
    }
    object["cases"].push_back(test);
  }
  object["verdict"] = failed ? "fail" : "pass";
  return object.dump(2) + "\n";
}

}  // namespace varve::tools
