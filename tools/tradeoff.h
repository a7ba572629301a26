// What `varve tradeoff` is made of: a ladder of rungs around a scene, a run of each with its cost,
// named measures of what it gave, errors and the front of those that nothing beats.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/scenario.h"
#include "io/log_reader.h"
#include "tools/analysis.h"
#include "tools/cli.h"
#include "tools/scenario_file.h"
#include "tools/signals.h"

namespace varve::tools {

// ---- the scene and its ladder ----

/// The scene of a tradeoff: as written, at fidelity `standard`, cut to a length in seconds.
struct TradeScene {
  std::string file;                   ///< as given: path or preset
  std::string text, folder;           ///< of the scenario, and where its other files lie
  std::vector<std::string> given;     ///< "KEY=VALUE" of the user
  std::vector<std::string> settings;  ///< with what follows from the rest: every run gets them
  core::Scenario base;                ///< resolved
  double until = 0;                   ///< [s]
};

/// Reads FILE with the user's settings; `until` cuts its length. Exits as load_scenario() does.
TradeScene load_trade_scene(const std::string& file, std::vector<std::string> settings,
                            std::optional<double> until);

/// `settings` on top of `base`: of a key that is in both, the value of `settings` (a scenario takes
/// each key once).
std::vector<std::string> settings_on_top(const std::vector<std::string>& base,
                                         const std::vector<std::string>& settings);

/// The scene with more settings, resolved; the first error's text where that makes no sense.
struct Resolved {
  core::Scenario scenario;
  std::string refused;  ///< empty: none
};
Resolved resolve_with(const TradeScene& scene, const std::vector<std::string>& settings);

/// One way to run the scene.
struct Rung {
  std::string name;                   ///< "reference", "cfl 0.5"
  std::string knob;                   ///< "level", "cfl", ...: what it differs from `standard` in
  std::vector<std::string> settings;  ///< on top of the scene's
  core::Scenario scenario;            ///< resolved
  std::string refused;                ///< why the scene can't be so; empty: it can
};

struct LadderOptions {
  std::vector<std::string> levels;  ///< of scenario.fidelity, besides standard
  std::vector<std::string> knobs;
  std::vector<std::string> vary;    ///< "KEY=V1,V2": a knob of the user's
  std::vector<std::string> rungs;   ///< "KEY=V,KEY=V": one rung of several settings
};
/// Names that LadderOptions::knobs may hold, with what each does.
const std::vector<std::pair<std::string, std::string>>& ladder_knobs();
/// `standard` first, then levels and knobs. Rungs equal to an earlier one are left out. UsageError
/// for names that mean nothing.
std::vector<Rung> make_ladder(const TradeScene& scene, const LadderOptions& options);

// ---- measures ----

/// A number (or a curve) that a run gives.
struct TradeMeasure {
  std::string name, unit, meaning;
  /// Known value, with what an error of it is divided by; else the reference rung's is it.
  std::optional<double> known;
  double scale = 1;
  bool needs_summary = false;   ///< AnalysisSummary of the whole log
  bool needs_energies = false;  ///< its table of energies too
  /// Text of an expression over what `varve analyze` gives (tools/measure.h); empty: built in.
  std::string expression;
  /// Empty where what it measures did not happen.
  std::function<std::vector<double>(const class RunView&)> evaluate;
};

/// A finished run, as measures see it.
class RunView {
 public:
  RunView(const io::LogReader& log, const core::Scenario& scenario, double until);

  /// One state as doubles.
  struct State {
    double time = 0;  ///< [s]
    std::vector<double> fluid_position, fluid_velocity, fluid_mass;
    std::vector<double> grain_position, grain_velocity;
  };
  const core::Scenario& scenario() const { return scenario_; }
  const AnalysisSummary& summary() const { return summary_; }
  /// Rows of the table of energies by column, all steps.
  const std::map<std::string, std::vector<double>>& energies() const { return energies_; }
  State first() const;
  State last() const;
  /// A number of the state at exactly the end asked for, between the two steps around it.
  double at_end(const std::function<double(const State&)>& number) const;

  /// Walks the log for what the measures need.
  void read(bool summary, bool energies);

 private:
  State state(std::uint64_t step) const;
  const io::LogReader& log_;
  const core::Scenario& scenario_;
  double until_;
  AnalysisSummary summary_;
  std::map<std::string, std::vector<double>> energies_;
};

/// All built-in measures that make sense for a scene.
std::vector<TradeMeasure> measures_of(const core::Scenario& scene);
/// Names of those taken where nobody asks.
std::vector<std::string> default_measures(const core::Scenario& scene);
/// The measures asked for ("NAME" of a built-in one, or "NAME=EXPRESSION"), or the defaults.
/// `known`: "NAME=VALUE", what a measure should come to. UsageError for what means nothing.
std::vector<TradeMeasure> choose_measures(const core::Scenario& scene,
                                          const std::vector<std::string>& asked,
                                          const std::vector<std::string>& known);

// ---- runs ----

struct Cost {
  double cpu_s = 0, wall_s = 0;        ///< of the child, all its threads
  std::uint64_t steps = 0, bytes = 0;  ///< done, of the log
};

/// What became of one run of one rung.
struct RungRun {
  int code = 0;             ///< exit code of varve run
  std::string failure;      ///< its last message, where the code is not 0
  std::string chain;        ///< at the last step
  Cost cost;
  double reading_s = 0;     ///< CPU time of reading the log back for the measures
  std::map<std::string, std::vector<double>> values;  ///< by measure
  bool cached = false;      ///< found in the folder, not run now
};

struct RunSettings {
  std::string folder;       ///< of the results
  unsigned threads = 1;
  bool keep_logs = false;
};

/// Runs the scene so (a child), measures it and stores the result; takes it from the folder where
/// it is there. Throws Exit{75} where a signal asks to stop: `signals` live as long as the ladder,
/// so that one between two runs is not missed.
RungRun run_rung(const TradeScene& scene, const std::vector<std::string>& settings,
                 const core::Scenario& resolved, const std::vector<TradeMeasure>& measures,
                 const RunSettings& how, const StopSignals& signals);
/// Cost of the run that run_rung() would find; nothing where it would run it.
std::optional<Cost> finished_cost(const core::Scenario& resolved,
                                  const std::vector<TradeMeasure>& measures,
                                  const RunSettings& how);

/// What a run will take, from its first steps.
Cost predict_cost(const core::Scenario& resolved, unsigned threads);

// ---- errors and the front ----

struct Judged {
  std::optional<double> value;   ///< mean over seeds; of a curve its largest |value|
  std::optional<double> error;   ///< relative, signed for numbers; absent: not measured
  double spread = 0;             ///< standard deviation over seeds, relative likewise
};

struct RungResult {
  Rung rung;
  std::string status;            ///< "ran", "failed", "refused", "dropped", "planned"
  std::string why;               ///< where not "ran"
  Cost predicted;                ///< of all its runs
  std::vector<RungRun> runs;     ///< by seed
  Cost cost;                     ///< mean over seeds
  std::vector<Judged> judged;    ///< by measure
  /// Largest |error| of all measures, each with the standard error of its mean over seeds.
  std::optional<double> worst;
  bool reference = false, front = false;
};

/// Which points no other beats: none is as cheap and as accurate, and better in one. NaN: never.
std::vector<bool> pareto_front(std::span<const double> cost, std::span<const double> error);
/// The cheapest of those with error <= limit; of equally cheap ones the most accurate.
std::optional<std::size_t> cheapest_within(std::span<const double> cost,
                                           std::span<const double> error, double limit);

/// Rungs that only record otherwise have the bits of `standard` (the first): where their chains say
/// so they get its values, which a log with fewer states gives less exactly.
void share_values(std::vector<RungResult>& rungs);

/// Fills cost, judged, worst, front of the rungs that ran. `reference`: index of the rung that
/// measures without a known value are compared with. Measures that did not happen there are
/// removed from `measures`; their names are returned.
std::vector<std::string> judge(std::vector<TradeMeasure>& measures,
                               std::vector<RungResult>& rungs, std::size_t reference);

// ---- what is printed ----

struct Recommendation {
  double within = 0;
  std::optional<std::size_t> rung;
};
struct TradeReport {
  TradeScene scene;
  std::vector<TradeMeasure> measures;
  std::vector<std::string> missing;  ///< measures that did not happen
  std::vector<RungResult> rungs;
  std::size_t reference = 0;
  std::uint64_t seeds = 1;
  unsigned threads = 1;
  std::vector<Recommendation> recommended;
};
std::string text_of(const TradeReport& report);
std::string json_of(const TradeReport& report);
std::string csv_of(const TradeReport& report);
std::string svg_of(const TradeReport& report);
/// What is planned and what it will take.
std::string plan_text(const TradeReport& report);

/// "2%", "0.02" -> 0.02. UsageError (naming the option) unless > 0.
double fraction(const std::string& text, std::string_view option);
/// Writes a file beside its name, then renames it: never half a file. ToolError(74).
void write_whole(const std::string& path, std::string_view text);

// ---- the other two price lists ----

/// `--log`: bytes, seek and encoding over tiers and cadences.
int trade_log(const Invocation& invocation);
/// `--limits`: the largest stable step, stiffness, ... by bisection.
int trade_limits(const Invocation& invocation);

}  // namespace varve::tools
