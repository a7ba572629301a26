// varve tradeoff: what accuracy costs on a scene of the user's.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/progress.h"
#include "tools/session.h"
#include "tools/steps.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

std::vector<std::string> listed(const Invocation& invocation, const std::string& option) {
  std::vector<std::string> names;
  for (const std::string& list : invocation.values(option)) {
    const std::string padded = list + ",";
    for (std::size_t begin = 0, comma; (comma = padded.find(',', begin)) != std::string::npos;
         begin = comma + 1)
      if (comma > begin) names.push_back(padded.substr(begin, comma - begin));
  }
  return names;
}

LadderOptions ladder_options(const Invocation& invocation) {
  LadderOptions options;
  options.levels = invocation.has("levels")
                       ? listed(invocation, "levels")
                       : std::vector<std::string>{"draft", "fine", "reference"};
  options.knobs = listed(invocation, "knobs");
  if (options.knobs == std::vector<std::string>{"all"}) options.knobs.clear();
  if (!invocation.has("knobs") || options.knobs.empty())
    for (const auto& [name, meaning] : ladder_knobs()) options.knobs.push_back(name);
  if (options.knobs == std::vector<std::string>{"none"}) options.knobs.clear();
  options.vary = invocation.values("vary");
  options.rungs = invocation.values("rung");
  return options;
}

/// Settings of the k-th seed: every key that draws from one.
std::vector<std::string> seed_settings(const core::Scenario& base, std::uint64_t k) {
  std::vector<std::string> settings;
  if (k == 0) return settings;
  const auto number = static_cast<std::int64_t>(k);
  if (base.has_grains() && (base.grains.jitter > 0 || !base.species.empty() ||
                            base.grains.arrangement == core::Arrangement::random))
    settings.push_back(fmt::format("grains.seed={}", base.grains.seed + number));
  if (base.has_fluid() && base.fluid.jitter > 0)
    settings.push_back(fmt::format("fluid.seed={}", base.fluid.seed + number));
  return settings;
}

class Tradeoff {
 public:
  explicit Tradeoff(const Invocation& invocation) : invocation_(invocation) {
    std::optional<double> until;
    if (invocation.has("until")) until = duration_option(invocation, "until");
    if (until && !(*until > 0)) throw UsageError("--until: expected a time > 0");
    for (const std::string& text : invocation.values("within"))
      report_.recommended.push_back({fraction(text, "--within"), {}});
    if (report_.recommended.empty()) report_.recommended = {{0.01, {}}, {0.02, {}}, {0.05, {}}};
    report_.seeds = invocation.count("seeds").value_or(1);
    if (report_.seeds < 1 || report_.seeds > 1000)
      throw UsageError(fmt::format("--seeds: expected 1 to 1000, got {}", report_.seeds));
    report_.threads = threads_option(invocation);
    report_.scene =
        load_trade_scene(invocation.arguments.front(), invocation.values("set"), until);
    if (report_.seeds > 1 && seed_settings(report_.scene.base, 1).empty())
      throw UsageError("--seeds: nothing in this scene is drawn from a seed (no jitter, no random "
                       "packing); all runs would be the same");
    report_.measures = choose_measures(report_.scene.base, invocation.values("measure"),
                                        invocation.values("known"));
    warn_of_few_states();
    const std::string name =
        std::filesystem::path(invocation.arguments.front()).stem().string() + ".tradeoff";
    how_ = {invocation.has("output") ? invocation.value("output") : name, report_.threads,
            invocation.has("keep-logs")};
  }

  int run() {
    make_rungs();
    predict();
    trim();
    find_reference();
    if (invocation_.has("dry-run")) {
      print(plan_text(report_));
      return exit_ok;
    }
    if (!invocation_.globals.quiet) fmt::print(stderr, "{}", plan_text(report_));
    run_all();
    finish();
    return exit_ok;
  }

 private:
  void warn_of_few_states() const {
    bool walks = false;
    for (const TradeMeasure& each : report_.measures)
      walks = walks || each.needs_summary || !each.expression.empty();
    const core::Record& record = report_.scene.base.record;
    if (walks && (record.tier == core::RecordTier::digests || record.every > 1))
      warn("the scene records few states, and measures are read from them; -s record.tier=deltas "
           "-s record.every=1 gives them all");
  }

  void make_rungs() {
    for (Rung& rung : make_ladder(report_.scene, ladder_options(invocation_))) {
      RungResult result;
      result.status = rung.refused.empty() ? "planned" : "refused";
      result.why = rung.refused;
      result.rung = std::move(rung);
      report_.rungs.push_back(std::move(result));
    }
  }

  core::Scenario scenario_of_seed(const Rung& rung, std::uint64_t k,
                                  std::vector<std::string>& settings) const {
    settings = rung.settings;
    for (std::string& each : seed_settings(report_.scene.base, k))
      settings.push_back(std::move(each));
    if (k == 0) return rung.scenario;
    const Resolved resolved = resolve_with(report_.scene, settings);
    if (!resolved.refused.empty())
      throw UsageError(fmt::format("--seeds: {}: {}", rung.name, resolved.refused));
    return resolved.scenario;
  }

  void predict() {
    for (RungResult& rung : report_.rungs) {
      if (rung.status != "planned") continue;
      bool finished = true;
      Cost found;
      for (std::uint64_t k = 0; k < report_.seeds && finished; ++k) {
        std::vector<std::string> settings;
        const auto cost =
            finished_cost(scenario_of_seed(rung.rung, k, settings), report_.measures, how_);
        finished = cost.has_value();
        if (cost) found = *cost;
      }
      if (finished) {
        rung.status = "finished";
        rung.predicted = found;
      } else {
        rung.predicted = predicted_cost(rung.rung);
      }
      rung.predicted.cpu_s *= static_cast<double>(report_.seeds);
      rung.predicted.wall_s *= static_cast<double>(report_.seeds);
    }
  }

  Cost predicted_cost(const Rung& rung) const {
    try {
      return predict_cost(rung.scenario, report_.threads);
    } catch (const ToolError& error) {
      // It fails within its first steps: cheap, and the run will say so.
      if (error.code() != exit_numerical) throw;
      return {};
    }
  }

  double to_run() const {
    double total = 0;
    for (const RungResult& rung : report_.rungs)
      if (rung.status == "planned") total += rung.predicted.cpu_s;
    return total;
  }

  /// Keeps to the budget: refuses, or leaves out the dearest rungs but for the reference.
  void trim() {
    if (!invocation_.has("budget")) {
      if (invocation_.has("trim")) throw UsageError("--trim needs --budget");
      return;
    }
    const double budget = duration_option(invocation_, "budget");
    if (to_run() <= budget) return;
    if (!invocation_.has("trim"))
      throw UsageError(fmt::format("--budget: the rungs will take about {:.3g} CPU-seconds, more "
                                   "than {:g}; --trim leaves out the dearest, --dry-run lists "
                                   "them, --until shortens them all",
                                   to_run(), budget));
    find_reference();
    while (to_run() > budget) {
      RungResult* dearest = nullptr;
      for (std::size_t i = 1; i < report_.rungs.size(); ++i) {
        RungResult& rung = report_.rungs[i];
        if (i == report_.reference || rung.status != "planned") continue;
        if (!dearest || rung.predicted.cpu_s > dearest->predicted.cpu_s) dearest = &rung;
      }
      if (!dearest)
        throw UsageError(fmt::format(
            "--budget: `standard` and the reference alone will take about {:.3g} CPU-seconds, "
            "more than {:g}; shorten them with --until, or choose another --reference",
            to_run(), budget));
      dearest->status = "dropped";
      dearest->why = fmt::format("{:.3g} CPU-seconds do not fit the budget",
                                 dearest->predicted.cpu_s);
    }
  }

  bool usable(const RungResult& rung) const {
    return rung.status == "planned" || rung.status == "finished" || rung.status == "ran";
  }

  /// The rung named by --reference, else the finest level that can run, else the dearest rung.
  void find_reference() {
    const auto index_of = [&](const std::string& name) -> std::optional<std::size_t> {
      for (std::size_t i = 0; i < report_.rungs.size(); ++i)
        if (report_.rungs[i].rung.name == name && usable(report_.rungs[i])) return i;
      return std::nullopt;
    };
    if (invocation_.has("reference")) {
      const auto found = index_of(invocation_.value("reference"));
      if (!found)
        throw UsageError(fmt::format("--reference: no rung '{}' that ran; --dry-run lists them",
                                     invocation_.value("reference")));
      report_.reference = *found;
      return;
    }
    for (const char* level : {"reference", "fine"})
      if (const auto found = index_of(level)) {
        report_.reference = *found;
        return;
      }
    report_.reference = 0;
    for (std::size_t i = 0; i < report_.rungs.size(); ++i)
      if (usable(report_.rungs[i]) && report_.rungs[i].predicted.cpu_s >
                                          report_.rungs[report_.reference].predicted.cpu_s)
        report_.reference = i;
  }

  void run_all() {
    std::error_code failed;
    std::filesystem::create_directories(how_.folder, failed);
    if (failed) throw ToolError(exit_output, fmt::format("{}: {}", how_.folder, failed.message()));
    for (RungResult& rung : report_.rungs) {
      if (!usable(rung)) continue;
      if (rung.status == "planned")
        note(invocation_.globals, fmt::format("{} (about {:.3g} CPU-seconds)", rung.rung.name,
                                              rung.predicted.cpu_s));
      rung.status = "ran";
      for (std::uint64_t k = 0; k < report_.seeds; ++k) {
        std::vector<std::string> settings;
        const core::Scenario scenario = scenario_of_seed(rung.rung, k, settings);
        try {
          rung.runs.push_back(
              run_rung(report_.scene, settings, scenario, report_.measures, how_, signals_));
          if (signals_.received() != 0) throw Exit{exit_stopped};
        } catch (const Exit& stopped) {
          if (stopped.code == exit_stopped)
            note(invocation_.globals,
                 fmt::format("stopped; finished runs are kept in {}: the same command goes on",
                             how_.folder));
          throw;
        }
        const RungRun& run = rung.runs.back();
        if (run.code == exit_ok) continue;
        rung.status = "failed";
        rung.why = fmt::format("exit {}: {}", run.code, run.failure);
      }
    }
  }

  void finish() {
    if (!usable(report_.rungs[report_.reference])) {
      const RungResult& lost = report_.rungs[report_.reference];
      if (invocation_.has("reference"))
        throw ToolError(exit_study, fmt::format("--reference {}: {}", lost.rung.name, lost.why));
      const std::string name = lost.rung.name;
      find_reference();
      if (!usable(report_.rungs[report_.reference]))
        throw ToolError(exit_study, fmt::format("no rung ran; {}: {}", name, lost.why));
      warn(fmt::format("`{}` failed; errors are taken against `{}`", name,
                       report_.rungs[report_.reference].rung.name));
    }
    share_values(report_.rungs);
    report_.missing = judge(report_.measures, report_.rungs, report_.reference);
    std::vector<double> costs, errors;
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    for (const RungResult& rung : report_.rungs) {
      costs.push_back(rung.worst ? rung.cost.cpu_s : none);
      errors.push_back(rung.worst.value_or(none));
    }
    for (Recommendation& each : report_.recommended)
      each.rung = cheapest_within(costs, errors, each.within);
    const std::filesystem::path folder(how_.folder);
    write_whole((folder / "tradeoff.json").string(), json_of(report_));
    write_whole((folder / "tradeoff.csv").string(), csv_of(report_));
    write_whole((folder / "tradeoff.svg").string(), svg_of(report_));
    print(invocation_.globals.json ? json_of(report_) : text_of(report_));
    note(invocation_.globals,
         fmt::format("{0}/tradeoff.json, {0}/tradeoff.csv, {0}/tradeoff.svg", how_.folder));
  }

  const Invocation& invocation_;
  TradeReport report_;
  RunSettings how_;
  StopSignals signals_;
};

int tradeoff(const Invocation& invocation) {
  const bool log = invocation.has("log"), limits = invocation.has("limits");
  if (log && limits) throw UsageError("--log and --limits exclude each other");
  if (log) return trade_log(invocation);
  if (limits) return trade_limits(invocation);
  if (invocation.has("list")) {
    const TradeScene scene =
        load_trade_scene(invocation.arguments.front(), invocation.values("set"), {});
    for (const TradeMeasure& each : measures_of(scene.base))
      print(fmt::format("{:<16} {}{}\n", each.name, each.meaning,
                        each.unit.empty() ? "" : " [" + each.unit + "]"));
    return exit_ok;
  }
  return Tradeoff(invocation).run();
}

Verb verb() {
  Verb verb;
  verb.name = "tradeoff";
  verb.usage = "FILE|PRESET";
  verb.summary = "Cost against error over a ladder of fidelities, on a scene of yours.";
  verb.description =
      "Runs the scene at the levels of scenario.fidelity and with one knob at a time away from\n"
      "`standard`; prints for each rung CPU seconds, wall seconds, steps, bytes and the error of\n"
      "named measures, against the finest rung or a known value. Rungs that no other beats are\n"
      "marked, the cheapest within an error is recommended. Table, CSV, JSON and a plot land in a\n"
      "folder; runs found there are not run again, so that a stopped tradeoff goes on.\n\n"
      "  varve tradeoff single_disc.cfg --dry-run          what would run, and what it takes\n"
      "  varve tradeoff column.cfg --until 0.15s --budget 10min --trim\n"
      "  varve tradeoff my.cfg --knobs none --vary fluid.density_diffusion=0,0.05,0.2\n"
      "  varve tradeoff my.cfg --measure 'plateau=mean(settling.settling_speed_m_s, 0.3, 0.5)'\n"
      "  varve tradeoff column.cfg --log                   the price of recording\n"
      "  varve tradeoff my.cfg --limits --steps 300        how far the scene can be driven\n";
  verb.options = {
      {"output,o", "FOLDER", "where results go and are found again [FILE.tradeoff]", false, ""},
      {"set,s", "KEY=VALUE", "set a key of the scenario, in every rung", true, ""},
      {"until", "T", "end every run at this time of the scene", false, ""},
      {"levels", "NAMES", "levels besides standard [draft,fine,reference]", true, ""},
      {"knobs", "NAMES", "all, none, or some of: spacing h/dx c0 cfl substeps precision kernel "
                         "record", true, ""},
      {"vary", "KEY=V,V", "a knob of your own; may be repeated", true, ""},
      {"rung", "KEY=V,KEY=V", "a rung of several settings; may be repeated", true, ""},
      {"measure", "NAME[=EXPR]", "what errors are taken of: one that --list names, or an "
                                 "expression over what varve analyze gives", true, ""},
      {"known", "NAME=VALUE", "what a measure should come to, in SI, in place of the reference",
       true, ""},
      {"list", "", "names the measures of this scene", false, ""},
      {"reference", "RUNG", "rung that the others are compared with [the finest level]", false, ""},
      {"within", "SHARE", "recommend the cheapest rung within this error [1%, 2%, 5%]", true, ""},
      {"seeds", "N", "runs per rung with different seeds: mean and spread", false, "1"},
      {"budget", "TIME", "refuse to start where the rungs need more CPU time", false, ""},
      {"trim", "", "leave out the dearest rungs until the budget holds", false, ""},
      {"dry-run", "", "print what would run, and stop", false, ""},
      {"keep-logs", "", "keep the logs of the runs in the folder", false, ""},
      threads_spec(),
      {"log", "", "the price of recording instead: bytes, seek, encoding", false, ""},
      {"limits", "", "the largest stable step, stiffness, ... instead, by bisection", false, ""},
      {"steps", "N", "--log: states recorded; --limits: steps of each trial", false, ""},
      {"seeks", "N", "--log: states sought in each log", false, "32"},
      {"precise", "SHARE", "--limits: width of the last bracket", false, "5%"},
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = tradeoff;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
