// varve diff: compares two runs, or a run with a digest file.
#include <chrono>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/cli.h"
#include "tools/diff_options.h"
#include "tools/diff_report.h"
#include "tools/diff_run.h"
#include "tools/diff_selftest.h"

namespace {

using namespace varve::tools;

int self_test(const Invocation& invocation) {
  if (invocation.arguments.size() != 1)
    throw UsageError("--self-test takes one RUN, a copy of which is changed on purpose");
  const auto log = open_whole(invocation.arguments[0]);
  constexpr std::uint64_t window_steps = 24;
  const SelfTest test = run_self_test(*log, invocation.count("plants").value_or(0), window_steps,
                                      invocation.count("seed").value_or(0));
  if (invocation.globals.json) {
    const nlohmann::ordered_json out{{"schema", "varve.diff.self_test/1"},
                                     {"passed", test.passed()},
                                     {"planted", std::to_string(test.planted)},
                                     {"located", std::to_string(test.located)},
                                     {"equal_pairs", std::to_string(test.equal_pairs)},
                                     {"false_alarms", std::to_string(test.false_alarms)},
                                     {"failures", test.failures}};
    print(out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  } else {
    print(
        fmt::format("self-test {}: {} of {} planted one-bit differences located exactly (step, "
                    "field, particle); {} false alarms in {} equal pairs\n",
                    test.passed() ? "passed" : "FAILED", test.located, test.planted,
                    test.false_alarms, test.equal_pairs));
    for (const std::string& failure : test.failures) print("  " + failure + "\n");
  }
  return test.passed() ? exit_ok : exit_internal;
}

int run(const Invocation& invocation) {
  const std::string annotate = invocation.has("annotate") ? invocation.value("annotate") : "";
  if (!annotate.empty() && annotate != "github")
    throw UsageError(fmt::format("--annotate: '{}' is not known; write github", annotate));
  const DiffOptions options = read_comparison_options(invocation);
  if (invocation.has("self-test")) return self_test(invocation);
  if (invocation.arguments.size() != 2) throw UsageError("expected two arguments (A B), got one");
  const auto start = std::chrono::steady_clock::now();
  const DiffReport report =
      compare_inputs(invocation.arguments[0], invocation.arguments[1], options);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const Globals& globals = invocation.globals;
  if (globals.json) {
    print(json_report(report));
  } else {
    std::string text = text_report(report, globals.quiet);
    const std::size_t line = text.find('\n');
    print(bold(globals, text.substr(0, line)) + text.substr(line));
  }
  if (invocation.has("junit"))
    write_text_file(invocation.value("junit"), junit_report(report, seconds.count()));
  if (annotate == "github") {
    // Runners read workflow commands from both outputs; JSON must stay alone on its own.
    const std::string commands = github_report(report);
    if (globals.json)
      fmt::print(stderr, "{}", commands);
    else
      print(commands);
  }
  return exit_code(report.verdict);
}

Verb verb() {
  Verb out;
  out.name = "diff";
  out.usage = "A B";
  out.summary = "compares two runs, or a run with a digest file, bit by bit";
  out.description =
      "Finds the first step, field and particle in which two runs differ, by bisection over the\n"
      "chain of state digests. A and B are logs or digest files ('varve digest'), in any order.\n"
      "Inputs that differ (parameters, models, compiler, flags) are listed but decide nothing.\n"
      "A fork and its parent, or two forks of one parent, are compared on the steps that both\n"
      "hold. Tolerances are off unless given; a difference within them is called that, never\n"
      "identical.\n"
      "\n"
      "Exit code: 0 identical or within tolerance, 1 different, 2 not comparable, 4 damaged "
      "input.\n"
      "\n"
      "  varve diff column.varve fork.varve\n"
      "  varve diff new.varve column.digest --junit diff.xml --annotate github\n"
      "  varve diff a.varve b.varve --rel 1e-12 --abs fluid.velocity=1e-9 --from t=0.1s\n"
      "  varve diff --self-test column.varve\n";
  out.options = comparison_options();
  out.options.push_back({"junit", "FILE", "write a JUnit report", false, ""});
  out.options.push_back({"annotate", "HOW", "github: print workflow commands", false, ""});
  out.options.push_back({"self-test", "",
                         "plant one-bit differences into copies of one RUN and find them", false,
                         ""});
  out.options.push_back({"plants", "N", "differences planted by --self-test", false, "20"});
  out.options.push_back({"seed", "N", "which ones", false, "1"});
  out.arguments_min = 1;
  out.arguments_max = 2;
  out.run = run;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
