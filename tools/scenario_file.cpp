#include "tools/scenario_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "core/grain_placement.h"
#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/embedded_files.h"
#include "tools/scenario_levels.h"
#include "tools/scenario_scan.h"

namespace varve::tools {
namespace {

constexpr std::string_view command_line = "<command line>";
constexpr std::string_view preset_key = "scenario.preset";
constexpr std::size_t errors_shown_max = 100;

/// Where a key was set last.
struct Place {
  std::string source;
  int line = 0, key_column = 0, value_column = 0;
};

bool is_event_key(std::string_view key) { return key.starts_with("event."); }

/// "event.wider.domain.width" -> "wider", "domain.width".
std::pair<std::string, std::string> split_event_key(const std::string& key) {
  const std::size_t dot = key.find('.', 6);
  if (dot == std::string::npos) return {key.substr(6), ""};
  return {key.substr(6, dot - 6), key.substr(dot + 1)};
}

class ScenarioReader {
 public:
  /// Takes all entries of one source. A later source wins over an earlier one; within one source a
  /// key may be set once.
  void take_text(std::string_view text, const std::string& source) {
    const Scan scan = scan_scenario(text, source);
    errors_.insert(errors_.end(), scan.errors.begin(), scan.errors.end());
    take_presets(scan, source);
    for (const ScannedSection& section : scan.sections) {
      sections_.insert_or_assign(section.name, Place{source, section.line, 1, 1});
      if (section.name.starts_with("event.")) event(section.name.substr(6));
    }
    for (const ScannedEntry& entry : scan.entries) {
      if (entry.key == preset_key) continue;
      set(entry.key, entry.value, {source, entry.line, entry.key_column, entry.value_column});
    }
  }

  /// Takes the levels that the sources name, the strongest source's word for each, under all of
  /// them: to be called first.
  void take_levels(std::string_view text, const std::vector<std::string>& settings) {
    for (const std::string_view key : level_keys) {
      std::string value = level_in(text, key);
      for (const std::string& setting : settings) {
        const std::size_t equals = setting.find('=');
        if (equals != std::string::npos && trimmed(setting.substr(0, equals)) == key)
          value = trimmed(setting.substr(equals + 1));
      }
      const ScenarioLevel* level = find_level(key, value);
      if (level && !level->text.empty())
        take_text(level->text, fmt::format("{} {}", key, level->value));
    }
  }

  void take_settings(const std::vector<std::string>& settings) {
    const std::string source(command_line);
    for (std::size_t i = 0; i < settings.size(); ++i) {
      const std::string& text = settings[i];
      const int number = static_cast<int>(i) + 1;
      const std::size_t equals = text.find('=');
      if (equals == std::string::npos || equals == 0) {
        errors_.push_back({source, number, 0, fmt::format("expected KEY=VALUE, got '{}'", text)});
        continue;
      }
      set(trimmed(text.substr(0, equals)), trimmed(text.substr(equals + 1)),
          {source, number, 0, 0});
    }
  }

  const core::Scenario& written() const { return scenario_; }
  std::vector<std::pair<std::string, std::string>> files() { return std::move(files_); }

  /// Resolves, or throws ScenarioError with everything that was found.
  core::Scenario finish(const std::string& source, const ScenarioOptions& options) {
    source_ = source;
    check_length(options.needs_length);
    take_grain_list(options);
    if (options.resolved && errors_.empty()) return std::move(scenario_);
    if (errors_.empty()) {
      for (const core::Problem& problem : core::resolve(scenario_))
        report(problem.key, problem.text);
    } else {
      check_missing();
    }
    if (!errors_.empty()) {
      std::stable_sort(errors_.begin(), errors_.end(), [](const auto& a, const auto& b) {
        if ((a.source == command_line) != (b.source == command_line))
          return b.source == command_line;
        return a.source == b.source && a.line < b.line;
      });
      throw ScenarioError(std::move(errors_));
    }
    return std::move(scenario_);
  }

 private:
  /// What a scenario's text, or else the preset it starts from, says of a key; empty if nothing.
  static std::string level_in(std::string_view text, std::string_view key) {
    std::string value;
    for (const ScannedEntry& entry : scan_scenario(text, "").entries) {
      if (entry.key == key) return entry.value;
      const Preset* preset = entry.key == preset_key ? find_preset(entry.value) : nullptr;
      if (preset && preset->text != text) value = level_in(preset->text, key);
    }
    return value;
  }

  static std::string trimmed(std::string text) {
    const std::size_t first = text.find_first_not_of(" \t");
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(" \t") - first + 1);
  }

  void error(const Place& place, int column, std::string text) {
    errors_.push_back({place.source, place.line, column, std::move(text)});
  }

  /// An error of a key as a whole: at its value, else at its section, else at the file.
  void report(const std::string& key, const std::string& text) {
    const std::string full = key.empty() ? text : key + ": " + text;
    if (const auto found = places_.find(key); found != places_.end())
      return error(found->second, found->second.value_column, full);
    for (std::size_t dot = key.rfind('.'); ; dot = key.rfind('.', dot - 1)) {
      const auto section = sections_.find(key.substr(0, dot));
      if (section != sections_.end()) return error(section->second, 1, full);
      if (dot == std::string::npos || dot == 0) break;
    }
    const auto whole = sections_.find(key);
    if (whole != sections_.end()) return error(whole->second, 1, full);
    error({source_, 1, 1, 1}, 1, full);
  }

  void take_presets(const Scan& scan, const std::string& source) {
    for (const ScannedEntry& entry : scan.entries) {
      if (entry.key != preset_key) continue;
      const Preset* preset = find_preset(entry.value);
      if (preset && !inside_preset_) {
        inside_preset_ = true;
        take_text(preset->text, fmt::format("preset {}", preset->name));
        inside_preset_ = false;
        continue;
      }
      std::vector<std::string_view> names;
      for (const Preset& known : presets()) names.push_back(known.name);
      error({source, entry.line, entry.key_column, entry.value_column}, entry.value_column,
            fmt::format("{}: '{}' is not known; expected one of {}", preset_key, entry.value,
                        fmt::join(names, ", ")));
    }
  }

  core::ScheduledChange& event(const std::string& name) {
    for (core::ScheduledChange& change : scenario_.changes)
      if (change.name == name) return change;
    scenario_.changes.emplace_back();
    scenario_.changes.back().name = name;
    return scenario_.changes.back();
  }

  void set(const std::string& key, const std::string& value, Place place) {
    const auto earlier = places_.find(key);
    if (earlier != places_.end() && earlier->second.source == place.source) {
      const std::string where = place.source == command_line
                                    ? fmt::format("by setting {}", earlier->second.line)
                                    : fmt::format("on line {}", earlier->second.line);
      return error(place, place.key_column, fmt::format("'{}' was already set {}", key, where));
    }
    if (is_event_key(key)) return set_event(key, value, place);
    if (key.starts_with("species.")) return set_species(key, value, place);
    const core::Parameter* parameter = core::find_parameter(key);
    if (!parameter) return unknown(key, core::nearest_key(key), place);
    places_.insert_or_assign(key, place);
    const auto problem = core::set_parameter(scenario_, *parameter, value);
    if (problem) return error(place, place.value_column, key + ": " + problem->text);
    // A length given nearer to the command line replaces one of the other kind.
    if (key == "time.until") give_way("time.steps", place);
    if (key == "time.steps") give_way("time.until", place);
  }

  void give_way(const std::string& other, const Place& place) {
    const auto found = places_.find(other);
    if (found == places_.end() || found->second.source == place.source) return;
    core::set_parameter(scenario_, *core::find_parameter(other),
                        core::default_text(*core::find_parameter(other)));
    places_.erase(found);
  }

  void unknown(const std::string& key, std::string_view nearest, const Place& place) {
    error(place, place.key_column,
          nearest.empty() ? fmt::format("unknown key '{}'", key)
                          : fmt::format("unknown key '{}'; did you mean '{}'?", key, nearest));
  }

  /// "species.fine.diameter": a key of its own kind of grains.
  void set_species(const std::string& key, const std::string& value, Place place) {
    const std::size_t dot = key.rfind('.');
    const std::string name = dot > 8 ? key.substr(8, dot - 8) : "";
    const std::string leaf = key.substr(dot + 1);
    if (name.empty() || !core::species_parameter(leaf))
      return error(place, place.key_column,
                   fmt::format("unknown key '{}'; expected species.NAME.diameter, .density or "
                               ".share", key));
    places_.insert_or_assign(key, place);
    if (const auto problem = core::set_species(scenario_, name, leaf, value))
      error(place, place.value_column, key + ": " + problem->text);
  }

  /// Reads the list of grains that the scenario names; its content is kept for genesis.
  void take_grain_list(const ScenarioOptions& options) {
    const std::string& name = scenario_.grains.file;
    if (name.empty()) return;
    std::string content;
    if (const std::string wrong = find_file(name, options, content); !wrong.empty())
      return report("grains.file", fmt::format("'{}': {}", name, wrong));
    auto read = core::read_grain_list(content, scenario_);
    if (const auto* problems = std::get_if<std::vector<core::ListProblem>>(&read)) {
      for (const core::ListProblem& problem : *problems)
        errors_.push_back({listed_name(name, options), problem.line, 0, problem.text});
      return;
    }
    scenario_.grains.list = std::get<std::vector<core::ListedGrain>>(std::move(read));
    scenario_.grains.arrangement = core::Arrangement::list;
    files_.emplace_back(name, std::move(content));
  }

  static std::string listed_name(const std::string& name, const ScenarioOptions& options) {
    return options.files ? name : (std::filesystem::path(options.folder) / name).string();
  }

  /// The content of a file that the scenario names; returns what is wrong with it.
  static std::string find_file(const std::string& name, const ScenarioOptions& options,
                               std::string& content) {
    if (options.files) {
      for (const auto& [known, text] : *options.files)
        if (known == name) {
          content = text;
          return "";
        }
      return "not embedded with the scenario";
    }
    constexpr std::size_t bytes_max = std::size_t{1} << 26;
    const std::string path = listed_name(name, options);
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) return "a directory; expected a file";
    std::ifstream file(path, std::ios::binary);
    if (!file) return std::strerror(errno);
    content.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    if (file.bad()) return "could not be read";
    if (content.size() > bytes_max)
      return fmt::format("{} bytes; expected at most {}", content.size(), bytes_max);
    return "";
  }

  void set_event(const std::string& key, const std::string& value, Place place) {
    const auto [name, inner] = split_event_key(key);
    if (name.empty() || inner.empty())
      return error(place, place.key_column,
                   fmt::format("unknown key '{}'; expected event.NAME.KEY", key));
    core::ScheduledChange& change = event(name);
    if (inner == "at" || inner == "at_step") return set_moment(change, inner, value, key, place);
    if (inner == "anchor" || inner == "outside")
      return set_width_rule(change, inner, value, key, place);
    const core::Parameter* parameter = core::find_parameter(inner);
    if (!parameter) {
      const std::string_view nearest = core::nearest_key(inner);
      return unknown(key, nearest.empty() ? "" : fmt::format("event.{}.{}", name, nearest), place);
    }
    places_.insert_or_assign(key, place);
    if (parameter->change == core::Change::never)
      return error(place, place.key_column,
                   fmt::format("{}: cannot change in a fork or an event: {}", key,
                               core::fixed_reason(*parameter)));
    core::Scenario scratch;
    if (const auto problem = core::set_parameter(scratch, *parameter, value))
      return error(place, place.value_column, key + ": " + problem->text);
    std::erase_if(change.settings,
                  [&inner = inner](const auto& setting) { return setting.first == inner; });
    change.settings.emplace_back(inner, value);
  }

  /// How an event's change of width is made: which wall stays, what becomes of grains outside.
  void set_width_rule(core::ScheduledChange& change, const std::string& inner,
                      const std::string& value, const std::string& key, const Place& place) {
    const bool is_anchor = inner == "anchor";
    const std::vector<std::string_view> names =
        is_anchor ? std::vector<std::string_view>{"left", "none", "right"}
                  : std::vector<std::string_view>{"error", "push", "remove"};
    places_.insert_or_assign(key, place);
    const auto found = std::find(names.begin(), names.end(), value);
    if (found == names.end())
      return error(place, place.value_column,
                   fmt::format("{}: '{}' is not known; expected {}, {} or {}", key, value, names[0],
                               names[1], names[2]));
    const int index = static_cast<int>(found - names.begin());
    if (is_anchor) {
      change.anchor = index - 1;
    } else {
      change.outside = static_cast<core::OutsideMode>(index);
    }
  }

  /// The moment of an event, read like time.until and time.steps.
  void set_moment(core::ScheduledChange& change, const std::string& inner, const std::string& value,
                  const std::string& key, const Place& place) {
    const std::string other = key.substr(0, key.size() - inner.size()) +
                              (inner == "at" ? "at_step" : "at");
    const auto found = places_.find(other);
    if (found != places_.end() && found->second.source == place.source)
      return error(place, place.key_column,
                   fmt::format("'{}' excludes '{}', set on line {}", key, other,
                               found->second.line));
    if (found != places_.end()) places_.erase(found);
    places_.insert_or_assign(key, place);
    core::Scenario scratch;
    const bool by_time = inner == "at";
    const auto* parameter = core::find_parameter(by_time ? "time.until" : "time.steps");
    if (const auto problem = core::set_parameter(scratch, *parameter, value))
      return error(place, place.value_column, key + ": " + problem->text);
    change.at = by_time ? scratch.time.until : core::automatic;
    change.at_step = by_time ? -1 : scratch.time.steps;
  }

  void check_length(bool needed) {
    const auto until = places_.find("time.until"), steps = places_.find("time.steps");
    const bool by_time = !std::isnan(scenario_.time.until), by_steps = scenario_.time.steps > 0;
    if (needed && by_time && by_steps && until != places_.end() && steps != places_.end())
      error(steps->second, steps->second.key_column,
            fmt::format("'time.steps' excludes 'time.until', set on line {}", until->second.line));
    if (needed && !by_time && !by_steps && until == places_.end() && steps == places_.end())
      report("time.until",
             "missing; expected a time, such as '1.5 s' (or time.steps, a number of steps)");
  }

  /// What must be given and is not, where other errors keep resolve() from saying so.
  void check_missing() {
    for (const core::Parameter& parameter : core::parameters()) {
      const auto* real = std::get_if<core::Parameter::Real>(&parameter.access);
      if (!real || parameter.may_be_automatic || core::default_text(parameter) != "auto") continue;
      if (places_.count(std::string(parameter.key)) > 0) continue;
      report(std::string(parameter.key), "missing; expected " + core::expected_text(parameter));
    }
  }

  core::Scenario scenario_;
  std::vector<Diagnostic> errors_;
  std::map<std::string, Place> places_;    ///< by full key
  std::map<std::string, Place> sections_;  ///< by name
  std::string source_;
  std::vector<std::pair<std::string, std::string>> files_;
  bool inside_preset_ = false;
};

std::string read_file(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw UsageError(fmt::format("{}: expected a scenario file, got a directory", path));
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    std::vector<std::string_view> names;
    for (const Preset& preset : presets()) names.push_back(preset.name);
    throw UsageError(fmt::format("{}: {}; expected a scenario file or one of the presets {}", path,
                                 std::strerror(errno), fmt::join(names, ", ")));
  }
  constexpr std::size_t bytes_max = std::size_t{1} << 27;  // more than scan and lists take
  std::string text;
  for (char block[65536]; text.size() < bytes_max && file;) {  // also of what has no size
    file.read(block, sizeof block);
    text.append(block, static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw UsageError(fmt::format("{}: could not be read", path));
  return text;
}

}  // namespace

std::string Diagnostic::message() const {
  std::string where = source;
  if (line > 0) where += fmt::format(":{}", line);
  if (line > 0 && column > 0) where += fmt::format(":{}", column);
  return where + ": error: " + text;
}

ScenarioError::ScenarioError(std::vector<Diagnostic> found)
    : std::runtime_error([&found] {
        std::string all;
        for (const Diagnostic& diagnostic : found)
          all += (all.empty() ? "" : "\n") + diagnostic.message();
        return all;
      }()),
      diagnostics_(std::move(found)) {}

ScenarioSource read_scenario_text(std::string_view whole, const std::string& name,
                                  const ScenarioOptions& given) {
  const SplitScenario split = split_embedded(whole);
  if (split.wrong_line > 0)
    throw ScenarioError({{name, split.wrong_line, 1,
                          "expected a line of an embedded file ('#|' or '#:' and its text), or the "
                          "next '#embedded file: NAME'"}});
  const std::string_view text = split.scenario;
  ScenarioOptions options = given;
  if (!options.files && !split.files.empty()) options.files = &split.files;
  ScenarioReader reader;
  if (!options.resolved) reader.take_levels(text, options.settings);
  reader.take_text(text, name);
  reader.take_settings(options.settings);
  ScenarioSource source;
  source.written = reader.written();
  source.scenario = reader.finish(name, options);
  source.files = reader.files();
  source.name = name;
  source.text = whole;
  return source;
}

ScenarioSource load_scenario(const std::string& path_or_preset, const ScenarioOptions& options) {
  const Preset* preset = find_preset(path_or_preset);
  const bool from_file = !preset || std::filesystem::exists(path_or_preset);
  const std::string text = from_file ? read_file(path_or_preset) : std::string(preset->text);
  const std::string name = from_file ? path_or_preset : fmt::format("preset {}", preset->name);
  try {
    ScenarioOptions beside = options;
    if (from_file) beside.folder = std::filesystem::path(path_or_preset).parent_path().string();
    return read_scenario_text(text, name, beside);
  } catch (const ScenarioError& error) {
    const auto& found = error.diagnostics();
    for (std::size_t i = 0; i < std::min(found.size(), errors_shown_max); ++i)
      fmt::print(stderr, "{}\n", found[i].message());
    if (found.size() > errors_shown_max)
      fmt::print(stderr, "{}: {} more errors\n", name, found.size() - errors_shown_max);
    throw Exit{exit_scenario};
  }
}

const Preset* find_preset(std::string_view name) {
  for (const Preset& preset : presets())
    if (preset.name == name) return &preset;
  return nullptr;
}

}  // namespace varve::tools
