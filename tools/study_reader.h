// One study file's sections into the structures of study_file.h.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/study_file.h"

namespace varve::tools {

/// Whether a name is what a pattern ("n*", "n16") says.
bool fits_pattern(std::string_view name, std::string_view pattern);

class StudyReader {
 public:
  StudyReader(StudyFile& study, std::string path, std::vector<Diagnostic>& found)
      : study_(study), path_(std::move(path)), found_(found) {}

  /// Takes all sections of a text; returns the files that it includes.
  std::vector<std::pair<std::string, StudyPlace>> take(std::string_view text);

 private:
  struct Entry {
    std::string key, value;  ///< key without its section
    StudyPlace place;
  };
  struct Section {
    std::string family, name;  ///< "case", "n16"; "study", ""
    StudyPlace place;
    std::vector<Entry> entries;
  };

  std::vector<Section> sections_of(std::string_view text);
  void add_section(std::vector<Section>& sections, const std::string& full, int line);
  void check_section(const Section& section);
  void take_study(const Section& section);
  void take_case(const Section& section);
  bool take_case_key(StudyCase& each, const Entry& entry);
  bool take_fork_key(StudyCase& each, const Entry& entry);
  void take_varied(StudyCase& each, const Entry& entry);
  void finish_case(StudyCase& each);
  void take_measure(const Section& section);
  void take_curve(const Section& section);
  void check_value(const Section& section, std::string_view kind, const Entry* value,
                   const Expression& expression, std::span<const double> at_point);
  void take_figure(const Section& section);
  void take_claim(const Section& section);
  void finish_claim(StudyClaim& claim);
  void take_compare(const Section& section);

  void error_at_value(const Entry& entry, const std::string& text);
  void error_at_key(const Entry& entry, const std::string& text);
  void unknown(const Section& section, const Entry& entry,
               const std::vector<std::string_view>& known);
  /// Reads a value of its kind, reporting what is wrong.
  bool flag(const Entry& entry);
  double seconds(const Entry& entry);
  std::uint64_t count(const Entry& entry, std::uint64_t lowest, std::uint64_t highest);
  std::vector<std::string> list(const Entry& entry);
  std::vector<double> point(const Entry& entry);
  std::optional<StudyLimit> limit(const Entry& entry, const std::string& text);
  void expected(StudyClaim& claim, const Entry& entry);
  std::string one_of(const Entry& entry, const std::vector<std::string_view>& names);

  StudyFile& study_;
  std::string path_;
  std::vector<Diagnostic>& found_;
  std::vector<std::uint64_t> seeds_;
  std::size_t quick_seeds_ = 0;
  Keep keep_ = Keep::log;
  std::vector<std::pair<std::string, StudyPlace>> included_;
};

}  // namespace varve::tools
