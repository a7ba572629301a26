// Observables read from a log: decoded states and the engine's contact records, nothing executed
// again. A table is written row by row as the log is walked; the summary keeps a bounded number of
// samples.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/observe/contacts.h"
#include "core/observe/fluid.h"
#include "core/observe/grains.h"
#include "core/observe/series.h"
#include "core/scenario.h"
#include "core/simulation.h"
#include "io/log_reader.h"
#include "tools/steps.h"

namespace varve::tools {

/// What every observable is computed from at one step.
struct ObservedStep {
  std::uint64_t step = 0;
  double time = 0, dt = 0;  ///< [s]
  core::GrainView grains;
  std::vector<core::ContactRow> contacts;
  double drag_work = 0, hydrodynamic_work = 0;  ///< [J] on the grains in this step
  double fluid_kinetic = 0;                     ///< [J]
  /// Sums since the first step analyzed [J].
  double normal_loss = 0, tangential_loss = 0, friction_loss = 0, total_drag_work = 0,
         total_hydrodynamic_work = 0;
  std::vector<core::WallHit> hits;  ///< that ended in this step
  core::FluidPoints fluid;          ///< pressure only where forces were evaluated
  /// Forces that act at this state, evaluated by the engine on it; filled where a table needs them.
  std::vector<core::GrainReport> forces;
  std::vector<double> points;       ///< of the request, for tables of the fluid
  std::vector<double> down;     ///< unit vector along gravity, three components
  std::vector<double> gravity;  ///< [m/s2] as grains feel it: submerged in the excess form
  std::vector<double> period;   ///< [m] 0 where not periodic
};

/// One table that `varve analyze` can write.
struct Observable {
  std::string name, summary, formula, source;
  bool every_step = false;  ///< rows of steps between strides too (things that happen)
  bool forces = false;      ///< needs the engine's forces at each state
  bool points = false;      ///< needs the request's points
  std::function<std::vector<std::string>(const core::Scenario&)> columns;
  std::function<void(const core::Scenario&, const ObservedStep&,
                     const std::function<void(std::vector<std::string>)>& row)>
      rows;
};
const std::vector<Observable>& observables();
/// UsageError naming the nearest where there is none of that name.
const Observable& find_observable(const std::string& name);

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
};

struct AnalysisRequest {
  StepRange range;
  std::vector<const Observable*> tables;
  std::optional<std::pair<double, double>> window;  ///< [s]
  std::vector<double> points;  ///< [m] where the fluid is looked at, dimension components each
};
/// Where a table's rows go; called once per row, the header first.
using RowSink = std::function<void(const Observable&, const std::vector<std::string>& row)>;

/// Walks the log once. Throws LogError, and UsageError where no state of the range is stored.
AnalysisSummary analyze(const io::LogReader& log, const core::Scenario& scenario,
                        const AnalysisRequest& request, const RowSink& sink);

}  // namespace varve::tools
