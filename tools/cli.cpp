#include "tools/cli.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <system_error>

#include <boost/program_options.hpp>
#include <fmt/format.h>
#include <unistd.h>

#include "io/errors.h"

namespace varve::tools {
namespace {

namespace po = boost::program_options;

std::string verb_name = "varve";  // set once, before anything is printed

/// The reader of standard output has gone.
struct OutputClosed {};

const std::vector<OptionSpec>& global_options() {
  static const std::vector<OptionSpec> options{
      {"help,h", "", "this text", false, ""},
      {"version", "", "version and build facts", false, ""},
      {"quiet,q", "", "no notes, no progress", false, ""},
      {"verbose,v", "", "say more; may be repeated", true, ""},
      {"json", "", "one JSON object on standard output", false, ""},
      {"color", "WHEN", "auto, always or never", false, "auto"},
      {"progress", "HOW", "auto, bar, lines, json or none", false, "auto"},
  };
  return options;
}

std::string long_name(const OptionSpec& option) {
  return option.name.substr(0, option.name.find(','));
}

/// Every option of the verb, its own first; its own hide global ones of the same name.
std::vector<OptionSpec> all_options(const Verb& verb) {
  std::vector<OptionSpec> all = verb.options;
  for (const OptionSpec& option : global_options()) {
    const bool hidden = std::any_of(verb.options.begin(), verb.options.end(), [&](const auto& own) {
      return long_name(own) == long_name(option);
    });
    if (!hidden) all.push_back(option);
  }
  return all;
}

// ---- help -----------------------------------------------------------------------------------

/// Breaks `text` at blanks so that it fits right of column `indent`.
std::string wrapped(std::string_view text, std::size_t indent) {
  constexpr std::size_t width = 80;
  std::string out;
  std::size_t column = indent;
  while (!text.empty()) {
    const std::size_t blank = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, blank);
    text.remove_prefix(std::min(blank + 1, text.size()));
    if (column + word.size() + 1 > width && column > indent) {
      out += '\n' + std::string(indent, ' ');
      column = indent;
    } else if (column > indent) {
      out += ' ';
      ++column;
    }
    out += word;
    column += word.size();
  }
  return out;
}

bool has_optional_value(const OptionSpec& option) { return option.value.starts_with('='); }

std::string option_line(const OptionSpec& option) {
  constexpr std::size_t indent = 26;
  const std::size_t comma = option.name.find(',');
  std::string line = "  ";
  line += comma == std::string::npos ? "    " : fmt::format("-{}, ", option.name.substr(comma + 1));
  line += "--" + long_name(option);
  if (has_optional_value(option)) {
    line += "[" + option.value + "]";
  } else if (!option.value.empty()) {
    line += " " + option.value;
  }
  if (line.size() + 2 > indent) {
    line += '\n' + std::string(indent, ' ');
  } else {
    line.resize(indent, ' ');
  }
  std::string help = option.help;
  if (!option.fallback.empty()) help += fmt::format(" [{}]", option.fallback);
  if (option.repeatable && !option.value.empty()) help += " (repeatable)";
  return line + wrapped(help, indent) + '\n';
}

std::string help_text(const Verb& verb) {
  std::string text = fmt::format("usage: varve {} [options]{}{}\n\n{}\n", verb.name,
                                 verb.usage.empty() ? "" : " ", verb.usage, verb.summary);
  if (!verb.description.empty()) text += '\n' + verb.description;
  if (text.back() != '\n') text += '\n';
  if (!verb.options.empty()) text += "\noptions:\n";
  for (const OptionSpec& option : verb.options) text += option_line(option);
  text += "\nfor every verb:\n";
  for (const OptionSpec& option : global_options()) text += option_line(option);
  return text;
}

std::string version_line() {
  std::string text = "varve " + version_text() + '\n';
  for (const auto& [key, value] : build_facts())
    if (key != "date" && key != "host") text += fmt::format("  {:<12} {}\n", key, value);
  return text;
}

// ---- parsing --------------------------------------------------------------------------------

po::options_description describe(const std::vector<OptionSpec>& options) {
  po::options_description description;
  for (const OptionSpec& option : options) {
    if (option.value.empty()) {
      description.add_options()(option.name.c_str(), "");
    } else if (has_optional_value(option)) {
      description.add_options()(option.name.c_str(),
                                po::value<std::vector<std::string>>()->implicit_value({}, ""), "");
    } else {
      description.add_options()(option.name.c_str(), po::value<std::vector<std::string>>(), "");
    }
  }
  description.add_options()("arguments", po::value<std::vector<std::string>>(), "");
  return description;
}

/// What was wrong with a command line, in our words.
std::string syntax_text(const po::error& error, const std::vector<OptionSpec>& options) {
  if (const auto* unknown = dynamic_cast<const po::unknown_option*>(&error)) {
    const std::string name = unknown->get_option_name();
    std::vector<std::string> known;
    for (const OptionSpec& option : options) known.push_back("--" + long_name(option));
    const std::vector<std::string_view> views(known.begin(), known.end());
    const std::string_view nearest = nearest_name(name, views);
    return fmt::format("unknown option '{}'{}", name,
                       nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest));
  }
  if (const auto* syntax = dynamic_cast<const po::error_with_option_name*>(&error)) {
    using Syntax = po::invalid_command_line_syntax;
    const auto* detail = dynamic_cast<const Syntax*>(syntax);
    const std::string name = syntax->get_option_name();
    if (detail && detail->kind() == po::invalid_syntax::missing_parameter)
      return fmt::format("option '{}': expected a value, got none", name);
    if (detail && detail->kind() == po::invalid_syntax::extra_parameter)
      return fmt::format("option '{}': expected no value, got one", name);
    if (detail && detail->kind() == po::invalid_syntax::empty_adjacent_parameter)
      return fmt::format("option '{}': expected a value behind '=', got none", name);
  }
  return error.what();
}

std::vector<po::basic_option<char>> split(int argc, char** argv,
                                          const std::vector<OptionSpec>& options) {
  const po::options_description description = describe(options);
  po::positional_options_description positional;
  positional.add("arguments", -1);
  const int style = po::command_line_style::unix_style & ~po::command_line_style::allow_guessing;
  try {
    return po::command_line_parser(argc, argv)
        .options(description)
        .positional(positional)
        .style(style)
        .run()
        .options;
  } catch (const po::error& error) {
    throw UsageError(syntax_text(error, options));
  }
}

template <class Mode>
Mode parse_mode(const Invocation& invocation, std::string_view option,
                const std::vector<std::pair<std::string_view, Mode>>& modes) {
  const std::string text = invocation.value(option);
  std::string names;
  for (const auto& [name, mode] : modes) {
    if (text == name) return mode;
    names += (names.empty() ? "" : ", ") + std::string(name);
  }
  throw UsageError(fmt::format("--{}: expected one of {}, got '{}'", option, names, text));
}

void read_globals(Invocation& invocation) {
  Globals& globals = invocation.globals;
  globals.quiet = invocation.has("quiet");
  globals.json = invocation.has("json");
  globals.verbosity = static_cast<int>(
      std::count_if(invocation.given.begin(), invocation.given.end(),
                    [](const auto& option) { return option.first == "verbose"; }));
  globals.color = parse_mode<ColorMode>(
      invocation, "color",
      {{"auto", ColorMode::automatic}, {"always", ColorMode::always}, {"never", ColorMode::never}});
  globals.progress = parse_mode<ProgressMode>(invocation, "progress",
                                              {{"auto", ProgressMode::automatic},
                                               {"bar", ProgressMode::bar},
                                               {"lines", ProgressMode::lines},
                                               {"json", ProgressMode::json},
                                               {"none", ProgressMode::none}});
}

Invocation parse(int argc, char** argv, const Verb& verb) {
  const std::vector<OptionSpec> options = all_options(verb);
  Invocation invocation;
  for (const OptionSpec& option : options)
    if (!option.fallback.empty())
      invocation.fallbacks.emplace_back(long_name(option), option.fallback);
  for (const auto& item : split(argc, argv, options)) {
    if (item.position_key >= 0) {
      invocation.arguments.insert(invocation.arguments.end(), item.value.begin(), item.value.end());
      continue;
    }
    const auto spec = std::find_if(options.begin(), options.end(), [&](const auto& option) {
      return long_name(option) == item.string_key;
    });
    if (spec != options.end() && !spec->repeatable && invocation.has(item.string_key) &&
        !spec->value.empty())
      throw UsageError(fmt::format("option '--{}' was given twice", item.string_key));
    if (spec != options.end() && has_optional_value(*spec) && item.original_tokens.size() > 1) {
      // Only --name=VALUE is a value; what stands apart is an argument.
      invocation.arguments.insert(invocation.arguments.end(), item.value.begin(), item.value.end());
      invocation.given.emplace_back(item.string_key, std::vector<std::string>{});
      continue;
    }
    invocation.given.emplace_back(item.string_key, item.value);
  }
  return invocation;
}

void check_arguments(const Invocation& invocation, const Verb& verb) {
  const std::size_t n = invocation.arguments.size();
  if (n >= verb.arguments_min && n <= verb.arguments_max) return;
  std::string expected = fmt::format("{}", verb.arguments_min);
  if (verb.arguments_max != verb.arguments_min)
    expected = n < verb.arguments_min ? fmt::format("at least {}", verb.arguments_min)
                                      : fmt::format("at most {}", verb.arguments_max);
  const bool one = verb.arguments_min == 1 && verb.arguments_max == 1;
  throw UsageError(fmt::format("expected {} argument{}{}, got {}", expected, one ? "" : "s",
                               verb.usage.empty() ? "" : " (" + verb.usage + ")", n));
}

// ---- the only catch -------------------------------------------------------------------------

void complain(std::string_view text) {
  std::fflush(stdout);
  const std::string line =
      fmt::format("varve{}{}: {}\n", verb_name.empty() ? "" : " ", verb_name, text);
  std::fwrite(line.data(), 1, line.size(), stderr);
}

int exit_code_of(io::ErrorKind kind) {
  switch (kind) {
    case io::ErrorKind::not_found:
    case io::ErrorKind::exists:
    case io::ErrorKind::locked:
    case io::ErrorKind::unsupported:
    case io::ErrorKind::mismatch: return exit_usage;
    case io::ErrorKind::not_a_log:
    case io::ErrorKind::damaged:
    case io::ErrorKind::limit: return exit_damaged;
    case io::ErrorKind::write_failed: return exit_output;
  }
  return exit_internal;
}

/// Writes out what is buffered. A reader that has gone is no error; a full disk is.
void finish_output() {
  errno = 0;
  const bool failed = std::fflush(stdout) != 0 || std::ferror(stdout) != 0;
  if (!failed) return;
  if (errno == EPIPE) throw OutputClosed{};
  throw ToolError(exit_output, fmt::format("standard output: could not be written: {}",
                                           errno == 0 ? "an earlier write failed"
                                                      : std::strerror(errno)));
}

int run_verb(int argc, char** argv, const Verb& verb) {
  Invocation invocation = parse(argc, argv, verb);
  if (invocation.has("help")) {
    print(help_text(verb));
  } else if (invocation.has("version")) {
    print(version_line());
  } else {
    read_globals(invocation);
    check_arguments(invocation, verb);
    const int code = verb.run(invocation);
    try {
      finish_output();
    } catch (const OutputClosed&) {
    }
    return code;
  }
  finish_output();
  return exit_ok;
}

int guarded(int argc, char** argv, const Verb& verb) {
  try {
    return run_verb(argc, argv, verb);
  } catch (const OutputClosed&) {
    return exit_ok;
  } catch (const Exit& exit) {
    return exit.code;
  } catch (const UsageError& error) {
    complain(error.what());
    return exit_usage;
  } catch (const ToolError& error) {
    complain(error.what());
    return error.code();
  } catch (const io::LogError& error) {
    complain(error.what());
    return exit_code_of(error.kind());
  } catch (const std::bad_alloc&) {
    complain("memory: expected more than this machine gives; nothing else is wrong with the input");
    return exit_internal;
  } catch (const std::system_error& error) {
    // fmt reports a failed write to standard output this way.
    if (error.code().value() == EPIPE) return exit_ok;
    complain(error.what());
    return std::ferror(stdout) != 0 ? exit_output : exit_internal;
  } catch (const std::exception& error) {
    complain(fmt::format("internal error: {}", error.what()));
    return exit_internal;
  }
}

}  // namespace

// ---- Invocation -----------------------------------------------------------------------------

bool Invocation::has(std::string_view option) const {
  return std::any_of(given.begin(), given.end(),
                     [&](const auto& item) { return item.first == option; });
}

std::vector<std::string> Invocation::values(std::string_view option) const {
  std::vector<std::string> all;
  for (const auto& [name, items] : given)
    if (name == option) all.insert(all.end(), items.begin(), items.end());
  if (!all.empty()) return all;
  for (const auto& [name, fallback] : fallbacks)
    if (name == option) all.push_back(fallback);
  return all;
}

std::string Invocation::value(std::string_view option) const {
  const std::vector<std::string> all = values(option);
  if (all.empty()) throw UsageError(fmt::format("option '--{}' is needed", option));
  return all.back();
}

std::optional<std::uint64_t> Invocation::count(std::string_view option) const {
  if (values(option).empty()) return std::nullopt;
  const std::string text = value(option);
  std::uint64_t number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (read.ec != std::errc{} || read.ptr != text.data() + text.size())
    throw UsageError(fmt::format("--{}: expected a whole number, got '{}'", option, text));
  return number;
}

std::optional<double> Invocation::number(std::string_view option) const {
  if (values(option).empty()) return std::nullopt;
  const std::string text = value(option);
  double number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (read.ec != std::errc{} || read.ptr != text.data() + text.size() || !std::isfinite(number))
    throw UsageError(fmt::format("--{}: expected a number, got '{}'", option, text));
  return number;
}

// ---- entry and helpers ----------------------------------------------------------------------

int verb_main(int argc, char** argv, const Verb& verb) {
  std::signal(SIGPIPE, SIG_IGN);
  verb_name = verb.name;
  const int code = guarded(argc, argv, verb);
  if (code == exit_usage && std::ferror(stderr) == 0 && isatty(STDERR_FILENO) != 0)
    fmt::print(stderr, "(varve {}{}--help says more)\n", verb.name, verb.name.empty() ? "" : " ");
  return code;
}

void print(std::string_view text) {
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size()) return;
  if (errno == EPIPE) throw OutputClosed{};
  throw ToolError(exit_output, fmt::format("standard output: could not be written: {}",
                                           std::strerror(errno)));
}

void note(const Globals& globals, std::string_view text) {
  if (!globals.quiet) complain(text);
}

void warn(std::string_view text) { complain(fmt::format("warning: {}", text)); }

std::string_view nearest_name(std::string_view name, const std::vector<std::string_view>& names) {
  constexpr std::size_t name_max = 64;
  if (name.empty() || name.size() > name_max) return "";
  std::string_view nearest;
  std::size_t least = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (std::string_view other : names) {
    // Levenshtein; a swap of neighbours costs two, which is near enough here.
    std::vector<std::size_t> row(other.size() + 1);
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= name.size(); ++i) {
      std::size_t diagonal = std::exchange(row[0], i);
      for (std::size_t j = 1; j < row.size(); ++j) {
        const std::size_t up = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (name[i - 1] != other[j - 1])});
        diagonal = up;
      }
    }
    if (row.back() < least && row.back() < std::max(name.size(), other.size())) {
      least = row.back();
      nearest = other;
    }
  }
  return nearest;
}

bool use_color(const Globals& globals, bool stderr_stream) {
  if (globals.color != ColorMode::automatic) return globals.color == ColorMode::always;
  const char* no_color = std::getenv("NO_COLOR");
  if (no_color && *no_color) return false;
  const char* term = std::getenv("TERM");
  if (!term || std::string_view(term) == "dumb") return false;
  return isatty(stderr_stream ? STDERR_FILENO : STDOUT_FILENO) != 0;
}

std::string bold(const Globals& globals, std::string_view text) {
  if (!use_color(globals, false)) return std::string(text);
  return fmt::format("\x1b[1m{}\x1b[0m", text);
}

std::string executable_folder() {
  std::string path(4096, '\0');
  const ssize_t n = readlink("/proc/self/exe", path.data(), path.size());
  if (n <= 0 || static_cast<std::size_t>(n) == path.size())
    throw ToolError(exit_internal, "/proc/self/exe: expected the path of this program, got none");
  path.resize(static_cast<std::size_t>(n));
  return path.substr(0, path.rfind('/'));
}

}  // namespace varve::tools
