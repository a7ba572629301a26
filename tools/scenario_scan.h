// The scan in front of Boost's INI parser: what stands on which line, what is no INI at all.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/scenario_file.h"

namespace varve::tools {

/// One "key = value" line. Keys carry their section: "domain.width", "event.wider.at".
struct ScannedEntry {
  std::string key;
  std::string value;   ///< as Boost's parser gives it
  std::string section; ///< as it should be called, if it was misspelt
  int line = 0, key_column = 0, value_column = 0;
};
struct ScannedSection {
  std::string name;
  int line = 0;
};
struct Scan {
  std::vector<ScannedEntry> entries;
  std::vector<ScannedSection> sections;  ///< in order of the file
  std::vector<Diagnostic> errors;
};

/// Which sections a kind of file has.
struct SectionRules {
  std::string_view what;                   ///< "scenario"
  std::vector<std::string_view> names;     ///< "domain"
  std::vector<std::string_view> families;  ///< "event." of sections [event.NAME]
  /// The key nearest to one that stands before any section, "" if none is; may be empty.
  std::function<std::string_view(std::string_view)> nearest_key;
};

/// Scans and parses. Errors do not end the scan.
Scan scan_ini(std::string_view text, const std::string& source, const SectionRules& rules);
/// The same with a scenario's sections.
Scan scan_scenario(std::string_view text, const std::string& source);

}  // namespace varve::tools
