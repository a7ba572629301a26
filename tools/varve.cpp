// varve VERB ...: the front door. Runs the executable varve-VERB that lies beside this one.
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

struct KnownVerb {
  std::string_view name, summary;
};
struct Group {
  std::string_view title;
  std::vector<KnownVerb> verbs;
};

/// What --help lists, as far as it is built; other executables varve-* beside it run all the same.
const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"start",
       {{"init", "write a commented scenario"},
        {"check", "read a scenario, show what follows from it"},
        {"run", "simulate, recording every step"},
        {"resume", "continue a run from its last whole record"}}},
      {"go back",
       {{"replay", "execute recorded steps again, check every digest"},
        {"show", "state and observables at a step"},
        {"fork", "a new run from any step, with changed keys"},
        {"tree", "runs and forks, who came from whom"}}},
      {"compare",
       {{"diff", "the first step, field and particle in which two runs differ"},
        {"digest", "a small file of digests to compare with later"}}},
      {"trust",
       {{"info", "what a log holds, and how it came about"},
        {"verify", "check every checksum and the chain"},
        {"recover", "save what is whole of a damaged log"}}},
      {"look",
       {{"analyze", "settling velocity, porosity, contacts, energy from a log"},
        {"export", "tables and particle files for other programs"},
        {"plot", "curves as SVG"},
        {"view", "one page of HTML with a time slider"}}},
      {"study",
       {{"study", "many forks with varied keys"},
        {"tradeoff", "cost against error over levels of fidelity"},
        {"validate", "the engine against published numbers"}}},
  };
  return all;
}

/// Verbs that are built: executables varve-* in our folder.
std::vector<std::string> built_verbs(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("varve-") && access(entry.path().c_str(), X_OK) == 0)
      names.push_back(name.substr(6));
  }
  return names;
}

bool contains(const std::vector<std::string>& names, std::string_view name) {
  for (const std::string& other : names)
    if (other == name) return true;
  return false;
}

std::string help_text(const std::string& folder) {
  const std::vector<std::string> built = built_verbs(folder);
  std::string text =
      "usage: varve VERB [options] ...\n\n"
      "Simulates settling grains in a fluid and records every step, so that a run can be\n"
      "replayed, forked from any step and compared bit for bit.\n";
  for (const Group& group : groups()) {
    std::string lines;
    for (const KnownVerb& verb : group.verbs)
      if (contains(built, verb.name))
        lines += fmt::format("  {:<10} {}\n", verb.name, verb.summary);
    if (!lines.empty()) text += fmt::format("\n{}\n{}", group.title, lines);
  }
  text +=
      "\nfirst steps\n"
      "  varve init column > column.cfg\n"
      "  varve run column.cfg -o column.varve\n"
      "  varve fork column.varve --at 50% --damping 0.25 -o softer.varve\n"
      "  varve diff column.varve softer.varve\n"
      "\nexit codes\n"
      "  0 done, identical     1 differ              2 usage, missing file\n"
      "  3 scenario invalid    4 log damaged         5 numerical failure\n"
      "  6 forks failed        70 internal error     74 output not written\n"
      "  75 stopped on request, resumable\n"
      "\nvarve VERB --help says more; varve --version tells what this was built from.\n";
  return text;
}

[[noreturn]] void run_verb(const std::string& folder, const std::string& verb,
                           std::vector<std::string> words) {
  const std::string path = folder + "/varve-" + verb;
  words[0] = path;
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(path.c_str(), argv.data());
  throw ToolError(exit_internal,
                  fmt::format("{}: could not be started: {}", path, std::strerror(errno)));
}

[[noreturn]] void refuse(const std::string& folder, const std::string& verb) {
  const std::vector<std::string> built = built_verbs(folder);
  const std::vector<std::string_view> names(built.begin(), built.end());
  const std::string_view nearest = nearest_name(verb, names);
  throw UsageError(fmt::format("expected a verb, got '{}'{}", verb,
                               nearest.empty() ? "; varve --help lists them"
                                               : fmt::format("; did you mean '{}'?", nearest)));
}

/// A verb's name: nothing that could leave our folder.
bool is_plain(std::string_view verb) {
  for (char c : verb)
    if (!((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_')) return false;
  return !verb.empty() && verb.front() != '-';
}

int front_door(const std::vector<std::string>& words) {
  const std::string folder = executable_folder();
  if (words.size() < 2) {
    fmt::print(stderr, "{}", help_text(folder));
    return exit_usage;
  }
  std::string verb = words[1];
  std::vector<std::string> rest(words.begin() + 1, words.end());
  if (verb == "help" && words.size() > 2) {
    verb = words[2];
    rest = {verb, "--help"};
  }
  if (verb == "help" || verb == "--help" || verb == "-h") {
    print(help_text(folder));
    return exit_ok;
  }
  if (!is_plain(verb) || !contains(built_verbs(folder), verb)) refuse(folder, verb);
  run_verb(folder, verb, std::move(rest));
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  using namespace varve::tools;
  const std::vector<std::string> words(argv, argv + argc);
  // The verb parses its own options; only the front door's own words are looked at here.
  Verb verb;
  verb.name = "";
  verb.run = [&words](const Invocation&) { return front_door(words); };
  char name[] = "varve";
  char version[] = "--version";
  std::array<char*, 2> own{name, version};
  const bool wants_version = words.size() > 1 && words[1] == "--version";
  return verb_main(wants_version ? 2 : 1, own.data(), verb);
}
