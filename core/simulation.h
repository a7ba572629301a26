// What tools see of the engine: a non-template Simulation with a field table. The dimension and the
// precision are chosen once, in create(); nothing here names a file, a clock or a log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/scenario.h"

namespace varve::core {

/// Raised whenever a golden digest changes; the commit says why.
inline constexpr std::uint32_t engine_revision = 2;

enum class FieldType { f64, f32, u64, u32, u8 };

/// One entry of the field table: everything the next step reads and nothing that can be recomputed.
struct FieldInfo {
  std::string name;        ///< "fluid.velocity"
  std::string population;  ///< "clock", "fluid", "grains", "contacts"
  FieldType type = FieldType::f64;
  unsigned components = 1;
  std::string unit;
  bool is_id = false;
  bool constant = false;  ///< changes only where the count does
  std::string follows;    ///< x follows v: x += dt v, in the field's own type
};

struct FieldSpan {
  std::uint64_t count = 0;
  std::span<const std::byte> bytes;  ///< particle-major, ascending id
};

struct ColumnInfo {
  std::string name;
  FieldType type = FieldType::f64;
  std::string unit;
};
struct TableInfo {
  std::string name;
  std::vector<ColumnInfo> columns;
};
struct TableSpan {
  std::uint64_t rows = 0;
  std::vector<std::span<const std::byte>> columns;
};

struct Clock {
  std::uint64_t step = 0;
  double time = 0;  ///< [s] t_s + (step - n_s) dt
  double dt = 0;    ///< [s]
};

/// A guard stopped the run. `what()` is the whole sentence; the parts are there for tools.
class NumericalFailure : public std::runtime_error {
 public:
  NumericalFailure(std::string criterion, std::uint64_t step, std::string field, std::uint64_t id,
                   double value, double limit, std::string advice);
  std::string criterion, field, advice;
  std::uint64_t step, id;
  double value, limit;
};

/// A request that the model cannot serve (exit 2): the text names key, value and the largest safe
/// one.
class ModelError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What happened at the end of a step: kind ("change", "fluid_added", ...) and key/value items.
struct Happening {
  std::string kind;
  std::vector<std::pair<std::string, std::string>> items;
};

/// Numbers that explain a run; never part of the state.
struct Counters {
  std::uint64_t list_rebuilds = 0;
  std::uint64_t porosity_clamps = 0;
  std::uint64_t drag_porosity_clamps = 0;
  std::uint64_t weak_coupling = 0;  ///< grain-steps with a Shepard sum below 0.5
  std::uint64_t grain_substeps = 0;
  std::vector<std::uint64_t> items_per_thread;  ///< particles worked on by each thread
  std::vector<std::pair<std::string, std::uint64_t>> passes;  ///< how often each stage ran
};

struct ChangeOptions {
  OutsideMode outside = OutsideMode::error;
  int anchor = 0;  ///< -1: the left wall stays, +1: the right wall stays, 0: both move by half
};

struct RunOptions {
  unsigned threads = 1;
  /// Tests only: every thread does its own share (core/workers.h), so that each is known to work.
  bool own_parts_only = false;
  /// Tests only: rebuild neighbour lists at pseudo-random steps chosen by this seed too, half the
  /// times in the order of cells.
  std::uint64_t rebuild_seed = 0;
  /// Tests only: 0 baseline, 1 x86-64-v3, 2 x86-64-v4; -1 the widest that the processor has.
  int instruction_set = -1;
};

/// Momentum of the last step, in N (N per m depth in 2D) where not said; D components each. Each
/// sum is taken by a pass of its own, from the other side than the one that moved the particles:
/// wall forces over the dummies, reactions over the fluid.
struct StepLedger {
  std::vector<double> fluid_momentum_change;  ///< [N s] sum m (v' - v)
  std::vector<double> grain_momentum_change;  ///< [N s]
  std::vector<double> walls_on_fluid;         ///< pressure and friction of the dummies
  std::vector<double> walls_on_grains;        ///< mean of the contact forces over the step
  std::vector<double> external_on_fluid;      ///< gravity (full form), body force
  std::vector<double> external_on_grains;     ///< weight; the holding force of frozen grains
  std::vector<double> grains_from_fluid;      ///< sum of hydrodynamic force and drag on grains
  std::vector<double> fluid_from_grains;      ///< sum of the reactions on fluid particles
  double force_scale = 0;                     ///< sum of |F| over all particles
};

/// Momentum and energy of the step that starts at an evaluated state, as advance() would take it.
/// Energies in J, powers in W (per m depth in 2D), means over the step; a loss is positive. Works
/// are forces times the mean of the velocities before and after, so that those on the fluid add up
/// to what its kinetic energy changes by. core/engine_balance_impl.h has the terms.
struct StepBalance {
  StepLedger ledger;
  double fluid_kinetic = 0;       ///< at the state
  double compression = 0;         ///< of the fluid at the state: sum m u(rho), du = p drho / rho^2
  double contact_elastic = 0;     ///< in the springs of contacts at the state
  double fluid_gain = 0;          ///< kinetic power of all forces on the fluid
  double viscous_loss = 0;        ///< shear among the fluid
  double wall_viscous_loss = 0;   ///< shear between fluid and walls
  double artificial_loss = 0;     ///< artificial viscosity
  double diffusion_loss = 0;      ///< density diffusion, of the compression energy
  double drag_loss = 0;           ///< drag, between grains and the fluid around them
  double shear_loss = 0;          ///< viscous part of the hydrodynamic force, likewise
  double external_on_fluid = 0;   ///< work of gravity (full form) and body force
  double walls_on_fluid = 0;      ///< work of walls that move, and of what holds fluid inside
  double wall_pressure = 0;       ///< work of the dummies' own pressure, which continuity lacks
  double step_pressure = 0;       ///< work of the pressure that the length of a step adds
  double on_grains = 0;           ///< work of drag and hydrodynamic force on the grains
  std::vector<double> shear_on_grains;  ///< [N] D per grain: viscous part of the hydrodynamic force
  /// Per grain, with the porosity of E3 (empty otherwise): V_j p_j [J], S_j, and what density
  /// diffusion adds to S_j in the step. E3 takes S_j for 1; what that makes of the pressure's work
  /// is V_j p_j dS_j, dS_j without the part of diffusion.
  std::vector<double> pressure_volume, shepard_sum, shepard_diffusion;
};

/// What acted on one grain in the last step [N], [m/s], [-].
struct GrainReport {
  std::vector<double> hydrodynamic, drag, fluid_velocity;
  double porosity = 1, shepard_sum = 0;
};

/// Fluid fields of the last step, by particle in ascending id.
struct FluidReport {
  std::vector<double> pressure;  ///< [Pa] as in the momentum equation: excess or full
  std::vector<double> porosity;  ///< [-] never clamped
};

class Simulation {
 public:
  /// The first state of a resolved scenario (changes scheduled for step 0 applied). This and
  /// restore() throw ArithmeticError where a thread does not compute as IEEE 754 says by default.
  static std::unique_ptr<Simulation> create(const Scenario& resolved, const RunOptions& options);
  /// The engine with `resolved` as it stood at genesis, holding a recorded state: changes scheduled
  /// up to the state's step are taken as done. Throws ModelError if the values do not fit the field
  /// table.
  static std::unique_ptr<Simulation> restore(const Scenario& resolved,
                                             std::span<const FieldSpan> values,
                                             const RunOptions& options);
  virtual ~Simulation() = default;

  virtual const std::vector<FieldInfo>& fields() const = 0;
  virtual FieldSpan field(std::size_t index) const = 0;
  virtual const std::vector<TableInfo>& tables() const = 0;
  /// Rows of the last completed step.
  virtual TableSpan table(std::size_t index) const = 0;

  virtual Clock clock() const = 0;
  /// The scenario as it stands now, scheduled changes up to now included.
  virtual const Scenario& scenario() const = 0;
  /// What happened at the end of the last completed step.
  virtual const std::vector<Happening>& happenings() const = 0;
  virtual const Counters& counters() const = 0;

  /// One step; then the changes scheduled for its end. Throws NumericalFailure: the state is then
  /// that of the last good step, unchanged.
  virtual void advance() = 0;
  /// Everything that advance() would find for the state as it stands, which stays: grain_reports()
  /// and fluid_report() then say, bit for bit, what they say after that advance(). Throws as it
  /// does.
  virtual void evaluate() = 0;
  /// Replaces the state.
  virtual void set_state(std::span<const FieldSpan> values) = 0;
  /// Changes keys now, by the fork rules. Throws ModelError; the state is then unchanged.
  virtual void change(const std::vector<std::pair<std::string, std::string>>& settings,
                      const ChangeOptions& options) = 0;

  /// Sums over the last step, each by a pass of its own; meaningful after advance().
  virtual StepLedger ledger() const = 0;
  /// The same and the energies, of the step that advance() would take; meaningful after
  /// evaluate().
  virtual StepBalance balance() const = 0;
  /// Forces on each grain in the last step; empty without coupling.
  virtual std::vector<GrainReport> grain_reports() const = 0;
  /// Pressures and porosities of the fluid in the last step.
  virtual FluidReport fluid_report() const = 0;
};

}  // namespace varve::core
