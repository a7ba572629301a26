#include "tools/study_member.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/units.h"
#include "io/errors.h"
#include "io/log_reader.h"
#include "tools/cli.h"
#include "tools/recording.h"
#include "tools/simulation_engine.h"
#include "tools/study_process.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string last_line(const std::string& path) {
  std::ifstream file(path);
  std::string line, last;
  while (std::getline(file, line))
    if (!line.empty()) last = line;
  return last;
}

class Member {
 public:
  Member(const StudyPlan& plan, const StudyStore& store, const StudyMember& member,
         unsigned threads)
      : plan_(plan), store_(store), member_(member), each_(plan.case_of(member)),
        folder_(store.member_folder(member.id)), log_(store.log_path(member.id)),
        threads_(threads) {}

  int execute() {
    fs::create_directories(folder_);
    timing_ = store_.read_timing(member_.id);
    row_.id = member_.id;
    row_.stop = "end";
    const MemberState state = store_.state_of(member_);
    if (state == MemberState::done) return exit_ok;
    if (state == MemberState::failed) return exit_study;
    if (state == MemberState::unmeasured) {
      row_ = *store_.read_row(member_.id);
      return measure_and_write();
    }
    const auto begun = std::chrono::steady_clock::now();
    const int code = simulate();
    timing_.run_s += seconds_since(begun);
    if (code == exit_stopped || code == exit_output || code > 128) {
      store_.write_timing(member_.id, timing_);
      return code == exit_output ? exit_output : exit_stopped;
    }
    if (code != exit_ok) return fail(code, failure_text(code));
    return measure_and_write();
  }

 private:
  static double seconds_since(std::chrono::steady_clock::time_point begun) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }
  std::string file(const char* name) const { return (fs::path(folder_) / name).string(); }

  /// Runs a verb in the member's folder, where no path says anything of the machine.
  int verb(std::vector<std::string> words) {
    words[0] = executable_folder() + "/varve-" + words[0];
    const PassSignals pass;
    return run_child(words, folder_, "out.json", "out.txt");
  }
  void add_common(std::vector<std::string>& words) const {
    words.insert(words.end(), {"--json", "--progress", "none", "--threads",
                               std::to_string(threads_)});
  }

  /// Whether the log that is there is this member's, as far as it goes.
  bool log_is_ours() const {
    if (!fs::exists(log_)) return false;
    try {
      const auto log = io::LogReader::open(log_);
      const io::Genesis& genesis = log->genesis();
      if (genesis.engine_revision != core::engine_revision) return false;
      if (!member_.is_fork) return genesis.scenario == member_.text;
      return genesis.lineage.has_value();  // the folder's name is the hash of the rest
    } catch (const io::LogError&) {
      return false;
    }
  }

  /// To the end of the run, from wherever it stands. Exit code of the last verb.
  int simulate() {
    int code = exit_ok;
    if (log_is_ours()) {
      code = resume({});
      // What can't be resumed is begun again.
      if (code == exit_damaged || code == exit_usage) code = start();
    } else {
      code = start();
    }
    if (code == exit_ok && each_.stop_when) code = extend();
    return code;
  }

  int start() {
    std::error_code ignored;
    fs::remove(log_, ignored);
    return member_.is_fork ? start_fork() : start_run();
  }

  int start_run() {
    write_whole(file("scenario.cfg"), member_.text);
    for (const auto& [name, content] : member_.files) {
      fs::create_directories(fs::path(file(name.c_str())).parent_path());
      write_whole(file(name.c_str()), content);
    }
    std::vector<std::string> words{"run", "scenario.cfg", "-o", "run.varve", "--overwrite"};
    add_common(words);
    return verb(std::move(words));
  }

  int start_fork() {
    const std::string parent =
        member_.parent ? "../" + plan_.members[*member_.parent].id + "/run.varve"
                       : fs::absolute(member_.parent_path).string();
    std::vector<std::string> words{"fork", parent, "--at", each_.at, "-o", "run.varve",
                                   "--overwrite"};
    for (const auto& [key, value] : member_.changes)
      words.insert(words.end(), {"-s", fmt::format("{}={}", key, value)});
    const auto add = [&](const char* option, const std::string& value) {
      if (!value.empty()) words.insert(words.end(), {option, value});
    };
    if (!member_.perturb.empty()) {
      add("--perturb", member_.perturb);
      add("--seed", std::to_string(member_.seed));
    }
    if (each_.ramp_time) add("--ramp-time", core::number_text(*each_.ramp_time));
    add("--outside", each_.outside);
    add("--anchor", each_.anchor);
    add("--until", each_.until.value_or(""));
    add("--steps", each_.steps.value_or(""));
    add_common(words);
    return verb(std::move(words));
  }

  int resume(const std::string& until) {
    std::vector<std::string> words{"resume", "run.varve"};
    if (!until.empty()) words.insert(words.end(), {"--until", until});
    add_common(words);
    return verb(std::move(words));
  }

  /// The rule for stopping is looked at whenever the log ends at one of its times; a log that was
  /// interrupted between two of them goes on to the next.
  int extend() {
    double until = 0;
    read_number(each_.until.value_or("0"), {0, 0, 1}, until);
    for (;; until = std::min(until + each_.check_every, each_.until_max)) {
      const auto log = io::LogReader::open(log_);
      const std::uint64_t last = log->last_step();
      const auto end = log->header(last), before = log->header(last == 0 ? 0 : last - 1);
      const Target target{std::nullopt, until};
      const bool limit = until >= each_.until_max;
      if (!end || (last > 0 && before && target.reached(last - 1, before->time))) {
        if (limit) break;
        continue;  // it is further: the rule did not hold here
      }
      if (!target.reached(last, end->time)) {
        const int code = resume(core::number_text(until));
        if (code != exit_ok) return code;
      }
      if (rule_holds()) {
        row_.stop = "rule";
        return exit_ok;
      }
      if (limit) break;
    }
    row_.stop = "limit";
    return exit_ok;
  }

  bool rule_holds() const {
    const auto log = io::LogReader::open(log_);
    const double value =
        evaluate_measures(*log, scenario_of(log->genesis(), log_), {&*each_.stop_when, 1})
            .values.at(0);
    return !std::isnan(value) && value != 0;
  }

  std::string failure_text(int code) const {
    if (code == exit_numerical) {
      std::ifstream output(file("out.json"));
      const Json object = Json::parse(output, nullptr, false);
      if (object.is_object() && object.contains("failure"))
        return object["failure"].value("text", std::string());
    }
    std::string line = last_line(file("out.txt"));
    for (const char* verb : {"varve run: ", "varve fork: ", "varve resume: "})
      if (line.starts_with(verb)) line.erase(0, std::string(verb).size());
    return line.empty() ? fmt::format("ended with exit code {}", code) : line;
  }

  int fail(int code, const std::string& text) {
    row_.failed = true;
    row_.code = code;
    row_.error = text;
    row_.stop.clear();
    take_end();
    store_.write_timing(member_.id, timing_);
    store_.write_row(row_);
    return exit_study;
  }

  /// What the log says of itself, where there is one.
  void take_end() {
    try {
      const auto log = io::LogReader::open(log_);
      row_.run_id = log->genesis().run_id();
      row_.last_step = log->last_step();
      timing_.steps = log->last_step() - log->first_step();
      timing_.log_bytes = fs::file_size(log_);
      if (const auto last = log->header(log->last_step())) {
        row_.final_chain = last->chain.hex();
        row_.time = last->time;
      }
    } catch (const io::LogError&) {
      row_.run_id.clear();
    }
  }

  int measure_and_write() {
    const auto begun = std::chrono::steady_clock::now();
    take_end();
    const std::vector<Measure> measures = store_.measures_of(member_.id);
    const std::vector<Curve> curves = store_.curves_of(member_.id);
    try {
      const auto log = io::LogReader::open(log_);
      const Measured measured =
          evaluate_measures(*log, scenario_of(log->genesis(), log_), measures, curves);
      for (std::size_t i = 0; i < measures.size(); ++i)
        row_.values[measure_key(measures[i])] = measured.values[i];
      for (std::size_t i = 0; i < curves.size(); ++i)
        row_.curves[curve_key(curves[i])] = measured.curves[i];
    } catch (const ExpressionError& error) {
      return fail(exit_usage, fmt::format("measuring: {}", error.what()));
    } catch (const UsageError& error) {
      return fail(exit_usage, without_path(error.what()));
    } catch (const io::LogError& error) {
      return fail(exit_damaged, without_path(error.what()));
    }
    if (member_.keep == Keep::digests) {
      const int code = verb({"digest", "run.varve", "-o", "run.digest", "--overwrite"});
      if (code != exit_ok) return code == exit_output ? exit_output : exit_stopped;
    }
    timing_.measure_s += seconds_since(begun);
    store_.write_timing(member_.id, timing_);
    store_.write_row(row_);
    return exit_ok;
  }

  std::string without_path(std::string text) const {
    for (std::size_t at; (at = text.find(log_)) != std::string::npos;)
      text.replace(at, log_.size(), "run.varve");
    return text;
  }

  const StudyPlan& plan_;
  const StudyStore& store_;
  const StudyMember& member_;
  const StudyCase& each_;
  std::string folder_, log_;
  unsigned threads_;
  StudyRow row_;
  StudyTiming timing_;
};

}  // namespace

int execute_member(const StudyPlan& plan, const StudyStore& store, const StudyMember& member,
                   unsigned threads) {
  return Member(plan, store, member, threads).execute();
}

}  // namespace varve::tools
