#include "tools/simulation_engine.h"

#include <fmt/format.h>

#include "core/arithmetic.h"
#include "core/assessment.h"
#include "core/parameters.h"
#include "io/errors.h"
#include "tools/cli.h"
#include "tools/scenario_file.h"

namespace varve::tools {

namespace {

io::ScalarType scalar_type(core::FieldType type) {
  switch (type) {
    case core::FieldType::f64: return io::ScalarType::f64;
    case core::FieldType::f32: return io::ScalarType::f32;
    case core::FieldType::u64: return io::ScalarType::u64;
    case core::FieldType::u32: return io::ScalarType::u32;
    case core::FieldType::u8: return io::ScalarType::u8;
  }
  throw std::logic_error("scalar_type: unknown type of field");
}

/// Turns the engine's typed failures into those of the tools.
template <class Work>
auto translated(const Work& work) {
  try {
    return work();
  } catch (const core::NumericalFailure& failure) {
    throw EngineFailure(failure.what(), {{"criterion", failure.criterion},
                                         {"step", std::to_string(failure.step)},
                                         {"field", failure.field},
                                         {"id", std::to_string(failure.id)},
                                         {"value", fmt::format("{}", failure.value)},
                                         {"limit", fmt::format("{}", failure.limit)},
                                         {"advice", failure.advice}});
  } catch (const core::ModelError& error) {
    throw UsageError(error.what());
  } catch (const core::ArithmeticError& error) {
    throw ToolError(exit_internal, error.what());
  }
}

}  // namespace

io::Schema schema_of(const core::Simulation& simulation) {
  io::Schema schema;
  for (const core::FieldInfo& info : simulation.fields()) {
    io::FieldDescriptor& field = schema.fields.emplace_back();
    field.name = info.name;
    field.population = info.population;
    field.type = scalar_type(info.type);
    field.components = info.components;
    field.unit = info.unit;
    field.is_id = info.is_id;
    field.constant = info.constant;
    field.follows = info.follows;
  }
  for (const core::TableInfo& info : simulation.tables()) {
    io::TableDescriptor& table = schema.tables.emplace_back();
    table.name = info.name;
    for (const core::ColumnInfo& column : info.columns)
      table.columns.push_back({column.name, scalar_type(column.type), column.unit});
  }
  return schema;
}

SimulationEngine::SimulationEngine(core::Scenario genesis_scenario,
                                   const core::RunOptions& options)
    : genesis_scenario_(std::move(genesis_scenario)), options_(options) {}

std::unique_ptr<SimulationEngine> SimulationEngine::fresh(const core::Scenario& resolved,
                                                          const core::RunOptions& options) {
  std::unique_ptr<SimulationEngine> engine(new SimulationEngine(resolved, options));
  engine->take(translated([&] { return core::Simulation::create(resolved, options); }));
  engine->take_happenings();
  return engine;
}

std::unique_ptr<SimulationEngine> SimulationEngine::of_genesis(const io::Genesis& genesis,
                                                               const std::string& path,
                                                               const core::RunOptions& options) {
  std::unique_ptr<SimulationEngine> engine(
      new SimulationEngine(scenario_of(genesis, path), options));
  engine->schema_ = genesis.schema;
  return engine;
}

void SimulationEngine::take(std::unique_ptr<core::Simulation> simulation) {
  io::Schema schema = schema_of(*simulation);
  if (!schema_.fields.empty() && schema != schema_)
    throw io::LogError(io::ErrorKind::mismatch, "",
                       "the log's fields are not those of its scenario in this engine");
  schema_ = std::move(schema);
  simulation_ = std::move(simulation);
  events_.clear();
}

void SimulationEngine::evaluate() {
  translated([&] { return simulation_->evaluate(), 0; });
}

void SimulationEngine::take_happenings() {
  events_.clear();
  for (const core::Happening& happening : simulation_->happenings())
    events_.push_back({simulation_->clock().step, happening.kind, happening.items});
}

io::FrameView SimulationEngine::frame() const {
  const core::Clock clock = simulation_->clock();
  io::FrameView view;
  view.step = clock.step;
  view.time = clock.time;
  view.dt = clock.dt;
  view.fields.reserve(schema_.fields.size());
  for (std::size_t i = 0; i < schema_.fields.size(); ++i) {
    const core::FieldSpan field = simulation_->field(i);
    view.fields.push_back({field.count, field.bytes});
  }
  view.tables.reserve(schema_.tables.size());
  for (std::size_t i = 0; i < schema_.tables.size(); ++i) {
    const core::TableSpan table = simulation_->table(i);
    view.tables.push_back({table.rows, table.columns});
  }
  return view;
}

void SimulationEngine::advance() {
  try {
    translated([&] { simulation_->advance(); });
  } catch (const UsageError& error) {
    // Nobody asked for anything just now: a scheduled change turned out to be impossible.
    const std::string step = std::to_string(simulation_->clock().step);
    throw EngineFailure(fmt::format("step {}: a scheduled change can't be made: {}", step,
                                    error.what()),
                        {{"criterion", "scheduled change"}, {"step", step}});
  }
  take_happenings();
}

void SimulationEngine::revisit(const io::FrameView& frame) {
  // Scheduled changes move walls: which have happened is found by restore().
  if (!simulation_ || !genesis_scenario_.changes.empty()) return restore(frame);
  std::vector<core::FieldSpan> values;
  for (const io::FieldView& field : frame.fields) values.push_back({field.count, field.bytes});
  try {
    simulation_->set_state(values);
  } catch (const core::ModelError& error) {
    throw io::LogError(io::ErrorKind::mismatch, "", error.what());
  }
}

void SimulationEngine::restore(const io::FrameView& frame) {
  std::vector<core::FieldSpan> values;
  for (const io::FieldView& field : frame.fields) values.push_back({field.count, field.bytes});
  try {
    take(core::Simulation::restore(genesis_scenario_, values, options_));
  } catch (const core::ModelError& error) {
    throw io::LogError(io::ErrorKind::mismatch, "", error.what());
  } catch (const core::ArithmeticError& error) {
    throw ToolError(exit_internal, error.what());
  }
}

void SimulationEngine::change(const std::vector<io::Setting>& settings,
                              const core::ChangeOptions& options) {
  translated([&] { simulation_->change(settings, options); });
  take_happenings();
}

core::Scenario scenario_of(const io::Genesis& genesis, const std::string& path) {
  try {
    const ScenarioOptions options{{}, false, true, {}, &genesis.files};
    return read_scenario_text(genesis.scenario, path + ":scenario", options).scenario;
  } catch (const ScenarioError& error) {
    throw io::LogError(io::ErrorKind::damaged, path,
                       fmt::format("its scenario can't be read back:\n{}", error.what()));
  }
}

io::Genesis make_genesis(const core::Scenario& resolved, const io::Schema& schema,
                         unsigned threads) {
  io::Genesis genesis;
  genesis.engine = engine_name;
  genesis.engine_revision = core::engine_revision;
  genesis.schema = schema;
  genesis.scenario = core::canonical_text(resolved);
  genesis.parameters = core::all_settings(resolved);
  for (const core::ModelUse& model : core::models_of(resolved))
    if (model.active) genesis.models.emplace_back(model.name, model.reason);
  genesis.tier = resolved.record.tier == core::RecordTier::deltas ? io::Tier::deltas
                                                                  : io::Tier::digests;
  genesis.every = static_cast<std::uint32_t>(resolved.record.every);
  genesis.keyframe_steps = static_cast<std::uint32_t>(resolved.record.keyframe_steps);
  genesis.build = build_facts();
  genesis.build.emplace_back("threads", std::to_string(threads));
  return genesis;
}

Target target_of(const core::Scenario& resolved) {
  Target target;
  if (resolved.time.steps > 0) {
    target.last_step = static_cast<std::uint64_t>(resolved.time.steps);
  } else if (resolved.time.until == resolved.time.until) {
    target.until = resolved.time.until;
  }
  return target;
}

void require_this_engine(const io::LogReader& log, const std::string& what_else_to_do,
                         bool any_revision) {
  const std::uint32_t revision =
      any_revision ? log.genesis().engine_revision : core::engine_revision;
  require_same_engine(log, engine_name, revision, what_else_to_do);
}

}  // namespace varve::tools
