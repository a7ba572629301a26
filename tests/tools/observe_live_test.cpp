// Observables of a log against the engine's own live values, bit for bit.
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/simulation.h"
#include "io/log_reader.h"
#include "tests/tools/verbs.h"
#include "tools/analysis.h"
#include "tools/simulation_engine.h"

namespace varve::test {
namespace {

/// Rows of a table by column, as text.
using Columns = std::map<std::string, std::vector<std::string>>;

class Live : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = folder_ / "crowd.varve";
    verb(0, {"run", folder_.write("crowd.cfg", crowd_scene()), "-o", path_, "-q"});
    log_ = io::LogReader::open(path_);
    scenario_ = tools::scenario_of(log_->genesis(), path_);
  }
  std::map<std::string, Columns> tables(const std::vector<std::string>& names,
                                        tools::StepRange range) const {
    tools::AnalysisRequest request;
    request.range = range;
    for (const std::string& name : names) request.tables.push_back(&tools::find_observable(name));
    std::map<std::string, std::vector<std::string>> headers;
    std::map<std::string, Columns> result;
    tools::analyze(*log_, scenario_, request,
                   [&](const tools::Observable& table, const std::vector<std::string>& row) {
                     std::vector<std::string>& header = headers[table.name];
                     if (header.empty()) {
                       header = row;
                       return;
                     }
                     ASSERT_EQ(row.size(), header.size()) << table.name;
                     for (std::size_t k = 0; k < row.size(); ++k)
                       result[table.name][header[k]].push_back(row[k]);
                   });
    return result;
  }
  TemporaryFolder folder_;
  std::string path_;
  std::unique_ptr<io::LogReader> log_;
  core::Scenario scenario_;
};

TEST_F(Live, ForcesBalanceAndMomentumAreTheEnginesBits) {
  constexpr std::uint64_t last = 60;
  const auto from_log = tables({"forces", "energy_budget", "momentum", "contacts"}, {0, last, 1});
  const auto engine = tools::SimulationEngine::fresh(scenario_, {});
  const Columns& forces = from_log.at("forces");
  const Columns& budget = from_log.at("energy_budget");
  const Columns& momentum = from_log.at("momentum");
  const std::size_t grains = 6;
  bool touched = false;
  for (std::uint64_t step = 0; step <= last; ++step) {
    engine->evaluate();
    const core::StepBalance balance = engine->simulation().balance();
    EXPECT_EQ(budget.at("compression_J").at(step), fmt::format("{}", balance.compression));
    EXPECT_EQ(budget.at("fluid_kinetic_J").at(step), fmt::format("{}", balance.fluid_kinetic));
    EXPECT_EQ(budget.at("contact_elastic_J").at(step),
              fmt::format("{}", balance.contact_elastic));
    // What advance() finds, not evaluate().
    engine->advance();
    const core::StepLedger ledger = engine->simulation().ledger();
    EXPECT_EQ(momentum.at("walls_on_fluid_y_N").at(step),
              fmt::format("{}", ledger.walls_on_fluid[1]));
    EXPECT_EQ(momentum.at("walls_on_grains_y_N").at(step),
              fmt::format("{}", ledger.walls_on_grains[1]));
    EXPECT_LE(std::stod(momentum.at("momentum_residual").at(step)), 1e-12) << step;
    EXPECT_LE(std::stod(momentum.at("reaction_residual").at(step)), 1e-12) << step;
    const std::vector<core::GrainReport> reports = engine->simulation().grain_reports();
    ASSERT_EQ(reports.size(), grains);
    for (std::size_t i = 0; i < grains; ++i) {
      const std::size_t row = step * grains + i;
      EXPECT_EQ(forces.at("hydrodynamic_y_N").at(row),
                fmt::format("{}", reports[i].hydrodynamic[1]));
      EXPECT_EQ(forces.at("drag_x_N").at(row), fmt::format("{}", reports[i].drag[0]));
      EXPECT_EQ(forces.at("porosity").at(row), fmt::format("{}", reports[i].porosity));
      // Its two parts are the whole.
      EXPECT_NEAR(std::stod(forces.at("pressure_y_N").at(row)) +
                      std::stod(forces.at("shear_y_N").at(row)),
                  reports[i].hydrodynamic[1], 1e-14 * std::abs(reports[i].hydrodynamic[1]));
    }
    touched = touched || ledger.walls_on_grains[1] != 0;
  }
  EXPECT_TRUE(touched);
}

TEST_F(Live, LossesAreSumsOfTheEnginesPowers) {
  constexpr std::uint64_t last = 40;
  const auto from_log = tables({"energy_budget"}, {0, last, 1});
  const Columns& budget = from_log.at("energy_budget");
  const auto engine = tools::SimulationEngine::fresh(scenario_, {});
  double viscous = 0, drag = 0, diffusion = 0, time = 0;
  for (std::uint64_t step = 0; step <= last; ++step) {
    engine->evaluate();
    const core::StepBalance balance = engine->simulation().balance();
    const double now = engine->simulation().clock().time;
    if (step > 0) diffusion += (now - time) * balance.diffusion_loss;
    EXPECT_NEAR(std::stod(budget.at("viscous_J").at(step)), viscous, 1e-13 * viscous);
    EXPECT_NEAR(std::stod(budget.at("drag_J").at(step)), drag, 1e-13 * std::abs(drag));
    EXPECT_NEAR(std::stod(budget.at("density_diffusion_J").at(step)), diffusion,
                1e-13 * std::abs(diffusion));
    engine->advance();
    const double dt = engine->simulation().clock().time - now;
    viscous += dt * balance.viscous_loss;
    drag += dt * balance.drag_loss;
    time = now;
  }
  EXPECT_GT(viscous, 0);
}

TEST_F(Live, GrainsAloneAreTheSameAsWithTheFluid) {
  // Decoding the grains only, and everything: the same rows.
  const auto fast = tables({"trajectories", "settling", "stress", "contacts"}, {3, 100, 2});
  const auto whole = tables({"trajectories", "settling", "stress", "contacts", "energy"},
                            {3, 100, 2});
  for (const char* name : {"trajectories", "settling", "stress", "contacts"})
    EXPECT_EQ(fast.at(name), whole.at(name)) << name;
  EXPECT_EQ(fast.at("settling").at("step").size(), 49u);
}

TEST_F(Live, EveryTableHasRowsAsWideAsItsHeader) {
  std::vector<std::string> names;
  for (const tools::Observable& each : tools::observables())
    if (!each.points) names.push_back(each.name);
  const auto all = tables(names, {0, 120, 20});
  for (const std::string& name : names)
    EXPECT_TRUE(all.count(name) > 0 || name == "detachment") << name;
}

}  // namespace
}  // namespace varve::test
