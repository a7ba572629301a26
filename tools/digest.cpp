// varve digest: a run's digests as a small text file, and whole folders of them checked.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/cli.h"
#include "tools/diff_options.h"
#include "tools/diff_run.h"
#include "tools/digest_check.h"
#include "tools/digest_file.h"

namespace {

using namespace varve;
using namespace varve::tools;

// 1, 2 or 5 times a power of ten, so that about a hundred steps are listed.
std::uint64_t default_every(std::uint64_t steps) {
  constexpr std::uint64_t lines = 100;
  std::uint64_t every = 1;
  for (int k = 0; steps / every > lines; ++k) every = k % 3 == 1 ? every / 2 * 5 : every * 2;
  return every;
}

int write_one(const Invocation& invocation) {
  if (invocation.has("bless")) throw UsageError("--bless goes with --check DIR");
  if (invocation.arguments.size() != 1) throw UsageError("expected one RUN, or --check DIR");
  const auto log = open_whole(invocation.arguments[0]);
  const std::uint64_t every =
      invocation.count("every").value_or(default_every(log->last_step() - log->first_step()));
  if (every == 0) throw UsageError("--every: expected a whole number >= 1, got 0");
  DigestFile file = make_digest_file(*log, every);
  if (!invocation.has("output")) {
    print(digest_file_text(file));
    return exit_ok;
  }
  const std::string path = invocation.value("output");
  write_digest_file(file, path, invocation.has("overwrite"));
  if (invocation.globals.json)
    print(nlohmann::ordered_json{{"schema", "varve.digest/1"},
                                 {"file", path},
                                 {"lines", std::to_string(file.lines.size())},
                                 {"every", std::to_string(every)},
                                 {"last_step", std::to_string(file.last_step())},
                                 {"final_chain", file.lines.back().chain.hex()}}
              .dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
          "\n");
  else
    note(invocation.globals,
         fmt::format("{}: {} of {} steps, every {}th and the last", path, file.lines.size(),
                     log->last_step() - log->first_step() + 1, every));
  return exit_ok;
}

int check(const Invocation& invocation) {
  if (!invocation.arguments.empty()) throw UsageError("--check DIR takes no RUN");
  const std::string folder = invocation.value("check");
  CheckOptions options;
  if (invocation.has("bless")) {
    options.bless_reason = invocation.value("bless");
    if (options.bless_reason->empty()) throw UsageError("--bless: a reason is needed");
  }
  if (const auto threads = invocation.count("threads"))
    options.run_arguments = {"--threads", std::to_string(*threads)};
  const std::vector<SceneCheck> scenes = check_scenes(folder, options);
  print(invocation.globals.json ? json_report(scenes) : text_report(scenes));
  if (invocation.has("junit"))
    write_text_file(invocation.value("junit"), junit_report(scenes, folder));
  return exit_code(scenes);
}

int run(const Invocation& invocation) {
  return invocation.has("check") ? check(invocation) : write_one(invocation);
}

Verb verb() {
  Verb out;
  out.name = "digest";
  out.usage = "RUN";
  out.summary = "writes a run's digests as a small text file, to commit as a regression reference";
  out.description =
      "The file holds the scenario's keys and digest, the engine's revision, and the chain of\n"
      "digests at every N-th and the last step; 'varve diff NEW.varve FILE' compares a run with "
      "it.\n"
      "\n"
      "--check DIR runs every DIR/NAME.cfg that has a DIR/NAME.digest and compares. Exit code: 0 "
      "all\n"
      "agree, 1 one differs, 2 one can't be compared. --bless REASON rewrites the digest files "
      "after\n"
      "an intended change; the reason is kept in them.\n"
      "\n"
      "  varve digest column.varve --every 100 -o column.digest\n"
      "  varve digest --check regression --junit regression.xml\n"
      "  varve digest --check regression --bless 'new drag law'\n";
  out.options = {{"every", "N", "list every N-th step (default: about a hundred lines)", false, ""},
                 {"output,o", "FILE", "write here (default: standard output)", false, ""},
                 {"overwrite", "", "replace FILE if it exists", false, ""},
                 {"check", "DIR", "run and compare all scenes of a folder", false, ""},
                 {"bless", "REASON", "with --check: rewrite the digest files", false, ""},
                 {"threads", "N", "with --check: threads of each run", false, ""},
                 {"junit", "FILE", "with --check: write a JUnit report", false, ""}};
  out.arguments_min = 0;
  out.arguments_max = 1;
  out.run = run;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
