// Derived numbers, and combinations that make no sense.
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/criteria.h"
#include "core/math.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

using ::testing::HasSubstr;

/// The benchmark disc.
Scenario disc() {
  Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.06;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.grains.lowest_y = 0.04;
  return s;
}

Scenario resolved(Scenario s) {
  for (const Problem& problem : resolve(s)) ADD_FAILURE() << problem.key << ": " << problem.text;
  return s;
}

std::string problems_of(Scenario s) {
  std::string text;
  for (const Problem& problem : resolve(s)) text += problem.key + ": " + problem.text + "\n";
  return text;
}

TEST(Resolve, DerivesWhatWasLeftOpen) {
  const Scenario s = resolved(disc());
  EXPECT_EQ(s.fluid.level, 0.06);
  EXPECT_EQ(s.fluid.pressure, PressureForm::excess);
  EXPECT_EQ(s.coupling.length, 2.5e-3);
  EXPECT_EQ(s.coupling.porosity_floor, 0.30);
  EXPECT_EQ(s.contact.tangential_ratio, 1.0 / 3.0);
  EXPECT_EQ(s.grains.centre_x, 0.01);
  const double mass = 1250 * pi * 2.5e-3 * 2.5e-3 / 4;
  EXPECT_NEAR(s.contact.stiffness, mass * (pi / 0.5e-3) * (pi / 0.5e-3), 1e-6);
  EXPECT_NEAR(pi * std::sqrt(mass / s.contact.stiffness), 0.5e-3, 1e-15);
  EXPECT_NEAR(s.fluid.sound_speed, 20 * 0.04905, 0.01);
  EXPECT_DOUBLE_EQ(s.time.dt, 0.25 * 1.25e-3 / s.fluid.sound_speed);
}

TEST(Resolve, TerminalSpeedsAreThoseOfTheBareLaws) {
  // Disc of 2.5 mm, 1250 in 1000 kg/m3, 0.01 Pa s: independently integrated to 4 digits.
  Scenario s = disc();
  s.coupling.drag = Drag::dallavalle_di_felice;
  EXPECT_NEAR(terminal_speed(s), 0.04905, 5e-6);
  s.coupling.drag = Drag::schiller_naumann;
  EXPECT_NEAR(terminal_speed(s), 0.05316, 1.5e-5);
  s.coupling.drag = Drag::cylinder;
  EXPECT_NEAR(terminal_speed(s), 0.06589, 1.5e-5);
  // Stokes: 12 mu U = (rho_s - rho0) g pi d^2 / 4, a sphere's Cd on the frontal area of a disc.
  s.coupling.drag = Drag::stokes;
  EXPECT_NEAR(terminal_speed(s), 250 * pi * 6.25e-6 / 4 * 9.81 / (12 * 0.01), 1e-9);
  s.grains.density = 1000;
  EXPECT_EQ(terminal_speed(s), 0);
  Scenario light = disc();
  light.grains.density = 750;  // rises as fast as its mirror image falls
  EXPECT_EQ(terminal_speed(light), terminal_speed(disc()));
}

TEST(Resolve, IsIdempotentToTheBit) {
  Scenario s = disc();
  s.changes.push_back({"softer", 0.3, -1, {{"contact.damping", "0.25"}}});
  s = resolved(s);
  const std::string once = canonical_text(s);
  EXPECT_EQ(canonical_text(resolved(s)), once);
}

TEST(Resolve, KeepsWhatIsGiven) {
  Scenario s = disc();
  s.fluid.sound_speed = 3.25;
  s.contact.stiffness = 12345.5;
  s.time.dt = 1e-5;
  s.coupling.length = 4e-3;
  s.grains.centre_x = 0.0087;
  s.coupling.porosity_floor = 0.4;
  s = resolved(s);
  EXPECT_EQ(s.fluid.sound_speed, 3.25);
  EXPECT_EQ(s.contact.stiffness, 12345.5);
  EXPECT_EQ(s.time.dt, 1e-5);
  EXPECT_EQ(s.coupling.length, 4e-3);
  EXPECT_EQ(s.grains.centre_x, 0.0087);
  EXPECT_EQ(s.coupling.porosity_floor, 0.4);
}

TEST(Resolve, SoundSpeedFollowsWhatMovesFastest) {
  Scenario s = disc();
  s.fluid.pressure = PressureForm::full;
  EXPECT_NEAR(resolved(s).fluid.sound_speed, 10 * std::sqrt(2 * 9.81 * 0.06), 1e-12);
  s = disc();
  s.domain.top = Boundary::free;
  s.fluid.level = 0.05;
  s.grains.lowest_y = 0.03;
  EXPECT_NEAR(resolved(s).fluid.sound_speed, 10 * std::sqrt(2 * 9.81 * 0.05), 1e-12);
  s = disc();
  s.grains.velocity_y = -0.3;
  EXPECT_NEAR(resolved(s).fluid.sound_speed, 20 * 0.3, 1e-12);
  s = disc();
  s.grains.rows = 0;
  EXPECT_EQ(resolved(s).fluid.sound_speed, 1.0);
  // Plane channel driven by a body force: U = a H^2 / (8 nu) in the middle.
  s.domain.sides = Boundary::periodic;
  s.fluid.body_force_x = 0.001;
  EXPECT_NEAR(resolved(s).fluid.sound_speed, 10 * 0.001 * 0.06 * 0.06 / (8 * 1e-5), 1e-12);
}

TEST(Resolve, PressureFormFollowsTheDomain) {
  Scenario s = disc();
  s.domain.top = Boundary::free;
  EXPECT_EQ(resolved(s).fluid.pressure, PressureForm::full);
  s = disc();
  s.fluid.level = 0.05;
  EXPECT_EQ(resolved(s).fluid.pressure, PressureForm::full);
  s = disc();
  s.domain.bottom = s.domain.top = Boundary::periodic;
  EXPECT_EQ(resolved(s).fluid.pressure, PressureForm::excess);
}

TEST(Resolve, EachCriterionCanSetTheStep) {
  const auto binding = [](Scenario s) {
    s = resolved(s);
    const StepLimit limit = binding_limit(step_limits(s));
    EXPECT_EQ(s.time.dt, limit.chosen);
    return std::string(limit.name);
  };
  EXPECT_EQ(binding(disc()), "cfl");
  Scenario viscous = disc();
  viscous.fluid.viscosity = 2;
  EXPECT_EQ(binding(viscous), "viscosity");
  Scenario falling = disc();
  falling.fluid.pressure = PressureForm::full;
  falling.fluid.sound_speed = 0.01;
  EXPECT_EQ(binding(falling), "acceleration");
  Scenario together = disc();
  together.time.substeps = 1;
  EXPECT_EQ(binding(together), "contact");
  Scenario dry = disc();
  dry.fluid.present = false;
  EXPECT_EQ(binding(dry), "contact");
  dry = resolved(dry);
  EXPECT_DOUBLE_EQ(dry.time.dt, contact_time(dry) / 30);
  EXPECT_EQ(substeps(dry), 1);
}

TEST(Resolve, ShortestContactIsThatOfAPairWhereThereIsOne) {
  Scenario one = resolved(disc());
  EXPECT_NEAR(contact_time(one), 0.5e-3, 1e-15);
  Scenario two = disc();
  two.grains.columns = 2;
  two = resolved(two);
  EXPECT_NEAR(contact_time(two), 0.5e-3 / std::sqrt(2), 1e-15);
  EXPECT_EQ(substeps(two),
            static_cast<std::int64_t>(std::ceil(30 * two.time.dt / contact_time(two))));
  two.time.substeps = 7;
  EXPECT_EQ(substeps(two), 7);
  two.grains.motion = GrainMotion::frozen;
  two.time.substeps = 0;
  EXPECT_EQ(substeps(two), 1);
}

TEST(Resolve, DampingDoesNotReachAnythingDerived) {
  Scenario soft = disc(), hard = disc();
  soft.contact.damping = 0;
  hard.contact.damping = 2;
  soft = resolved(soft);
  hard = resolved(hard);
  hard.contact.damping = 0;
  EXPECT_EQ(canonical_text(soft), canonical_text(hard));
  EXPECT_EQ(substeps(soft), substeps(hard));
}

TEST(ResolveProblems, NothingGiven) {
  const std::string text = problems_of({});
  EXPECT_THAT(text, HasSubstr("domain.width: missing; expected a length > 0"));
  EXPECT_THAT(text, HasSubstr("domain.height: missing"));
}

TEST(ResolveProblems, NamedWithNumberAndSafeValue) {
  Scenario s = disc();
  s.coupling.length = 1.6e-3;
  EXPECT_THAT(problems_of(s), HasSubstr("coupling.length: 0.0016 m is 0.64 d"));
  EXPECT_THAT(problems_of(s), HasSubstr("smallest safe value 0.00165"));
  s.coupling.length = 1.66e-3;
  EXPECT_EQ(problems_of(s), "");

  s = disc();
  s.time.dt = 1e-3;
  EXPECT_THAT(problems_of(s), HasSubstr("time.dt: 0.001 s is above the cfl limit cfl h / c0; "
                                        "largest safe value 0.00031854"));
  s = disc();
  s.grains.lowest_y = 0.001;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.lowest_y: 0.001 m puts grains outside the domain; "
                                        "expected 0.00125..0.05875 m"));
  s = disc();
  s.grains.centre_x = -0.1;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.centre_x: -0.1 m puts grains outside"));
  s = disc();
  s.grains.columns = 20;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.columns: the array is 0.05 m wide, the domain "
                                        "0.02 m; largest number that fits 8"));
  s = disc();
  s.grains.rows = 30;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.rows: the array is 0.075 m high"));
  s = disc();
  s.grains.columns = 2;
  s.grains.gap = 0.1;
  s.grains.jitter = 0.06;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.jitter: 0.06 can make neighbours overlap; "
                                        "largest safe value 0.05"));
  s = disc();
  s.fluid.level = 0.07;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.level: 0.07 m is above the domain; largest value "
                                        "0.06 m"));
  s = disc();
  s.domain.width = 0.0204;
  EXPECT_THAT(problems_of(s), HasSubstr("domain.width: 0.0204 m is not a whole number of spacings "
                                        "of 0.001 m; nearest: 0.02 m or 0.021 m"));
  s = disc();
  s.fluid.spacing = 1e-12;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.spacing: 1e-12 m needs 2e+10 particles"));
  s = disc();
  s.fluid.spacing = 1e-6;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.spacing: 1e-06 m makes 1.2e+09 fluid particles"));
  s = disc();
  s.fluid.present = false;
  s.grains.rows = 0;
  EXPECT_THAT(problems_of(s), HasSubstr("there is nothing to simulate"));
  s = disc();
  s.contact.stiffness = 1e15;
  EXPECT_THAT(problems_of(s), HasSubstr("contact.stiffness: 1e+15 N/m needs"));
}

TEST(ResolveProblems, BoundariesThatContradict) {
  Scenario s = disc();
  s.domain.top = Boundary::periodic;
  EXPECT_THAT(problems_of(s), HasSubstr("domain.top: periodic on one side only"));
  s = disc();
  s.domain.top = Boundary::free;
  s.fluid.pressure = PressureForm::excess;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.pressure: 'excess' needs a closed"));
  s = disc();
  s.domain.top = s.domain.bottom = Boundary::periodic;
  s.fluid.pressure = PressureForm::full;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.pressure: 'full' with periodic bottom and top"));
  s = disc();
  s.domain.sides = Boundary::periodic;
  s.domain.width = 0.008;
  const double least = periodic_minimum(s);
  EXPECT_THAT(problems_of(s), HasSubstr("domain.width: 0.008 m is too small for periodic sides"));
  s.coupling.length = 2.5e-3;
  EXPECT_GE(periodic_minimum(s), 2 * 2 * 2.5e-3);
  EXPECT_GE(periodic_minimum(s), least * 0.99);
}

TEST(ResolveProblems, ValuesSetByAProgramObeyTheTable) {
  Scenario s = disc();
  s.contact.damping = -1;
  s.domain.height = -0.06;
  const std::string text = problems_of(s);
  EXPECT_THAT(text, HasSubstr("contact.damping: -1 is out of range; expected a ratio 0..2"));
  EXPECT_THAT(text, HasSubstr("domain.height: -0.06 is out of range"));
  s = disc();
  s.grains.gap = INFINITY;
  EXPECT_THAT(problems_of(s), HasSubstr("grains.gap: inf is out of range"));
}

TEST(ResolveSteps, TimesBecomeTheLastStepNotAfterThem) {
  EXPECT_EQ(last_step_at(0.3, 1e-3), 300u);  // 0.3 / 1e-3 is a little below 300
  EXPECT_EQ(last_step_at(0.2999, 1e-3), 299u);
  EXPECT_EQ(last_step_at(0, 1e-3), 0u);
  EXPECT_EQ(last_step_at(-1, 1e-3), 0u);
  EXPECT_EQ(first_step_at(0.3, 1e-3), 300u);
  EXPECT_EQ(first_step_at(0.3001, 1e-3), 301u);
  EXPECT_EQ(first_step_at(0, 1e-3), 0u);
}

TEST(ResolveEvents, AreSortedAndAChangedStepShiftsTheClock) {
  Scenario s = disc();
  s.time.dt = 2e-4;
  s.changes.push_back({"late", 0.4, -1, {{"contact.friction", "0.1"}}});
  s.changes.push_back({"finer", 0.2, -1, {{"time.dt", "0.1 ms"}}});
  s.changes.push_back({"early", core::automatic, 10, {{"contact.damping", "0.5"}}});
  s = resolved(s);
  ASSERT_EQ(s.changes.size(), 3u);
  EXPECT_EQ(s.changes[0].name, "early");
  EXPECT_EQ(s.changes[0].at_step, 10);
  EXPECT_EQ(s.changes[1].name, "finer");
  EXPECT_EQ(s.changes[1].at_step, 1000);
  EXPECT_EQ(s.changes[1].settings[0].second, "1e-04");
  EXPECT_EQ(s.changes[2].name, "late");
  EXPECT_EQ(s.changes[2].at_step, 3000);  // 1000 steps to 0.2 s, then 2000 of half the length
}

TEST(ResolveEvents, AChangedStepCountsInTheLengthOfTheRun) {
  Scenario s = disc();
  s.time.dt = 2e-4;
  s.time.until = 0.5;
  EXPECT_EQ(steps_of_run(resolved(s)), 2500u);
  s.changes.push_back({"finer", 0.2, -1, {{"time.dt", "0.1 ms"}}});
  EXPECT_EQ(steps_of_run(resolved(s)), 1000u + 3000u);
  s.changes.push_back({"later", 0.7, -1, {{"time.dt", "0.05 ms"}}});
  EXPECT_EQ(steps_of_run(resolved(s)), 4000u);
  s.time.steps = 7;
  EXPECT_EQ(steps_of_run(resolved(s)), 7u);
}

TEST(ResolveEvents, AreCheckedInTheOrderInWhichTheyHappen) {
  Scenario s = disc();
  // Legal only after the step was shortened.
  s.changes.push_back({"thick", 0.4, -1, {{"fluid.viscosity", "1"}}});
  s.changes.push_back({"finer", 0.2, -1, {{"time.dt", "0.01 ms"}}});
  EXPECT_EQ(problems_of(s), "");
  s.changes[1].at = 0.5;
  EXPECT_THAT(problems_of(s), HasSubstr("event.thick.fluid.viscosity: 1 Pa s puts the viscosity "
                                        "limit"));
}

TEST(ResolveEvents, ThatMakeNoSense) {
  const auto with = [](ScheduledChange change) {
    Scenario s = disc();
    s.changes.push_back(std::move(change));
    return problems_of(s);
  };
  EXPECT_THAT(with({"a", core::automatic, -1, {{"contact.damping", "1"}}}),
              HasSubstr("event.a.at: missing"));
  EXPECT_THAT(with({"a", -1, -1, {{"contact.damping", "1"}}}), HasSubstr("lies before the start"));
  EXPECT_THAT(with({"a", 0.1, -1, {}}), HasSubstr("the event changes nothing"));
  EXPECT_THAT(with({"a b", 0.1, -1, {{"contact.damping", "1"}}}), HasSubstr("may hold letters"));
  EXPECT_THAT(with({"a", 0.1, -1, {{"grains.rows", "2"}}}),
              HasSubstr("event.a.grains.rows: cannot change in a fork or an event: number, size"));
}

// ---- shapes of the domain ----

/// The disc's box as one of spheres.
Scenario sphere() {
  Scenario s = disc();
  s.domain.dimension = 3;
  s.domain.depth = 0.01;
  return s;
}

TEST(Resolve, ASolidDomainNeedsItsDepth) {
  const Scenario s = resolved(sphere());
  EXPECT_EQ(s.grains.centre_z, 0.005);
  EXPECT_EQ(s.coupling.porosity_floor, 0.25);
  EXPECT_EQ(s.contact.tangential_ratio, 2.0 / 7.0);
  EXPECT_EQ(fluid_lattice(s).particles, 20 * 60 * 10);
  Scenario without = sphere();
  without.domain.depth = automatic;
  EXPECT_THAT(problems_of(without), HasSubstr("domain.depth: missing"));
  Scenario uneven = sphere();
  uneven.domain.depth = 0.0104;
  EXPECT_THAT(problems_of(uneven), HasSubstr("domain.depth: 0.0104 m is not a whole number"));
}

TEST(Resolve, WhatOnlySpaceHasIsRefusedInThePlane) {
  Scenario s = disc();
  s.domain.shape = Shape::pipe;
  s.domain.depth = 0.01;
  s.domain.faces = Boundary::periodic;
  s.fluid.body_force_z = 1;
  s.grains.layers = 2;
  s.grains.centre_z = 0;
  s.grains.velocity_z = 1;
  const std::string text = problems_of(s);
  for (const char* key : {"domain.shape", "domain.depth", "domain.faces", "fluid.body_force_z",
                          "grains.layers", "grains.centre_z", "grains.velocity_z"})
    EXPECT_THAT(text, HasSubstr(std::string(key) + ": has no meaning in 2D"));
}

TEST(Resolve, AGrainsOwnDisturbanceIsCorrectedInSpaceAndTwoWayOnly) {
  Scenario s = disc();
  s.coupling.self_disturbance = true;
  EXPECT_THAT(problems_of(s), HasSubstr("coupling.self_disturbance: 'on' needs domain.dimension"));
  s.domain.dimension = 3;
  s.domain.depth = 0.02;
  EXPECT_EQ(problems_of(s), "");
  s.coupling.length = 0.75 * s.grains.diameter;  // least 0.805 d: 1 - 1.0737 R / hc = 1 / 3
  EXPECT_THAT(problems_of(s), HasSubstr("0.001875 m is too short for coupling.self_disturbance"));
  EXPECT_THAT(problems_of(s), HasSubstr("smallest safe value 0.00201"));
  s.coupling.length = 0.8055 * s.grains.diameter;
  EXPECT_EQ(problems_of(s), "");
  s.coupling.mode = CouplingMode::one_way;
  EXPECT_THAT(problems_of(s), HasSubstr("'on' in one-way coupling"));
}

TEST(Resolve, ShiftingIsForFluidThatFillsItsPlaceAndGrainsThatTakeNoneOfIt) {
  Scenario s = disc();
  s.fluid.shifting = 1;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.shifting: 1: its gradients leave out"));
  s.coupling.mode = CouplingMode::one_way;
  EXPECT_EQ(problems_of(s), "");
  s.domain.top = Boundary::free;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.shifting: 1: this fluid has a free surface"));
}

TEST(Resolve, APipeIsRoundAndHoldsItsGrains) {
  Scenario s = sphere();
  s.domain.shape = Shape::pipe;
  s.domain.width = 0.012;
  s.grains.centre_x = automatic;
  EXPECT_THAT(problems_of(s), HasSubstr("domain.depth: 0.01 m: a pipe is as deep as it is wide"));
  s.domain.depth = automatic;
  EXPECT_EQ(resolved(s).domain.depth, 0.012);
  EXPECT_EQ(fluid_lattice(resolved(s)).particles, 112 * 60);
  Scenario square = s;  // its corners are outside, though each side would fit
  square.grains.columns = square.grains.layers = 4;
  EXPECT_THAT(problems_of(square), HasSubstr("from the pipe's axis; its radius is 0.006 m"));
  Scenario open = s;
  open.domain.sides = Boundary::periodic;
  EXPECT_THAT(problems_of(open), HasSubstr("domain.sides: the side of a pipe is a wall"));
}

TEST(Resolve, AWallMovesOnlyWhereItHolds) {
  Scenario s = disc();
  s.domain.lid_speed = 0.3;
  EXPECT_GE(resolved(s).fluid.sound_speed, 3.0);
  s.domain.top = Boundary::free_slip;
  EXPECT_THAT(problems_of(s), HasSubstr("domain.lid_speed: 0.3 m/s moves nothing"));
}

TEST(Resolve, FlowsAtTheStartNeedSidesThatFitThem) {
  Scenario s = disc();
  s.grains.rows = 0;
  s.fluid.initial = InitialFlow::taylor_green;
  s.fluid.initial_speed = 0.1;
  EXPECT_THAT(problems_of(s), HasSubstr("domain.sides: fluid.initial = taylor_green"));
  s.domain.sides = s.domain.bottom = s.domain.top = Boundary::periodic;
  // The taller the box the faster its vortices rise: 10 x 0.1 m/s x 6 / 2.
  EXPECT_NEAR(resolved(s).fluid.sound_speed, 3.0, 1e-12);
  s.fluid.initial = InitialFlow::shear;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.initial: 'shear' jumps"));
}

TEST(Resolve, AColumnOfFluidHasAFreeSurface) {
  Scenario s = disc();
  s.grains.rows = 0;
  s.fluid.width = 0.01;
  EXPECT_EQ(resolved(s).fluid.pressure, PressureForm::full);
  EXPECT_EQ(fluid_lattice(resolved(s)).particles, 10 * 60);
  s.fluid.width = 0.02;  // all of it is no column
  EXPECT_TRUE(std::isnan(resolved(s).fluid.width));
  EXPECT_EQ(resolved(s).fluid.pressure, PressureForm::excess);
  s.fluid.width = 0.03;
  EXPECT_THAT(problems_of(s), HasSubstr("fluid.width: 0.03 m is wider than the domain"));
}

}  // namespace
}  // namespace varve::core
