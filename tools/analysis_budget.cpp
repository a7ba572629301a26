#include "tools/analysis_budget.h"

#include <cmath>
#include <limits>

namespace varve::tools {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

}  // namespace

double BudgetRow::residual_share() const { return released != 0 ? residual / released : nothing; }

double BudgetRow::wall_share() const {
  return losses() > 0 ? (wall_viscous + wall_contact) / losses() : nothing;
}

double momentum_residual(const core::StepLedger& ledger, double dt) {
  if (!(ledger.force_scale > 0) || !(dt > 0)) return 0;
  double squares = 0;
  for (std::size_t k = 0; k < ledger.fluid_momentum_change.size(); ++k) {
    const double off =
        (ledger.fluid_momentum_change[k] + ledger.grain_momentum_change[k]) / dt -
        (ledger.walls_on_fluid[k] + ledger.walls_on_grains[k] + ledger.external_on_fluid[k] +
         ledger.external_on_grains[k]);
    squares += off * off;
  }
  return std::sqrt(squares) / ledger.force_scale;
}

void EnergyBudget::take_contacts(double normal, double tangential, double friction,
                                 double at_walls) {
  if (!begun_) return;
  sums_.normal += normal;
  sums_.tangential += tangential;
  sums_.friction += friction;
  sums_.wall_contact += at_walls;
}

double EnergyBudget::potential_of(const core::GrainView& grains,
                                  const std::vector<double>& weights) const {
  double potential = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) potential -= weights[k] * grains.position[k];
  return potential;
}

void EnergyBudget::add_powers(const core::StepBalance& balance, double before, double now) {
  const auto add = [&](double& sum, double core::StepBalance::*power) {
    sum += before * before_.*power + now * balance.*power;
  };
  using B = core::StepBalance;
  add(sums_.viscous, &B::viscous_loss);
  add(sums_.wall_viscous, &B::wall_viscous_loss);
  add(sums_.artificial, &B::artificial_loss);
  add(sums_.drag, &B::drag_loss);
  add(sums_.shear, &B::shear_loss);
  add(sums_.external, &B::external_on_fluid);
  add(sums_.walls_work, &B::walls_on_fluid);
  add(sums_.wall_pressure, &B::wall_pressure);
  add(sums_.time_step, &B::step_pressure);
}

void EnergyBudget::add_porosity_form(const core::StepBalance& balance) {
  if (before_.shepard_sum.size() != balance.shepard_sum.size()) return;
  for (std::size_t j = 0; j < balance.shepard_sum.size(); ++j)
    sums_.porosity_form +=
        0.5 * (before_.pressure_volume[j] + balance.pressure_volume[j]) *
        (balance.shepard_sum[j] - before_.shepard_sum[j] - balance.shepard_diffusion[j]);
}

BudgetRow EnergyBudget::take(std::uint64_t step, double time, double dt,
                             const core::StepBalance& balance, const core::GrainView& grains,
                             const core::GrainEnergy& energy, const std::vector<double>& weights) {
  sums_.potential = potential_of(grains, weights);
  sums_.translation = energy.translation;
  sums_.rotation = energy.rotation;
  sums_.fluid_kinetic = balance.fluid_kinetic;
  sums_.compression = balance.compression;
  sums_.contact_elastic = balance.contact_elastic;
  const double total = sums_.potential + sums_.translation + sums_.rotation +
                       sums_.fluid_kinetic + sums_.compression + sums_.contact_elastic;
  if (!begun_) {
    first_energy_ = total;
    first_potential_ = sums_.potential;
  } else {
    // A power of a state is the mean over the step that starts there; diffusion has then been at
    // work in the step that led here.
    const double span = time - time_;
    const bool next = step == step_ + 1;
    add_powers(balance, next ? span : 0.5 * span, next ? 0 : 0.5 * span);
    sums_.diffusion += next ? span * balance.diffusion_loss
                            : 0.5 * span * (before_.diffusion_loss + balance.diffusion_loss);
    add_porosity_form(balance);
  }
  sums_.released = first_potential_ - sums_.potential;
  sums_.residual = first_energy_ - total - sums_.losses() + sums_.external + sums_.walls_work +
                   sums_.wall_pressure + sums_.porosity_form + sums_.time_step;
  sums_.momentum_residual = momentum_residual(balance.ledger, dt);
  begun_ = true;
  step_ = step;
  time_ = time;
  before_ = balance;
  return sums_;
}

}  // namespace varve::tools
