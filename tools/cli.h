// What all verbs share: declaration of options, help, global flags, exit codes, the only catch.
// Boost.Program_options does the parsing, in cli.cpp (prefix guessing off).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace varve::tools {

/// Exit codes, the same for every verb.
enum ExitCode : int {
  exit_ok = 0,
  exit_differ = 1,
  exit_usage = 2,
  exit_scenario = 3,
  exit_damaged = 4,
  exit_numerical = 5,
  exit_study = 6,
  exit_internal = 70,
  exit_output = 74,
  exit_stopped = 75,
};

/// Wrong usage, missing file, inputs that can't be compared: exit 2 with this text.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit with a code after all messages have been printed already (e.g. 3 with every error listed).
struct Exit {
  int code;
};

struct OptionSpec {
  std::string name;         ///< "output,o" or "threads"
  std::string value;        ///< "RUN", "N"; empty for a flag
  std::string help;
  bool repeatable = false;
  std::string fallback;     ///< default shown in help and used when not given
};

enum class ColorMode { automatic, always, never };
enum class ProgressMode { automatic, bar, lines, json, none };

struct Globals {
  bool quiet = false;
  int verbosity = 0;
  bool json = false;
  ColorMode color = ColorMode::automatic;
  ProgressMode progress = ProgressMode::automatic;
};

/// A parsed command line.
class Invocation {
 public:
  Globals globals;
  std::vector<std::string> arguments;  ///< positional
  bool has(std::string_view option) const;
  /// Value of an option (its fallback if not given); UsageError if there is neither.
  std::string value(std::string_view option) const;
  std::vector<std::string> values(std::string_view option) const;
  std::optional<std::uint64_t> count(std::string_view option) const;  ///< whole number; UsageError else
  std::optional<double> number(std::string_view option) const;

  std::vector<std::pair<std::string, std::vector<std::string>>> given;      // option, values
  std::vector<std::pair<std::string, std::string>> fallbacks;
};

struct Verb {
  std::string name;         ///< "diff"
  std::string usage;        ///< "A B"
  std::string summary;      ///< one line
  std::string description;  ///< paragraphs for --help, with at least one example
  std::vector<OptionSpec> options;
  std::size_t arguments_min = 0, arguments_max = 0;
  std::function<int(const Invocation&)> run;
};

/// Parses, runs, catches: LogError, UsageError, Exit, scenario and numerical errors become a message
/// on stderr ("varve VERB: ...") and the documented exit code. --help and --version are answered here.
int verb_main(int argc, char** argv, const Verb& verb);

/// True if colour / a progress bar may be used on stderr (tty, NO_COLOR, TERM=dumb, --color).
bool use_color(const Globals& globals, bool stderr_stream);
std::string bold(const Globals& globals, std::string_view text);

/// Folder of the running executable, in which the other verbs live too.
std::string executable_folder();
/// "varve 0.1.0 (g++ 12.2.0, ...)" and the build facts that genesis records.
std::vector<std::pair<std::string, std::string>> build_facts();

}  // namespace varve::tools
