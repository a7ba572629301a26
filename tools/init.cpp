// varve init: a commented scenario to start from.
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/scenario_file.h"

namespace varve::tools {
namespace {

std::string preset_list() {
  std::string names;
  for (const Preset& preset : presets())
    names += (names.empty() ? "" : ", ") + std::string(preset.name);
  return names;
}

/// Every key with its meaning; those that have their default are commented out.
std::string every_key(const Preset& preset) {
  // As written rather than as resolved: what the preset leaves open stays open.
  const core::Scenario written = read_scenario_text(preset.text, std::string(preset.name)).written;
  std::string text = fmt::format(
      "# Every key, with the values of preset {}. Keys behind '#' have their default.\n"
      "# Numbers are SI unless a unit follows; 'auto' is derived, `varve check` shows from what.\n"
      "# (forks) marks what a fork or an event may change.\n",
      preset.name);
  std::string section;
  for (const core::Parameter& parameter : core::parameters()) {
    const std::size_t dot = parameter.key.find('.');
    if (parameter.key.substr(0, dot) != section) {
      section = parameter.key.substr(0, dot);
      text += fmt::format("\n[{}]\n", section);
    }
    const std::string key(parameter.key.substr(dot + 1));
    const std::string fallback = core::default_text(parameter);
    const std::string value = core::get_parameter(written, parameter);
    const bool is_default = value == fallback;
    const bool has_unit = !parameter.unit.empty() && value != "auto";
    text += fmt::format("# {}; {}{}\n", parameter.meaning, core::expected_text(parameter),
                        parameter.change == core::Change::never ? "" : " (forks)");
    text += fmt::format("{}{} = {}{}{}\n", is_default ? "# " : "", key, value,
                        has_unit ? " " : "", has_unit ? parameter.unit : "");
  }
  return text;
}

void write_new_file(const std::string& path, std::string_view text, bool overwrite) {
  const int flags = O_WRONLY | O_CREAT | O_CLOEXEC | (overwrite ? O_TRUNC : O_EXCL);
  const int file = open(path.c_str(), flags, 0666);
  if (file < 0 && errno == EEXIST)
    throw UsageError(fmt::format("{}: expected a new file, got one that exists (--overwrite "
                                 "replaces it)", path));
  if (file < 0 && (errno == ENOENT || errno == EISDIR || errno == ENOTDIR))
    throw UsageError(fmt::format("{}: {}", path, std::strerror(errno)));
  bool written = file >= 0;
  while (written && !text.empty()) {
    const ssize_t n = ::write(file, text.data(), text.size());
    if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
    if (n < 0 && errno != EINTR) written = false;
  }
  const int reason = errno;
  const bool closed = file < 0 || ::close(file) == 0;
  if (!written || !closed)
    throw ToolError(exit_output, fmt::format("{}: could not be written: {}", path,
                                             std::strerror(written ? errno : reason)));
}

int run(const Invocation& invocation) {
  if (invocation.has("list")) {
    for (const Preset& preset : presets()) {
      const core::Scenario scenario =
          read_scenario_text(preset.text, std::string(preset.name)).scenario;
      print(fmt::format("{:<14} {}\n", preset.name, scenario.title));
    }
    return exit_ok;
  }
  const std::string name = invocation.arguments.empty() ? "single_disc" : invocation.arguments[0];
  const Preset* preset = find_preset(name);
  if (!preset) {
    std::vector<std::string_view> names;
    for (const Preset& known : presets()) names.push_back(known.name);
    const std::string_view nearest = nearest_name(name, names);
    throw UsageError(fmt::format("preset: expected one of {}, got '{}'{}", preset_list(), name,
                                 nearest.empty() ? ""
                                                 : fmt::format("; did you mean '{}'?", nearest)));
  }
  const std::string text = invocation.has("all") ? every_key(*preset) : std::string(preset->text);
  if (!invocation.has("output")) {
    print(text);
    return exit_ok;
  }
  const std::string path = invocation.value("output");
  write_new_file(path, text, invocation.has("overwrite"));
  note(invocation.globals, fmt::format("wrote {}; next: varve check {}", path, path));
  return exit_ok;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  using namespace varve::tools;
  Verb verb;
  verb.name = "init";
  verb.usage = "[PRESET]";
  verb.summary = "writes a commented scenario to start from";
  verb.description =
      "Prints the scenario PRESET (single_disc if none is named), or writes it to a file with -o.\n"
      "\n"
      "  varve init > disc.cfg              the settling disc\n"
      "  varve init column -o column.cfg    four rows of eight grains in a pipe\n"
      "  varve init --all | less            every key, its unit, range and default\n";
  verb.options = {
      {"output,o", "FILE", "write to a file instead of standard output", false, ""},
      {"overwrite", "", "replace the file if it exists", false, ""},
      {"all", "", "every key with its meaning, range and default", false, ""},
      {"list", "", "the presets, one a line", false, ""},
  };
  verb.arguments_max = 1;
  verb.run = run;
  return verb_main(argc, argv, verb);
}
