// Gates: the engine held against published numbers and closed forms. A case builds its scene in
// code, runs the engine without a log, and returns rows: what was expected, what came out, how far
// off it may be. Files validate_*.cpp hold one group of cases each.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace varve::tools {

enum class Verdict {
  pass,
  fail,
  missed,    ///< outside the tolerance for a reason that is known and stated; no failure
  reported,  ///< no gate
};
std::string_view name_of(Verdict verdict);

/// "No gate": a row that is reported only.
inline constexpr double no_gate = std::numeric_limits<double>::quiet_NaN();

/// One number of ours beside the one it is held against.
struct ValidationRow {
  std::string quantity;
  std::string unit;  ///< SI, "" for pure numbers
  double reference = 0, ours = 0;
  double tolerance = no_gate;  ///< largest |deviation| that passes
  double scale = 0;            ///< what the deviation is a part of; 0: the reference
  std::string scale_name;      ///< "" for the reference; else "u_max", "absolute", ...
  std::string note;
  std::string excuse = {};  ///< why the gate may be missed; printed where it is

  /// (ours - reference) / scale; NaN where ours is.
  double deviation() const;
  Verdict verdict() const;
};

/// Held against a reference that is not 0; the deviation is relative to it.
ValidationRow relative_row(std::string quantity, std::string unit, double reference, double ours,
                           double tolerance, std::string note = "");
/// The deviation is a part of `scale`, which has a name ("lid speed").
ValidationRow scaled_row(std::string quantity, std::string unit, double reference, double ours,
                         double scale, std::string scale_name, double tolerance,
                         std::string note = "");
/// The deviation is the difference itself.
ValidationRow absolute_row(std::string quantity, std::string unit, double reference, double ours,
                           double tolerance, std::string note = "");

enum class CaseKind {
  fast,         ///< runs by default; all of them within a minute
  slow,         ///< runs with --all
  restitution,  ///< runs with --restitution or --all
  convergence,  ///< runs with --convergence or --all
};

struct ValidationCase {
  std::string name;    ///< "poiseuille"
  std::string gate;    ///< "T4"; "-" where there is none
  CaseKind kind = CaseKind::fast;
  std::string title;   ///< one line
  std::string source;  ///< of the reference values
  std::vector<ValidationRow> (*run)() = nullptr;
};

/// Every case, in the order of the gates.
const std::vector<ValidationCase>& validation_cases();

struct CaseResult {
  const ValidationCase* test = nullptr;
  std::vector<ValidationRow> rows;
  double seconds = 0;  ///< CPU time of the thread

  /// fail if a row fails or there is none; else missed if one is; else pass if one passes.
  Verdict verdict() const;
};

/// Runs a case. A guard of the engine that stops it, or a scene that it refuses, becomes a row that
/// fails and says why.
CaseResult run_case(const ValidationCase& test);

/// Cases by name or gate, as given, in the order of validation_cases(). UsageError if one names
/// nothing.
std::vector<const ValidationCase*> chosen_cases(const std::vector<std::string>& only);

std::string text_of(const CaseResult& result);
std::string json_of(const std::vector<CaseResult>& results);

void add_law_cases(std::vector<ValidationCase>& cases);
void add_balance_cases(std::vector<ValidationCase>& cases);
void add_flow_cases(std::vector<ValidationCase>& cases);
void add_surface_cases(std::vector<ValidationCase>& cases);
void add_sphere_cases(std::vector<ValidationCase>& cases);
void add_disturbance_cases(std::vector<ValidationCase>& cases);
void add_swarm_cases(std::vector<ValidationCase>& cases);
void add_disc_cases(std::vector<ValidationCase>& cases);
void add_contact_cases(std::vector<ValidationCase>& cases);
void add_restitution_cases(std::vector<ValidationCase>& cases);
void add_convergence_cases(std::vector<ValidationCase>& cases);

}  // namespace varve::tools
