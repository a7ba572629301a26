// The engine where its models end: each test states what is to happen there. Numbers X.. are the
// rows of core/PHYSICS.md, "Extremes"; rows that have a test elsewhere are named there.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/criteria.h"
#include "core/random.h"
#include "core/walls.h"
#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

/// A scene's first problem, as "key: text"; empty if it has none.
std::string problem_of(Scenario scenario) {
  const std::vector<Problem> problems = resolve(scenario);
  return problems.empty() ? "" : problems.front().key + ": " + problems.front().text;
}

bool all_finite(const Simulation& simulation) {
  for (std::size_t k = 0; k < simulation.fields().size(); ++k) {
    if (simulation.fields()[k].type != FieldType::f64) continue;
    for (const double each : numbers<double>(simulation.field(k).bytes))
      if (!std::isfinite(each)) return false;
  }
  return true;
}

double fastest(const Simulation& simulation, const char* name) {
  double most = 0;
  for (const double each : field(simulation, name)) most = std::max(most, std::abs(each));
  return most;
}

void advance_to(Simulation& simulation, double time) {
  while (simulation.clock().time < time) simulation.advance();
}

Scenario closed_box(double width = 0.02, double height = 0.02) {
  Scenario s;
  s.domain.width = width;
  s.domain.height = height;
  s.fluid.sound_speed = 1;
  s.time.until = 1;
  return s;
}

/// One grain in the middle of a closed box.
Scenario one_grain(double density) {
  Scenario s = closed_box();
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = density;
  return s;
}

TEST(Extremes, X1FluidThatNoGrainTouchesMovesAsIfThereWereNone) {
  Scenario with = closed_box();
  with.fluid.initial = InitialFlow::taylor_green;
  with.fluid.initial_speed = 0.05;
  with.domain.sides = with.domain.bottom = with.domain.top = Boundary::free_slip;
  with.grains.rows = with.grains.columns = 1;
  with.coupling.mode = CouplingMode::off;
  Scenario without = with;
  without.grains.rows = 0;
  const auto a = started(with), b = started(without);
  for (int n = 0; n < 50; ++n) {
    a->advance();
    b->advance();
  }
  for (const char* name : {"fluid.position", "fluid.velocity", "fluid.superficial_density"})
    EXPECT_EQ(field(*a, name), field(*b, name)) << name;
  EXPECT_THAT(b->fluid_report().porosity, Each(1.0));
}

TEST(Extremes, X5AStepIsTakenUpToEachLimitAndRefusedBeyondIt) {
  Scenario dry = one_grain(2000), wet = dry, viscous = dry;
  dry.fluid.present = false;
  dry.time.substeps = 1;
  viscous.fluid.viscosity = 50;
  for (const Scenario& raw : {wet, viscous, dry}) {
    const Scenario base = resolved(raw);
    const double limit = binding_limit(step_limits(base), true).largest;
    for (const double part : {0.9, 1.0}) {
      Scenario s = raw;
      s.time.dt = part * limit;
      ASSERT_EQ(problem_of(s), "") << part;
      const auto simulation = started(s);
      for (int n = 0; n < 100; ++n) simulation->advance();
      EXPECT_TRUE(all_finite(*simulation));
    }
    Scenario s = raw;
    s.time.dt = 1.1 * limit;
    EXPECT_THAT(problem_of(s), HasSubstr("time.dt: "));
    EXPECT_THAT(problem_of(s), HasSubstr("largest safe value"));
  }
}

TEST(Extremes, X6DragFarStifferThanTheStepIsStableAndTheGrainFollowsTheFluid) {
  for (const double density : {1.001, 1e3, 1e6}) {
    Scenario s = one_grain(density);
    s.gravity.magnitude = 0;
    s.domain.sides = s.domain.bottom = s.domain.top = Boundary::periodic;
    s.fluid.initial = InitialFlow::uniform;
    s.fluid.initial_speed = 0.05;
    s.fluid.viscosity = 0.1;
    s.coupling.drag = Drag::stokes;
    const auto simulation = started(s);
    double worst = 0;
    for (int n = 0; n < 200; ++n) {
      simulation->advance();
      // Forces die out as the grain comes up to speed: the scale is all the fluid's momentum.
      const StepLedger ledger = simulation->ledger();
      const double dt = simulation->clock().dt;
      worst = std::max(worst, momentum_residual(ledger, dt) * dt * ledger.force_scale);
    }
    EXPECT_LE(worst, 1e-13 * 0.4 * 0.05) << density;
    const double v = field(*simulation, "grains.velocity")[0];
    EXPECT_GE(v, 0) << density;
    EXPECT_LE(v, 0.051) << density;
    if (density < 2) {
      EXPECT_NEAR(v, 0.05, 5e-3);
    }
  }
}

TEST(Extremes, X8GrainsAtClosePackingAreClampedAndCountedAndHeatNothing) {
  Scenario s = closed_box();
  s.grains.rows = s.grains.columns = 5;
  s.grains.gap = 0;
  s.grains.motion = GrainMotion::frozen;
  const auto simulation = started(s);
  for (int n = 0; n < 300; ++n) simulation->advance();
  EXPECT_GT(simulation->counters().porosity_clamps, 0u);
  const std::vector<double> eps = simulation->fluid_report().porosity;
  EXPECT_LT(*std::min_element(eps.begin(), eps.end()), 0.3);
  EXPECT_LT(fastest(*simulation, "fluid.velocity"), 1e-9);
}

TEST(Extremes, X11NoSpacingBetweenAFifthAndTwoDiametersFails) {
  for (const double spacing : {0.5e-3, 1e-3, 2e-3, 4e-3, 5e-3}) {
    Scenario s = closed_box(0.04, 0.04);
    s.fluid.spacing = spacing;
    s.grains.rows = s.grains.columns = 1;
    s.coupling.length = std::max(2.5e-3, 2 * spacing);
    const auto simulation = started(s);
    advance_to(*simulation, 0.1);
    EXPECT_TRUE(all_finite(*simulation)) << spacing;
    EXPECT_LT(field(*simulation, "grains.velocity")[1], -0.02) << spacing;
  }
}

TEST(Extremes, X12AGrainAtRestInFluidAtRestStaysThere) {
  for (const Drag drag : {Drag::stokes, Drag::schiller_naumann, Drag::dallavalle_di_felice,
                          Drag::gidaspow, Drag::cylinder}) {
    Scenario s = one_grain(2500);
    s.gravity.magnitude = 0;
    s.coupling.drag = drag;
    const auto simulation = started(s);
    const std::vector<double> x = field(*simulation, "grains.position");
    for (int n = 0; n < 50; ++n) simulation->advance();
    EXPECT_EQ(field(*simulation, "grains.position"), x);
    EXPECT_LT(fastest(*simulation, "grains.velocity"), 1e-25);
  }
}

TEST(Extremes, X14ANeutralGrainRestsAndSmallDifferencesOfDensityAreSymmetric) {
  const auto drift = [](double density) {
    const auto simulation = started(one_grain(density));
    advance_to(*simulation, 0.05);
    return field(*simulation, "grains.velocity")[1];
  };
  EXPECT_LT(std::abs(drift(1000)), 1e-25);
  const double up = drift(999), down = drift(1001);
  EXPECT_GT(up, 0);
  EXPECT_LT(down, 0);
  EXPECT_NEAR(up / -down, 1, 0.02);
  EXPECT_GT(drift(500), 0.01);
}

TEST(Extremes, X15InAThinGasAGrainFallsFreely) {
  Scenario s = one_grain(2500);
  s.fluid.density = 1.2;
  s.fluid.viscosity = 1.8e-5;
  s.fluid.sound_speed = 10;
  s.time.until = 0.02;
  const auto simulation = started(s);
  advance_to(*simulation, 0.02);
  const double t = simulation->clock().time, v = field(*simulation, "grains.velocity")[1];
  EXPECT_NEAR(v / (-9.81 * t), 1, 2e-3);
  EXPECT_TRUE(all_finite(*simulation));
}

TEST(Extremes, X16ALoadOfSixtyPercentSolidsIsCountedInFullAndKeepsQuiet) {
  Scenario s = closed_box();
  s.domain.sides = s.domain.bottom = s.domain.top = Boundary::periodic;
  s.grains.rows = s.grains.columns = 7;  // 7 x 7 discs of 2.5 mm in 2 x 2 cm: 60 %
  s.grains.gap = 0.02 / 7 / 2.5e-3 - 1;
  s.grains.density = 2650;
  const auto simulation = started(s);
  for (int n = 0; n < 300; ++n) simulation->advance();
  double solid = 0;
  const std::vector<double> eps = simulation->fluid_report().porosity,
                            m = field(*simulation, "fluid.mass"),
                            rhob = field(*simulation, "fluid.superficial_density");
  for (std::size_t a = 0; a < eps.size(); ++a) solid += m[a] / rhob[a] * (1 - eps[a]);
  const double grains = 49 * 0.25 * 3.14159265358979 * 2.5e-3 * 2.5e-3;
  EXPECT_NEAR(solid / grains, 1, 0.01);
  // No checkerboard: the pressure's noise stays far below rho0 c0^2.
  const std::vector<double> p = simulation->fluid_report().pressure;
  const auto [least, most] = std::minmax_element(p.begin(), p.end());
  EXPECT_LT(*most - *least, 0.05 * 1000);
}

TEST(Extremes, X19FluidOnADummyOfTheWallIsPushedBack) {
  Scenario s = closed_box();
  const auto simulation = started(s);
  std::vector<double> x = field(*simulation, "fluid.position");
  const std::size_t lost = 20 * 10;
  x[2 * lost] = -0.5e-3;  // where the first dummy is
  set_field(*simulation, "fluid.position", x);
  for (int n = 0; n < 200; ++n) simulation->advance();
  EXPECT_TRUE(all_finite(*simulation));
  EXPECT_GT(field(*simulation, "fluid.position")[2 * lost], 0);
}

TEST(Extremes, X20ADomainAsNarrowAsAKernelHoldsItsPressureAndAPeriodicOneIsRefused) {
  Scenario s = closed_box(3e-3, 0.03);
  s.fluid.smoothing_ratio = 1.5;  // support 3 mm
  s.fluid.pressure = PressureForm::full;
  s.fluid.sound_speed = 8;
  const auto simulation = started(s);
  advance_to(*simulation, 0.1);
  const std::vector<double> x = field(*simulation, "fluid.position"),
                            p = simulation->fluid_report().pressure;
  for (std::size_t a = 0; a < p.size(); ++a) {
    const double depth = 0.03 - x[2 * a + 1];
    if (depth < 3e-3 || depth > 0.027) continue;
    EXPECT_NEAR(p[a] / (9810 * 0.03), depth / 0.03, 0.02);
  }
  s.domain.sides = Boundary::periodic;
  EXPECT_THAT(problem_of(s), HasSubstr("domain.width: "));
  EXPECT_THAT(problem_of(s), HasSubstr("smallest safe value"));
}

TEST(Extremes, X21InAPipeNarrowerThanTheCouplingNothingOfTheBalanceIsLost) {
  for (const Porosity form : {Porosity::kernel, Porosity::conservative}) {
    Scenario s = closed_box(4e-3, 0.02);
    s.grains.rows = s.grains.columns = 1;
    s.grains.density = 2000;
    s.coupling.porosity = form;
    const auto simulation = started(s);
    double worst = 0;
    for (int n = 0; n < 300; ++n) {
      simulation->advance();
      const StepLedger ledger = simulation->ledger();
      worst = std::max({worst, momentum_residual(ledger, simulation->clock().dt),
                        reaction_residual(ledger)});
    }
    EXPECT_LE(worst, 1e-12);
    EXPECT_LT(field(*simulation, "grains.velocity")[1], 0);
    if (form == Porosity::kernel) continue;
    double solid = 0;
    const std::vector<double> eps = simulation->fluid_report().porosity,
                              m = field(*simulation, "fluid.mass"),
                              rhob = field(*simulation, "fluid.superficial_density");
    for (std::size_t a = 0; a < eps.size(); ++a) solid += m[a] / rhob[a] * (1 - eps[a]);
    EXPECT_NEAR(solid / (0.25 * 3.14159265358979 * 2.5e-3 * 2.5e-3), 1, 0.02);
  }
}

TEST(Extremes, X22BehindAFastGrainFluidDoesNotPairUp) {
  Scenario s = single_disc();
  s.grains.density = 2500;
  s.fluid.sound_speed = 4;
  const auto simulation = started(s);
  double least = 1;
  while (simulation->clock().time < 0.2) {
    for (int n = 0; n < 100; ++n) simulation->advance();
    least = std::min(least, closest(*simulation));
  }
  EXPECT_GT(least, 0.25);
}

TEST(Extremes, X23CompressionFallsWithTheSquareOfTheSoundSpeed) {
  double speed_before = 0;
  for (const double sound : {1.0, 2.0, 4.0}) {
    Scenario s = single_disc();
    s.fluid.sound_speed = sound;
    const auto simulation = started(s);
    advance_to(*simulation, 0.15);
    const std::vector<double> p = simulation->fluid_report().pressure;
    double most = 0;
    for (const double each : p) most = std::max(most, std::abs(each) / (1000 * sound * sound));
    // Ten times the square of the Mach number holds the jumps of porosity around the grain too.
    const double mach = 0.05 / sound;
    EXPECT_LT(most, 40 * mach * mach) << sound;
    const double speed = field(*simulation, "grains.velocity")[1];
    if (speed_before != 0) {
      EXPECT_NEAR(speed / speed_before, 1, 0.05) << sound;
    }
    speed_before = speed;
  }
}

TEST(Extremes, X24ArtificialViscosityDoesNotReachAGrainThatOnlyFeelsFluidAtRest) {
  std::vector<double> speeds;
  for (const double alpha : {0.0, 0.1, 1.0}) {
    Scenario s = one_grain(2000);
    s.fluid.artificial_alpha = alpha;
    s.coupling.mode = CouplingMode::one_way;
    const auto simulation = started(s);
    advance_to(*simulation, 0.05);
    speeds.push_back(field(*simulation, "grains.velocity")[1]);
  }
  EXPECT_EQ(speeds[0], speeds[1]);
  EXPECT_EQ(speeds[0], speeds[2]);
}

TEST(Extremes, X25WithoutGravityAndWallsMomentumIsKept) {
  Scenario s = closed_box();
  s.domain.sides = s.domain.bottom = s.domain.top = Boundary::periodic;
  s.gravity.magnitude = 0;
  s.grains.rows = s.grains.columns = 3;
  s.grains.gap = 0.5;
  const auto simulation = started(s);
  std::vector<double> v = field(*simulation, "fluid.velocity");
  for (std::size_t k = 0; k < v.size(); ++k) v[k] = 0.02 * symmetric(7, k, 0);
  set_field(*simulation, "fluid.velocity", v);
  const auto momentum = [&] {
    std::array<double, 2> sum{};
    const std::vector<double> fluid = field(*simulation, "fluid.velocity"),
                              m = field(*simulation, "fluid.mass"),
                              grains = field(*simulation, "grains.velocity");
    const double each = 2500 * 0.25 * 3.14159265358979 * 2.5e-3 * 2.5e-3;
    for (std::size_t k = 0; k < fluid.size(); ++k) sum[k % 2] += m[k / 2] * fluid[k];
    for (std::size_t k = 0; k < grains.size(); ++k) sum[k % 2] += each * grains[k];
    return sum;
  };
  const auto before = momentum();
  for (int n = 0; n < 300; ++n) simulation->advance();
  const auto after = momentum();
  const double scale = 0.4 * 0.02;  // all the fluid at the largest speed
  EXPECT_NEAR(after[0], before[0], 1e-12 * scale);
  EXPECT_NEAR(after[1], before[1], 1e-12 * scale);
}

/// A tank half full under a free surface, one grain above it.
Scenario above_the_surface() {
  Scenario s = closed_box(0.02, 0.03);
  s.domain.top = Boundary::free;
  s.fluid.level = 0.012;
  s.fluid.sound_speed = 8;
  s.grains.rows = s.grains.columns = 1;
  s.grains.lowest_y = 0.022;
  return s;
}

TEST(Extremes, X2AGrainWithoutFluidAroundItFallsFreelyAndEntersWithoutAJump) {
  const auto simulation = started(above_the_surface());
  const double dt = simulation->clock().dt, radius = 1.25e-3, reach = 5e-3;
  double before = 0, largest = 0;
  while (field(*simulation, "grains.position")[1] > 0.012 - radius) {
    simulation->advance();
    const double y = field(*simulation, "grains.position")[1],
                 v = field(*simulation, "grains.velocity")[1];
    if (y > 0.012 + reach + 1e-3) {
      EXPECT_NEAR(v, -9.81 * simulation->clock().time, 1e-12);
    }
    largest = std::max(largest, std::abs((v - before) / dt + 9.81));
    before = v;
  }
  // The fluid takes hold of it over many steps: no step sees more than a few times its weight.
  EXPECT_LT(largest, 5 * 9.81);
  EXPECT_TRUE(all_finite(*simulation));
}

TEST(Extremes, X28AGrainThrownOutThroughAnOpenTopComesBack) {
  Scenario s = above_the_surface();
  s.grains.velocity_y = 0.6;  // to 1.8 cm above where it starts, 1 cm beyond the domain
  const auto simulation = started(s);
  double highest = 0;
  while (simulation->clock().time < 0.14) {
    simulation->advance();
    highest = std::max(highest, field(*simulation, "grains.position")[1]);
  }
  EXPECT_GT(highest, 0.035);
  EXPECT_LT(field(*simulation, "grains.position")[1], 0.03);
  EXPECT_TRUE(all_finite(*simulation));
}

TEST(Extremes, X30AnImpactTooFastForItsStiffnessIsStopped) {
  Scenario s = one_grain(2500);
  s.fluid.viscosity = 1e-3;
  s.fluid.sound_speed = 20;
  s.grains.lowest_y = 2e-3;
  s.grains.velocity_y = -3;
  s.contact.time = 5e-3;  // overlaps of about v t / pi
  const auto simulation = started(s);
  try {
    advance_to(*simulation, 0.01);
    FAIL() << "not stopped";
  } catch (const NumericalFailure& failure) {
    EXPECT_THAT(failure.criterion, HasSubstr("overlap"));
    EXPECT_EQ(failure.id, 0u);
    EXPECT_GT(failure.value, failure.limit);
  }
  // Ten times as stiff in time it holds.
  s.contact.time = 0.2e-3;
  const auto stiff = started(s);
  advance_to(*stiff, 0.003);
  EXPECT_TRUE(all_finite(*stiff));
}

// ---- changes while a run lasts ----

/// The damped column, some steps after its grains have touched.
std::unique_ptr<Simulation> touching() {
  auto simulation = started(small_column());
  for (int n = 0; n < 150; ++n) simulation->advance();
  return simulation;
}

TEST(Extremes, AForkToNoDampingOrCriticalRunsOnAndAboveIsRefused) {
  for (const char* damping : {"0", "2"}) {
    const auto simulation = touching();
    simulation->change(Settings{{"contact.damping", damping}}, {});
    for (int n = 0; n < 600; ++n) simulation->advance();
    EXPECT_TRUE(all_finite(*simulation)) << damping;
    EXPECT_LT(fastest(*simulation, "grains.velocity"), 0.5) << damping;
  }
  try {
    touching()->change(Settings{{"contact.damping", "2.1"}}, {});
    FAIL() << "not refused";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("0..2"));
  }
}

TEST(Extremes, AForkToAStiffnessTenThousandTimesAsHighIsSubSteppedOrRefusedWithTheLargest) {
  const auto simulation = touching();
  const double stiffness = simulation->scenario().contact.stiffness;
  const double dt = simulation->clock().dt;
  simulation->change(Settings{{"contact.stiffness", std::to_string(1e4 * stiffness)}}, {});
  EXPECT_EQ(simulation->clock().dt, dt);
  for (int n = 0; n < 100; ++n) simulation->advance();
  EXPECT_TRUE(all_finite(*simulation));
  EXPECT_GE(simulation->counters().grain_substeps, 100u * 100u);
  // Where the number of sub-steps is fixed, the step can't be.
  Scenario fixed = small_column();
  fixed.time.substeps = 40;
  const auto bound = started(fixed);
  try {
    bound->change(Settings{{"contact.stiffness", std::to_string(1e4 * stiffness)}}, {});
    FAIL() << "not refused";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("largest safe value"));
  }
}

TEST(Extremes, AForkToAWidthOfOneCouplingDiameterRunsOrNamesTheGrainsInTheWay) {
  Scenario s = small_column();
  s.grains.columns = 1;
  s.grains.velocity_x = 0;
  const auto simulation = started(s);
  for (int n = 0; n < 50; ++n) simulation->advance();
  simulation->change(Settings{{"domain.width", "0.01"}}, {});  // 2 Rc
  for (int n = 0; n < 300; ++n) simulation->advance();
  EXPECT_TRUE(all_finite(*simulation));
  simulation->change(Settings{{"domain.width", "0.006"}}, {});
  for (int n = 0; n < 300; ++n) simulation->advance();
  EXPECT_TRUE(all_finite(*simulation));
  const auto wide = touching();
  try {
    wide->change(Settings{{"domain.width", "0.006"}}, {});
    FAIL() << "not refused";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("grain"));
  }
}

}  // namespace
}  // namespace varve::core::test
