// Observables read from a log: decoded states and the engine's contact records, nothing executed
// again. A table is written row by row as the log is walked; the summary keeps a bounded number of
// samples.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/observe/contacts.h"
#include "core/observe/flow.h"
#include "core/observe/fluid.h"
#include "core/observe/grains.h"
#include "core/observe/network.h"
#include "core/observe/series.h"
#include "core/scenario.h"
#include "core/simulation.h"
#include "io/log_reader.h"
#include "tools/analysis_budget.h"
#include "tools/steps.h"

namespace varve::tools {

/// What every observable is computed from at one step.
struct ObservedStep {
  std::uint64_t step = 0;
  double time = 0, dt = 0;  ///< [s]
  core::GrainView grains;
  std::vector<double> weights;  ///< [N] dimension components per grain, as it feels it
  std::vector<core::ContactRow> contacts;
  double drag_work = 0, hydrodynamic_work = 0;  ///< [J] on the grains in this step
  double fluid_kinetic = 0;                     ///< [J]
  /// Sums since the first step analyzed [J].
  double normal_loss = 0, tangential_loss = 0, friction_loss = 0, total_drag_work = 0,
         total_hydrodynamic_work = 0;
  std::vector<core::WallHit> hits;  ///< that ended in this step
  // Of the last state taken:
  core::GroupMotion group;
  std::vector<core::ContactLink> links;
  std::vector<core::GrainStress> stresses;
  core::ForceChains chains;
  std::vector<std::uint32_t> clusters;
  std::vector<core::Departure> departures;
  std::size_t apart = 0;  ///< grains that have left the main cluster
  // Of the last state decoded whole:
  core::FluidPoints fluid;        ///< pressure only where forces were evaluated
  core::FluidPoints superficial;  ///< the same with m / rho0 as volumes
  core::FlowLattice lattice;      ///< filled where a table or the summary needs it
  core::FlowFeatures features;
  core::FlowThrough through;      ///< at the centroid's height, relative to the grains
  /// A diameter below the lowest grain and above the highest one, at the centroid's x; nothing
  /// without grains.
  std::optional<core::FluidAtPoint> beneath, above;
  /// Forces that act at this state, evaluated by the engine on it; filled where a table needs them.
  std::vector<core::GrainReport> forces;
  core::StepBalance balance;
  BudgetRow budget;
  std::vector<double> points;   ///< of the request, for tables of the fluid
  std::vector<double> down;     ///< unit vector along gravity, three components
  std::vector<double> period;   ///< [m] 0 where not periodic
  core::Domain walls;           ///< where they stand now
};

/// What of a state a table needs. Tables of the grains cost little; for the others the fluid is
/// decoded, and for forces the engine evaluates them.
enum class Needs { grains, fluid, forces };

/// One table that `varve analyze` can write.
struct Observable {
  std::string name, summary, formula, source;
  Needs needs = Needs::grains;
  bool every_step = false;  ///< rows of steps between strides too (things that happen)
  bool points = false;      ///< needs the request's points
  bool lattice = false;     ///< needs the lattice of the fluid and what is found on it
  std::function<std::vector<std::string>(const core::Scenario&)> columns;
  std::function<void(const core::Scenario&, const ObservedStep&,
                     const std::function<void(std::vector<std::string>)>& row)>
      rows;
};
const std::vector<Observable>& observables();
/// UsageError naming the nearest where there is none of that name.
const Observable& find_observable(const std::string& name);

/// A number that a whole run has; absent where nothing of the kind happened.
struct Scalar {
  std::string name;
  std::optional<double> value;
};
/// What there is, in order, with unit and formula.
struct ScalarInfo {
  std::string name, formula, unit;
};
const std::vector<ScalarInfo>& scalar_infos();

/// What the summary says; absent where the run has nothing of the kind.
struct AnalysisSummary {
  std::uint64_t first_step = 0, last_step = 0, stride = 1, states = 0;
  double first_time = 0, last_time = 0;
  std::size_t grains = 0;
  std::optional<core::Window> settling;  ///< of the settling speed, in the window
  std::string window_rule;
  std::optional<double> acceleration_time;  ///< [s] to 95 % of the window's mean
  double peak_speed = 0, peak_time = 0;     ///< of the settling speed
  std::optional<double> first_contact;      ///< [s]
  std::optional<double> first_floor_contact;
  std::size_t collisions = 0, wall_collisions = 0;
  std::vector<core::TurningPoint> turns;    ///< of the settling speed in the window
  std::optional<core::Oscillation> oscillation;
  std::size_t wall_hits = 0;
  core::Spread restitution;
  double peak_force = 0, peak_force_time = 0;
  std::optional<double> rest_time;  ///< [s] all grains slower than 1 mm/s from then on
  double normal_loss = 0, tangential_loss = 0, friction_loss = 0;
  std::vector<Scalar> scalars;      ///< one per scalar_infos(), in its order
};

/// Which states are decoded whole where tables or the summary need more than the grains.
struct FluidSteps {
  enum class Rule { as_range, keyframes, every } rule = Rule::as_range;
  std::uint64_t every = 1;  ///< of Rule::every, counted from the range's first step
};

struct AnalysisRequest {
  StepRange range;
  std::vector<const Observable*> tables;
  std::optional<std::pair<double, double>> window;  ///< [s]
  std::vector<double> points;  ///< [m] where the fluid is looked at, dimension components each
  /// Not given: as the range where a table needs the fluid, else keyframes and the last state.
  std::optional<FluidSteps> fluid;
  bool pictures = false;  ///< the fluid's lattice is wanted whatever the tables
  /// Called with every state taken, after the tables.
  std::function<void(const core::Scenario&, const ObservedStep&, bool whole)> on_state;
};
/// Where a table's rows go; called once per row, the header first.
using RowSink = std::function<void(const Observable&, const std::vector<std::string>& row)>;

/// Walks the log once. Throws LogError, and UsageError where no state of the range is stored.
AnalysisSummary analyze(const io::LogReader& log, const core::Scenario& scenario,
                        const AnalysisRequest& request, const RowSink& sink);

}  // namespace varve::tools
