// What all verbs share: declaration of options, help, global flags, exit codes, the only catch.
// Boost.Program_options does the parsing, in cli.cpp (prefix guessing off).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
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

/// Any other failure with a documented exit code: printed as "varve VERB: text". Verbs that compute
/// translate the engine's failures into it (5 for a numerical failure, 2 for a change that is
/// refused), since this file links no physics.
class ToolError : public std::runtime_error {
 public:
  ToolError(int code, const std::string& text) : std::runtime_error(text), code_(code) {}
  int code() const noexcept { return code_; }

 private:
  int code_;
};

/// Exit with a code after all messages have been printed already (e.g. 3 with every error listed).
struct Exit {
  int code;
};

struct OptionSpec {
  std::string name;         ///< "output,o" or "threads"
  std::string value;        ///< "RUN", "N"; empty for a flag; "=N": may be left out
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
  /// A whole number >= 0 or a finite number; nothing if not given (or given without its value),
  /// UsageError if it is none.
  std::optional<std::uint64_t> count(std::string_view option) const;
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

/// Parses, runs, catches: LogError, UsageError, ToolError and Exit become a message on stderr
/// ("varve VERB: ...") and the documented exit code. --help and --version are answered here, also
/// where the rest of the command line is incomplete. SIGPIPE is ignored: a reader of standard
/// output that has had enough ends the verb with success, at the next print() or at the end.
int verb_main(int argc, char** argv, const Verb& verb);

/// Writes to standard output. Ends the verb (with success) where the reader has gone, and with exit
/// 74 where the output cannot be written.
void print(std::string_view text);
/// "varve VERB: text" on standard error, unless -q.
void note(const Globals& globals, std::string_view text);
/// "varve VERB: warning: text" on standard error, also with -q.
void warn(std::string_view text);

/// The closest of `names` to a misspelt one, or "" if none is near.
std::string_view nearest_name(std::string_view name, const std::vector<std::string_view>& names);

/// True if colour / a progress bar may be used on stderr (tty, NO_COLOR, TERM=dumb, --color).
bool use_color(const Globals& globals, bool stderr_stream);
std::string bold(const Globals& globals, std::string_view text);

/// Folder of the running executable, in which the other verbs live too.
std::string executable_folder();
/// "0.1.0"
std::string version_text();
/// What genesis records beside the digested part: version, compiler, flags, build type, C library,
/// CPU and its features, host, date.
std::vector<std::pair<std::string, std::string>> build_facts();

}  // namespace varve::tools
