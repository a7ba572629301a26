// varve validate: the engine against published numbers and closed forms.
#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "tools/cli.h"
#include "tools/validate.h"

namespace varve::tools {
namespace {

using Cases = std::vector<const ValidationCase*>;

Cases wanted(const Invocation& invocation) {
  if (invocation.has("only")) {
    if (invocation.has("all") || invocation.has("convergence") || invocation.has("restitution"))
      throw UsageError("--only names the cases; expected it without --all, --convergence and "
                       "--restitution");
    return chosen_cases(invocation.values("only"));
  }
  const bool all = invocation.has("all");
  const bool convergence = invocation.has("convergence");
  const bool restitution = invocation.has("restitution");
  Cases cases;
  for (const ValidationCase& test : validation_cases()) {
    const bool takes = all || (test.kind == CaseKind::convergence && convergence) ||
                       (test.kind == CaseKind::restitution && restitution) ||
                       (test.kind == CaseKind::fast && !convergence && !restitution);
    if (takes) cases.push_back(&test);
  }
  return cases;
}

std::string listed(const Cases& cases) {
  constexpr const char* when[] = {"", "--all", "--restitution", "--convergence"};
  std::string text;
  for (const ValidationCase* test : cases)
    text += fmt::format("{:<4} {:<24} {:<14} {}\n", test->gate, test->name,
                        when[static_cast<int>(test->kind)], test->title);
  return text;
}

/// Runs the cases on `jobs` threads; calls `done` under a lock, in the order of the list.
template <class Done>
std::vector<CaseResult> run_all(const Cases& cases, std::size_t jobs, Done done) {
  std::vector<CaseResult> results(cases.size());
  std::vector<char> ready(cases.size(), 0);
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t told = 0;
  const auto work = [&] {
    for (std::size_t k = next++; k < cases.size(); k = next++) {
      CaseResult result = run_case(*cases[k]);
      const std::lock_guard lock(mutex);
      results[k] = std::move(result);
      ready[k] = 1;
      for (; told < cases.size() && ready[told]; ++told) done(results[told]);
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t n = 1; n < jobs; ++n) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  return results;
}

std::string summary(const std::vector<CaseResult>& results) {
  std::size_t rows[4] = {};
  double seconds = 0;
  for (const CaseResult& result : results) {
    seconds += result.seconds;
    for (const ValidationRow& row : result.rows) ++rows[static_cast<int>(row.verdict())];
  }
  return fmt::format("{} rows pass, {} fail, {} missed for a stated reason, {} reported; "
                     "{:.1f} s of CPU\n",
                     rows[0], rows[1], rows[2], rows[3], seconds);
}

int run(const Invocation& invocation) {
  const bool json = invocation.globals.json;
  if (invocation.has("list")) {
    Cases cases;
    for (const ValidationCase& test : validation_cases()) cases.push_back(&test);
    print(listed(invocation.has("only") ? wanted(invocation) : cases));
    return exit_ok;
  }
  const Cases cases = wanted(invocation);
  const std::size_t jobs =
      std::min<std::size_t>(invocation.count("jobs").value_or(1), cases.size());
  if (jobs == 0) throw UsageError("--jobs: expected a whole number >= 1, got '0'");
  // Lines are collected here and printed by this thread alone, since print() may end the verb.
  if (!json)
    print(fmt::format("     {:<44} {:>12} {:>12}{:<6} {:>10}  {:<18} {}\n", "quantity",
                      "reference", "ours", "", "deviation", "tolerance", "verdict"));
  const std::vector<CaseResult> results = run_all(cases, jobs, [&](const CaseResult& result) {
    note(invocation.globals, fmt::format("{}: {}", result.test->name, name_of(result.verdict())));
  });
  bool failed = false;
  for (const CaseResult& result : results) {
    failed = failed || result.verdict() == Verdict::fail;
    if (!json) print(text_of(result));
  }
  print(json ? json_of(results) : summary(results));
  return failed ? exit_differ : exit_ok;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  using namespace varve::tools;
  Verb verb;
  verb.name = "validate";
  verb.usage = "";
  verb.summary = "the engine against published numbers";
  verb.description =
      "Runs scenes with a known answer and prints, row by row, the reference and its source, our\n"
      "value, the deviation, the tolerance and the verdict. Rows without a tolerance are reported\n"
      "only; 'missed' is outside the tolerance for a reason that is printed with it. By default\n"
      "the fast cases, about a minute of CPU.\n"
      "\n"
      "Exit codes: 0 no gate fails, 1 a gate fails, 2 wrong usage.\n"
      "\n"
      "  varve validate                       the fast cases\n"
      "  varve validate --list                every case, its gate, and what it is\n"
      "  varve validate --only poiseuille --only T13\n"
      "  varve validate --all --jobs 2        the slow ones too: many minutes\n"
      "  varve validate --restitution         rebound, dry and wet, beside theory\n"
      "  varve validate --convergence         error against spacing, step and precision\n"
      "  varve validate --json | jq '.cases[].rows[] | select(.verdict == \"FAIL\")'\n";
  verb.options = {
      {"only", "NAME", "this case, or all cases of this gate (T1 ... T17)", true, ""},
      {"all", "", "every case, the slow ones too", false, ""},
      {"convergence", "", "only the studies of convergence and precision", false, ""},
      {"restitution", "", "only the tables of rebound", false, ""},
      {"list", "", "name the cases, run nothing", false, ""},
      {"jobs,j", "N", "cases at a time, each on one thread", false, "1"},
  };
  verb.run = run;
  return verb_main(argc, argv, verb);
}
