// varve analyze: what its tables say is what the log holds, and the summary follows from them.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/json_schema.h"
#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

using ::testing::HasSubstr;

/// A CSV file as columns by name.
std::map<std::string, std::vector<std::string>> columns_of(const std::string& text) {
  std::istringstream lines(text);
  std::string line, cell;
  std::vector<std::string> names;
  std::map<std::string, std::vector<std::string>> columns;
  std::getline(lines, line);
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
  while (std::getline(lines, line)) {
    std::size_t k = 0;
    for (std::istringstream cells(line); std::getline(cells, cell, ','); ++k)
      columns[names.at(k)].push_back(cell);
    EXPECT_EQ(k, names.size()) << line;
  }
  return columns;
}

class Analyze : public ::testing::Test {
 protected:
  void SetUp() override {
    disc_ = folder_ / "disc.varve";
    crowd_ = folder_ / "crowd.varve";
    verb(0, {"run", folder_.write("disc.cfg", disc_scene()), "-o", disc_, "-q"});
    verb(0, {"run", folder_.write("crowd.cfg", crowd_scene()), "-o", crowd_, "-q"});
  }
  std::map<std::string, std::vector<std::string>> table(const std::string& run,
                                                        const std::string& name,
                                                        const std::string& range = "first:last") {
    return columns_of(
        verb(0, {"analyze", run, "--observable", name, "--range", range}).output);
  }
  TemporaryFolder folder_;
  std::string disc_, crowd_;
};

TEST_F(Analyze, TrajectoriesAreTheRecordedBits) {
  const auto rows = table(crowd_, "trajectories", "100");
  ASSERT_EQ(rows.at("grain").size(), 6u);
  const Json shown = json_verb(0, {"show", crowd_, "--at", "100", "--fields", "grains"});
  for (std::size_t i = 0; i < 6; ++i) {
    const Json& x = shown["fields"]["grains.position"][i];
    const Json& v = shown["fields"]["grains.velocity"][i];
    EXPECT_EQ(std::stod(rows.at("x_m")[i]), x[0].get<double>());
    EXPECT_EQ(std::stod(rows.at("y_m")[i]), x[1].get<double>());
    EXPECT_EQ(std::stod(rows.at("vx_m_s")[i]), v[0].get<double>());
    EXPECT_EQ(std::stod(rows.at("vy_m_s")[i]), v[1].get<double>());
    EXPECT_EQ(rows.at("row")[i], std::to_string(i / 3));
    EXPECT_EQ(rows.at("column")[i], std::to_string(i % 3));
  }
}

TEST_F(Analyze, TheGroupsMotionIsTheMeanOfItsGrains) {
  const auto group = table(crowd_, "settling"), all = table(crowd_, "trajectories");
  ASSERT_EQ(group.at("step").size(), 121u);
  for (const std::size_t n : {0u, 60u, 120u}) {
    double vy = 0, lowest = 1;
    for (std::size_t i = 6 * n; i < 6 * n + 6; ++i) {
      vy += std::stod(all.at("vy_m_s")[i]);
      lowest = std::min(lowest, std::stod(all.at("y_m")[i]));
    }
    EXPECT_NEAR(std::stod(group.at("settling_speed_m_s")[n]), -vy / 6, 1e-15);
    EXPECT_EQ(std::stod(group.at("lowest_y_m")[n]), lowest);
  }
}

TEST_F(Analyze, ARangeWithAStrideTakesThoseStepsButEveryContact) {
  const auto rows = table(crowd_, "settling", "10:50:20");
  EXPECT_THAT(rows.at("step"), testing::ElementsAre("10", "30", "50"));
  const auto every = table(crowd_, "contacts", "10:50:20");
  EXPECT_EQ(every.at("step").size(), 41u);
}

TEST_F(Analyze, LossesAreThoseOfTheContactRecordsAddedUp) {
  const auto contacts = table(crowd_, "contacts"), energy = table(crowd_, "energy");
  double normal = 0, friction = 0;
  for (const std::string& each : contacts.at("normal_loss_J")) normal += std::stod(each);
  for (const std::string& each : contacts.at("friction_loss_J")) friction += std::stod(each);
  EXPECT_GT(normal, 0);
  EXPECT_NEAR(std::stod(energy.at("normal_loss_J").back()), normal, 1e-12 * normal);
  const Json summary = json_verb(0, {"analyze", crowd_});
  EXPECT_NEAR(summary["contacts"]["normal_loss_J"].get<double>(), normal, 1e-12 * normal);
  EXPECT_NEAR(summary["contacts"]["friction_loss_J"].get<double>(), friction,
              1e-12 * std::abs(friction) + 1e-30);
}

TEST_F(Analyze, ADiscsFirstHitHasTheRestitutionOfItsDamping) {
  const auto hits = table(disc_, "wall_hits");
  ASSERT_FALSE(hits.at("grain").empty());
  EXPECT_EQ(hits.at("wall")[0], "bottom");
  const double impact = std::stod(hits.at("impact_speed_m_s")[0]),
               rebound = std::stod(hits.at("rebound_speed_m_s")[0]);
  EXPECT_EQ(std::stod(hits.at("restitution")[0]), rebound / impact);
  // 0.744 dry; the fluid takes a little more.
  EXPECT_NEAR(rebound / impact, 0.72, 0.03);
  const Json summary = json_verb(0, {"analyze", disc_});
  EXPECT_EQ(summary["schema"], "varve.analyze/1");
  EXPECT_EQ(summary["grains"], 1);
  EXPECT_EQ(summary["contacts"]["first_floor_s"], summary["contacts"]["first_s"]);
  EXPECT_EQ(summary["contacts"]["wall_hits"].get<std::size_t>(), hits.at("grain").size());
}

TEST_F(Analyze, SeveralTablesGoToAFolder) {
  const std::string tables = folder_ / "tables";
  verb(0, {"analyze", crowd_, "--observable", "settling,energy", "--csv", tables, "-q"});
  EXPECT_TRUE(std::filesystem::exists(tables + "/settling.csv"));
  EXPECT_TRUE(std::filesystem::exists(tables + "/energy.csv"));
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--observable", "settling,energy"}).errors,
              HasSubstr("folder"));
}

TEST_F(Analyze, WhatItCannotDoIsSaid) {
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--observable", "setling"}).errors,
              HasSubstr("did you mean 'settling'?"));
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--window", "3"}).errors, HasSubstr("FROM:TO"));
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--csv", "x"}).errors, HasSubstr("--observable"));
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--observable", "settling", "--csv",
                       (folder_ / "no") + "/such/x.csv"})
                  .errors,
              HasSubstr("No such file"));
  EXPECT_EQ(verb(74, {"analyze", crowd_, "--observable", "trajectories", "--csv", "/dev/full"})
                .output,
            "");
  // Digests alone hold no states.
  const std::string digests = folder_ / "digests.varve";
  verb(0, {"run", folder_ / "disc.cfg", "-o", digests, "-s", "record.tier=digests", "-q"});
  const std::string message = verb(2, {"analyze", digests, "--range", "5:9"}).errors;
  EXPECT_THAT(message, HasSubstr("no state of steps 5 to 9 is stored"));
}

TEST_F(Analyze, TheListNamesEveryColumnsFormulaAndSource) {
  const std::string list = verb(0, {"analyze", crowd_, "--list"}).output;
  for (const char* name : {"settling", "trajectories", "rows", "columns", "gaps", "porosity",
                           "contacts", "wall_hits", "energy", "forces", "flow", "energy_budget",
                           "momentum", "vortices", "profile", "flux", "beneath", "stress",
                           "row_stress", "column_stress", "chains", "shape", "row_shape",
                           "detachment", "wall_distance"})
    EXPECT_THAT(list, HasSubstr(std::string(name) + "\n"));
  const Json summary = json_verb(0, {"analyze", crowd_});
  EXPECT_GT(summary["scalars"].size(), 60u);
  for (const auto& [name, value] : summary["scalars"].items())
    EXPECT_THAT(list, HasSubstr("\n" + name)) << name;
  EXPECT_THAT(list, HasSubstr("settling_speed_m_s"));
}

TEST_F(Analyze, ForcesAreThoseThatMoveTheGrainNext) {
  // Without contact m dv/dt = weight + hydrodynamic + drag, at every step to round-off.
  const auto forces = table(disc_, "forces", "0:20"), moved = table(disc_, "trajectories", "0:21");
  const double mass = 2000 * 0.25 * 3.14159265358979 * 2.5e-3 * 2.5e-3;
  for (std::size_t n = 0; n < 20; ++n) {
    const double force = std::stod(forces.at("weight_y_N")[n]) +
                         std::stod(forces.at("hydrodynamic_y_N")[n]) +
                         std::stod(forces.at("drag_y_N")[n]);
    const double dt = std::stod(moved.at("time_s")[n + 1]) - std::stod(moved.at("time_s")[n]);
    const double change = std::stod(moved.at("vy_m_s")[n + 1]) - std::stod(moved.at("vy_m_s")[n]);
    EXPECT_NEAR(mass * change / dt, force, 1e-9 * std::abs(force)) << n;
    EXPECT_GT(std::stod(forces.at("drag_coefficient")[n]), 1);
  }
}

TEST_F(Analyze, NumbersOfTheRunAreThoseOfItsTables) {
  const Json all = json_verb(0, {"analyze", crowd_, "--fluid", "all"});
  const Json& scalars = all["scalars"];
  EXPECT_THAT(JsonSchema("analyze").breaches(all), testing::IsEmpty()) << all.dump(1);
  EXPECT_EQ(scalars["terminal_speed_m_s"], all["settling"]["terminal_speed_m_s"]);
  EXPECT_EQ(scalars["first_floor_contact_s"], all["contacts"]["first_floor_s"]);
  const auto contacts = table(crowd_, "contacts");
  double collisions = 0;
  for (const std::string& each : contacts.at("begun")) collisions += std::stod(each);
  EXPECT_EQ(scalars["collisions"].get<double>() + scalars["wall_collisions"].get<double>(),
            collisions);
  const double end = all["settling"]["window_s"][1].get<double>(),
               begin = all["settling"]["window_s"][0].get<double>();
  const auto porosity = table(crowd_, "porosity");
  double sum = 0, count = 0;
  for (std::size_t n = 0; n < porosity.at("step").size(); ++n) {
    const double t = std::stod(porosity.at("time_s")[n]);
    if (t < begin || t > end) continue;
    sum += std::stod(porosity.at("compactness")[n]);
    ++count;
  }
  EXPECT_NEAR(scalars["compactness"].get<double>(), sum / count, 1e-12);
  EXPECT_EQ(scalars["compactness_first"].get<double>(),
            std::stod(porosity.at("compactness").front()));
  EXPECT_LE(scalars["momentum_residual_max"].get<double>(), 1e-12);
  // Keyframes and the last state: 0, 32, 64, 96, 120.
  EXPECT_EQ(json_verb(0, {"analyze", crowd_})["scalars"]["states_evaluated"], 5);
  EXPECT_EQ(scalars["states_evaluated"], 121);
}

TEST_F(Analyze, TheBudgetOfADiscClosesFromTheLogAlone) {
  const std::string disc = folder_ / "single.varve";
  verb(0, {"run", std::string(VARVE_SCENARIOS) + "/single_disc.cfg", "-o", disc, "--until",
           "0.25s", "-q"});
  const auto budget = table(disc, "energy_budget");
  const double released = std::stod(budget.at("released_J").back());
  EXPECT_GT(released, 1e-4);
  EXPECT_LE(std::abs(std::stod(budget.at("residual_J").back())), 0.01 * released);
  EXPECT_EQ(std::stod(budget.at("residual_share").back()),
            std::stod(budget.at("residual_J").back()) / released);
  EXPECT_GT(std::stod(budget.at("density_diffusion_J").back()), 0);
  for (const std::string& each : budget.at("momentum_residual")) EXPECT_LE(std::stod(each), 1e-12);
}

TEST_F(Analyze, FluidAtKeyframesAndGrainsAtEveryStep) {
  const std::string tables = folder_ / "tables";
  verb(0, {"analyze", crowd_, "--observable", "settling,vortices,forces", "--fluid", "keyframes",
           "--csv", tables, "-q"});
  const auto steps = [&](const char* name) {
    std::ifstream file(tables + "/" + name);
    std::ostringstream text;
    text << file.rdbuf();
    return columns_of(text.str()).at("step");
  };
  EXPECT_EQ(steps("settling.csv").size(), 121u);
  EXPECT_THAT(steps("vortices.csv"), testing::ElementsAre("0", "32", "64", "96", "120"));
  EXPECT_EQ(steps("forces.csv").size(), 5u * 6);
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--fluid", "often"}).errors,
              HasSubstr("keyframes, all or a number"));
}

TEST_F(Analyze, APictureShowsEveryGrain) {
  const std::string picture = folder_ / "one.svg", folder = folder_ / "pictures";
  verb(0, {"analyze", crowd_, "--svg", picture, "--range", "60", "-q"});
  std::ifstream file(picture);
  std::ostringstream text;
  text << file.rdbuf();
  for (int grain = 0; grain < 6; ++grain)
    EXPECT_THAT(text.str(), HasSubstr("<title>grain " + std::to_string(grain) + ": "));
  EXPECT_THAT(text.str(), HasSubstr("step 60"));
  EXPECT_THAT(text.str(), HasSubstr("</svg>\n"));
  EXPECT_THAT(text.str(), HasSubstr("<path d='M"));
  verb(0, {"analyze", crowd_, "--svg", folder, "--range", "0:120:60", "-q"});
  EXPECT_TRUE(std::filesystem::exists(folder + "/step_000000120.svg"));
  EXPECT_THAT(verb(2, {"analyze", crowd_, "--svg", picture}).errors, HasSubstr("one picture"));
}

TEST_F(Analyze, TheFlowIsTakenAtPointsAndOnAGrid) {
  const std::string last = "last";
  const auto rows = columns_of(verb(0, {"analyze", disc_, "--observable", "flow", "--grid", "0.002",
                                        "--at-point", "0.005,0.006", "--range", last})
                                   .output);
  ASSERT_EQ(rows.at("x_m").size(), 1u + 5 * 6);
  EXPECT_EQ(std::stod(rows.at("y_m")[0]), 0.006);
  for (const std::string& weight : rows.at("weight")) EXPECT_NEAR(std::stod(weight), 0.95, 0.2);
  EXPECT_THAT(verb(2, {"analyze", disc_, "--observable", "flow"}).errors, HasSubstr("--grid"));
  EXPECT_THAT(verb(2, {"analyze", disc_, "--observable", "flow", "--at-point", "1"}).errors,
              HasSubstr("2 coordinates"));
  EXPECT_THAT(verb(2, {"analyze", disc_, "--observable", "flow", "--grid", "-1"}).errors,
              HasSubstr("> 0"));
}

}  // namespace
}  // namespace varve::test
