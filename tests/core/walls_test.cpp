#include "core/walls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/simulation.h"
#include "tests/core/scenes.h"

namespace varve::core {
namespace {

using scenes::resolved;
using testing::HasSubstr;

TEST(Walls, AreNumberedLeftRightBottomTop) {
  Scenario s = resolved(scenes::box());
  s.domain.left = -0.005;
  const std::vector<Wall> walls = domain_walls(s);
  ASSERT_EQ(walls.size(), 4u);
  const double at[] = {-0.005, 0.015, 0, 0.03};
  const double inward[] = {1, -1, 1, -1};
  for (std::uint32_t n = 0; n < 4; ++n) {
    EXPECT_EQ(walls[n].number, n);
    EXPECT_EQ(walls[n].axis, n < 2 ? 0 : 1);
    EXPECT_DOUBLE_EQ(walls[n].at, at[n]);
    EXPECT_EQ(walls[n].inward, inward[n]);
  }
  const Vec<double, 2> x(0.0, 0.01);
  EXPECT_DOUBLE_EQ(distance_inside(walls[0], x), 0.005);
  EXPECT_DOUBLE_EQ(distance_inside(walls[1], x), 0.015);
  EXPECT_DOUBLE_EQ(distance_inside(walls[2], x), 0.01);
  EXPECT_DOUBLE_EQ(distance_inside(walls[3], x), 0.02);
}

TEST(Walls, AreAllClearOfTheBoxBetweenThem) {
  const Scenario closed = resolved(scenes::box());
  const Box<2> box = clear_of_walls<2>(domain_walls(closed));
  EXPECT_EQ(box.lower, (Vec<double, 2>(closed.domain.left, 0)));
  EXPECT_EQ(box.upper, (Vec<double, 2>(closed.domain.left + closed.domain.width,
                                       closed.domain.height)));
  Scenario tank = scenes::tank();
  tank.domain.sides = Boundary::periodic;
  tank.domain.top = Boundary::free;
  const Box<2> open = clear_of_walls<2>(domain_walls(resolved(tank)));
  EXPECT_TRUE(std::isinf(open.lower[0]) && std::isinf(open.upper[0]) && std::isinf(open.upper[1]));
  EXPECT_EQ(open.lower[1], 0);
  // A round pipe of radius 2 about (1, 3): the corners lie inside, and not far from the wall.
  const std::vector<Wall> pipe = {
      {wall_pipe, Boundary::no_slip, 1, 0.0, 1.0, 0.0, 2.0, 1.0, 3.0}};
  const Box<3> inside = clear_of_walls<3>(pipe);
  for (const double x : {inside.lower[0], inside.upper[0]})
    for (const double z : {inside.lower[2], inside.upper[2]}) {
      const double distance = distance_inside<3>(pipe[0], {x, 7, z});
      EXPECT_GT(distance, 0);
      EXPECT_LT(distance, 0.05);
    }
}

TEST(Walls, PeriodicSidesAndAFreeTopAreNone) {
  Scenario s = scenes::tank();
  s.domain.sides = Boundary::periodic;
  const std::vector<Wall> walls = domain_walls(resolved(s));
  ASSERT_EQ(walls.size(), 1u);
  EXPECT_EQ(walls[0].number, wall_bottom);
}

TEST(DummyLayers, CoverTheSupportWithoutRoundingUpAWholeNumber) {
  Scenario s = scenes::box();
  EXPECT_EQ(fluid_dummy_layers(resolved(s)), 3);  // 2.5
  s.fluid.smoothing_ratio = 1.5;
  EXPECT_EQ(fluid_dummy_layers(resolved(s)), 3);  // 3.0
  s.fluid.kernel = Kernel::quintic;
  EXPECT_EQ(fluid_dummy_layers(resolved(s)), 5);  // 4.5
  EXPECT_EQ(coupling_dummy_layers(resolved(s)), 0);
  EXPECT_EQ(coupling_dummy_layers(resolved(scenes::box_with_grains(1, 1))), 5);  // 5.0
}

TEST(WallDummies, SurroundAClosedBoxCornersIncluded) {
  const Scenario s = resolved(scenes::box());
  const auto dummies = wall_dummies(s, 3);
  ASSERT_EQ(dummies.size(), 26u * 36 - 20 * 30);
  EXPECT_NEAR(dummies.front().position[0], -0.0025, 1e-15);
  EXPECT_NEAR(dummies.front().position[1], -0.0025, 1e-15);
  EXPECT_EQ(dummies.front().wall, wall_bottom);
  EXPECT_NEAR(dummies.back().position[0], 0.0225, 1e-15);
  EXPECT_NEAR(dummies.back().position[1], 0.0325, 1e-15);
  EXPECT_EQ(dummies.back().wall, wall_top);
  for (const auto& dummy : dummies) {
    const double x = dummy.position[0], y = dummy.position[1];
    EXPECT_TRUE(x < 0 || x > 0.02 || y < 0 || y > 0.03);
  }
}

TEST(WallDummies, GoRowByRowFromTheBottomLeft) {
  const auto dummies = wall_dummies(resolved(scenes::box()), 3);
  EXPECT_TRUE(std::is_sorted(dummies.begin(), dummies.end(), [](const auto& a, const auto& b) {
    if (a.position[1] != b.position[1]) return a.position[1] < b.position[1];
    return a.position[0] < b.position[0];
  }));
}

TEST(WallDummies, AreAbsentBeyondPeriodicSidesAndAboveAFreeSurface) {
  Scenario s = scenes::tank();
  // Side walls stand as high as the domain, not only as high as the fluid.
  EXPECT_EQ(wall_dummies(resolved(s), 3).size(), 26u * 33 - 20 * 30);
  s.domain.sides = Boundary::periodic;
  const auto floor_only = wall_dummies(resolved(s), 3);
  EXPECT_EQ(floor_only.size(), 20u * 3);
  for (const auto& dummy : floor_only) {
    EXPECT_GT(dummy.position[0], 0);
    EXPECT_LT(dummy.position[0], 0.02);
  }
}

TEST(WallDummies, FollowAMovedWallExactly) {
  Scenario s = resolved(scenes::box());
  s.domain.left = -0.003;
  s.domain.width = 0.026;
  const auto dummies = wall_dummies(s, 3);
  const double left = -0.003, right = left + 0.026;
  EXPECT_EQ(std::count_if(dummies.begin(), dummies.end(),
                          [&](const auto& d) { return d.position[0] == left + -0.5 * 0.001; }),
            36);
  EXPECT_EQ(std::count_if(dummies.begin(), dummies.end(),
                          [&](const auto& d) { return d.position[0] == right + 0.5 * 0.001; }),
            36);
}

TEST(WallDummies, CarryTheKindOfTheirWall) {
  Scenario s = scenes::box();
  s.domain.sides = Boundary::free_slip;
  for (const auto& dummy : wall_dummies(resolved(s), 3)) {
    const bool side = dummy.wall == wall_left || dummy.wall == wall_right;
    EXPECT_EQ(dummy.kind, side ? Boundary::free_slip : Boundary::no_slip);
  }
}

TEST(WallDummies, NeedFluid) {
  Scenario s = scenes::box_with_grains(1, 1);
  s.fluid.present = false;
  EXPECT_TRUE(wall_dummies(resolved(s), 3).empty());
}

TEST(WholeSpacings, NameTheNearestLengths) {
  EXPECT_EQ(whole_spacings("domain.width", 0.06, 0.001), 60);
  EXPECT_EQ(whole_spacings("domain.width", 0.06 + 1e-10, 0.001), 60);
  try {
    whole_spacings("domain.width", 0.0605, 0.001);
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), HasSubstr("domain.width: 0.0605 m"));
    EXPECT_THAT(error.what(), HasSubstr("0.06 m or 0.061 m"));
  }
}

TEST(Box, SeparatesOverTheShorterWay) {
  const Box<2> box{{-1, 0}, {3, 2}, {true, false}};
  EXPECT_EQ(box.separation({2.5, 1.5}, {-0.5, 0.5}), (Vec<double, 2>(-1, 1)));
  EXPECT_EQ(box.separation({-0.5, 0.5}, {2.5, 1.5}), (Vec<double, 2>(1, -1)));
  EXPECT_EQ(box.separation({1, 0}, {0, 2}), (Vec<double, 2>(1, -2)));
}

TEST(Box, WrapsIntoAHalfOpenInterval) {
  const Box<2> box{{0, 0}, {1, 1}, {true, false}};
  EXPECT_EQ(box.wrapped({1, 5})[0], 0);
  EXPECT_EQ(box.wrapped({1, 5})[1], 5);
  EXPECT_EQ(box.wrapped({-0.25, 0})[0], 0.75);
  // A point so little below 0 that adding the period rounds to 1.
  EXPECT_EQ(box.wrapped({-1e-20, 0})[0], 0);
}

// ---- three dimensions ----

Scenario solid() {
  Scenario s = scenes::box();
  s.domain.dimension = 3;
  s.domain.depth = 0.012;
  return s;
}

Scenario pipe() {
  Scenario s = solid();
  s.domain.shape = Shape::pipe;
  s.domain.width = 0.012;
  s.domain.depth = automatic;
  s.domain.left = -0.004;
  return s;
}

TEST(SolidWalls, OfABoxAreSixOfAPipeThree) {
  std::vector<std::uint32_t> numbers;
  for (const Wall& wall : domain_walls(resolved(solid()))) numbers.push_back(wall.number);
  EXPECT_THAT(numbers, testing::ElementsAre(0, 1, 2, 3, 4, 5));
  const std::vector<Wall> walls = domain_walls(resolved(pipe()));
  ASSERT_EQ(walls.size(), 3u);
  EXPECT_EQ(walls[2].number, wall_pipe);
  EXPECT_TRUE(walls[2].is_pipe());
  Scenario open = solid();
  open.domain.faces = Boundary::periodic;
  EXPECT_EQ(domain_walls(resolved(open)).size(), 4u);
}

TEST(SolidWalls, OfAPipeLieAtItsRadiusAllAround) {
  const Wall wall = domain_walls(resolved(pipe())).back();
  const double x = 0.002, z = 0.006, r = 0.006;  // axis and radius
  const Vec<double, 3> inside(x + 0.6 * 0.005, 0.01, z - 0.8 * 0.005);
  EXPECT_NEAR(distance_inside<3>(wall, inside), r - 0.005, 1e-15);
  const Vec<double, 3> normal = inward_normal<3>(wall, inside);
  EXPECT_NEAR(normal[0], -0.6, 1e-12);
  EXPECT_EQ(normal[1], 0);
  EXPECT_NEAR(normal[2], 0.8, 1e-12);
  EXPECT_LT(distance_inside<3>(wall, {x + 0.007, 0, z}), 0);
  // On the axis there is no nearest point, but always the same normal.
  EXPECT_EQ(inward_normal<3>(wall, {wall.centre_x, 0, wall.centre_z}),
            (Vec<double, 3>(1, 0, 0)));
}

TEST(SolidDummies, SurroundABoxOnAllSides) {
  EXPECT_EQ(wall_dummies<3>(resolved(solid()), 3).size(), 26u * 36 * 18 - 20 * 30 * 12);
  Scenario s = solid();
  s.domain.faces = Boundary::periodic;
  EXPECT_EQ(wall_dummies<3>(resolved(s), 3).size(), (26u * 36 - 20 * 30) * 12);
}

TEST(SolidDummies, AndTheFluidOfAPipeTileTheLattice) {
  const Scenario s = resolved(pipe());
  const auto dummies = wall_dummies<3>(s, 3);
  std::size_t beside = 0, across = 0;
  for (const auto& dummy : dummies) {
    const double x = dummy.position[0] - 0.002, z = dummy.position[2] - 0.006;
    const double r = std::sqrt(x * x + z * z);
    EXPECT_LT(r, 0.009);
    if (dummy.wall == wall_pipe) {
      ++beside;
      EXPECT_GE(r, 0.006);
    } else {
      ++across;
      EXPECT_TRUE(dummy.wall == wall_bottom || dummy.wall == wall_top);
    }
  }
  std::size_t within = 0, fluid = 0;
  for (int k = -3; k < 15; ++k)
    for (int i = -3; i < 15; ++i) {
      within += in_pipe(i, k, 12, 3) ? 1 : 0;
      fluid += in_pipe(i, k, 12) ? 1 : 0;
    }
  EXPECT_EQ(fluid, 112u);
  EXPECT_EQ(beside, 30 * (within - fluid));
  EXPECT_EQ(across, 6 * within);
}

TEST(SolidDummies, OfALidMoveWithIt) {
  Scenario s = solid();
  s.domain.lid_speed = 0.3;
  s.domain.floor_speed = -0.1;
  for (const auto& dummy : wall_dummies<3>(resolved(s), 2))
    EXPECT_EQ(dummy.speed_x, dummy.wall == wall_top      ? 0.3
                             : dummy.wall == wall_bottom ? -0.1
                                                         : 0.0);
}

}  // namespace
}  // namespace varve::core
