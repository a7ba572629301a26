// varve's own engine behind io's engine interface, and what a log's genesis says of it. Here core
// and io meet: the field table becomes the schema, happenings become events, typed failures of the
// engine become those of recording.h.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/simulation.h"
#include "io/engine.h"
#include "io/log_reader.h"
#include "tools/recording.h"

namespace varve::tools {

/// Name under which genesis records the engine.
inline constexpr const char* engine_name = "varve";

class SimulationEngine : public io::Engine {
 public:
  /// A fresh run of a resolved scenario, standing at its first state.
  static std::unique_ptr<SimulationEngine> fresh(const core::Scenario& resolved,
                                                 const core::RunOptions& options);
  /// An engine for the run that `genesis` describes. It holds no state until restore(); only
  /// schema() may be called before. `path` names the log in messages.
  static std::unique_ptr<SimulationEngine> of_genesis(const io::Genesis& genesis,
                                                      const std::string& path,
                                                      const core::RunOptions& options);

  const io::Schema& schema() const override { return schema_; }
  io::FrameView frame() const override;
  const std::vector<io::Event>& events() const override { return events_; }
  /// Throws EngineFailure where a guard stops the run or a scheduled change can't be made.
  void advance() override;
  /// Throws LogError(mismatch) where the state is not one of this scenario's.
  void restore(const io::FrameView& frame) override;
  /// The same for one state after the other of a run whose keys nobody else changes: the engine is
  /// kept where it can be.
  void revisit(const io::FrameView& frame);
  /// Throws UsageError where a key may not change or its new value cannot be served.
  void change(const std::vector<io::Setting>& settings) override { change(settings, {}); }
  void change(const std::vector<io::Setting>& settings, const core::ChangeOptions& options);

  const core::Simulation& simulation() const { return *simulation_; }
  /// Forces at the restored state, for simulation()'s reports (core::Simulation::evaluate).
  void evaluate();

 private:
  SimulationEngine(core::Scenario genesis_scenario, const core::RunOptions& options);
  void take(std::unique_ptr<core::Simulation> simulation);
  void take_happenings();

  core::Scenario genesis_scenario_;
  core::RunOptions options_;
  std::unique_ptr<core::Simulation> simulation_;
  io::Schema schema_;
  std::vector<io::Event> events_;
};

/// Fields and tables of the engine as io knows them.
io::Schema schema_of(const core::Simulation& simulation);

/// Scenario that a log's genesis holds. Throws LogError(damaged) if it can't be read back.
core::Scenario scenario_of(const io::Genesis& genesis, const std::string& path);

/// Genesis of a run of `resolved` (schema as given), without lineage.
io::Genesis make_genesis(const core::Scenario& resolved, const io::Schema& schema,
                         unsigned threads);

/// Where the run of a resolved scenario ends: `time.steps` if set, else `time.until`.
Target target_of(const core::Scenario& resolved);

/// Refuses logs of other engines and, unless `any_revision`, of other revisions (UsageError).
void require_this_engine(const io::LogReader& log, const std::string& what_else_to_do = "",
                         bool any_revision = false);

}  // namespace varve::tools
