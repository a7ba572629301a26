// Scenario files: INI sections with units, read through Boost.Program_options with a scan in front
// of it that knows where everything stands, so that every error is reported at once with its
// position.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/scenario.h"

namespace varve::tools {

/// One finding. `line` 0: the source as a whole; `column` 0: the line as a whole. Both from 1,
/// columns in bytes.
struct Diagnostic {
  std::string source;  ///< path, "preset NAME", or "<command line>"
  int line = 0, column = 0;
  std::string text;
  /// "bad.cfg:7:11: error: contact.damping: 'lots' is not a number; ..."
  std::string message() const;
};

/// A scenario that can't be used; `what()` holds every message, one a line.
class ScenarioError : public std::runtime_error {
 public:
  explicit ScenarioError(std::vector<Diagnostic> found);
  const std::vector<Diagnostic>& diagnostics() const noexcept { return diagnostics_; }

 private:
  std::vector<Diagnostic> diagnostics_;
};

/// A resolved scenario and where it came from.
struct ScenarioSource {
  core::Scenario scenario;  ///< resolved
  core::Scenario written;   ///< as given, with what was left open still open
  std::string name;         ///< path, or "preset NAME"
  std::string text;         ///< as read
  /// Other files that it names, to be embedded in genesis: name, content.
  std::vector<std::pair<std::string, std::string>> files;
};

struct ScenarioOptions {
  std::vector<std::string> settings{};  ///< "KEY=VALUE" of -s, in order; they win over the file
  /// time.until or time.steps must be given. A caller that sets the length of the run says no.
  bool needs_length = true;
  /// The text is a resolved scenario's canonical one (a genesis): nothing is derived or limited
  /// again. A fork's scenario need not be one that a fresh run could start with.
  bool resolved = false;
  /// Folder of the files that the scenario names; "" is the working folder.
  std::string folder{};
  /// Where those files are held in memory instead (a genesis): name, content.
  const std::vector<std::pair<std::string, std::string>>* files = nullptr;
};

/// Reads and resolves a scenario held in memory; `name` stands in messages. Throws ScenarioError.
ScenarioSource read_scenario_text(std::string_view text, const std::string& name,
                                  const ScenarioOptions& options = {{}, false, false, {}, nullptr});

/// Reads and resolves a file, or the preset of that name where there is no such file. Prints every
/// error to stderr and throws Exit{3} if it can't be used; UsageError for a missing file or a
/// directory.
ScenarioSource load_scenario(const std::string& path_or_preset,
                             const ScenarioOptions& options = {});

/// Built-in scenarios: the shipped files, embedded when varve was built.
struct Preset {
  std::string_view name, text;
};
const std::vector<Preset>& presets();
/// The preset called `name`, or nullptr.
const Preset* find_preset(std::string_view name);

}  // namespace varve::tools
