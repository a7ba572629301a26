// What check says of a scenario.
#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/assessment.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

Scenario resolved(Scenario s) {
  for (const Problem& problem : resolve(s)) ADD_FAILURE() << problem.key << ": " << problem.text;
  return s;
}

Scenario disc() {
  Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.06;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.fluid.sound_speed = 1;
  s.time.until = 1.5;
  return s;
}

bool is_active(const Scenario& s, const std::string& name) {
  for (const ModelUse& model : models_of(s))
    if (model.name == name) {
      EXPECT_FALSE(model.reason.empty()) << name;
      return model.active;
    }
  ADD_FAILURE() << "no model " << name;
  return false;
}

bool warns(const Scenario& s, const std::string& key) {
  const Assessment a = assess(resolved(s));
  return std::any_of(a.warnings.begin(), a.warnings.end(),
                     [&](const Warning& warning) { return warning.key == key; });
}

TEST(Models, OnlyWhatTheSceneNeeds) {
  Scenario s = resolved(disc());
  for (const char* name : {"fluid", "viscosity", "density diffusion", "excess pressure", "walls",
                           "grains", "contacts", "friction and rotation", "coupling",
                           "reaction on the fluid", "drag", "grain sub-steps"})
    EXPECT_TRUE(is_active(s, name)) << name;
  for (const char* name : {"free surface", "periodic sides", "body force", "scheduled changes"})
    EXPECT_FALSE(is_active(s, name)) << name;
  Scenario liquid = disc();
  liquid.grains.rows = 0;
  liquid = resolved(liquid);
  for (const char* name : {"grains", "contacts", "friction and rotation", "coupling", "drag",
                           "reaction on the fluid", "grain sub-steps"})
    EXPECT_FALSE(is_active(liquid, name)) << name;
  Scenario dry = disc();
  dry.fluid.present = false;
  dry = resolved(dry);
  for (const char* name : {"fluid", "viscosity", "density diffusion", "excess pressure",
                           "free surface", "coupling", "drag"})
    EXPECT_FALSE(is_active(dry, name)) << name;
  EXPECT_TRUE(is_active(dry, "contacts"));
  Scenario smooth = disc();
  smooth.contact.rotation = false;
  EXPECT_FALSE(is_active(resolved(smooth), "friction and rotation"));
  Scenario one_way = disc();
  one_way.coupling.mode = CouplingMode::one_way;
  EXPECT_TRUE(is_active(resolved(one_way), "drag"));
  EXPECT_FALSE(is_active(resolved(one_way), "reaction on the fluid"));
}

TEST(Assessment, CountsAndNumbersOfTheDisc) {
  const Assessment a = assess(resolved(disc()));
  EXPECT_EQ(a.fluid_particles, 1200u);
  EXPECT_EQ(a.grains, 1u);
  EXPECT_NEAR(a.fluid_mass, 1000 * (0.02 * 0.06 - 4.908738521e-6), 1e-9);
  EXPECT_NEAR(a.grain_mass, 1250 * 4.908738521e-6, 1e-12);
  EXPECT_EQ(a.steps, 4800u);
  EXPECT_EQ(a.step_set_by, "cfl");
  EXPECT_EQ(a.substeps, 19);  // 30 x 0.3125 ms / 0.5 ms = 18.75
  EXPECT_NEAR(a.reynolds, 1000 * 0.04905 * 2.5e-3 / 0.01, 0.01);
  EXPECT_NEAR(a.stokes, 1.25 * a.reynolds / 9, 1e-9);
  EXPECT_NEAR(a.restitution, 0.744, 5e-4);  // of a dashpot that never pulls
  EXPECT_GT(a.log_bytes_low, 0);
  EXPECT_GT(a.log_bytes_high, a.log_bytes_low);
}

TEST(Assessment, AStepThatWasGivenIsSaidToBe) {
  Scenario s = disc();
  s.time.dt = 1e-4;
  EXPECT_EQ(assess(resolved(s)).step_set_by, "time.dt");
}

TEST(Assessment, ALogOfDigestsIsSmaller) {
  Scenario s = disc();
  const double deltas = assess(resolved(s)).log_bytes_low;
  s.record.tier = RecordTier::digests;
  EXPECT_LT(assess(resolved(s)).log_bytes_high, deltas);
}

TEST(Assessment, WarnsBeforeARun) {
  Scenario s = disc();
  s.coupling.length = 7.5e-3;
  s.domain.width = 0.06;
  EXPECT_TRUE(assess(resolved(s)).warnings.empty());
  const Scenario sound = s;

  s.fluid.sound_speed = 0.2;
  EXPECT_TRUE(warns(s, "fluid.sound_speed"));
  s = sound;
  s.coupling.length = 2e-3;
  EXPECT_TRUE(warns(s, "coupling.length"));
  s = sound;
  s.fluid.pressure = PressureForm::full;
  s.fluid.sound_speed = automatic;
  EXPECT_TRUE(warns(s, "fluid.pressure"));
  s = sound;
  s.coupling.drag = Drag::stokes;
  s.fluid.sound_speed = automatic;
  EXPECT_TRUE(warns(s, "coupling.drag"));
  s = sound;
  s.contact.stiffness = 100;
  EXPECT_TRUE(warns(s, "contact.stiffness"));
  s = sound;
  s.fluid.kernel = Kernel::cubic;
  EXPECT_TRUE(warns(s, "fluid.kernel"));
  s = sound;
  s.fluid.density_diffusion = 0;
  EXPECT_TRUE(warns(s, "fluid.density_diffusion"));
  s = sound;
  s.fluid.spacing = 0.01;
  EXPECT_TRUE(warns(s, "fluid.spacing"));
  s = sound;
  s.time.cfl = 0.6;
  EXPECT_TRUE(warns(s, "time.cfl"));
}

}  // namespace
}  // namespace varve::core
