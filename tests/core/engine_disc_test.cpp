// The benchmark: one disc settles in a closed box of 2 x 6 cm and comes to rest on the floor.
// Resolved simulations (Glowinski 2001; Wan and Turek 2006) reach 0.0557 m/s and touch the floor
// after 0.745 to 0.755 s.
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

/// Everything asked of the run, which is made once.
struct DiscRun {
  double contact_time = -1;
  double plateau = 0;  // [m/s] mean speed over 0.30 to 0.50 s
  double elastic = 0, fluid = 0, weight = 0;  // [N] means over 0.1 s around 3 s, upwards
  double worst_momentum = 0, worst_reaction = 0;

  DiscRun() {
    Scenario scenario = resolved(single_disc());
    const auto simulation = Simulation::create(scenario, {});
    weight = -(scenario.grains.density - scenario.fluid.density) * 0.25 * 3.14159265358979323846 *
             scenario.grains.diameter * scenario.grains.diameter * scenario.gravity.magnitude;
    int plateau_steps = 0, rest_steps = 0;
    while (simulation->clock().time < 3.05) {
      simulation->advance();
      const double t = simulation->clock().time;
      const std::vector<double> v = field(*simulation, "grains.velocity");
      const std::vector<double> x = field(*simulation, "grains.position");
      const StepLedger ledger = simulation->ledger();
      worst_momentum = std::max(worst_momentum, momentum_residual(ledger, scenario.time.dt));
      worst_reaction = std::max(worst_reaction, reaction_residual(ledger));
      if (contact_time < 0 && simulation->table(0).rows > 0) contact_time = t;
      if (t >= 0.3 && t <= 0.5) {
        plateau += std::sqrt(v[0] * v[0] + v[1] * v[1]);
        ++plateau_steps;
      }
      if (t >= 2.95) {
        const GrainReport report = simulation->grain_reports().at(0);
        elastic += scenario.contact.stiffness * (0.5 * scenario.grains.diameter - x[1]);
        fluid += report.hydrodynamic[1] + report.drag[1];
        ++rest_steps;
      }
    }
    plateau /= plateau_steps;
    elastic /= rest_steps;
    fluid /= rest_steps;
  }
};

// One test, since the run is what takes its time.
TEST(EngineDiscSlow, FallsTouchesAndRestsAsTheBenchmarkSaysAndKeepsMomentum) {
  const DiscRun run;
  const auto property = [](const char* name, double value) {
    RecordProperty(name, std::to_string(value));
  };
  property("contact_time_s", run.contact_time);
  property("plateau_m_s", run.plateau);
  property("elastic_over_load", -run.elastic / (run.weight + run.fluid));
  property("elastic_over_weight", -run.elastic / run.weight);
  EXPECT_GE(run.contact_time, 0.72);
  EXPECT_LE(run.contact_time, 0.76);
  EXPECT_GE(run.plateau, 0.052);
  EXPECT_LE(run.plateau, 0.060);
  EXPECT_NEAR(-run.elastic / (run.weight + run.fluid), 1, 1e-3);
  EXPECT_NEAR(-run.elastic / run.weight, 1, 5e-3);
  EXPECT_LE(run.worst_momentum, 1e-12);
  EXPECT_GT(run.worst_momentum, 0);
  EXPECT_LE(run.worst_reaction, 1e-12);
}

}  // namespace
}  // namespace varve::core::test
