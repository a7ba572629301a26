// Tables of forces and energies.
#include <array>
#include <cmath>
#include <map>

#include "core/observe/drag_numbers.h"
#include "tools/analysis_tables.h"

namespace varve::tools {
namespace {

/// -sum of weights times places: submerged in the excess form.
double potential_of(const ObservedStep& now) {
  double potential = 0;
  for (std::size_t k = 0; k < now.weights.size(); ++k)
    potential -= now.weights[k] * now.grains.position[k];
  return potential;
}

Observable energy() {
  Observable o;
  o.name = "energy";
  o.summary = "energies of grains and fluid, and what contacts and the fluid took";
  o.formula =
      "1/2 m v^2, 1/2 I w^2, -m g.x of grains (submerged in the excess form); 1/2 m v^2 of the "
      "fluid; losses and work summed since the first step analyzed";
  o.source = "definition; contact and work records";
  o.needs = Needs::fluid;
  o.columns = [](const core::Scenario&) {
    return TableRow{"step", "time_s", "grains_kinetic_J", "grains_rotation_J",
                    "grains_potential_J", "fluid_kinetic_J", "normal_loss_J",
                    "tangential_loss_J", "friction_loss_J", "drag_work_on_grains_J",
                    "hydrodynamic_work_on_grains_J"};
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const core::GrainEnergy e = core::grain_energy(
        now.grains, dimension_of(s) == 2 ? 0.5 : 0.4, std::array<double, 3>{});
    TableRow row = row_beginning(now);
    add_values(row, {e.translation, e.rotation, potential_of(now), now.fluid_kinetic,
                     now.normal_loss, now.tangential_loss, now.friction_loss,
                     now.total_drag_work, now.total_hydrodynamic_work});
    emit(std::move(row));
  };
  return o;
}

Observable energy_budget() {
  Observable o;
  o.name = "energy_budget";
  o.summary = "where the energy is and where it went, each term by itself, and what is left over";
  o.formula =
      "states: potential, kinetic, rotation of grains; kinetic and compression (sum m u(rho), du = "
      "p drho / rho^2) of the fluid; springs of contacts. Lost since the first state: viscous "
      "(shear in the fluid), wall_viscous (at walls), artificial, density_diffusion, drag (F.(u - "
      "v)), shear (viscous part of the hydrodynamic force, likewise), contacts by normal and "
      "tangential dashpot and friction, wall_contact (of these three, with walls). Put in: "
      "external (gravity of the full form, body force), walls_work (walls that move). Put in by "
      "the discretisation: wall_pressure (the dummies' own pressure), porosity_form (E3 takes S_j "
      "for 1), time_step (continuity with the places at the step's start). residual: energy that "
      "left and is in no term; residual_share: of the potential energy released; wall_share: "
      "(wall_viscous + wall_contact) / all losses. Exact where every step is analyzed, else powers "
      "are taken to be linear in between. Grains must be free; the averaged pressure force "
      "(coupling.pressure_force) has no energy and does not close";
  o.source = "the engine's balance of the recorded state (core/engine_balance_impl.h); records";
  o.needs = Needs::forces;
  o.columns = [](const core::Scenario&) {
    return TableRow{"step", "time_s", "potential_J", "grains_kinetic_J", "grains_rotation_J",
                    "fluid_kinetic_J", "compression_J", "contact_elastic_J", "released_J",
                    "viscous_J", "wall_viscous_J", "artificial_J", "density_diffusion_J", "drag_J",
                    "shear_J", "normal_loss_J", "tangential_loss_J", "friction_loss_J",
                    "wall_contact_J", "external_J", "walls_work_J", "wall_pressure_J",
                    "porosity_form_J", "time_step_J", "residual_J", "residual_share", "wall_share",
                    "momentum_residual"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    const BudgetRow& b = now.budget;
    TableRow row = row_beginning(now);
    add_values(row, {b.potential, b.translation, b.rotation, b.fluid_kinetic, b.compression,
                     b.contact_elastic, b.released, b.viscous, b.wall_viscous, b.artificial,
                     b.diffusion, b.drag, b.shear, b.normal, b.tangential, b.friction,
                     b.wall_contact, b.external, b.walls_work, b.wall_pressure, b.porosity_form,
                     b.time_step, b.residual, b.residual_share(), b.wall_share(),
                     b.momentum_residual});
    emit(std::move(row));
  };
  return o;
}

Observable momentum() {
  Observable o;
  o.name = "momentum";
  o.summary = "momentum of a step against the forces from outside";
  o.formula =
      "change of the momentum of fluid and grains over dt, forces of walls and from outside, each "
      "summed by a pass of its own; reaction: forces on grains plus reactions on the fluid; "
      "residuals over the sum of |F| of all particles";
  o.source = "the engine's balance of the recorded state";
  o.needs = Needs::forces;
  o.columns = [](const core::Scenario& s) {
    TableRow row{"step", "time_s"};
    add_axes(row, s, "fluid_change_", "_N_s");
    add_axes(row, s, "grains_change_", "_N_s");
    add_axes(row, s, "walls_on_fluid_", "_N");
    add_axes(row, s, "walls_on_grains_", "_N");
    add_axes(row, s, "external_", "_N");
    row.insert(row.end(), {"momentum_residual", "reaction_residual"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const core::StepLedger& l = now.balance.ledger;
    const std::size_t d = dimension_of(s);
    std::vector<double> external(d);
    double reaction2 = 0;
    for (std::size_t k = 0; k < d; ++k) {
      external[k] = l.external_on_fluid[k] + l.external_on_grains[k];
      const double off = l.grains_from_fluid[k] + l.fluid_from_grains[k];
      reaction2 += off * off;
    }
    TableRow row = row_beginning(now);
    for (const auto* each : {&l.fluid_momentum_change, &l.grain_momentum_change,
                             &l.walls_on_fluid, &l.walls_on_grains})
      add_values(row, *each);
    add_values(row, external);
    row.push_back(cell(now.budget.momentum_residual));
    row.push_back(cell(l.force_scale > 0 ? std::sqrt(reaction2) / l.force_scale : 0));
    emit(std::move(row));
  };
  return o;
}

/// Of the contacts of this step on each grain [N], means over the step that led to this state.
std::map<std::uint64_t, std::array<double, 3>> contact_forces(const ObservedStep& now) {
  std::map<std::uint64_t, std::array<double, 3>> forces;
  if (!(now.dt > 0)) return forces;
  for (const core::ContactRow& row : now.contacts)
    for (std::size_t k = 0; k < 3; ++k) {
      forces[row.grain][k] += row.impulse[k] / now.dt;
      if (row.kind == 0) forces[row.partner][k] -= row.impulse[k] / now.dt;
    }
  return forces;
}

void add_force_row(const core::Scenario& s, const ObservedStep& now, std::size_t i,
                   const double* contact, const EmitRow& emit) {
  const std::size_t d = dimension_of(s);
  const core::GrainReport& f = now.forces[i];
  TableRow row = row_beginning(now);
  add_grain(row, s, now.grains.id[i]);
  add_values(row, f.hydrodynamic.data(), d);
  add_values(row, f.drag.data(), d);
  add_values(row, contact, d);
  add_values(row, now.weights.data() + i * d, d);
  add_values(row, f.fluid_velocity.data(), d);
  double slip2 = 0, drag2 = 0;
  for (std::size_t k = 0; k < d; ++k) {
    const double slip = f.fluid_velocity[k] - now.grains.velocity[i * d + k];
    slip2 += slip * slip;
    drag2 += f.drag[k] * f.drag[k];
  }
  const core::DragNumbers n = core::drag_numbers(s, 2 * now.grains.radius[i], std::sqrt(slip2),
                                                 f.porosity, std::sqrt(drag2));
  add_values(row, {std::sqrt(slip2), n.reynolds, n.coefficient, f.porosity, n.shielding});
  const double* shear = now.balance.shear_on_grains.data() + i * d;
  for (std::size_t k = 0; k < d; ++k) row.push_back(cell(f.hydrodynamic[k] - shear[k]));
  add_values(row, shear, d);
  emit(std::move(row));
}

Observable forces() {
  Observable o;
  o.name = "forces";
  o.summary = "forces on every grain, slip, drag coefficient, shielding";
  o.formula =
      "hydrodynamic: V (-grad p + div tau), of which pressure and shear; drag: mean of K (u - v) "
      "over the sub-steps, at this state; contact: impulse over dt of the step that led here; Re = "
      "rho0 eps |u - v| d / mu; Cd = |drag| / (1/2 rho0 (eps |u - v|)^2 A); shielding: |drag| over "
      "that of a lone grain at the same slip";
  o.source = "the engine's force pass on the recorded state; contact records";
  o.needs = Needs::forces;
  o.columns = [](const core::Scenario& s) {
    TableRow row = grain_columns();
    add_axes(row, s, "hydrodynamic_", "_N");
    add_axes(row, s, "drag_", "_N");
    add_axes(row, s, "contact_", "_N");
    add_axes(row, s, "weight_", "_N");
    add_axes(row, s, "fluid_v", "_m_s");
    row.insert(row.end(), {"slip_m_s", "reynolds", "drag_coefficient", "porosity", "shielding"});
    add_axes(row, s, "pressure_", "_N");
    add_axes(row, s, "shear_", "_N");
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const auto contact = contact_forces(now);
    const std::array<double, 3> none{};
    for (std::size_t i = 0; i < now.forces.size(); ++i) {
      const auto touching = contact.find(now.grains.id[i]);
      add_force_row(s, now, i, touching == contact.end() ? none.data() : touching->second.data(),
                    emit);
    }
  };
  return o;
}

}  // namespace

std::vector<Observable> force_tables() {
  return {energy(), forces(), energy_budget(), momentum()};
}

}  // namespace varve::tools
