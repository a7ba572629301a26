#include "core/initial.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "core/kernel.h"
#include "core/simulation.h"
#include "core/walls.h"
#include "tests/core/scenes.h"

namespace varve::core {
namespace {

using scenes::resolved;
using DoubleState = State<2, DoublePrecision>;

DoubleState first(const Scenario& s) { return first_state<2, DoublePrecision>(s); }

TEST(FirstState, FillsTheBoxWithALattice) {
  const Scenario s = resolved(scenes::box());
  const DoubleState state = first(s);
  ASSERT_EQ(state.fluid.size(), 20u * 30);
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    EXPECT_EQ(state.fluid.id[a], a);
    EXPECT_NEAR(state.fluid.position[a][0], (static_cast<double>(a % 20) + 0.5) * 1e-3, 1e-15);
    EXPECT_NEAR(state.fluid.position[a][1], (static_cast<double>(a / 20) + 0.5) * 1e-3, 1e-15);
    EXPECT_EQ(state.fluid.velocity[a], (Vec<double, 2>(0, 0)));
    EXPECT_EQ(state.fluid.superficial_density[a], 1000);
    EXPECT_DOUBLE_EQ(state.fluid.mass[a], 1e-3);
  }
  EXPECT_EQ(state.grains.size(), 0u);
  EXPECT_EQ(state.contacts.size(), 0u);
  EXPECT_EQ(state.clock.step, 0u);
  EXPECT_EQ(state.clock.time, 0);
  EXPECT_EQ(state.clock.dt, s.time.dt);
}

TEST(FirstState, StartsAtTheLeftWall) {
  Scenario s = scenes::box();
  s.domain.left = -0.01;
  const DoubleState state = first(resolved(s));
  EXPECT_NEAR(state.fluid.position.front()[0], -0.0095, 1e-15);
  EXPECT_NEAR(state.fluid.position.back()[0], 0.0095, 1e-15);
}

TEST(FirstState, UnderAFreeSurfaceIsAtRestUnderGravity) {
  const Scenario s = resolved(scenes::tank());
  const DoubleState state = first(s);
  ASSERT_EQ(state.fluid.size(), 20u * 20);
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const double depth = 0.02 - state.fluid.position[a][1];
    const double pressure = 36 * (state.fluid.superficial_density[a] - 1000);
    EXPECT_NEAR(pressure, 1000 * 9.81 * depth, 1e-7);
    EXPECT_NEAR(state.fluid.mass[a] / state.fluid.superficial_density[a], 1e-6, 1e-20);
  }
}

TEST(FirstState, WithFullPressureAndATiltRestsOnTheLowerCorner) {
  Scenario s = scenes::box();
  s.fluid.pressure = PressureForm::full;
  s.fluid.sound_speed = 8;
  s.gravity.tilt = 0.5;
  const DoubleState state = first(resolved(s));
  double least = 1e9;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const Vec<double, 2> x = state.fluid.position[a];
    const double pressure = 64 * (state.fluid.superficial_density[a] - 1000);
    EXPECT_NEAR(pressure, 9810 * (std::cos(0.5) * (0.03 - x[1]) + std::sin(0.5) * x[0]), 1e-7);
    least = std::min(least, pressure);
  }
  EXPECT_GT(least, 0);
}

TEST(FirstState, HasNoHydrostaticPressureInTheExcessForm) {
  Scenario s = scenes::box();
  s.gravity.magnitude = 100;
  for (const double rhob : first(resolved(s)).fluid.superficial_density) EXPECT_EQ(rhob, 1000);
}

TEST(FirstState, JittersFluidWithinItsBoundAndBySeed) {
  Scenario s = scenes::box();
  const DoubleState lattice = first(resolved(s));
  s.fluid.jitter = 0.05;
  const DoubleState one = first(resolved(s)), again = first(resolved(s));
  s.fluid.seed = 2;
  const DoubleState two = first(resolved(s));
  double most = 0;
  for (std::size_t a = 0; a < lattice.fluid.size(); ++a) {
    const Vec<double, 2> shift = one.fluid.position[a] - lattice.fluid.position[a];
    EXPECT_LE(shift.cwiseAbs().maxCoeff(), 0.05e-3 * (1 + 1e-9));
    EXPECT_NE(shift[0], shift[1]);
    most = std::max(most, shift.cwiseAbs().maxCoeff());
    EXPECT_EQ(one.fluid.position[a], again.fluid.position[a]);
    EXPECT_NE(one.fluid.position[a], two.fluid.position[a]);
  }
  EXPECT_GT(most, 0.045e-3);
}

TEST(FirstState, PlacesGrainsRowByRowFromTheBottom) {
  Scenario s = scenes::box_with_grains(3, 4);
  s.grains.lowest_y = 0.01;
  s.grains.velocity_y = -0.1;
  const DoubleState state = first(resolved(s));
  const double pitch = 2.75e-3;
  ASSERT_EQ(state.grains.size(), 12u);
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(state.grains.id[i], i);
    EXPECT_EQ(state.grains.species[i], 0u);
    EXPECT_NEAR(state.grains.position[i][0], 0.01 + (static_cast<double>(i % 4) - 1.5) * pitch,
                1e-15);
    EXPECT_NEAR(state.grains.position[i][1], 0.01 + static_cast<double>(i / 4) * pitch, 1e-15);
    EXPECT_EQ(state.grains.velocity[i], (Vec<double, 2>(0, -0.1)));
    EXPECT_EQ(state.grains.spin[i][0], 0);
  }
}

TEST(FirstState, JittersGrainsBySeedWithoutMovingTheFluid) {
  Scenario s = scenes::box_with_grains(3, 4);
  const DoubleState lattice = first(resolved(s));
  s.grains.jitter = 0.05;
  const DoubleState one = first(resolved(s));
  s.grains.seed = 2;
  const DoubleState two = first(resolved(s));
  for (std::size_t i = 0; i < 12; ++i) {
    const Vec<double, 2> shift = one.grains.position[i] - lattice.grains.position[i];
    EXPECT_GT(shift.norm(), 0);
    EXPECT_LE(shift.cwiseAbs().maxCoeff(), 0.05 * 2.5e-3 * (1 + 1e-9));
    EXPECT_NE(one.grains.position[i], two.grains.position[i]);
  }
  EXPECT_EQ(one.fluid.position, two.fluid.position);
}

TEST(FirstState, HoldsSpinOnlyWithRotation) {
  Scenario s = scenes::box_with_grains(1, 2);
  EXPECT_EQ(first(resolved(s)).grains.spin.size(), 2u);
  s.contact.rotation = false;
  s.contact.friction = 0;
  EXPECT_EQ(first(resolved(s)).grains.spin.size(), 0u);
}

TEST(FirstState, WithoutFluidHoldsNone) {
  Scenario s = scenes::box_with_grains(1, 2);
  s.fluid.present = false;
  s.domain.width = 0.0123;
  const DoubleState state = first(resolved(s));
  EXPECT_EQ(state.fluid.size(), 0u);
  EXPECT_EQ(state.grains.size(), 2u);
}

/// [m2] Volume that the masses leave out of the lattice for grains.
double volume_left_out(const Scenario& s, const DoubleState& state) {
  double sum = 0;
  for (const double m : state.fluid.mass) sum += 1e-6 - m / s.fluid.density;
  return sum;
}

constexpr double disc = 0.25 * pi * 2.5e-3 * 2.5e-3;

TEST(FirstState, LeavesOutTheGrainsVolume) {
  const Scenario s = resolved(scenes::box_with_grains(1, 1));
  EXPECT_NEAR(volume_left_out(s, first(s)), disc, 2e-3 * disc);
}

TEST(FirstState, ConservativePorosityLeavesItOutBesideAWallToo) {
  Scenario s = scenes::box_with_grains(1, 3);
  s.coupling.porosity = Porosity::conservative;
  s.grains.lowest_y = 0.0013;
  s.grains.centre_x = 0.0042;
  s.coupling.porosity_floor = 0.05;
  const Scenario r = resolved(s);
  EXPECT_NEAR(volume_left_out(r, first(r)), 3 * disc, 1e-10 * disc);
}

TEST(FirstState, ConservativePorosityLeavesOutExactlyTheGrains) {
  Scenario s = scenes::box_with_grains(4, 5);
  s.coupling.porosity = Porosity::conservative;
  s.fluid.jitter = 0.1;
  const Scenario r = resolved(s);
  EXPECT_NEAR(volume_left_out(r, first(r)), 20 * disc, 1e-10 * disc);
}

TEST(FirstState, HasNoPressureBesideGrains) {
  const Scenario s = resolved(scenes::box_with_grains(4, 5));
  const DoubleState state = first(s);
  const std::vector<double> eps = floored_porosity(s, state);
  double least = 1;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    EXPECT_NEAR(state.fluid.superficial_density[a] / eps[a], 1000, 1e-9);
    EXPECT_NEAR(state.fluid.mass[a] / state.fluid.superficial_density[a], 1e-6, 1e-20);
    least = std::min(least, eps[a]);
  }
  EXPECT_LT(least, 0.5);
}

TEST(FirstState, IsThatOfTheEngine) {
  const Scenario s = resolved(scenes::box_with_grains(4, 5));
  const auto simulation = Simulation::create(s, {});
  simulation->advance();
  const FluidReport report = simulation->fluid_report();
  // One step from rest cannot raise more than a trace of pressure; a wrong initial porosity of 1 %
  // would show as 0.01 rho0 c0^2.
  for (const double p : report.pressure) EXPECT_LT(std::abs(p), 1e-3 * 1000);
}

TEST(FirstState, FloorsThePorosityOfMass) {
  Scenario s = scenes::box_with_grains(4, 5);
  s.grains.gap = 0;
  s.coupling.porosity_floor = 0.6;
  const DoubleState state = first(resolved(s));
  double least = 1e9;
  for (const double m : state.fluid.mass) least = std::min(least, m);
  EXPECT_DOUBLE_EQ(least, 0.6e-3);
}

TEST(FirstState, GivesGrainsNoRoomUnlessTheCouplingIsTwoWay) {
  Scenario s = scenes::box_with_grains(4, 5);
  for (CouplingMode mode : {CouplingMode::one_way, CouplingMode::off}) {
    s.coupling.mode = mode;
    for (const double rhob : first(resolved(s)).fluid.superficial_density) EXPECT_EQ(rhob, 1000);
  }
}

TEST(FirstState, InFloatIsTheSameSceneRounded) {
  Scenario s = scenes::box_with_grains(2, 3);
  s.fluid.jitter = 0.05;
  const Scenario r = resolved(s);
  const DoubleState exact = first(r);
  const auto single = first_state<2, FloatPrecision>(r);
  const auto mixed = first_state<2, MixedPrecision>(r);
  ASSERT_EQ(single.fluid.size(), exact.fluid.size());
  for (std::size_t a = 0; a < exact.fluid.size(); ++a) {
    EXPECT_EQ(single.fluid.position[a], exact.fluid.position[a].cast<float>());
    EXPECT_EQ(mixed.fluid.position[a], exact.fluid.position[a]);
    EXPECT_NEAR(single.fluid.mass[a] / exact.fluid.mass[a], 1, 1e-5);
    EXPECT_EQ(mixed.fluid.mass[a], static_cast<float>(exact.fluid.mass[a]));
  }
  EXPECT_EQ(single.grains.id, exact.grains.id);
}

TEST(FirstState, RefusesWhatIsNotResolvedOrNoLattice) {
  EXPECT_THROW(first(scenes::box()), std::logic_error);
  Scenario s = resolved(scenes::box());
  s.domain.width = 0.0205;
  EXPECT_THROW(first(s), ModelError);
}

// ---- porosity of packed arrays ----

/// Least, largest and mean porosity over points spread through the middle cell of an array of
/// touching discs, d = 1, hc in diameters. Rows are `row_height` apart, odd ones shifted.
struct Ripple {
  double least = 1, largest = 0, mean = 0;
};
Ripple packed_porosity(double hc, double row_height, double shift) {
  Scenario s;
  s.domain.width = s.domain.height = 24;
  s.fluid.spacing = 0.1;
  s.fluid.sound_speed = 1;
  s.time.until = 1;
  s.grains.rows = s.grains.columns = 1;
  s.grains.diameter = 1;
  s.coupling.length = hc;
  s.coupling.porosity_floor = 1e-3;
  s = resolved(s);
  DoubleState state;
  for (int j = -9; j <= 9; ++j)
    for (int i = -9; i <= 9; ++i) {
      state.grains.id.push_back(state.grains.size());
      state.grains.species.push_back(0);
      state.grains.position.emplace_back(12 + i + (j % 2 ? shift : 0), 12 + j * row_height);
      state.grains.velocity.push_back(Vec<double, 2>::Zero());
    }
  constexpr int n = 40;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      state.fluid.id.push_back(state.fluid.size());
      state.fluid.position.emplace_back(12 + (i + 0.5) / n, 12 + 2 * row_height * (j + 0.5) / n);
      state.fluid.velocity.push_back(Vec<double, 2>::Zero());
    }
  state.fluid.mass.assign(state.fluid.size(), 1);
  state.fluid.superficial_density.assign(state.fluid.size(), 1);
  Ripple ripple;
  for (const double eps : floored_porosity(s, state)) {
    ripple.least = std::min(ripple.least, eps);
    ripple.largest = std::max(ripple.largest, eps);
    ripple.mean += eps / (n * n);
  }
  return ripple;
}

TEST(LatticePorosity, OfASquareArrayIs0p2146) {
  const Ripple narrow = packed_porosity(1, 1, 0), wide = packed_porosity(2, 1, 0);
  EXPECT_NEAR(narrow.least, 0.185, 0.002);
  EXPECT_NEAR(narrow.largest, 0.234, 0.002);
  EXPECT_NEAR(narrow.mean, 1 - pi / 4, 1e-3);
  EXPECT_GT(wide.least, 0.2135);
  EXPECT_LT(wide.largest, 0.2154);
  EXPECT_NEAR(wide.mean, 0.214602, 1e-4);
}

TEST(LatticePorosity, OfAHexagonalArrayIs0p0931) {
  const double row = std::sqrt(3.0) / 2;
  const Ripple narrow = packed_porosity(1, row, 0.5), wide = packed_porosity(2, row, 0.5);
  EXPECT_NEAR(narrow.least, 0.067, 0.002);
  EXPECT_NEAR(narrow.largest, 0.104, 0.002);
  EXPECT_NEAR(narrow.mean, 1 - pi / (2 * std::sqrt(3.0)), 1e-3);
  EXPECT_GT(wide.least, 0.0922);
  EXPECT_LT(wide.largest, 0.0936);
  EXPECT_NEAR(wide.mean, 0.093100, 1e-4);
}

TEST(LatticePorosity, AtALoneGrainsCentreIsTheClosedForm) {
  Scenario s = scenes::box_with_grains(1, 1);
  s.grains.centre_x = 0.0105;
  s.grains.lowest_y = 0.0155;
  for (double hc : {1.0, 1.5, 2.0}) {
    s.coupling.length = hc * 2.5e-3;
    const Scenario r = resolved(s);
    const DoubleState state = first(r);
    const std::vector<double> eps = floored_porosity(r, state);
    EXPECT_NEAR(eps[15 * 20 + 10], 1 - 7.0 / 16 / (hc * hc), 1e-12);
  }
}

}  // namespace
}  // namespace varve::core
