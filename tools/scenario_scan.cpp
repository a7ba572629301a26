#include "tools/scenario_scan.h"

#include <algorithm>
#include <sstream>

#include <boost/program_options.hpp>
#include <fmt/format.h>

#include "core/parameters.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

namespace po = boost::program_options;

constexpr std::size_t file_bytes_max = std::size_t{1} << 20;
constexpr std::size_t line_bytes_max = 4096;

bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Names of the table's sections, in its order.
std::vector<std::string_view> section_names() {
  std::vector<std::string_view> names;
  for (const core::Parameter& parameter : core::parameters()) {
    const std::string_view name = parameter.key.substr(0, parameter.key.find('.'));
    if (names.empty() || names.back() != name) names.push_back(name);
  }
  return names;
}

/// Printable form of a piece of a line.
std::string shown(std::string_view text) {
  constexpr std::size_t shown_max = 40;
  std::string out;
  for (char c : text.substr(0, shown_max))
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return text.size() > shown_max ? out + "..." : out;
}

class Scanner {
 public:
  Scanner(std::string_view text, const std::string& source, const SectionRules& rules)
      : text_(text), source_(source), rules_(rules) {}

  Scan run() {
    if (!check_bytes()) return std::move(scan_);
    std::size_t start = 0;
    for (int line = 1; start <= text_.size(); ++line) {
      const std::size_t end = std::min(text_.find('\n', start), text_.size());
      take_line(text_.substr(start, end - start), line);
      start = end + 1;
    }
    parse_values();
    return std::move(scan_);
  }

 private:
  void error(int line, std::size_t column, std::string text) {
    scan_.errors.push_back({source_, line, static_cast<int>(column), std::move(text)});
  }

  bool check_bytes() {
    constexpr std::string_view utf8_mark = "\xef\xbb\xbf";
    if (text_.size() > file_bytes_max) {
      error(0, 0, fmt::format("{} bytes; expected a {} of at most {} bytes", text_.size(),
                              rules_.what, file_bytes_max));
      return false;
    }
    if (text_.starts_with("\xff\xfe") || text_.starts_with("\xfe\xff")) {
      error(1, 1, "UTF-16 text; expected UTF-8");
      return false;
    }
    if (text_.starts_with(utf8_mark)) text_.remove_prefix(utf8_mark.size());
    if (text_.find('\0') != std::string_view::npos) {
      const auto before = text_.substr(0, text_.find('\0'));
      error(1 + static_cast<int>(std::count(before.begin(), before.end(), '\n')), 1,
            "a zero byte; expected a text file");
      return false;
    }
    return true;
  }

  void take_line(std::string_view line, int number) {
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (line.size() > line_bytes_max) {
      error(number, 1, fmt::format("a line of {} bytes; expected at most {}", line.size(),
                                   line_bytes_max));
      return;
    }
    const std::string_view bare = trim(line.substr(0, line.find('#')));
    if (bare.empty() || bare.front() == ';') return;
    const std::size_t column = static_cast<std::size_t>(bare.data() - line.data()) + 1;
    if (bare.front() == '[') {
      take_section(bare, number, column);
    } else {
      take_entry(line, bare, number, column);
    }
  }

  void take_section(std::string_view bare, int number, std::size_t column) {
    std::string_view name = bare.substr(1);
    const bool closed = name.ends_with(']');
    if (closed) name.remove_suffix(1);
    name = trim(name);
    const bool whole = closed && name.find_first_of("[]=") == std::string_view::npos;
    if (!whole || name.empty()) {
      error(number, column, fmt::format("expected '[section]', got '{}'", shown(bare)));
      // What follows is checked as if the section were the one that was meant.
      name = trim(name.substr(0, name.find_first_of("[]=")));
    }
    section_ = name;
    meant_ = name;
    usable_ = true;
    if (is_known(name)) return note_section(number);
    std::vector<std::string> all(rules_.names.begin(), rules_.names.end());
    for (const std::string_view family : rules_.families)
      all.push_back(std::string(family) + "NAME");
    const std::string nearest = nearest_section(name);
    if (whole && !name.empty())
      error(number, column,
            fmt::format("unknown section '{}'; {}", shown(name),
                        nearest.empty() ? fmt::format("expected one of {}", fmt::join(all, ", "))
                                        : fmt::format("did you mean '{}'?", nearest)));
    meant_ = nearest;
    usable_ = !nearest.empty();
    if (usable_) note_section(number);
  }

  bool is_known(std::string_view name) const {
    for (const std::string_view family : rules_.families)
      if (name.starts_with(family) && name.size() > family.size()) return true;
    return std::find(rules_.names.begin(), rules_.names.end(), name) != rules_.names.end();
  }

  /// A section's name with what is misspelt of it put right, "" where nothing is near.
  std::string nearest_section(std::string_view name) const {
    if (const std::string_view near = nearest_name(name, rules_.names); !near.empty())
      return std::string(near);
    const std::size_t dot = name.find('.');
    if (dot == std::string_view::npos || dot + 1 == name.size()) return "";
    const std::string_view family = nearest_name(name.substr(0, dot + 1), rules_.families);
    return family.empty() ? "" : std::string(family) + std::string(name.substr(dot + 1));
  }

  void note_section(int number) { scan_.sections.push_back({meant_, number}); }

  void take_entry(std::string_view line, std::string_view bare, int number, std::size_t column) {
    const std::size_t equals = bare.find('=');
    const std::string_view key = trim(bare.substr(0, equals));
    if (equals == std::string_view::npos || key.empty()) {
      error(number, column, fmt::format("expected 'key = value', got '{}'", shown(bare)));
      return;
    }
    if (key.find_first_of(" \t\"'") != std::string_view::npos) {
      error(number, column, fmt::format("'{}' is no key; expected one word", shown(key)));
      return;
    }
    if (!usable_) return;  // the section's own error has said it
    if (section_.empty() && key.find('.') == std::string_view::npos) {
      const std::string_view meant =
          rules_.nearest_key ? rules_.nearest_key(key) : std::string_view();
      error(number, column,
            fmt::format("key '{}' stands before any [section]{}", shown(key),
                        meant.empty() ? "" : fmt::format("; did you mean '{}'?", meant)));
      return;
    }
    const std::string_view value = trim(bare.substr(equals + 1));
    ScannedEntry entry;
    entry.section = meant_;
    entry.key = meant_.empty() ? std::string(key) : meant_ + "." + std::string(key);
    entry.line = number;
    entry.key_column = static_cast<int>(column);
    entry.value_column =
        value.empty() ? static_cast<int>(column + bare.size())
                      : static_cast<int>(value.data() - line.data()) + 1;
    scan_.entries.push_back(std::move(entry));
    ini_ += fmt::format("{}={}\n", scan_.entries.back().key, value);
  }

  /// What the scan let through is read by Boost; its values answer to the entries one by one.
  void parse_values() {
    std::istringstream stream(ini_);
    po::options_description none;
    const auto parsed = po::parse_config_file(stream, none, true);
    if (parsed.options.size() != scan_.entries.size()) {
      error(0, 0, "could not be read as INI; expected '[section]' and 'key = value' lines");
      scan_.entries.clear();
      return;
    }
    for (std::size_t i = 0; i < scan_.entries.size(); ++i)
      scan_.entries[i].value = parsed.options[i].value.empty() ? "" : parsed.options[i].value[0];
  }

  std::string_view text_;
  const std::string& source_;
  const SectionRules& rules_;
  Scan scan_;
  std::string section_, meant_;  ///< as written; as it is taken
  bool usable_ = true;
  std::string ini_;
};

}  // namespace

Scan scan_ini(std::string_view text, const std::string& source, const SectionRules& rules) {
  return Scanner(text, source, rules).run();
}

Scan scan_scenario(std::string_view text, const std::string& source) {
  static const SectionRules rules{
      "scenario", section_names(), {"species.", "event."}, core::nearest_key};
  return scan_ini(text, source, rules);
}

}  // namespace varve::tools
