// varve study: sensitivity studies made of runs and forks, from a study file to a report.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/cli.h"
#include "tools/progress.h"
#include "tools/session.h"
#include "tools/study_estimate.h"
#include "tools/study_format.h"
#include "tools/study_lock.h"
#include "tools/study_member.h"
#include "tools/study_plan.h"
#include "tools/study_pool.h"
#include "tools/study_report.h"
#include "tools/study_slurm.h"
#include "tools/study_store.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Request {
  const Invocation& invocation;
  StudyPlan plan;
  StudyStore store;
  std::set<std::size_t> selection;

  explicit Request(const Invocation& from)
      : invocation(from), plan(load_plan(from.arguments.at(1))),
        store(plan, from.has("folder") ? from.value("folder") : plan.file.name + ".results"),
        selection(selected_members(plan, from.has("quick"), only(from))) {
    if (selection.empty())
      throw UsageError(fmt::format("{}: no case has quick = yes{}", plan.file.path,
                                   from.has("only") ? " among those of --only" : ""));
  }
  static std::vector<std::string> only(const Invocation& from) {
    std::vector<std::string> names;
    for (const std::string& list : from.values("only"))
      for (std::string& name : split_list(list)) names.push_back(std::move(name));
    return names;
  }
  /// The selection without those that stand in it twice.
  std::vector<std::size_t> unique() const {
    std::vector<std::size_t> indices;
    std::set<std::string> seen;
    for (const std::size_t index : selection)
      if (seen.insert(plan.members[index].id).second) indices.push_back(index);
    return indices;
  }
};

Json json_of(const StudyPlan& plan, const StudyMember& member) {
  Json varied = Json::object();
  for (const auto& [key, value] : member.varied) varied[key] = value;
  return {{"id", member.id},
          {"case", plan.case_of(member).name},
          {"seed", std::to_string(member.seed)},
          {"varied", varied},
          {"origin", origin_of(plan, member)}};
}

// ---- plan ---------------------------------------------------------------------------------------

struct Totals {
  double seconds = 0, left_s = 0, bytes = 0, kept = 0;
};

Totals totals_of(const StudyPlan& plan, const std::vector<Estimate>& estimates) {
  Totals totals;
  for (const Estimate& each : estimates) {
    totals.seconds += each.seconds;
    if (!each.ended) totals.left_s += each.seconds;
    totals.bytes += each.bytes;
    if (plan.members[each.index].keep == Keep::log) totals.kept += each.bytes;
  }
  return totals;
}

void print_estimates(const Request& request, const std::vector<Estimate>& estimates,
                     unsigned jobs) {
  const Totals totals = totals_of(request.plan, estimates);
  std::map<std::size_t, std::pair<std::size_t, Totals>> by_case;
  for (const Estimate& each : estimates) {
    auto& [count, sum] = by_case[request.plan.members[each.index].case_index];
    ++count;
    sum.seconds += each.seconds;
    sum.bytes += each.bytes;
  }
  print(fmt::format("{:<24} {:>8} {:>12} {:>12}\n", "case", "members", "time", "logs"));
  for (const auto& [index, entry] : by_case)
    print(fmt::format("{:<24} {:>8} {:>12} {:>12}\n", request.plan.file.cases[index].name,
                      entry.first, human_duration(entry.second.seconds),
                      human_bytes(static_cast<std::uint64_t>(entry.second.bytes))));
  print(fmt::format("expected: {} on one core, {} with -j {}; {} still to do; {} of logs, {} "
                    "kept\n",
                    human_duration(totals.seconds), human_duration(totals.seconds / jobs), jobs,
                    human_duration(totals.left_s / jobs),
                    human_bytes(static_cast<std::uint64_t>(totals.bytes)),
                    human_bytes(static_cast<std::uint64_t>(totals.kept))));
}

int show_plan(const Request& request, bool estimate, unsigned jobs) {
  const StudyPlan& plan = request.plan;
  const std::vector<std::size_t> indices = request.unique();
  const std::vector<Estimate> estimates =
      estimate ? estimate_members(plan, request.store, request.selection)
               : std::vector<Estimate>();
  if (request.invocation.globals.json) {
    Json out{{"schema", "varve.study_plan/1"}, {"study", plan.file.path}};
    out["members"] = Json::array();
    for (std::size_t i = 0; i < indices.size(); ++i) {
      Json member = json_of(plan, plan.members[indices[i]]);
      if (estimate) {
        member["expected"] = {{"steps", estimates[i].steps},
                              {"seconds", estimates[i].seconds},
                              {"log_bytes", estimates[i].bytes}};
      }
      out["members"].push_back(std::move(member));
    }
    if (estimate) {
      const Totals totals = totals_of(plan, estimates);
      out["expected"] = {{"seconds", totals.seconds},
                         {"seconds_left", totals.left_s},
                         {"log_bytes", totals.bytes},
                         {"kept_bytes", totals.kept}};
    }
    print(out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
    return exit_ok;
  }
  for (const std::size_t index : indices) {
    const StudyMember& member = plan.members[index];
    print(fmt::format("{}  {:<44} {}\n", member.id, label_of(plan, member),
                      origin_of(plan, member)));
  }
  std::size_t forks = 0;
  for (const std::size_t index : indices) forks += plan.members[index].is_fork;
  print(fmt::format("{} members: {} runs, {} forks; {} measures, {} claims\n", indices.size(),
                    indices.size() - forks, forks, plan.file.measures.size(),
                    plan.file.claims.size()));
  if (estimate) print_estimates(request, estimates, jobs);
  return exit_ok;
}

// ---- run and retry ------------------------------------------------------------------------------

unsigned jobs_of(const Invocation& invocation) {
  const auto jobs = invocation.count("jobs");
  if (jobs && (*jobs < 1 || *jobs > 1024))
    throw UsageError(fmt::format("-j: expected 1 to 1024, got {}", *jobs));
  return static_cast<unsigned>(jobs.value_or(1));
}

int end_code(const PoolResult& result) {
  if (result.output_failed) return exit_output;
  if (result.stopped || result.interrupted > 0) return exit_stopped;
  return result.failed > 0 ? exit_study : exit_ok;
}

int run_selection(const Request& request, const std::set<std::size_t>& selection) {
  PoolOptions options;
  options.jobs = jobs_of(request.invocation);
  options.threads = threads_option(request.invocation);
  options.globals = request.invocation.globals;
  const PoolResult result = run_members(request.plan, request.store, selection, options);
  const int code = end_code(result);
  if (options.globals.json) {
    const Json out{{"schema", "varve.study_run/1"},
                   {"study", request.plan.file.path},
                   {"folder", request.store.folder()},
                   {"members", std::to_string(request.unique().size())},
                   {"done", std::to_string(result.done)},
                   {"already_done", std::to_string(result.skipped)},
                   {"failed", std::to_string(result.failed)},
                   {"interrupted", std::to_string(result.interrupted)},
                   {"stopped", result.stopped}};
    print(out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  } else if (!options.globals.quiet) {
    print(fmt::format("{}: {} done, {} were there, {} failed{}\n",
                      request.store.path("results.csv"), result.done, result.skipped,
                      result.failed,
                      result.interrupted > 0
                          ? fmt::format(", {} interrupted; varve study run goes on",
                                        result.interrupted)
                          : result.stopped ? "; stopped, varve study run goes on" : ""));
  }
  return code;
}

void make_folder(const Request& request) {
  std::error_code failed;
  fs::create_directories(request.store.path("members"), failed);
  if (failed)
    throw ToolError(exit_output,
                    fmt::format("{}: {}", request.store.folder(), failed.message()));
}

/// One member, of a job array: others may be at work in the same folder.
int run_one(const Request& request, const std::string& id) {
  const std::vector<StudyMember>& members = request.plan.members;
  const auto member = std::find_if(members.begin(), members.end(),
                                   [&](const StudyMember& each) { return each.id == id; });
  if (member == members.end())
    throw UsageError(fmt::format("--member: {} has no member '{}'; varve study plan lists them",
                                 request.plan.file.path, id));
  const FolderLock lock(request.store.member_folder(id));
  return run_selection(request, {static_cast<std::size_t>(member - members.begin())});
}

int write_slurm(const Request& request) {
  request.store.write_plan();
  const std::vector<std::string> paths = write_slurm_scripts(
      request.plan, request.store, request.selection,
      {executable_folder() + "/varve-study", threads_option(request.invocation)});
  for (const std::string& path : paths) note(request.invocation.globals, "wrote " + path);
  if (paths.empty()) note(request.invocation.globals, "nothing is left to do");
  return exit_ok;
}

int run(const Request& request) {
  if (request.invocation.has("dry-run"))
    return show_plan(request, true, jobs_of(request.invocation));
  make_folder(request);
  if (request.invocation.has("member"))
    return run_one(request, request.invocation.value("member"));
  if (request.invocation.has("slurm")) return write_slurm(request);
  const FolderLock lock(request.store.folder());
  request.store.write_plan();
  return run_selection(request, request.selection);
}

int retry(const Request& request) {
  make_folder(request);
  const FolderLock lock(request.store.folder());
  std::set<std::size_t> failed;
  for (const std::size_t index : request.selection) {
    const auto row = request.store.read_row(request.plan.members[index].id);
    if (!row || !row->failed) continue;
    request.store.forget(row->id);
    for (std::optional<std::size_t> m = index; m; m = request.plan.members[*m].parent)
      failed.insert(*m);
  }
  if (failed.empty()) {
    note(request.invocation.globals, "nothing failed");
    return exit_ok;
  }
  return run_selection(request, failed);
}

// ---- status -------------------------------------------------------------------------------------

int status(const Request& request) {
  const StudyPlan& plan = request.plan;
  std::map<std::size_t, std::map<MemberState, std::size_t>> by_case;
  std::map<MemberState, std::size_t> all;
  Json failed = Json::array();
  std::string failures;
  for (const std::size_t index : request.unique()) {
    const StudyMember& member = plan.members[index];
    const MemberState state = request.store.state_of(member);
    ++by_case[member.case_index][state];
    ++all[state];
    if (state != MemberState::failed) continue;
    const StudyRow row = request.store.read_row(member.id).value_or(StudyRow{});
    Json entry = json_of(plan, member);
    entry["code"] = row.code;
    entry["error"] = row.error;
    failed.push_back(std::move(entry));
    failures += fmt::format("failed: {} ({}): {}\n", label_of(plan, member), member.id, row.error);
  }
  const auto states = {MemberState::done, MemberState::failed, MemberState::partial,
                       MemberState::unmeasured, MemberState::missing};
  if (request.invocation.globals.json) {
    Json out{{"schema", "varve.study_status/1"},
             {"study", plan.file.path},
             {"folder", request.store.folder()},
             {"members", std::to_string(request.unique().size())}};
    for (const MemberState state : states)
      out[std::string(name_of(state))] = std::to_string(all[state]);
    out["failures"] = failed;
    print(out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  } else {
    print(fmt::format("{:<24} {:>7} {:>7} {:>8} {:>11} {:>8}\n", "case", "done", "failed",
                      "partial", "unmeasured", "missing"));
    for (auto& [index, counts] : by_case)
      print(fmt::format("{:<24} {:>7} {:>7} {:>8} {:>11} {:>8}\n", plan.file.cases[index].name,
                        counts[MemberState::done], counts[MemberState::failed],
                        counts[MemberState::partial], counts[MemberState::unmeasured],
                        counts[MemberState::missing]));
    print(failures);
  }
  return all[MemberState::failed] > 0 ? exit_study : exit_ok;
}

// ---- report -------------------------------------------------------------------------------------

/// Writes a report in the form that its name's ending says.
void write_report(const Document& document, const std::string& path, const std::string& plots) {
  if (path.ends_with(".html")) return write_whole(path, html_of(document));
  if (!path.ends_with(".md"))
    throw UsageError(fmt::format("-o: '{}'; expected a name that ends in .html or .md", path));
  if (plots.empty()) return write_whole(path, markdown_of(document, ""));
  std::error_code failed;
  fs::create_directories(plots, failed);
  if (failed) throw ToolError(exit_output, fmt::format("{}: {}", plots, failed.message()));
  for (const DocumentBlock& block : document.blocks)
    if (const auto* plot = std::get_if<DocumentPlot>(&block))
      write_whole((fs::path(plots) / (plot->name + ".svg")).string(), svg_of(plot->plot));
  const fs::path beside = fs::absolute(path).parent_path();
  write_whole(path, markdown_of(document, fs::absolute(plots).lexically_relative(beside).string()));
}

int report(const Request& request) {
  if (!fs::exists(request.store.path("members")))
    throw UsageError(fmt::format("{}: no results; varve study run {} makes them",
                                 request.store.folder(), request.plan.file.path));
  request.store.write_results();
  const StudyData data(request.plan, request.store);
  const Document document = report_of(data);
  std::vector<std::string> paths = request.invocation.values("output");
  if (paths.empty())
    paths = {request.store.path("report.html"), request.store.path("report.md")};
  const std::string plots =
      request.invocation.has("plots") ? request.invocation.value("plots") : std::string();
  for (const std::string& path : paths) write_report(document, path, plots);
  if (request.invocation.globals.json) {
    Json out{{"schema", "varve.study_report/1"}, {"study", request.plan.file.path}};
    out["files"] = paths;
    out["claims"] = Json::array();
    for (const StudyClaim& claim : request.plan.file.claims) {
      const ClaimResult result = judge(data, claim);
      const auto number = [](double value) { return std::isnan(value) ? Json() : Json(value); };
      out["claims"].push_back({{"id", claim.id},
                               {"verdict", name_of(result.verdict)},
                               {"ours", number(result.ours)},
                               {"spread", number(result.spread)},
                               {"seeds", std::to_string(result.seeds)}});
    }
    print(out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  } else {
    for (const std::string& path : paths) note(request.invocation.globals, "wrote " + path);
  }
  return exit_ok;
}

int study(const Invocation& invocation) {
  if (invocation.has("help-format")) {
    print(study_format);
    return exit_ok;
  }
  if (invocation.arguments.size() != 2)
    throw UsageError("expected plan, run, status, retry or report, and a study file");
  const std::string& action = invocation.arguments[0];
  const std::map<std::string, int (*)(const Request&)> actions{
      {"plan",
       [](const Request& request) {
         return show_plan(request, request.invocation.has("dry-run"),
                          jobs_of(request.invocation));
       }},
      {"run", run},
      {"status", status},
      {"retry", retry},
      {"report", report},
  };
  const auto found = actions.find(action);
  if (found == actions.end()) {
    std::vector<std::string_view> names;
    for (const auto& [name, each] : actions) names.push_back(name);
    const std::string_view near = nearest_name(action, names);
    throw UsageError(fmt::format("expected one of {}, got '{}'{}", fmt::join(names, ", "), action,
                                 near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
  }
  return found->second(Request(invocation));
}

Verb verb() {
  Verb verb;
  verb.name = "study";
  verb.usage = "plan|run|status|retry|report FILE";
  verb.summary = "Runs and forks over varied keys, what is measured of them, and a report.";
  verb.description =
      "A study file names cases (scenarios or forks, keys to vary, seeds), measures and claims;\n"
      "--help-format describes it. What is done is recognised by its content and not run again; a\n"
      "killed study goes on where it was; what fails stays as a row and gives exit 6.\n\n"
      "  varve study plan damping.study --dry-run      what would be run, how long, how large\n"
      "  varve study run damping.study -j 2\n"
      "  varve study status damping.study\n"
      "  varve study retry damping.study               only what failed\n"
      "  varve study report damping.study -o damping.html -o damping.md\n";
  verb.options = {
      {"folder", "DIR", "folder of the results [NAME.results]", false, ""},
      {"jobs,j", "N", "members side by side", false, "1"},
      {"quick", "", "only cases with quick = yes", false, ""},
      {"only", "CASES", "only these cases (and what they are forked from); n* for many", true, ""},
      {"output,o", "FILE", "of report: page (.html) or Markdown (.md) [both, in the folder]", true,
       ""},
      {"plots", "DIR", "of report: SVG files that the Markdown shows", false, ""},
      {"dry-run", "", "of plan and run: print the plan, expected time and bytes", false, ""},
      {"slurm", "", "of run: write scripts of job arrays instead of running", false, ""},
      {"member", "ID", "of run: this member alone, as a task of such an array", false, ""},
      threads_spec(),
      {"help-format", "", "the format of study files", false, ""},
  };
  verb.arguments_min = 0;
  verb.arguments_max = 2;
  verb.run = study;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
