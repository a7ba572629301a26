// Study files: which runs and forks, what is measured of them, what is claimed (the format:
// tools/study_format.txt). This part reads and checks the text; study_plan.h makes runs of it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/measure.h"
#include "tools/scenario_file.h"

namespace varve::tools {

/// Where something stands in a study file.
struct StudyPlace {
  std::string source;
  int line = 0, key_column = 0, value_column = 0;
};
Diagnostic at_value(const StudyPlace& place, const std::string& text);
Diagnostic at_key(const StudyPlace& place, const std::string& text);

enum class Keep { none, digests, log };
std::string_view name_of(Keep keep);

struct StudySetting {
  std::string key, value;
  StudyPlace place;
};

/// Keys that take several values, together where there are several keys.
struct StudyVaried {
  std::vector<std::string> keys;
  std::vector<std::vector<std::string>> points;  ///< one value per key
  StudyPlace place;
};

struct StudyCase {
  std::string name, title;
  std::string folder;  ///< of the file that it stands in
  std::string scenario;
  std::string parent, at;
  StudyPlace place, scenario_place, parent_place, at_place;
  std::vector<StudySetting> settings;
  std::vector<StudyVaried> varied;
  std::vector<std::uint64_t> seeds;  ///< none: one member with the scenario's own
  std::size_t quick_seeds = 0;  ///< so many of them with --quick
  Keep keep = Keep::log;
  std::optional<std::string> perturb;    ///< as written
  std::optional<double> ramp_time;       ///< [s]
  std::string outside, anchor;           ///< "": not given
  std::optional<std::string> until, steps;
  StudyPlace length_place;
  std::optional<Measure> stop_when;
  double check_every = 0, until_max = 0;  ///< [s]
  bool quick = false;
};

/// A comparison such as "> 50".
struct StudyLimit {
  bool greater = true;
  double value = 0;
  bool holds(double number) const { return greater ? number > value : number < value; }
  std::string text() const;
};

/// Names of cases, each may end with '*'.
struct CaseList {
  std::vector<std::string> patterns;  ///< none: all
  StudyPlace place;
  bool contains(std::string_view name) const;
};

struct StudyMeasure {
  Measure measure;
  std::string unit, title;
  CaseList cases;
  bool quality = false;
  std::optional<StudyLimit> flag;
  StudyPlace place;
};

struct StudyCurve {
  Curve curve;
  std::string unit, title;
  CaseList cases;
  StudyPlace place;
};

struct StudyFigure {
  std::string id, title, x, note;
  CaseList cases;
  std::vector<std::string> measures, curves;
  StudyPlace place, measures_place, curves_place, x_place;
};

enum class ClaimKind { value, direction, self_contradictory, not_testable };
std::string_view name_of(ClaimKind kind);

struct StudyClaim {
  std::string id, figure, text, study_value, contradicts, note;
  ClaimKind kind = ClaimKind::value;
  bool kind_given = false;
  std::string value_text;
  std::optional<Expression> value;
  std::optional<std::pair<double, double>> range;  ///< expected = A .. B
  std::optional<StudyLimit> limit;                 ///< expected = > A
  bool expects_true = false;
  std::string expected_text;
  std::optional<StudyLimit> direction;
  StudyPlace place, value_place, figure_place, expected_place;
};

struct StudyCompare {
  std::string name, title, of, with;
  std::vector<std::string> measures, curves;
  StudyPlace place, of_place, with_place, measures_place, curves_place;
};

struct StudyFile {
  std::string path, name, title;  ///< name: of the file, without folder and ending
  std::vector<StudyCase> cases;
  std::vector<StudyMeasure> measures;
  std::vector<StudyCurve> curves;
  std::vector<StudyFigure> figures;
  std::vector<StudyClaim> claims;
  std::vector<StudyCompare> compares;

  const StudyCase* find_case(std::string_view name) const;
  const StudyMeasure* find_measure(std::string_view name) const;
  const StudyCurve* find_curve(std::string_view name) const;
};

/// Reads a file and those that it includes. Everything wrong with them is added to `found`; the
/// result is usable only where nothing is. Throws UsageError where the file can't be read.
StudyFile read_study(const std::string& path, std::vector<Diagnostic>& found);

/// Prints what was found, in order, and throws Exit{3} if there is anything.
void refuse_if_any(std::vector<Diagnostic> found);

}  // namespace varve::tools
