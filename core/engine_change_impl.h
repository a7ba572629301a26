// Engine between steps: construction, walls, and changes of parameters and geometry.
#pragma once

#include "core/engine.h"
#include "core/engine_step_impl.h"
#include "core/geometry_change.h"
#include "core/parameters.h"

namespace varve::core {

template <int D, class P>
Engine<D, P>::Engine(const Scenario& scenario, State<D, P> state, const RunOptions& options)
    : scenario_(scenario),
      state_(std::move(state)),
      workers_(options.threads, options.own_parts_only),
      instruction_set_(options.instruction_set < 0
                           ? best_instruction_set()
                           : std::min(best_instruction_set(),
                                      static_cast<InstructionSet>(options.instruction_set))),
      lists_(instruction_set_),
      coupling_(instruction_set_),
      contacts_(instruction_set_),
      options_(options) {
  require_exact_arithmetic(workers_);
  adopt_scenario();
  build_fields();
  build_tables();
  for (const char* name : engine_detail::pass_names) counters_.passes.emplace_back(name, 0);
  refresh_spans();
}

template <int D, class P>
void Engine<D, P>::adopt_scenario() {
  c_ = constants_of<D>(scenario_);
  walls_ = domain_walls(scenario_);
  clear_ = core::clear_of_walls<D>(walls_);
  if (scenario_.has_fluid()) {
    build_walls();
    const PressureSum sum = c_.shifts()             ? PressureSum::corrected
                            : c_.conjugate_pressure ? PressureSum::conjugate
                                                    : PressureSum::plain;
    sweeps_ = pair_sweeps<D, P>(scenario_.fluid.kernel, c_.period.any(), sum, instruction_set_);
    const std::size_t n = state_.fluid.size();
    for (auto* each : {&work_.volume_before, &work_.density_before, &work_.volume, &work_.pressure,
                       &work_.push})
      each->assign(n, 0);
    work_.stress_force.assign(n, Vec<Real, D>::Zero());
    work_.viscous_force.assign(c_.conjugate_pressure ? n : 0, Vec<Real, D>::Zero());
    work_.shift_velocity.assign(c_.shifts() ? n : 0, Vec<Real, D>::Zero());
    work_.gradient_correction.assign(c_.shifts() ? n * symmetric_numbers<D> : 0, 0);
    const std::size_t porous = c_.two_way ? n : 0;
    work_.porosity.assign(porous, 1);
    work_.floored_porosity.assign(porous, 1);
  }
  if (c_.coupled) drag_law_ = make_drag_law<D>(scenario_.coupling.drag);
  lists_.reset();
  contacts_.reset();
  next_ = state_;
}

template <int D, class P>
void Engine<D, P>::build_walls() {
  const std::vector<WallDummy<D>> dummies =
      wall_dummies<D>(scenario_, fluid_dummy_layers(scenario_));
  const std::size_t n = dummies.size();
  const Real volume = static_cast<Real>(integer_power<D>(c_.spacing));
  work_.wall_count = n;
  // The padding point lies far outside: its kernel value is an exact zero, as are its volumes.
  const auto far = static_cast<Position>(1e6);
  work_.wall_position.assign(n + 1, Vec<Position, D>::Constant(far));
  work_.wall_own_velocity.assign(n + 1, Vec<Real, D>::Zero());
  work_.wall_velocity.assign(n + 1, Vec<Real, D>::Zero());
  work_.wall_volume.assign(n + 1, 0);
  work_.wall_viscous_volume.assign(n + 1, 0);
  work_.wall_push.assign(n + 1, 0);
  for (std::size_t w = 0; w < n; ++w) {
    work_.wall_position[w] = dummies[w].position.template cast<Position>();
    work_.wall_own_velocity[w][0] = static_cast<Real>(dummies[w].speed_x);
    work_.wall_volume[w] = volume;
    work_.wall_viscous_volume[w] = dummies[w].kind == Boundary::no_slip ? volume : Real(0);
  }
}

template <int D, class P>
void Engine<D, P>::apply_scheduled() {
  const std::vector<ScheduledChange> changes = scenario_.changes;
  for (const ScheduledChange& scheduled : changes)
    if (scheduled.at_step >= 0 &&
        static_cast<std::uint64_t>(scheduled.at_step) == state_.clock.step)
      change(scheduled.settings, scheduled_options(scheduled));
}

template <int D, class P>
void Engine<D, P>::skip_scheduled() {
  const std::vector<ScheduledChange> changes = scenario_.changes;
  for (const ScheduledChange& scheduled : changes) {
    if (scheduled.at_step < 0 ||
        static_cast<std::uint64_t>(scheduled.at_step) > state_.clock.step)
      continue;
    const auto problems =
        apply_settings(scenario_, scheduled.settings, scheduled_options(scheduled).anchor);
    if (!problems.empty()) throw ModelError(problems.front().key + ": " + problems.front().text);
  }
  adopt_scenario();
}

template <int D, class P>
void Engine<D, P>::change(const std::vector<std::pair<std::string, std::string>>& settings,
                          const ChangeOptions& options) {
  if (settings.empty()) return;
  Scenario after = scenario_;
  const std::vector<Problem> problems = apply_settings(after, settings, options.anchor);
  if (!problems.empty()) {
    std::string text;
    for (const Problem& problem : problems)
      text += (text.empty() ? "" : "\n") + problem.key + ": " + problem.text;
    throw ModelError(text);
  }
  Happening change{"change", {}};
  for (const auto& [key, value] : settings) {
    const Parameter* parameter = find_parameter(key);
    change.items.emplace_back(key, get_parameter(after, *parameter));
  }
  std::vector<Happening> happenings{change};
  if (after.domain.width != scenario_.domain.width) {
    const GeometryReport report =
        change_width<D, P>(scenario_, after.domain.width, options, state_);
    describe(report, happenings);
  }
  if (after.time.dt != scenario_.time.dt) {
    state_.clock.since_step = state_.clock.step;
    state_.clock.since_time = state_.clock.time;
    state_.clock.dt = after.time.dt;
  }
  scenario_ = std::move(after);
  adopt_scenario();
  refresh_spans();
  happenings_.insert(happenings_.end(), happenings.begin(), happenings.end());
}

}  // namespace varve::core
