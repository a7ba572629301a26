#include "core/geometry_change.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/criteria.h"
#include "core/initial.h"
#include "core/math.h"
#include "core/walls.h"
#include "tests/core/scenes.h"

namespace varve::core {
namespace {

using scenes::resolved;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using DoubleState = State<2, DoublePrecision>;

constexpr double disc = 0.25 * pi * 2.5e-3 * 2.5e-3;

DoubleState first(const Scenario& s) { return first_state<2, DoublePrecision>(s); }

GeometryReport widen(const Scenario& s, double width, DoubleState& state,
                     ChangeOptions options = {}) {
  return change_width<2, DoublePrecision>(s, width, options, state);
}

Scenario moved(Scenario s, const GeometryReport& report) {
  s.domain.left = report.walls.left;
  s.domain.width = report.walls.width;
  return s;
}

std::string refusal(const Scenario& s, double width, DoubleState& state,
                    ChangeOptions options = {}) {
  try {
    widen(s, width, state, options);
  } catch (const ModelError& error) {
    return error.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

bool same(const DoubleState& a, const DoubleState& b) {
  return a.fluid.id == b.fluid.id && a.fluid.mass == b.fluid.mass &&
         a.fluid.position == b.fluid.position && a.fluid.velocity == b.fluid.velocity &&
         a.fluid.superficial_density == b.fluid.superficial_density && a.grains.id == b.grains.id &&
         a.grains.position == b.grains.position && a.grains.velocity == b.grains.velocity &&
         a.contacts.key == b.contacts.key && a.contacts.spring == b.contacts.spring;
}

void expect_balanced(const GeometryReport& r) {
  EXPECT_NEAR(r.mass_before + r.mass_added - r.mass_removed, r.mass_after, 1e-12 * r.mass_before);
  EXPECT_GE(r.mass_added, 0);
  EXPECT_GE(r.mass_removed, 0);
}

constexpr double half_a_particle = 0.5e-3 * (1 + 1e-9);

/// p / (rho0 c0^2) of each particle.
std::vector<double> pressures(const Scenario& s, const DoubleState& state) {
  const std::vector<double> eps = floored_porosity(s, state);
  std::vector<double> p;
  for (std::size_t a = 0; a < state.fluid.size(); ++a)
    p.push_back(state.fluid.superficial_density[a] / eps[a] / s.fluid.density - 1);
  return p;
}

// ---- where the walls go ----

TEST(MovedSideWalls, BothMoveByHalfTheChange) {
  const Scenario s = resolved(scenes::box());
  EXPECT_DOUBLE_EQ(moved_side_walls(s, 0.03, 0).left, -0.005);
  EXPECT_EQ(moved_side_walls(s, 0.03, 0).width, 0.03);
  EXPECT_DOUBLE_EQ(moved_side_walls(s, 0.016, 0).left, 0.002);
  EXPECT_EQ(moved_side_walls(s, 0.02, 0).left, 0);
}

TEST(MovedSideWalls, AnAnchoredWallStays) {
  const Scenario s = resolved(scenes::box());
  EXPECT_EQ(moved_side_walls(s, 0.021, -1).left, 0);
  EXPECT_DOUBLE_EQ(moved_side_walls(s, 0.021, 1).left, -0.001);
}

TEST(MovedSideWalls, MoveByWholeSpacings) {
  const Scenario s = resolved(scenes::box());
  try {
    moved_side_walls(s, 0.0247, 0);
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("domain.width: 0.0247 m"), HasSubstr("0.00235 m"),
                                    HasSubstr("0.024 m or 0.026 m")));
  }
  EXPECT_THROW(moved_side_walls(s, 0.021, 0), ModelError);
  EXPECT_NO_THROW(moved_side_walls(s, 0.021, -1));
}

TEST(MovedSideWalls, AreFreeWithoutFluid) {
  Scenario s = scenes::box_with_grains(1, 1);
  s.fluid.present = false;
  EXPECT_DOUBLE_EQ(moved_side_walls(resolved(s), 0.0247, 0).left, -0.00235);
}

TEST(MovedSideWalls, DoNotExistInAPeriodicDomain) {
  Scenario s = scenes::box();
  s.domain.sides = Boundary::periodic;
  EXPECT_THROW(moved_side_walls(resolved(s), 0.03, 0), ModelError);
}

TEST(MovedSideWalls, LeaveRoomForAGrain) {
  const Scenario s = resolved(scenes::box_with_grains(1, 1));
  EXPECT_THROW(moved_side_walls(s, 0.002, 0), ModelError);
  EXPECT_THROW(moved_side_walls(s, 0, 0), ModelError);
  EXPECT_THROW(moved_side_walls(s, std::nan(""), 0), ModelError);
}

// ---- wider ----

TEST(Wider, AddsColumnsOutsideTheOldWalls) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  const DoubleState old = state;
  const GeometryReport report = widen(s, 0.026, state);
  EXPECT_EQ(report.fluid_added, 6u * 30);
  EXPECT_NEAR(report.mass_added, 1000 * 0.006 * 0.03, 1e-15);
  EXPECT_EQ(report.mass_adjusted, 0);
  EXPECT_EQ(report.fluid_removed, 0u);
  expect_balanced(report);
  ASSERT_EQ(state.fluid.size(), 780u);
  for (std::size_t a = 0; a < 600; ++a) {
    EXPECT_EQ(state.fluid.position[a], old.fluid.position[a]);
    EXPECT_EQ(state.fluid.mass[a], old.fluid.mass[a]);
    EXPECT_EQ(state.fluid.superficial_density[a], old.fluid.superficial_density[a]);
  }
  // Ids in lattice order: row by row from the bottom, each row from the left.
  const double x[] = {-2.5e-3, -1.5e-3, -0.5e-3, 20.5e-3, 21.5e-3, 22.5e-3};
  for (std::size_t k = 0; k < 180; ++k) {
    const std::size_t a = 600 + k;
    EXPECT_EQ(state.fluid.id[a], a);
    EXPECT_NEAR(state.fluid.position[a][0], x[k % 6], 1e-15);
    EXPECT_NEAR(state.fluid.position[a][1], (static_cast<double>(k / 6) + 0.5) * 1e-3, 1e-15);
    EXPECT_EQ(state.fluid.velocity[a], (Vec<double, 2>(0, 0)));
    EXPECT_EQ(state.fluid.superficial_density[a], 1000);
  }
}

TEST(Wider, WithAnAnchorAddsOnOneSide) {
  const Scenario s = resolved(scenes::box());
  for (int anchor : {-1, 1}) {
    DoubleState state = first(s);
    const GeometryReport report = widen(s, 0.023, state, {OutsideMode::error, anchor});
    EXPECT_EQ(report.fluid_added, 3u * 30);
    EXPECT_DOUBLE_EQ(report.walls.left, anchor < 0 ? 0 : -0.003);
    for (std::size_t a = 600; a < state.fluid.size(); ++a)
      EXPECT_EQ(state.fluid.position[a][0] > 0.01, anchor < 0);
  }
}

TEST(Wider, GivesNewFluidTheMeanExcessPressure) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  for (std::size_t a = 0; a < state.fluid.size(); ++a)
    state.fluid.superficial_density[a] *= 1 + 1e-3 * (1 + std::sin(static_cast<double>(a)));
  double sum = 0, volume = 0;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const double v = state.fluid.mass[a] / state.fluid.superficial_density[a];
    sum += v * (state.fluid.superficial_density[a] - 1000);
    volume += v;
  }
  const GeometryReport report = widen(s, 0.026, state);
  for (std::size_t a = 600; a < state.fluid.size(); ++a)
    EXPECT_NEAR(state.fluid.superficial_density[a] - 1000, sum / volume, 1e-9);
  EXPECT_NEAR(report.mass_added, 1000 * 0.006 * 0.03, 1e-12);
}

TEST(Wider, WithFullPressurePutsTheMeanOnTopOfTheHydrostatic) {
  Scenario s = scenes::box();
  s.fluid.pressure = PressureForm::full;
  s.fluid.sound_speed = 8;
  const Scenario r = resolved(s);
  DoubleState state = first(r);
  widen(r, 0.026, state);
  for (std::size_t a = 600; a < state.fluid.size(); ++a)
    EXPECT_NEAR(64 * (state.fluid.superficial_density[a] - 1000),
                9810 * (0.03 - state.fluid.position[a][1]), 1e-6);
}

TEST(Wider, UnderAFreeSurfaceFillsUpToTheSurfaceBesideTheWall) {
  const Scenario s = resolved(scenes::tank());
  DoubleState state = first(s);
  const GeometryReport report = widen(s, 0.024, state);
  EXPECT_EQ(report.fluid_added, 4u * 20);
  for (std::size_t a = 400; a < state.fluid.size(); ++a)
    EXPECT_NEAR(36 * (state.fluid.superficial_density[a] - 1000),
                9810 * (0.02 - state.fluid.position[a][1]), 1e-6);
}

TEST(Wider, UnderASlopedSurfaceFillsEachSideToItsOwnHeight) {
  const Scenario s = resolved(scenes::tank());
  DoubleState state = first(s);
  // Drop the upper 8 rows of the right half.
  DoubleState sloped;
  sloped.clock = state.clock;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    if (state.fluid.position[a][0] > 0.01 && state.fluid.position[a][1] > 0.012) continue;
    sloped.fluid.id.push_back(state.fluid.id[a]);
    sloped.fluid.mass.push_back(state.fluid.mass[a]);
    sloped.fluid.position.push_back(state.fluid.position[a]);
    sloped.fluid.velocity.push_back(state.fluid.velocity[a]);
    sloped.fluid.superficial_density.push_back(state.fluid.superficial_density[a]);
  }
  const std::size_t before = sloped.fluid.size();
  const std::uint64_t highest = sloped.fluid.id.back();
  const GeometryReport report = widen(s, 0.022, sloped);
  EXPECT_EQ(report.fluid_added, 20u + 12u);
  for (std::size_t a = before; a < sloped.fluid.size(); ++a) {
    EXPECT_EQ(sloped.fluid.id[a], highest + 1 + (a - before));
    EXPECT_LT(sloped.fluid.position[a][1], sloped.fluid.position[a][0] < 0.01 ? 0.02 : 0.012);
  }
}

constexpr Porosity both_porosities[] = {Porosity::kernel, Porosity::conservative};

/// Two rows of grains against the left wall.
Scenario beside_the_wall(Porosity porosity = Porosity::kernel) {
  Scenario s = scenes::box_with_grains(2, 2);
  s.coupling.porosity = porosity;
  s.grains.centre_x = 0.0013 + 0.5 * 2.75e-3;
  s.grains.lowest_y = 0.01;
  return resolved(s);
}

TEST(Wider, LeavesNoPressureWhereAGrainsWallIsTakenAway) {
  for (Porosity porosity : both_porosities) {
    const Scenario s = beside_the_wall(porosity);
    DoubleState state = first(s);
    const GeometryReport report = widen(s, 0.026, state);
    for (const double p : pressures(moved(s, report), state)) EXPECT_NEAR(p, 0, 1e-12);
    expect_balanced(report);
    if (porosity == Porosity::kernel) continue;
    // Grains and fluid fill the box, before and after; fluid that stayed got part of the grains'
    // volume back, which new fluid now bears.
    EXPECT_NEAR(report.mass_before, 1000 * (0.020 * 0.03 - 4 * disc), 1e-12);
    EXPECT_NEAR(report.mass_after, 1000 * (0.026 * 0.03 - 4 * disc), 1e-12);
    EXPECT_GT(report.mass_adjusted, 0.1 * 1000 * disc);
  }
}

TEST(Wider, PutsNoNewFluidInsideAGrain) {
  const Scenario s = beside_the_wall();
  DoubleState state = first(s);
  const std::size_t before = state.fluid.size();
  widen(s, 0.026, state);
  ASSERT_GT(state.fluid.size(), before);
  for (std::size_t a = before; a < state.fluid.size(); ++a)
    for (const auto& grain : state.grains.position)
      EXPECT_GT((state.fluid.position[a] - grain).norm(), 1.25e-3);
}

TEST(Wider, DropsContactsWithTheMovedWallsOnly) {
  const Scenario s = beside_the_wall();
  DoubleState state = first(s);
  state.contacts.key = {{0, 0, 1}, {0, 1, wall_left}, {0, 1, wall_bottom}, {1, 1, wall_right}};
  state.contacts.spring.assign(4, Vec<double, 2>(1e-6, 0));
  DoubleState anchored = state;
  EXPECT_EQ(widen(s, 0.026, state).contacts_removed, 2u);
  EXPECT_THAT(state.contacts.key, ElementsAre(ContactKey{0, 0, 1}, ContactKey{0, 1, wall_bottom}));
  EXPECT_EQ(state.contacts.spring.size(), 2u);
  EXPECT_EQ(widen(s, 0.026, anchored, {OutsideMode::error, -1}).contacts_removed, 1u);
  EXPECT_EQ(anchored.contacts.size(), 3u);
}

TEST(Wider, WithoutFluidMovesOnlyTheWalls) {
  Scenario s = scenes::box_with_grains(2, 2);
  s.fluid.present = false;
  const Scenario r = resolved(s);
  DoubleState state = first(r);
  const DoubleState old = state;
  const GeometryReport report = widen(r, 0.0247, state);
  EXPECT_TRUE(same(state, old));
  EXPECT_EQ(report.fluid_added, 0u);
}

TEST(SameWidth, ChangesNothing) {
  const Scenario s = beside_the_wall();
  DoubleState state = first(s);
  state.contacts.key = {{0, 1, wall_left}};
  const DoubleState old = state;
  widen(s, 0.02, state);
  EXPECT_TRUE(same(state, old));
}

// ---- narrower ----

TEST(Narrower, RemovesTheSweptColumns) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  const GeometryReport report = widen(s, 0.014, state);
  EXPECT_EQ(report.fluid_removed, 6u * 30);
  EXPECT_EQ(report.fluid_pulled, 0u);
  EXPECT_NEAR(report.mass_removed, 1000 * 0.006 * 0.03, 1e-15);
  expect_balanced(report);
  ASSERT_EQ(state.fluid.size(), 14u * 30);
  EXPECT_TRUE(std::is_sorted(state.fluid.id.begin(), state.fluid.id.end()));
  for (const auto& x : state.fluid.position) {
    EXPECT_GT(x[0], 0.003);
    EXPECT_LT(x[0], 0.017);
  }
}

TEST(Narrower, WithAnAnchorSweepsOneSide) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  widen(s, 0.017, state, {OutsideMode::error, 1});
  for (const auto& x : state.fluid.position) EXPECT_GT(x[0], 0.003);
  EXPECT_EQ(state.fluid.size(), 17u * 30);
}

/// The box stirred: particles displaced by up to 0.4 dx, so that columns do not end at the walls.
DoubleState stirred(const Scenario& s) {
  Scenario jittered = s;
  jittered.fluid.jitter = 0.4;
  return first(jittered);
}

TEST(Narrower, RemovesByMassOutermostFirst) {
  const Scenario s = resolved(scenes::box());
  for (const double fraction : {0.97, 1.0, 1.03}) {
    DoubleState state = stirred(s);
    for (double& m : state.fluid.mass) m *= fraction;
    for (double& rhob : state.fluid.superficial_density) rhob *= fraction;
    const DoubleState old = state;
    const GeometryReport report = widen(s, 0.014, state);
    EXPECT_NEAR(report.mass_removed, 1000 * 0.006 * 0.03, half_a_particle);
    expect_balanced(report);
    const auto beyond = [&](std::size_t a) {
      return std::max(0.003 - old.fluid.position[a][0], old.fluid.position[a][0] - 0.017);
    };
    double innermost_removed = 1, outermost_kept = -1;
    for (std::size_t a = 0; a < old.fluid.size(); ++a) {
      const bool kept =
          std::binary_search(state.fluid.id.begin(), state.fluid.id.end(), old.fluid.id[a]);
      if (kept) outermost_kept = std::max(outermost_kept, beyond(a));
      if (!kept) innermost_removed = std::min(innermost_removed, beyond(a));
    }
    EXPECT_GE(innermost_removed, outermost_kept);
    EXPECT_EQ(report.fluid_pulled > 0, fraction > 1);
    EXPECT_EQ(innermost_removed < 0, fraction < 1);
    for (const auto& x : state.fluid.position) {
      EXPECT_GE(x[0], 0.003);
      EXPECT_LE(x[0], 0.017);
    }
  }
}

TEST(Narrower, BreaksTiesById) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  // One particle heavier by 20 particles: fewer of the others go, the lowest ids of a column first.
  state.fluid.mass[0] *= 21;
  widen(s, 0.017, state, {OutsideMode::error, 1});
  // Columns 0 and 1 whole and column 2 up to the balance: 90 - 20 are to go.
  std::vector<std::uint64_t> kept_of_column_two;
  for (const std::uint64_t id : state.fluid.id)
    if (id % 20 == 2) kept_of_column_two.push_back(id);
  ASSERT_EQ(kept_of_column_two.size(), 20u);
  EXPECT_EQ(kept_of_column_two.front(), 10u * 20 + 2);
}

TEST(Narrower, PullsTheRestToHalfASpacingInsideWithoutMeetingOthers) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  state.fluid.mass[0] *= 21;
  const GeometryReport report = widen(s, 0.017, state, {OutsideMode::error, 1});
  EXPECT_EQ(report.fluid_pulled, 20u);
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    if (state.fluid.id[a] % 20 != 2) continue;
    // The uppermost finds no room beside the others and goes further in.
    const bool uppermost = state.fluid.id[a] == 29u * 20 + 2;
    EXPECT_NEAR(state.fluid.position[a][0], uppermost ? 0.004 : 0.0035, 1e-15);
    for (std::size_t b = 0; b < state.fluid.size(); ++b) {
      if (b == a) continue;
      EXPECT_GT((state.fluid.position[a] - state.fluid.position[b]).norm(), 0.49e-3);
    }
  }
}

TEST(Narrower, LeavesNoPressureWhereAWallComesNearAGrain) {
  for (Porosity porosity : both_porosities) {
    Scenario s = scenes::box_with_grains(2, 4);  // from 4.6 to 15.4 mm
    s.coupling.porosity = porosity;
    const Scenario r = resolved(s);
    DoubleState state = first(r);
    const GeometryReport report = widen(r, 0.012, state);
    EXPECT_EQ(report.fluid_removed, 8u * 30);
    EXPECT_EQ(report.fluid_pulled, 0u);
    for (const double p : pressures(moved(r, report), state)) EXPECT_NEAR(p, 0, 1e-12);
    expect_balanced(report);
    if (porosity == Porosity::kernel) continue;
    EXPECT_NEAR(report.mass_removed, 1000 * 0.008 * 0.03, 1e-12);
    EXPECT_NE(report.mass_adjusted, 0);
  }
}

TEST(Narrower, UnderAFreeSurfaceTakesExactlyWhatIsOutside) {
  const Scenario s = resolved(scenes::tank());
  DoubleState state = first(s);
  const GeometryReport report = widen(s, 0.014, state);
  EXPECT_EQ(report.fluid_removed, 6u * 20);
  EXPECT_EQ(report.fluid_pulled, 0u);
  expect_balanced(report);
}

TEST(Narrower, RefusesToLeaveGrainsOutsideAndNamesThem) {
  const Scenario s = resolved(scenes::box_with_grains(2, 4));
  DoubleState state = first(s);
  const DoubleState old = state;
  EXPECT_THAT(refusal(s, 0.01, state),
              AllOf(HasSubstr("domain.width: 0.01 m"), HasSubstr("4 grains"),
                    HasSubstr("id 0, 3, 4, 7"), HasSubstr("push or remove"),
                    HasSubstr("narrowest width that holds all grains is 0.012 m")));
  EXPECT_TRUE(same(state, old));
}

TEST(Narrower, ToleratesAnOverlapOfOnePercent) {
  Scenario s = scenes::box_with_grains(1, 1);
  s.grains.centre_x = 0.003 + 1.25e-3 - 0.009 * 2.5e-3;
  DoubleState state = first(resolved(s));
  EXPECT_NO_THROW(widen(resolved(s), 0.014, state));
  s.grains.centre_x = 0.003 + 1.25e-3 - 0.011 * 2.5e-3;
  state = first(resolved(s));
  EXPECT_THROW(widen(resolved(s), 0.014, state), ModelError);
}

TEST(Narrower, PushesGrainsAgainstTheNewWall) {
  Scenario s = scenes::box_with_grains(2, 2);
  s.grains.gap = 3;  // centres at 5 and 15 mm
  s.grains.velocity_y = -0.1;
  s.coupling.porosity = Porosity::conservative;
  const Scenario r = resolved(s);
  DoubleState state = first(r);
  const DoubleState old = state;
  const GeometryReport report = widen(r, 0.01, state, {OutsideMode::push, 0});
  EXPECT_THAT(report.grains_pushed, ElementsAre(0, 1, 2, 3));
  EXPECT_TRUE(report.grains_removed.empty());
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(state.grains.position[i][0], i % 2 ? 0.015 - 1.25e-3 : 0.005 + 1.25e-3, 1e-15);
    EXPECT_EQ(state.grains.position[i][1], old.grains.position[i][1]);
    EXPECT_EQ(state.grains.velocity[i], old.grains.velocity[i]);
  }
  // The grains' volume stays in the box: all that was swept is fluid.
  EXPECT_NEAR(report.mass_removed, 1000 * 0.01 * 0.03, half_a_particle);
  for (const double p : pressures(moved(r, report), state)) EXPECT_NEAR(p, 0, 1e-12);
  expect_balanced(report);
}

TEST(Narrower, DoesNotPushGrainsIntoEachOther) {
  const Scenario s = resolved(scenes::box_with_grains(1, 4));
  DoubleState state = first(s);
  const DoubleState old = state;
  EXPECT_THAT(refusal(s, 0.01, state, {OutsideMode::push, 0}),
              AllOf(HasSubstr("grain 0 would overlap grain 1 by"), HasSubstr("at most 1 %")));
  EXPECT_TRUE(same(state, old));
}

TEST(Narrower, RemovesGrainsWithTheirContacts) {
  Scenario conservative = scenes::box_with_grains(2, 4);
  conservative.coupling.porosity = Porosity::conservative;
  const Scenario s = resolved(conservative);
  DoubleState state = first(s);
  state.contacts.key = {{0, 0, 1}, {1, 0, 2}, {2, 0, 3}, {5, 0, 6}, {5, 1, wall_bottom}};
  state.contacts.spring.assign(5, Vec<double, 2>(1e-6, 0));
  const GeometryReport report = widen(s, 0.01, state, {OutsideMode::remove, 0});
  EXPECT_THAT(report.grains_removed, ElementsAre(0, 3, 4, 7));
  EXPECT_THAT(state.grains.id, ElementsAre(1, 2, 5, 6));
  EXPECT_EQ(state.grains.position.size(), 4u);
  EXPECT_EQ(state.grains.velocity.size(), 4u);
  EXPECT_EQ(state.grains.species.size(), 4u);
  EXPECT_EQ(state.grains.spin.size(), 4u);
  EXPECT_EQ(report.contacts_removed, 2u);
  EXPECT_THAT(state.contacts.key,
              ElementsAre(ContactKey{1, 0, 2}, ContactKey{5, 0, 6}, ContactKey{5, 1, wall_bottom}));
  // The fluid takes the room of the removed grains.
  EXPECT_NEAR(report.mass_removed, 1000 * (0.01 * 0.03 - 4 * disc), half_a_particle);
  for (const double p : pressures(moved(s, report), state)) EXPECT_NEAR(p, 0, 1e-12);
  expect_balanced(report);
}

TEST(Narrower, MayRemoveEveryGrain) {
  Scenario s = scenes::box_with_grains(3, 1);
  s.grains.centre_x = 0.002;
  const Scenario r = resolved(s);
  DoubleState state = first(r);
  widen(r, 0.01, state, {OutsideMode::remove, 0});
  EXPECT_EQ(state.grains.size(), 0u);
  for (const double rhob : state.fluid.superficial_density) EXPECT_NEAR(rhob, 1000, 1e-9);
}

// ---- in general ----

TEST(ChangeOfWidth, ThereAndBackRestoresTheLatticeAndItsMass) {
  const Scenario s = resolved(scenes::box());
  DoubleState state = first(s);
  const DoubleState old = state;
  const GeometryReport wider = widen(s, 0.026, state);
  const GeometryReport back = widen(moved(s, wider), 0.02, state);
  EXPECT_NEAR(back.mass_after, wider.mass_before, 1e-12 * back.mass_after);
  EXPECT_TRUE(same(state, old));
  EXPECT_NEAR(back.walls.left, 0, 1e-17);
}

TEST(ChangeOfWidth, IsDeterministic) {
  const Scenario s = beside_the_wall();
  for (double width : {0.026, 0.018}) {
    DoubleState one = stirred(s), two = stirred(s);
    widen(s, width, one, {OutsideMode::push, -1});
    widen(s, width, two, {OutsideMode::push, -1});
    EXPECT_TRUE(same(one, two));
  }
}

TEST(ChangeOfWidth, BalancesInFloatToo) {
  const Scenario s = beside_the_wall();
  auto state = first_state<2, FloatPrecision>(s);
  const GeometryReport wider = change_width<2, FloatPrecision>(s, 0.026, {}, state);
  expect_balanced(wider);
  EXPECT_EQ(wider.fluid_added, 180u);
  auto mixed = first_state<2, MixedPrecision>(s);
  const GeometryReport narrower =
      change_width<2, MixedPrecision>(s, 0.018, {OutsideMode::push, -1}, mixed);
  expect_balanced(narrower);
}

// ---- with the engine running on ----

double mean_pressure(const Simulation& simulation) {
  const FluidReport report = simulation.fluid_report();
  double sum = 0;
  for (const double p : report.pressure) sum += p;
  const double c0 = simulation.scenario().fluid.sound_speed;
  return sum / static_cast<double>(report.pressure.size()) / (1000 * c0 * c0);
}

/// Mean excess pressure / (rho0 c0^2) around a change of width `lead` seconds into a run.
struct Aftermath {
  double before = 0, next_step = 0;
  double later = 0;  ///< ten acoustic times later, averaged over the last of them
};
/// Without a width: the same without the change.
Aftermath run_through(const Scenario& s, double lead, const char* width, ChangeOptions options) {
  const auto simulation = Simulation::create(s, {});
  do simulation->advance();
  while (simulation->clock().time < lead);
  Aftermath result;
  result.before = mean_pressure(*simulation);
  if (width) simulation->change({{"domain.width", width}}, options);
  simulation->advance();
  result.next_step = mean_pressure(*simulation);
  const double acoustic = s.domain.height / s.fluid.sound_speed;
  const double until = simulation->clock().time + 10 * acoustic;
  int averaged = 0;
  while (simulation->clock().time < until) {
    simulation->advance();
    if (simulation->clock().time < until - acoustic) continue;
    result.later += mean_pressure(*simulation);
    ++averaged;
  }
  result.later /= averaged;
  return result;
}

TEST(MeanExcessPressure, IsUnchangedTenAcousticTimesLater) {
  Scenario s = scenes::box_with_grains(1, 1);
  const Scenario falling = resolved(s);
  s = scenes::box_with_grains(1, 3);
  s.grains.lowest_y = 1.25e-3;
  const Scenario resting = resolved(s);
  struct Case {
    const char* name;
    const Scenario& scene;
    const char* width;
    ChangeOptions options;
  };
  const Case cases[] = {
      {"falling, wider", falling, "0.03", {}},
      {"falling, narrower", falling, "0.012", {}},
      {"resting, wider on the right", resting, "0.026", {OutsideMode::error, -1}},
      {"resting, narrower", resting, "0.012", {}},
  };
  for (const Case& each : cases) {
    // A moving grain makes the mean drift by itself; the change must not add to that.
    const Aftermath unchanged = run_through(each.scene, 0.06, nullptr, {});
    const double drift = unchanged.later - unchanged.before;
    const Aftermath changed = run_through(each.scene, 0.06, each.width, each.options);
    EXPECT_LT(std::abs(changed.next_step - changed.before), 2e-4) << each.name;
    EXPECT_LT(std::abs(changed.later - changed.before - drift), 2e-3)
        << each.name << ": " << changed.before << " before, " << changed.later << " after; drift "
        << drift;
  }
}

TEST(MeanExcessPressure, OfADenseArrayIsUnchangedOneStepLater) {
  Scenario s = scenes::box_with_grains(2, 3);
  s.grains.lowest_y = 0.015;
  const Scenario centred = resolved(s);
  s.grains.centre_x = 1.25e-3 + 2.75e-3;
  const Scenario at_the_wall = resolved(s);
  struct Case {
    const Scenario& scene;
    const char* width;
    ChangeOptions options;
  };
  const Case cases[] = {{centred, "0.03", {}},
                        {centred, "0.016", {}},
                        {centred, "0.01", {}},
                        {at_the_wall, "0.026", {}},
                        {at_the_wall, "0.016", {OutsideMode::remove, 0}},
                        {at_the_wall, "0.014", {OutsideMode::error, -1}}};
  for (const auto& [scene, width, options] : cases) {
    const auto simulation = Simulation::create(scene, {});
    while (simulation->clock().time < 0.06) simulation->advance();
    const double before = mean_pressure(*simulation);
    simulation->change({{"domain.width", width}}, options);
    simulation->advance();
    EXPECT_LT(std::abs(mean_pressure(*simulation) - before), 3e-4) << width;
  }
}

}  // namespace
}  // namespace varve::core
