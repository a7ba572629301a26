// The engine itself, for one dimension and one precision. advance() reads like the method section
// of a paper; core/PHYSICS.md is that section.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/arithmetic.h"
#include "core/constants.h"
#include "core/contacts.h"
#include "core/coupling.h"
#include "core/drag.h"
#include "core/fluid_lists.h"
#include "core/geometry_change.h"
#include "core/pair_sweeps.h"
#include "core/parts.h"
#include "core/simulation.h"
#include "core/stage_digests.h"
#include "core/state.h"
#include "core/walls.h"
#include "core/workers.h"

namespace varve::core {

template <int D, class P>
class Engine final : public Simulation {
 public:
  using Real = typename P::Real;
  using Position = typename P::Position;

  Engine(const Scenario& scenario, State<D, P> state, const RunOptions& options);

  const std::vector<FieldInfo>& fields() const override { return fields_; }
  FieldSpan field(std::size_t index) const override { return spans_[index]; }
  const std::vector<TableInfo>& tables() const override { return tables_; }
  TableSpan table(std::size_t index) const override;
  Clock clock() const override {
    return {state_.clock.step, state_.clock.time, state_.clock.dt};
  }
  const Scenario& scenario() const override { return scenario_; }
  const std::vector<Happening>& happenings() const override { return happenings_; }
  const Counters& counters() const override;
  StepLedger ledger() const override;
  StepBalance balance() const override;
  std::vector<GrainReport> grain_reports() const override;
  FluidReport fluid_report() const override;

  void advance() override;
  void evaluate() override;
  void set_state(std::span<const FieldSpan> values) override;
  void change(const std::vector<std::pair<std::string, std::string>>& settings,
              const ChangeOptions& options) override;
  void apply_scheduled();
  /// Takes changes scheduled up to the present step as done: keys only, the state has them already.
  void skip_scheduled();

 private:
  /// Derived arrays, rebuilt by the same code at every step. Fluid arrays have one entry per
  /// particle, dummy arrays one more than there are dummies: a padding point that weighs nothing.
  struct Work {
    std::vector<Real> porosity, floored_porosity, volume_before, density_before, volume, pressure;
    std::vector<Real> push;
    // What pairs read of each other, by place in the lists.
    std::vector<PairRecord<Real>> records;
    std::vector<Vec<Position, D>> place_position;
    std::vector<Vec<Real, D>> place_velocity;
    std::vector<Real> place_first, place_second;
    // What the sweeps find, by place, where that is not by index.
    std::vector<Real> place_density, place_volume, place_pressure;
    std::vector<Vec<Real, D>> place_stress, place_viscous;
    const Real *first = nullptr, *second = nullptr;
    std::vector<Vec<Real, D>> stress_force, viscous_force, shift_velocity;
    std::vector<Real> gradient_correction;
    std::vector<Vec<Position, D>> wall_position;
    std::vector<Vec<Real, D>> wall_own_velocity, wall_velocity;
    std::vector<Real> wall_volume, wall_viscous_volume, wall_push;
    std::size_t wall_count = 0;
    std::vector<OuterForce<D>> outer;  // per grain
  };

  void build_fields();
  void build_tables();
  void build_grain_tables();
  void check_counts(const State<D, P>& state) const;
  bool is_driven() const { return scenario_.grains.motion == GrainMotion::driven; }
  bool rolls() const { return c_.contact.rotation && c_.contact.rolling_friction > 0; }
  void refresh_spans();
  void adopt_scenario();  // constants, walls and lists from scenario_
  void build_walls();
  SweepData<D, P> sweep_data();

  void find_forces();

  // The stages of a step, in order.
  void update_lists();
  void find_porosity();
  void prepare_fluid();
  void find_density_and_pressure();
  void sweep(typename PairSweeps<D, P>::Loop loop, std::size_t points);
  template <class Body>
  void for_each_mapped(std::span<const std::int32_t> map, const Body& body);
  void list_places();
  void list_numbers(const std::vector<Real>& first, const std::vector<Real>& second);
  void find_wall_values();
  void find_stresses();
  void add_artificial_viscosity();
  void find_shifts();
  void find_grain_forces();
  void move_grains();
  void hold_grains();
  void sum_work();
  void move_fluid();
  void check_grains() const;
  bool grain_is_good(std::size_t i, double limit) const;
  void report_grain(std::size_t i, double limit) const;
  void commit();
  void record_tables();
  void record_grain_tables();

  void digest_stage(Stage stage);
  void digest_neighbours();
  std::size_t move_fluid_part(std::size_t begin, std::size_t end);
  bool fluid_is_good(std::size_t a) const;
  [[noreturn]] void report_fluid(std::size_t a) const;
  void wrap(Vec<Position, D>& x) const;
  bool clear_of_walls(const Vec<Position, D>& x) const;
  Vec<double, D> wall_repulsion(const Vec<Position, D>& x) const;
  double density_deviation(std::size_t a) const;
  double beyond_walls(const Vec<Position, D>& x) const;
  static void describe(const GeometryReport& report, std::vector<Happening>& happenings);
  static ChangeOptions scheduled_options(const ScheduledChange& scheduled);
  Vec<double, D> walls_on_fluid(const FluidState<D, P>& at) const;
  StepLedger ledger_of(const FluidState<D, P>& at, const Vec<double, D>& fluid_change,
                       const Vec<double, D>& grain_change,
                       const Vec<double, D>& wall_impulse) const;
  std::vector<Vec<double, D>> velocities_ahead() const;
  double internal_energy(double density) const;
  Vec<double, D> corrected(std::size_t a, const Vec<double, D>& d) const;
  template <class SmoothingKernel>
  double late_work(const SmoothingKernel& kernel, std::size_t a, const Vec<double, D>& d,
                   const Vec<double, D>& v) const;
  template <class SmoothingKernel>
  void balance_pairs(const SmoothingKernel& kernel, const std::vector<Vec<double, D>>& mean,
                     std::vector<Vec<double, D>>& viscous, std::vector<double>& diffused,
                     StepBalance& sum) const;
  template <class SmoothingKernel>
  void balance_walls(const SmoothingKernel& kernel, const std::vector<Vec<double, D>>& mean,
                     std::vector<Vec<double, D>>& viscous, StepBalance& sum) const;
  void balance_fluid(std::vector<Vec<double, D>>& mean, std::vector<Vec<double, D>>& viscous,
                     std::vector<double>& diffused, StepBalance& sum) const;
  void balance_grains(const std::vector<Vec<double, D>>& mean,
                      const std::vector<Vec<double, D>>& viscous,
                      const std::vector<double>& diffused, StepBalance& sum) const;
  double contact_elastic() const;
  Vec<double, D> apart(const Vec<Position, D>& a, const Vec<Position, D>& b) const;
  bool has_fluid() const { return with_fluid && scenario_.has_fluid(); }
  bool has_grains() const { return with_grains && scenario_.has_grains(); }
  bool coupled() const { return with_fluid && with_grains && c_.coupled; }
  bool two_way() const { return with_fluid && with_grains && c_.two_way; }
  void count_pass(std::size_t pass) { ++counters_.passes[pass].second; }

  Scenario scenario_;
  Constants<D> c_;
  State<D, P> state_, next_;  // next_ holds the state before the last step once that is committed
  Work work_;
  Workers workers_;
  PairSweeps<D, P> sweeps_;
  InstructionSet instruction_set_;
  FluidLists<D, Position> lists_;
  CouplingStage<D, P> coupling_;
  Contacts<D, P> contacts_;
  Vec<double, D> evaluated_wall_impulse_ = Vec<double, D>::Zero();  // [N s] of evaluate()'s step
  DragLaw<D> drag_law_;
  std::vector<Wall> walls_;
  Box<D> clear_;  // of all walls
  RunOptions options_;

  StageDigests stage_digests_;

  std::vector<FieldInfo> fields_;
  std::vector<FieldSpan> spans_;
  std::vector<TableInfo> tables_;
  bool has_stage_table_ = false;
  std::vector<std::vector<std::vector<std::byte>>> table_bytes_;
  std::vector<std::uint64_t> table_rows_;
  std::vector<std::uint64_t> step_numbers_;  // clock as recorded: step, n_s
  std::vector<double> step_times_;           // time, dt, t_s
  std::vector<Happening> happenings_;
  mutable Counters counters_;
  double drag_work_ = 0, hydrodynamic_work_ = 0;
};

}  // namespace varve::core
