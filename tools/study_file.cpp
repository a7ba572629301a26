#include "tools/study_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include <fmt/format.h>

#include "tools/cli.h"
#include "tools/study_reader.h"
#include "tools/study_values.h"

namespace varve::tools {

Diagnostic at_value(const StudyPlace& place, const std::string& text) {
  return {place.source, place.line, place.value_column, text};
}
Diagnostic at_key(const StudyPlace& place, const std::string& text) {
  return {place.source, place.line, place.key_column, text};
}

std::string_view name_of(Keep keep) {
  return keep == Keep::log ? "log" : keep == Keep::digests ? "digests" : "none";
}

std::string_view name_of(ClaimKind kind) {
  switch (kind) {
    case ClaimKind::value: return "value";
    case ClaimKind::direction: return "direction";
    case ClaimKind::self_contradictory: return "self-contradictory";
    case ClaimKind::not_testable: return "not-testable";
  }
  return "value";
}

std::string StudyLimit::text() const {
  return fmt::format("{} {}", greater ? ">" : "<", core::number_text(value));
}

bool CaseList::contains(std::string_view name) const {
  if (patterns.empty()) return true;
  return std::any_of(patterns.begin(), patterns.end(),
                     [&](const std::string& pattern) { return fits_pattern(name, pattern); });
}

bool fits_pattern(std::string_view name, std::string_view pattern) {
  if (!pattern.ends_with('*')) return name == pattern;
  return name.starts_with(pattern.substr(0, pattern.size() - 1));
}

const StudyCase* StudyFile::find_case(std::string_view wanted) const {
  for (const StudyCase& each : cases)
    if (each.name == wanted) return &each;
  return nullptr;
}
const StudyMeasure* StudyFile::find_measure(std::string_view wanted) const {
  for (const StudyMeasure& each : measures)
    if (each.measure.name == wanted) return &each;
  return nullptr;
}
const StudyCurve* StudyFile::find_curve(std::string_view wanted) const {
  for (const StudyCurve& each : curves)
    if (each.curve.name == wanted) return &each;
  return nullptr;
}

namespace {

/// What names stand for is known once every file has been read.
class CrossCheck {
 public:
  CrossCheck(const StudyFile& study, std::vector<Diagnostic>& found)
      : study_(study), found_(found) {
    for (const StudyCase& each : study.cases) cases_.push_back(each.name);
    for (const StudyMeasure& each : study.measures) measures_.push_back(each.measure.name);
    for (const StudyCurve& each : study.curves) curves_.push_back(each.curve.name);
    for (const StudyFigure& each : study.figures) figures_.push_back(each.id);
  }

  void run() {
    for (const StudyMeasure& each : study_.measures) check_cases(each.cases);
    for (const StudyCurve& each : study_.curves) check_cases(each.cases);
    for (const StudyFigure& each : study_.figures) {
      check_cases(each.cases);
      for (const std::string& name : each.measures)
        expect("measure", name, measures_, each.measures_place);
      for (const std::string& name : each.curves) expect("curve", name, curves_, each.curves_place);
    }
    for (const StudyCompare& each : study_.compares) {
      expect("case", each.of, cases_, each.of_place);
      expect("case", each.with, cases_, each.with_place);
      for (const std::string& name : each.measures)
        expect("measure", name, measures_, each.measures_place);
      for (const std::string& name : each.curves) expect("curve", name, curves_, each.curves_place);
    }
    for (const StudyClaim& each : study_.claims) {
      if (!each.figure.empty()) expect("figure", each.figure, figures_, each.figure_place);
      if (each.value) check_references(each);
    }
  }

 private:
  void expect(const char* what, const std::string& name, const std::vector<std::string_view>& names,
              const StudyPlace& place, std::size_t offset = 0) {
    if (std::find(names.begin(), names.end(), name) != names.end()) return;
    const std::string_view near = nearest_name(name, names);
    Diagnostic diagnostic = at_value(
        place, fmt::format("there is no {} '{}'{}", what, name,
                           near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
    diagnostic.column += static_cast<int>(offset);
    found_.push_back(std::move(diagnostic));
  }

  void check_cases(const CaseList& list) {
    for (const std::string& pattern : list.patterns)
      if (std::none_of(cases_.begin(), cases_.end(),
                       [&](std::string_view name) { return fits_pattern(name, pattern); }))
        expect("case", pattern, cases_, list.place);
  }

  void check_references(const StudyClaim& claim) {
    for_each_node(*claim.value, [&](const Expression& node) {
      if (node.kind != Expression::Kind::reference || node.word.empty()) return;
      expect("measure", node.name, measures_, claim.value_place, node.column - 1);
      if (std::none_of(cases_.begin(), cases_.end(),
                       [&](std::string_view name) { return fits_pattern(name, node.word); }))
        expect("case", node.word, cases_, claim.value_place, node.column - 1);
    });
  }

  const StudyFile& study_;
  std::vector<Diagnostic>& found_;
  std::vector<std::string_view> cases_, measures_, curves_, figures_;
};

std::string read_text(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw UsageError(fmt::format("{}: expected a study file, got a directory", path));
  std::ifstream file(path, std::ios::binary);
  if (!file) throw UsageError(fmt::format("{}: {}", path, std::strerror(errno)));
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// Reads a file, then what it includes; each file once.
void read_into(StudyFile& study, const std::string& path, std::set<std::string>& read,
               std::vector<Diagnostic>& found) {
  std::error_code ignored;
  if (!read.insert(std::filesystem::weakly_canonical(path, ignored).string()).second) return;
  StudyReader reader(study, path, found);
  const std::vector<std::pair<std::string, StudyPlace>> included = reader.take(read_text(path));
  for (const auto& [name, place] : included) {
    const std::string inner = (std::filesystem::path(path).parent_path() / name).string();
    if (!std::filesystem::is_regular_file(inner, ignored))
      found.push_back(at_value(place, fmt::format("study.include: '{}' is no file", inner)));
    else
      read_into(study, inner, read, found);
  }
}

}  // namespace

StudyFile read_study(const std::string& path, std::vector<Diagnostic>& found) {
  StudyFile study;
  study.path = path;
  study.name = std::filesystem::path(path).stem().string();
  std::set<std::string> read;
  read_into(study, path, read, found);
  if (study.cases.empty() && found.empty())
    found.push_back({path, 0, 0, "no case; expected at least one section [case.NAME]"});
  CrossCheck(study, found).run();
  return study;
}

void refuse_if_any(std::vector<Diagnostic> found) {
  if (found.empty()) return;
  std::stable_sort(found.begin(), found.end(), [](const Diagnostic& a, const Diagnostic& b) {
    return a.source == b.source && a.line < b.line;
  });
  constexpr std::size_t shown_max = 100;
  for (std::size_t i = 0; i < std::min(found.size(), shown_max); ++i)
    fmt::print(stderr, "{}\n", found[i].message());
  if (found.size() > shown_max)
    fmt::print(stderr, "{} more errors\n", found.size() - shown_max);
  throw Exit{exit_scenario};
}

}  // namespace varve::tools
