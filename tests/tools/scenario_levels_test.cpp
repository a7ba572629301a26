// Levels: scenario.model and scenario.fidelity lie under everything a scenario says itself.
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/parameters.h"
#include "tools/scenario_file.h"
#include "tools/scenario_levels.h"

namespace varve::tools {
namespace {

const std::string disc =
    "[domain]\nwidth = 2 cm\nheight = 6 cm\n[grains]\nrows = 1\ncolumns = 1\n"
    "density = 1250\n[time]\nuntil = 1\n";

core::Scenario read(const std::string& text, const std::vector<std::string>& settings = {}) {
  return read_scenario_text(text, "good.cfg", {settings, true, false}).scenario;
}

TEST(ScenarioLevels, WithNoneOfThemTheDefaultsHold) {
  const core::Scenario scenario = read(disc);
  EXPECT_EQ(scenario.fidelity, core::Fidelity::standard);
  EXPECT_EQ(scenario.fluid.spacing, 1e-3);
  EXPECT_EQ(scenario.time.cfl, 0.25);
  EXPECT_EQ(scenario.precision, core::Precision::double_);
}

TEST(ScenarioLevels, OfFidelityOrderResolutionSoundSpeedAndStep) {
  double spacing = 1, sound = 0, dt = 1;
  for (const char* level : {"draft", "standard", "fine", "reference"}) {
    const core::Scenario scenario = read(disc, {std::string("scenario.fidelity=") + level});
    EXPECT_LT(scenario.fluid.spacing, spacing) << level;
    EXPECT_GT(scenario.fluid.sound_speed, sound) << level;
    EXPECT_LT(scenario.time.dt, dt) << level;
    // A grain is resolved as the level says, and the lattice fills the domain.
    EXPECT_GE(2.5e-3 / scenario.fluid.spacing, scenario.fluid.resolution * (1 - 1e-9)) << level;
    spacing = scenario.fluid.spacing;
    sound = scenario.fluid.sound_speed;
    dt = scenario.time.dt;
  }
  EXPECT_EQ(read(disc, {"scenario.fidelity=draft"}).precision, core::Precision::float_);
}

TEST(ScenarioLevels, LieUnderTheFileAndTheCommandLine) {
  const std::string text = "[scenario]\nfidelity = draft\n" + disc;
  EXPECT_EQ(read(text).time.cfl, 0.5);
  EXPECT_EQ(read("[scenario]\nfidelity = draft\nprecision = double\n" + disc).precision,
            core::Precision::double_);
  EXPECT_EQ(read(text, {"time.cfl=0.1"}).time.cfl, 0.1);
  // The command line's level replaces the file's.
  EXPECT_EQ(read(text, {"scenario.fidelity=reference"}).time.cfl, 0.125);
  EXPECT_EQ(read(text, {"scenario.fidelity=standard"}).time.cfl, 0.25);
}

TEST(ScenarioLevels, OfTheStudyUndoEveryDeviationFromIt) {
  const core::Scenario scenario = read(disc, {"scenario.model=study"});
  EXPECT_EQ(scenario.model, core::Model::study);
  EXPECT_EQ(scenario.fluid.pressure, core::PressureForm::full);
  EXPECT_EQ(scenario.fluid.density_diffusion, 0);
  EXPECT_GT(scenario.fluid.artificial_alpha, 0);
  EXPECT_FALSE(scenario.coupling.exclude_own_volume);
  EXPECT_EQ(scenario.coupling.pressure_force, core::PressureForce::averaged);
  EXPECT_EQ(scenario.time.substeps, 1);
  // One common step, which the contacts then bound.
  EXPECT_LE(scenario.time.dt, 0.5e-3 / 30);
}

TEST(ScenarioLevels, SurviveTheGenesisOfARun) {
  const core::Scenario scenario =
      read(disc, {"scenario.model=study", "scenario.fidelity=fine", "time.cfl=0.2"});
  const std::string text = core::canonical_text(scenario);
  const core::Scenario again = read_scenario_text(text, "genesis", {{}, false, true}).scenario;
  EXPECT_EQ(core::canonical_text(again), text);
  EXPECT_EQ(core::canonical_text(read(text)), text);
}

TEST(ScenarioLevels, EveryKeyOfTheirsExists) {
  for (const std::string_view key : level_keys) {
    const core::Parameter* parameter = core::find_parameter(key);
    ASSERT_NE(parameter, nullptr) << key;
    for (const std::string_view value : parameter->choices) {
      const ScenarioLevel* level = find_level(key, value);
      ASSERT_NE(level, nullptr) << key << " = " << value;
      EXPECT_NO_THROW(read_scenario_text(std::string(level->text) + disc, "level"))
          << key << " = " << value;
    }
  }
}

TEST(ScenarioLevels, AnUnknownOneIsAnErrorAtItsPlace) {
  try {
    read("[scenario]\nfidelity = best\n" + disc);
    FAIL() << "not refused";
  } catch (const ScenarioError& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("good.cfg:2:12: error: scenario.fidelity: 'best'"));
  }
}

TEST(ScenarioLevels, ASpacingThatDividesNothingIsAskedFor) {
  try {
    read("[fluid]\nspacing = auto\n[domain]\nwidth = 2 cm\nheight = 6.12345 cm\n"
         "[grains]\nrows = 1\ncolumns = 1\n[time]\nuntil = 1\n");
    FAIL() << "not refused";
  } catch (const ScenarioError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("fluid.spacing: auto finds none"));
  }
}

}  // namespace
}  // namespace varve::tools
