// Where the energy of a run is, and where it went: sums over the states of a walk.
#pragma once

#include <cstdint>
#include <vector>

#include "core/observe/grains.h"
#include "core/simulation.h"

namespace varve::tools {

/// Energies at a state, and losses and works since the first state taken [J, per m depth in 2D].
struct BudgetRow {
  double potential = 0, translation = 0, rotation = 0, fluid_kinetic = 0, compression = 0,
         contact_elastic = 0;
  double released = 0;  ///< potential energy since the first state
  double viscous = 0, wall_viscous = 0, artificial = 0, diffusion = 0, drag = 0, shear = 0;
  double normal = 0, tangential = 0, friction = 0;  ///< of all contacts
  double wall_contact = 0;                          ///< the part of these three with walls
  double external = 0, walls_work = 0;              ///< put in
  double wall_pressure = 0, porosity_form = 0, time_step = 0;  ///< put in by the discretisation
  double residual = 0;           ///< energy that left and is found in no term
  double momentum_residual = 0;  ///< [-] of the step that starts here

  double losses() const {
    return viscous + wall_viscous + artificial + diffusion + drag + shear + normal + tangential +
           friction;
  }
  /// [-] residual over the potential energy released; NaN while none is.
  double residual_share() const;
  /// [-] shear at the walls and contacts with them, of all losses; NaN while nothing is lost.
  double wall_share() const;
};

/// Sums balances. A step that follows on the one before is summed exactly as the engine moved;
/// between states further apart powers are taken to change linearly.
class EnergyBudget {
 public:
  /// Losses by contacts during one step, `at_walls` those with walls.
  void take_contacts(double normal, double tangential, double friction, double at_walls);
  /// `weights`: [N] dimension components per grain.
  BudgetRow take(std::uint64_t step, double time, double dt, const core::StepBalance& balance,
                 const core::GrainView& grains, const core::GrainEnergy& energy,
                 const std::vector<double>& weights);

 private:
  void add_powers(const core::StepBalance& balance, double before, double now);
  void add_porosity_form(const core::StepBalance& balance);
  double potential_of(const core::GrainView& grains, const std::vector<double>& weights) const;

  bool begun_ = false;
  std::uint64_t step_ = 0;
  double time_ = 0, first_energy_ = 0, first_potential_ = 0;
  core::StepBalance before_;
  BudgetRow sums_;
};

/// |change of momentum - walls - external forces| over the sum of all forces.
double momentum_residual(const core::StepLedger& ledger, double dt);

}  // namespace varve::tools
