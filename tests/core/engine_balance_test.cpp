// The energy balance of the engine: what it says of a step is what the step does, and its terms
// close against the potential energy released.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

/// Sums of a run's balances from its first state on [J per metre of depth].
class Budget {
 public:
  explicit Budget(const Scenario& resolved)
      : scenario_(resolved), simulation_(Simulation::create(resolved, {})) {
    look();
    first_energy_ = energy_;
    first_potential_ = potential_;
  }
  void advance() {
    const double dt = simulation_->clock().dt;
    const StepBalance before = balance_;
    lost_ += dt * (before.viscous_loss + before.wall_viscous_loss + before.artificial_loss +
                   before.drag_loss + before.shear_loss - before.external_on_fluid -
                   before.walls_on_fluid - before.wall_pressure - before.step_pressure);
    simulation_->advance();
    for (const char* name : {"normal_loss", "tangential_loss", "friction_loss"})
      for (const double each : column(*simulation_, 0, name)) lost_ += each;
    look();
    lost_ += dt * balance_.diffusion_loss;
    for (std::size_t j = 0; j < before.shepard_sum.size(); ++j)
      lost_ -= 0.5 * (before.pressure_volume[j] + balance_.pressure_volume[j]) *
               (balance_.shepard_sum[j] - before.shepard_sum[j] - balance_.shepard_diffusion[j]);
  }
  double time() const { return simulation_->clock().time; }
  double released() const { return first_potential_ - potential_; }
  double residual() const { return first_energy_ - energy_ - lost_; }
  const StepBalance& balance() const { return balance_; }
  Simulation& simulation() { return *simulation_; }

 private:
  void look() {
    simulation_->evaluate();
    balance_ = simulation_->balance();
    const double d = scenario_.grains.diameter, area = 0.25 * 3.14159265358979323846 * d * d;
    const double weight =
        (scenario_.grains.density - scenario_.fluid.density) * area * scenario_.gravity.magnitude;
    const double mass = scenario_.grains.density * area;
    potential_ = 0;
    double kinetic = 0;
    const std::vector<double> x = field(*simulation_, "grains.position");
    for (std::size_t i = 1; i < x.size(); i += 2) potential_ += weight * x[i];
    for (const double v : field(*simulation_, "grains.velocity")) kinetic += 0.5 * mass * v * v;
    for (const double w : field(*simulation_, "grains.spin"))
      kinetic += 0.0625 * mass * d * d * w * w;
    energy_ = potential_ + kinetic + balance_.fluid_kinetic + balance_.compression +
              balance_.contact_elastic;
  }

  Scenario scenario_;
  std::unique_ptr<Simulation> simulation_;
  StepBalance balance_;
  double energy_ = 0, potential_ = 0, first_energy_ = 0, first_potential_ = 0, lost_ = 0;
};

TEST(EngineBalance, WhatItForeseesIsWhatTheStepDoes) {
  for (const PressureForce form : {PressureForce::conjugate, PressureForce::averaged}) {
    Scenario scenario = small_column();
    scenario.coupling.pressure_force = form;
    const auto simulation = started(scenario);
    const double dt = simulation->clock().dt;
    for (int n = 0; n < 40; ++n) simulation->advance();
    simulation->evaluate();
    const StepBalance balance = simulation->balance();
    const std::vector<double> m = field(*simulation, "fluid.mass");
    const auto kinetic = [&] {
      const std::vector<double> v = field(*simulation, "fluid.velocity");
      double sum = 0;
      for (std::size_t k = 0; k < v.size(); ++k) sum += 0.5 * m[k / 2] * v[k] * v[k];
      return sum;
    };
    const double before = kinetic();
    EXPECT_NEAR(balance.fluid_kinetic, before, 1e-12 * before);
    simulation->advance();
    EXPECT_NEAR(dt * balance.fluid_gain, kinetic() - before, 1e-10 * before);
    const std::vector<double> works = column(*simulation, 1, "drag_on_grains");
    EXPECT_NEAR(dt * balance.on_grains,
                works[0] + column(*simulation, 1, "hydrodynamic_on_grains")[0],
                1e-9 * std::abs(works[0]));
    const StepLedger ledger = simulation->ledger();
    EXPECT_EQ(balance.ledger.walls_on_fluid, ledger.walls_on_fluid);
    EXPECT_EQ(balance.ledger.fluid_from_grains, ledger.fluid_from_grains);
    EXPECT_EQ(balance.ledger.walls_on_grains, ledger.walls_on_grains);
    EXPECT_LE(momentum_residual(balance.ledger, dt), 1e-12);
    EXPECT_GT(balance.viscous_loss, 0);
    EXPECT_GT(balance.drag_loss, 0);
  }
}

TEST(EngineBalance, OfADiscClosesUntilItsPlateau) {
  Budget budget(resolved(single_disc()));
  while (budget.time() < 0.4) budget.advance();
  EXPECT_GT(budget.released(), 2e-4);
  EXPECT_LE(std::abs(budget.residual()), 0.01 * budget.released());
  // Far from nothing: it is the terms that close it.
  EXPECT_GT(budget.balance().viscous_loss, 0.1 * budget.released());
}

TEST(EngineBalance, OfAHeapClosesBetterTheShorterTheStep) {
  Scenario scenario = small_column();
  scenario.domain.width = 0.03;
  scenario.domain.height = 0.04;
  scenario.grains.rows = 4;
  scenario.grains.columns = 8;
  scenario.grains.velocity_x = scenario.grains.velocity_y = 0;
  scenario.grains.lowest_y = automatic;
  std::vector<double> residuals;
  for (const double cfl : {0.25, 0.125}) {
    scenario.time.cfl = cfl;
    Budget budget(resolved(scenario));
    while (budget.time() < 0.1) budget.advance();
    EXPECT_GT(budget.released(), 5e-3);
    residuals.push_back(std::abs(budget.residual()) / budget.released());
  }
  EXPECT_LE(residuals[0], 0.01);
  EXPECT_LE(residuals[1], 0.7 * residuals[0]);
}

TEST(EngineBalance, ArtificialViscosityAndDiffusionLoseAndAMovingLidWorks) {
  Scenario s;
  s.domain.width = s.domain.height = 0.02;
  s.domain.lid_speed = 0.05;
  s.fluid.sound_speed = 1;
  s.fluid.artificial_alpha = 0.1;
  s.time.until = 1;
  const auto simulation = started(s);
  double start = 0, kinetic = 0, compression = 0, in = 0, out = 0, artificial = 0;
  const double dt = simulation->clock().dt;
  StepBalance balance;
  for (int n = 0; n <= 400; ++n) {
    simulation->evaluate();
    balance = simulation->balance();
    kinetic = balance.fluid_kinetic;
    compression = balance.compression;
    if (n == 0) start = kinetic + compression;
    if (n > 0) out += dt * balance.diffusion_loss;
    if (n == 400) break;
    in += dt * (balance.walls_on_fluid + balance.wall_pressure + balance.step_pressure);
    out += dt * (balance.viscous_loss + balance.wall_viscous_loss + balance.artificial_loss);
    artificial += dt * balance.artificial_loss;
    simulation->advance();
  }
  EXPECT_GT(artificial, 0.05 * out);
  EXPECT_GT(in, 0);
  EXPECT_NEAR(kinetic + compression - start, in - out, 0.01 * in);
}

}  // namespace
}  // namespace varve::core::test
