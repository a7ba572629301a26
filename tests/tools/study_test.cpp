// varve study as a user runs it: what is planned, run, recognised, resumed, kept and reported.
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/json_schema.h"
#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Rows of a CSV file without quoted cells, by column.
std::vector<std::map<std::string, std::string>> rows_of(const std::string& path) {
  std::istringstream lines(text_of(path));
  std::string line, cell;
  std::vector<std::string> names;
  std::getline(lines, line);
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
  std::vector<std::map<std::string, std::string>> rows;
  while (std::getline(lines, line)) {
    rows.emplace_back();
    std::size_t k = 0;
    for (std::istringstream cells(line); std::getline(cells, cell, ','); ++k)
      rows.back()[names.at(k)] = cell;
  }
  return rows;
}

/// Two seeds of six grains, forks of both with another damping and with none.
constexpr const char* study = R"([study]
title = Six grains
seeds = 2
[case.base]
scenario = crowd.cfg
quick = yes
quick_seeds = 1
[case.damped]
scenario = crowd.cfg
vary.contact.damping = 0.1, 0.2
[case.forks]
parent = case.base
at = 60
vary.contact.damping = 0.2, 0.3
[measure.speed]
value = mean(settling.settling_speed_m_s, 0.02 s)
unit = m/s
[measure.lowest]
value = last(settling.lowest_y_m)
[measure.never]
value = rest_time_s
[curve.v]
value = settling.settling_speed_m_s
points = 20
[figure.1]
title = Six
cases = damped, forks
curves = v
[claim.Q1]
figure = 1
text = they sink
kind = direction
value = lowest[base] > 0
expected = true
)";

class Study : public testing::Test {
 protected:
  void SetUp() override {
    folder_.write("crowd.cfg", crowd_scene());
    folder_.write("six.study", study);
  }
  /// varve study with --json in the folder; what it prints must fit its schema.
  Json json(int code, const std::string& action, std::vector<std::string> more = {},
            const std::string& file = "six.study") {
    std::vector<std::string> words{"study", action, file, "-q"};
    words.insert(words.end(), more.begin(), more.end());
    const Json out = json_verb(code, words, folder_.path());
    const std::string schema = "study_" + (action == "retry" ? std::string("run") : action);
    EXPECT_THAT(JsonSchema(schema).breaches(out), IsEmpty()) << out.dump(1);
    return out;
  }
  std::string results(const std::string& folder = "six.results") const {
    return text_of(folder_ / (folder + "/results.csv"));
  }
  std::string errors(const std::string& file, int code = 3) {
    return verb(code, {"study", "plan", file}, folder_.path()).errors;
  }
  TemporaryFolder folder_;
};

TEST_F(Study, PlansEveryMemberUnderAnIdOfWhatDefinesIt) {
  const Json plan = json(0, "plan");
  // Damping 0.2 is the scenario's own: those runs are the base's.
  ASSERT_EQ(plan["members"].size(), 8u);
  std::map<std::string, std::string> ids;
  for (const Json& each : plan["members"])
    ids[each["case"].get<std::string>() + each["varied"].dump() + each["seed"].dump()] = each["id"];
  EXPECT_EQ(ids.size(), 8u);
  // What is measured or claimed, and how it is called, changes nothing of the runs.
  std::string other = study;
  other.replace(other.find("Six grains"), 10, "Six stones");
  folder_.write("other.study", other + "[measure.more]\nvalue = contacts.first_s\n");
  EXPECT_EQ(json(0, "plan", {}, "other.study")["members"], plan["members"]);
  // A key of the scenario changes its runs, and the forks that come from them.
  folder_.write("crowd.cfg", crowd_scene("[contact]\nfriction = 0.2\n"));
  std::set<std::string> before, after;
  for (const Json& each : plan["members"]) before.insert(each["id"].get<std::string>());
  for (const Json& each : json(0, "plan")["members"]) after.insert(each["id"].get<std::string>());
  for (const std::string& id : after) EXPECT_EQ(before.count(id), 0u);
}

TEST_F(Study, DryRunPredictsAndRunsNothing) {
  for (const char* action : {"plan", "run"}) {
    std::vector<std::string> words{"study", action, "six.study", "--dry-run"};
    const Json out = json_verb(0, words, folder_.path());
    EXPECT_THAT(JsonSchema("study_plan").breaches(out), IsEmpty()) << out.dump(1);
    EXPECT_GT(out["expected"]["seconds"], 0);
    EXPECT_GT(out["expected"]["log_bytes"], 1e5);
    EXPECT_LT(out["expected"]["log_bytes"], 1e8);
    EXPECT_EQ(out["members"][0]["expected"]["steps"], 120);
  }
  EXPECT_FALSE(fs::exists(folder_ / "six.results"));
  EXPECT_THAT(verb(0, {"study", "plan", "six.study", "--dry-run"}, folder_.path()).output,
              HasSubstr("expected: "));
}

TEST_F(Study, RunsOnceAndTheSameWhateverTheOrder) {
  const Json first = json(0, "run", {"-j", "2"});
  EXPECT_EQ(first["done"], "8");
  const std::string csv = results();
  const auto rows = rows_of(folder_ / "six.results/results.csv");
  ASSERT_EQ(rows.size(), 10u) << "the shared members stand in both cases";
  for (const auto& row : rows) {
    EXPECT_EQ(row.at("status"), "ok");
    EXPECT_EQ(std::strtod(row.at("speed").c_str(), nullptr),
              std::strtod(row.at("speed_hex").c_str(), nullptr));
    EXPECT_EQ(row.at("never"), "");
  }
  // A member is what the verbs make of the same scenario by hand.
  verb(0, {"run", "crowd.cfg", "-o", "hand.varve", "-q", "-s", "grains.seed=2"}, folder_.path());
  const std::string log = folder_ / ("six.results/members/" + rows[1].at("id") + "/run.varve");
  EXPECT_EQ(chain_at(log, 120), chain_at(folder_ / "hand.varve", 120));
  // A fork that changes nothing ends where its parent ends; the other does not.
  EXPECT_EQ(rows[6].at("case"), "forks");
  EXPECT_EQ(rows[6].at("contact.damping"), "0.2");
  EXPECT_EQ(rows[6].at("lowest_hex"), rows[0].at("lowest_hex"));
  EXPECT_NE(rows[8].at("lowest_hex"), rows[0].at("lowest_hex"));

  const Json again = json(0, "run");
  EXPECT_EQ(again["done"], "0");
  EXPECT_EQ(again["already_done"], "8");
  EXPECT_EQ(results(), csv);
  json(0, "run", {"--folder", "one", "-j", "1"});
  EXPECT_EQ(results("one"), csv);
  EXPECT_THAT(csv, Not(HasSubstr(folder_.path())));
}

TEST_F(Study, AWrongFileIsRefusedWithEveryErrorAtItsPlace) {
  folder_.write("bad.study", R"([study]
seeds = many
[case.a]
scenario = crowd.cfg
set.contact.dampin = 0.1
vary.contact.damping = 0.1, lots
[case.b]
scenario = nowhere.cfg
[case.c]
parent = case.aa
at = 10
[case.d]
parent = case.e
at = 10
set.fluid.spacing = 2 mm
[case.e]
scenario = crowd.cfg
colour = red
[case.f]
scenario = crowd.cfg
parent = case.e
[case.g]
scenario = crowd.cfg
seeds = 2
set.grains.jitter = 0
[measure.m]
value = mean(settling.setling_speed_m_s)
cases = x*
[measure.n]
unit = s
[claim.Q1]
kind = value
value = m[a] + k[a]
expected = about 3
[claim.Q2]
value = spread(m[a])
[figre.1]
)");
  const std::string all = errors("bad.study");
  for (const char* each : {
           "bad.study:2:9: error: seeds: 'many' is no seed",
           "bad.study:5:1: error: unknown key 'contact.dampin'; did you mean 'contact.damping'?",
           "bad.study:6:24: error: contact.damping: 'lots' is not a number",
           "bad.study:8:12: error: scenario: 'nowhere.cfg' is neither a file nor one of the ",
           "bad.study:10:10: error: parent: there is no case 'aa'; did you mean 'a'?",
           "bad.study:15:1: error: fluid.spacing: cannot change in a fork",
           "bad.study:18:1: error: unknown key 'colour' in [case.e]",
           "bad.study:19:1: error: case 'f': both a scenario and a parent",
           "bad.study:22:1: error: case 'g': 2 seeds, but grains.jitter is 0",
           "bad.study:27:14: error: value: table 'settling' has no column 'setling_speed_m_s'; did "
           "you mean 'settling_speed_m_s'?",
           "bad.study:28:9: error: there is no case 'x*'",
           "bad.study:29:1: error: measure 'n' has no value",
           "bad.study:33:16: error: there is no measure 'k'",
           "bad.study:34:12: error: expected: 'about 3'; expected A .. B",
           "bad.study:35:1: error: claim 'Q2': no kind",
           "bad.study:36:9: error: value: unknown function 'spread'",
           "bad.study:37:1: error: unknown section 'figre.1'; did you mean 'figure.1'?"})
    EXPECT_THAT(all, HasSubstr(each));
  folder_.write("empty.study", "[study]\ntitle = none\n");
  EXPECT_THAT(errors("empty.study"), HasSubstr("empty.study: error: no case"));
  EXPECT_THAT(errors("gone.study", 2), HasSubstr("gone.study: No such file"));
  folder_.write("round.study", "[case.a]\nparent = case.b\nat = 1\n[case.b]\nparent = case.a\n"
                               "at = 1\n");
  EXPECT_THAT(errors("round.study"), HasSubstr("'a' comes from itself"));
}

TEST_F(Study, IncludedFilesJoinIt) {
  folder_.write("all.study", "[study]\ninclude = six.study, two.study\n");
  folder_.write("two.study", "[study]\nseeds = 3\ninclude = all.study\n[case.more]\n"
                             "scenario = crowd.cfg\nset.contact.friction = 0.1\n");
  EXPECT_EQ(json(0, "plan", {}, "all.study")["members"].size(), 11u);
  folder_.write("two.study", "[case.base]\nscenario = crowd.cfg\n");
  EXPECT_THAT(errors("all.study"),
              HasSubstr("two.study:1:1: error: case 'base' was already described at"));
}

TEST_F(Study, WhatFailsStaysAsARowAndCanBeRetried) {
  folder_.write("failing.study", R"([case.good]
scenario = crowd.cfg
[case.fast]
scenario = crowd.cfg
set.guards.speed = 0.05
[case.late]
parent = case.good
at = 5000
[case.orphan]
parent = case.fast
at = 10
[measure.x]
value = last(settling.lowest_y_m)
)");
  EXPECT_EQ(json(6, "run", {"-j", "2"}, "failing.study")["failed"], "3");
  const std::string csv = results("failing.results");
  EXPECT_THAT(csv, HasSubstr(",good,1,ok,,120,"));
  EXPECT_THAT(csv, HasSubstr(",fast,1,failed,"));
  EXPECT_THAT(csv, HasSubstr("its parent failed: "));
  EXPECT_THAT(csv, Not(HasSubstr(folder_.path())));
  const Json status = json(6, "status", {}, "failing.study");
  EXPECT_EQ(status["done"], "1");
  EXPECT_EQ(status["failures"].size(), 3u);
  EXPECT_EQ(status["failures"][0]["code"], 5) << status["failures"][0]["error"];
  EXPECT_THAT(status["failures"][1]["error"].get<std::string>(), HasSubstr("5000"));
  // Nothing but the failed ones is run again, to the same end.
  const Json again = json(6, "run", {}, "failing.study");
  EXPECT_EQ(again["done"], "0");
  EXPECT_EQ(again["failed"], "3");
  const Json retried = json(6, "retry", {}, "failing.study");
  EXPECT_EQ(retried["already_done"], "1");
  EXPECT_EQ(retried["failed"], "3");
  EXPECT_EQ(results("failing.results"), csv);
}

/// As study, with runs long enough to be met while they go on.
std::string slow_study() {
  return R"([case.long]
scenario = long.cfg
vary.contact.damping = 0.1, 0.2
[case.forks]
parent = case.long[contact.damping=0.1]
at = 700
vary.contact.damping = 0.2, 0.3
[case.until]
scenario = long.cfg
until = 0.02 s
stop_when = last(settling.lowest_y_m) < 2.9 mm
check_every = 0.02 s
until_max = 0.2 s
[measure.x]
value = last(settling.lowest_y_m)
[measure.mean]
value = mean(settling.settling_speed_m_s)
)";
}

TEST_F(Study, KilledAtAnyTimeItGoesOnToTheSameResults) {
  folder_.write("long.cfg", long_scene());
  folder_.write("slow.study", slow_study());
  const auto begun = std::chrono::steady_clock::now();
  json(0, "run", {"-j", "2", "--folder", "whole"}, "slow.study");
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
  const std::string expected = results("whole");
  const char* wanted = std::getenv("VARVE_LONG");
  const int kills = wanted && std::string(wanted) != "0" ? 10 : 3;
  std::mt19937 chance(7);
  std::uniform_real_distribution<double> part(0.05, 0.3);
  int met = 0;
  for (int k = 0; k < kills; ++k) {
    Background running({"study", "run", folder_ / "slow.study", "-j", "2", "--folder",
                        folder_ / "killed", "-q"});
    std::this_thread::sleep_for(part(chance) * took);
    running.signal(SIGKILL);
    if (running.wait() == 128 + SIGKILL) ++met;
    // Whatever is there is whole: header and rows, none of them in half.
    const std::string csv = results("killed");
    EXPECT_TRUE(csv.empty() || csv.ends_with("\n")) << csv;
  }
  EXPECT_GE(met, 1) << "the study was over before it could be killed";
  json(0, "run", {"-j", "2", "--folder", "killed"}, "slow.study");
  EXPECT_EQ(results("killed"), expected);
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "killed"))
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr(".XXXXXX")));
  EXPECT_THAT(expected, HasSubstr(",rule,")) << "the rule for stopping held";
}

TEST_F(Study, ASignalLetsMembersCloseTheirLogs) {
  folder_.write("long.cfg", long_scene());
  folder_.write("slow.study", slow_study());
  Background running({"study", "run", folder_ / "slow.study", "-j", "2", "--folder",
                      folder_ / "stopped", "-q"});
  const auto any_log = [&] {
    std::error_code ignored;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "stopped", ignored))
      if (entry.path().filename() == "run.varve") return true;
    return false;
  };
  for (int k = 0; k < 1000 && !any_log(); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  running.signal(SIGTERM);
  EXPECT_EQ(running.wait(), 75);
  const Json status = json(0, "status", {"--folder", "stopped"}, "slow.study");
  EXPECT_NE(status["partial"], "0");
  EXPECT_NE(status["missing"], "0");
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "stopped"))
    if (entry.path().filename() == "run.varve") {
      EXPECT_EQ(json_verb(0, {"show", entry.path().string(), "--at", "last"})["schema"],
                "varve.show/1");
    }
  json(0, "run", {"-j", "2", "--folder", "stopped"}, "slow.study");
}

TEST_F(Study, QuickAndOnlyChooseCases) {
  EXPECT_EQ(json(0, "plan", {"--quick"})["members"].size(), 1u);
  // Forks come with what they are forked from.
  EXPECT_EQ(json(0, "plan", {"--only", "forks"})["members"].size(), 6u);
  EXPECT_EQ(json(0, "plan", {"--only", "da*"})["members"].size(), 4u);
  EXPECT_EQ(json(0, "run", {"--quick"})["done"], "1");
  const auto rows = rows_of(folder_ / "six.results/results.csv");
  EXPECT_EQ(rows.size(), 2u) << "the member that two cases share";
  EXPECT_THAT(verb(2, {"study", "plan", "six.study", "--only", "damp"}, folder_.path()).errors,
              HasSubstr("has no case 'damp'; did you mean 'damped'?"));
}

/// Bytes of everything below a folder.
std::uintmax_t bytes_in(const std::string& folder) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

TEST_F(Study, KeepBoundsTheDisk) {
  const auto with = [&](const std::string& keep, const std::string& more = "") {
    std::string text = study;
    text.replace(text.find("seeds = 2"), 9, "seeds = 2\nkeep = " + keep);
    folder_.write(keep + ".study", text + more);
    return json(0, "run", {"-j", "2"}, keep + ".study");
  };
  for (const char* keep : {"log", "digests", "none"}) EXPECT_EQ(with(keep)["done"], "8") << keep;
  const auto all = bytes_in(folder_ / "log.results"), few = bytes_in(folder_ / "digests.results"),
             none = bytes_in(folder_ / "none.results");
  EXPECT_GT(all, 2000000u);
  EXPECT_LT(few, all / 10);
  EXPECT_LT(none, few);
  EXPECT_EQ(results("digests.results"), results("log.results"));
  EXPECT_EQ(results("none.results"), results("log.results"));
  for (const char* keep : {"digests", "none"})
    EXPECT_EQ(with(keep)["already_done"], "8") << keep;
  // A measure that comes later is taken of a log that is there, and needs another run of one that
  // is not; what is measured does not depend on that.
  const std::string more = "[measure.more]\nvalue = max(settling.max_speed_m_s)\n";
  const auto chain = text_of(folder_ / "log.results/timings.csv");
  EXPECT_EQ(with("log", more)["done"], "8");
  EXPECT_EQ(with("none", more)["done"], "8");
  EXPECT_EQ(results("none.results"), results("log.results"));
  EXPECT_THAT(results("log.results"), HasSubstr(",more,more_hex\n"));
}

TEST_F(Study, ALogThatIsNoLongerWholeIsMadeAgain) {
  json(0, "run", {"-j", "2"});
  const std::string csv = results();
  const auto rows = rows_of(folder_ / "six.results/results.csv");
  const std::string cut = folder_ / ("six.results/members/" + rows[0].at("id") + "/run.varve");
  fs::resize_file(cut, fs::file_size(cut) / 2);
  const std::string gone = folder_ / ("six.results/members/" + rows[9].at("id") + "/run.varve");
  fs::remove(gone);
  EXPECT_EQ(json(0, "status")["done"], "6");
  EXPECT_EQ(json(0, "run")["done"], "2");
  EXPECT_EQ(results(), csv);
}

TEST_F(Study, TheReportIsOnePageAndMarkdown) {
  json(0, "run", {"-j", "2"});
  const Json out = json(0, "report");
  ASSERT_EQ(out["claims"].size(), 1u);
  EXPECT_EQ(out["claims"][0]["verdict"], "reproduced");
  EXPECT_EQ(out["claims"][0]["seeds"], "2");
  const std::string html = text_of(folder_ / "six.results/report.html");
  const std::string markdown = text_of(folder_ / "six.results/report.md");
  EXPECT_THAT(html, HasSubstr("<svg"));
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src="), std::string::npos);
  EXPECT_THAT(markdown, HasSubstr("| contact.damping | damped | 4 |"));
  EXPECT_THAT(markdown, HasSubstr("| Q1 | 1 | they sink |"));
  EXPECT_THAT(markdown, Not(HasSubstr(folder_.path())));
  verb(0, {"study", "report", "six.study", "-q", "-o", "R.md", "--plots", "plots"},
       folder_.path());
  EXPECT_THAT(text_of(folder_ / "R.md"), HasSubstr("![1: v](plots/1_v.svg)"));
  EXPECT_TRUE(fs::exists(folder_ / "plots/1_v.svg"));
  EXPECT_THAT(verb(2, {"study", "report", "six.study", "-o", "R.pdf"}, folder_.path()).errors,
              HasSubstr("ends in .html or .md"));
}

TEST_F(Study, JobArraysRunOneMemberATask) {
  verb(0, {"study", "run", "six.study", "--slurm", "--threads", "2"}, folder_.path());
  const std::string runs = text_of(folder_ / "six.results/slurm/array-0-0.sh");
  EXPECT_THAT(runs, HasSubstr("#SBATCH --array=0-3\n"));
  EXPECT_THAT(runs, HasSubstr("--cpus-per-task=2"));
  EXPECT_THAT(text_of(folder_ / "six.results/slurm/array-1-0.sh"),
              HasSubstr("#SBATCH --array=0-3\n"));
  EXPECT_THAT(text_of(folder_ / "six.results/slurm/submit.sh"),
              HasSubstr("after=--dependency=afterany$jobs\njobs=\n"));
  // Tasks as Slurm would start them, forks last.
  for (const char* script : {"array-0-0.sh", "array-1-0.sh"})
    for (const char* task : {"0", "1", "2", "3"}) {
      const CommandResult result =
          run_command({"/bin/bash", folder_ / "six.results/slurm" + ("/" + std::string(script))},
                      {folder_.path(), {{"SLURM_ARRAY_TASK_ID", task}}, ""});
      EXPECT_EQ(result.code, 0) << result.output << result.errors;
    }
  EXPECT_EQ(json(0, "status")["done"], "8");
  const std::string csv = results();
  json(0, "run", {"-j", "2", "--folder", "local"});
  EXPECT_EQ(results("local"), csv);
  EXPECT_THAT(verb(2, {"study", "run", "six.study", "--member", "abc"}, folder_.path()).errors,
              HasSubstr("has no member 'abc'"));
}

TEST_F(Study, TwoAtATimeInOneFolderAreRefused) {
  folder_.write("long.cfg", long_scene());
  folder_.write("slow.study", slow_study());
  Background running({"study", "run", folder_ / "slow.study", "--folder", folder_ / "slow", "-q"});
  for (int k = 0; k < 1000 && !fs::exists(folder_ / "slow/plan.csv"); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_THAT(verb(2, {"study", "run", "slow.study", "--folder", "slow"}, folder_.path()).errors,
              HasSubstr(fmt::format("another varve study is at work here (process {})",
                                    running.pid())));
  running.signal(SIGTERM);
  running.wait();
}

TEST_F(Study, SaysWhatItWants) {
  EXPECT_THAT(verb(2, {"study", "plam", "six.study"}, folder_.path()).errors,
              HasSubstr("got 'plam'; did you mean 'plan'?"));
  EXPECT_THAT(verb(2, {"study", "run"}, folder_.path()).errors, HasSubstr("and a study file"));
  EXPECT_THAT(verb(0, {"study", "--help-format"}).output, HasSubstr("[measure.NAME]"));
  EXPECT_THAT(verb(2, {"study", "report", "six.study"}, folder_.path()).errors,
              HasSubstr("no results; varve study run six.study makes them"));
}

}  // namespace
}  // namespace varve::test
