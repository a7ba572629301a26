// The coupling's averages against closed forms, and its exactness: what grains get is what the
// fluid loses, a grain's volume is handed out without loss, and lists and threads reach no bit.
#include "core/coupling.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/criteria.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/random.h"

namespace varve::core {
namespace {

using P = DoublePrecision;
using V2 = Vec<double, 2>;

/// A lattice of fluid on [0, nx dx] x [0, ny dx], grains in it, and the coupling between them.
struct Bed {
  Constants<2> c;
  State<2, P> state;
  std::vector<V2> stress;
  std::vector<Wall> walls;
  std::vector<double> volume, porosity, floored;
  Workers workers{1};
  CouplingStage<2, P> stage;

  Bed(std::size_t nx, std::size_t ny, double dx = 1e-3) {
    c.spacing = dx;
    c.species = {species_constants<2>(2.5e-3, 1250)};
    c.reference_density = 1000;
    c.viscosity = 0.01;
    c.coupled = c.two_way = true;
    c.coupling_length = c.species[0].diameter;
    c.porosity_floor = 0.3;
    for (std::size_t j = 0; j < ny; ++j)
      for (std::size_t i = 0; i < nx; ++i) {
        state.fluid.id.push_back(state.fluid.size());
        state.fluid.position.emplace_back((static_cast<double>(i) + 0.5) * dx,
                                          (static_cast<double>(j) + 0.5) * dx);
        state.fluid.velocity.emplace_back(V2::Zero());
        volume.push_back(dx * dx);
        stress.emplace_back(V2::Zero());
      }
  }
  void add(V2 x, V2 v = V2::Zero()) {
    state.grains.id.push_back(state.grains.size());
    state.grains.species.push_back(0);
    state.grains.position.push_back(x);
    state.grains.velocity.push_back(v);
  }
  void find_porosity(double skin = 0) {
    const std::size_t n = state.fluid.size();
    porosity.assign(n, 0);
    floored.assign(n, 0);
    stage.rebuild(c, state, walls, skin, workers);
    stage.porosity(c, state, volume, porosity, floored, workers);
  }
  void find_forces(Drag drag = Drag::dallavalle_di_felice) {
    find_porosity();
    stage.forces(c, state, {state.fluid.position, state.fluid.velocity, volume, stress},
                 make_drag_law<2>(drag), workers);
  }
  const GrainForce<2>& force(std::size_t i = 0) const { return stage.grain_forces()[i]; }
  double solid() const {
    double sum = 0;
    for (std::size_t a = 0; a < volume.size(); ++a) sum += volume[a] * (1 - porosity[a]);
    return sum;
  }
};

double wendland(double h, double r) { return SmoothingKernel<2, Kernel::wendland_c2>(h).value(r); }

// ---- porosity ----

TEST(CouplingPorosity, WithoutAGrainIsOneToTheBit) {
  Bed bed(20, 20);
  bed.add({0.1, 0.1});  // far outside the fluid
  bed.find_porosity();
  EXPECT_THAT(bed.porosity, testing::Each(1.0));
}

TEST(CouplingPorosity, AtTheCentreOfALoneGrainIsTheKernelsPeak) {
  Bed bed(21, 21);
  bed.add({10.5e-3, 10.5e-3});  // on a fluid particle
  bed.find_porosity();
  EXPECT_NEAR(bed.porosity[10 * 21 + 10], 1 - 7.0 / 16, 1e-14);
}

/// Mean porosity and its spread over fluid among grains in contact, periodic both ways.
std::pair<double, double> packed(const std::vector<V2>& cell, double width, double height,
                                 double hc_over_d, int repeat_x, int repeat_y) {
  const double lx = width * repeat_x, ly = height * repeat_y;
  Bed bed(0, 0);
  bed.c.coupling_length = hc_over_d * bed.c.species[0].diameter;
  bed.c.porosity_floor = 0.01;
  bed.c.period.length[0] = lx;
  bed.c.period.length[1] = ly;
  constexpr int n = 60;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      bed.state.fluid.id.push_back(bed.state.fluid.size());
      bed.state.fluid.position.emplace_back((i + 0.5) / n * lx, (j + 0.5) / n * ly);
      bed.state.fluid.velocity.emplace_back(V2::Zero());
      bed.volume.push_back(lx * ly / (n * n));
    }
  for (int j = 0; j < repeat_y; ++j)
    for (int i = 0; i < repeat_x; ++i)
      for (const V2& x : cell) bed.add(x + V2(i * width, j * height));
  bed.find_porosity();
  double mean = 0, least = 1, most = 0;
  for (const double eps : bed.porosity) {
    mean += eps / (n * n);
    least = std::min(least, eps);
    most = std::max(most, eps);
  }
  return {mean, most - least};
}

TEST(CouplingPorosity, OfASquareArrayInContactIsOneMinusAQuarterPi) {
  const double d = 2.5e-3;
  const auto [mean, spread] = packed({{0.3 * d, 0.4 * d}}, d, d, 1.0, 6, 6);
  EXPECT_NEAR(mean, 0.2146, 5e-4);
  EXPECT_LT(spread, 0.06);
  const auto [wide_mean, wide_spread] = packed({{0.3 * d, 0.4 * d}}, d, d, 2.0, 10, 10);
  EXPECT_NEAR(wide_mean, 1 - pi / 4, 5e-4);
  EXPECT_LT(wide_spread, 0.004);
}

TEST(CouplingPorosity, OfAHexagonalArrayInContactIsOneMinusPiOverTwoRootThree) {
  const double d = 2.5e-3, height = std::sqrt(3.0) * d;
  const std::vector<V2> cell = {{0.25 * d, 0.25 * height}, {0.75 * d, 0.75 * height}};
  const auto [mean, spread] = packed(cell, d, height, 1.0, 6, 4);
  EXPECT_NEAR(mean, 0.0931, 5e-4);
  EXPECT_LT(spread, 0.06);
}

/// Walls around a bed of `side` metres.
std::vector<Wall> box_walls(double side) {
  return {{wall_left, Boundary::no_slip, 0, 0.0, 1.0},
          {wall_right, Boundary::no_slip, 0, side, -1.0},
          {wall_bottom, Boundary::no_slip, 1, 0.0, 1.0},
          {wall_top, Boundary::no_slip, 1, side, -1.0}};
}

TEST(CouplingPorosity, HandsOutAGrainsWholeVolumeToTheFluidInsideTheWalls) {
  // In the open to the lattice's error, near a wall and in a corner by the images; in the
  // conservative form exactly.
  for (const V2& place : {V2(15.2e-3, 15.4e-3), V2(15.2e-3, 1.25e-3), V2(1.3e-3, 1.4e-3),
                          V2(28.75e-3, 28.7e-3), V2(0.1e-3, 12e-3)})
    for (const bool conservative : {false, true}) {
      Bed bed(30, 30);
      bed.c.conservative_porosity = conservative;
      bed.c.porosity_floor = 1e-6;
      bed.walls = box_walls(30e-3);
      bed.add(place);
      bed.find_forces();
      EXPECT_NEAR(bed.solid() / bed.c.species[0].volume, 1, conservative ? 1e-12 : 2e-3)
          << place.transpose() << (conservative ? ", conservative" : "");
      EXPECT_NEAR(bed.force().weight, 1, 2e-3) << place.transpose();
    }
}

TEST(CouplingPorosity, WithoutImagesAWallTakesItsShare) {
  // The control of the test above: half of a grain on a wall would be lost.
  Bed bed(30, 30);
  bed.add({15.2e-3, 0});
  bed.find_porosity();
  EXPECT_NEAR(bed.solid() / bed.c.species[0].volume, 0.5, 5e-3);
}

TEST(CouplingPorosity, IsLevelAcrossAWall) {
  // Fluid pressed against a wall must not find thinner solid there, or it would be drawn through.
  Bed bed(30, 30);
  bed.walls = box_walls(30e-3);
  for (const double x : {12.5e-3, 15e-3, 17.5e-3}) bed.add({x, 1.25e-3});
  const std::size_t probe = 15;
  const auto at = [&](double y) {
    bed.state.fluid.position[probe] = {15.1e-3, y};
    bed.find_porosity();
    return bed.porosity[probe];
  };
  for (const double y : {0.05e-3, 0.2e-3, 0.4e-3}) EXPECT_NEAR(at(y), at(-y), 1e-12) << y;
}

TEST(CouplingPorosity, WithoutWallsInReachBothFormsOfTheNormalisationAgreeToTheLatticesError) {
  Bed kernel(30, 30), conservative(30, 30);
  conservative.c.conservative_porosity = true;
  for (Bed* bed : {&kernel, &conservative}) {
    bed->add({15.2e-3, 15.4e-3});
    bed->find_porosity();
  }
  for (std::size_t a = 0; a < kernel.porosity.size(); ++a)
    EXPECT_NEAR(kernel.porosity[a], conservative.porosity[a], 1e-3);
}

TEST(CouplingPorosity, IsFlooredForUseCountedAndReportedAsItIs) {
  Bed bed(30, 30);
  for (const double shift : {-0.4e-3, 0.0, 0.4e-3}) bed.add({15.2e-3 + shift, 15.4e-3});
  bed.find_porosity();
  std::uint64_t below = 0;
  for (std::size_t a = 0; a < bed.porosity.size(); ++a) {
    below += bed.porosity[a] < 0.3;
    EXPECT_EQ(bed.floored[a], std::max(bed.porosity[a], 0.3));
  }
  EXPECT_GT(below, 0u);
  EXPECT_EQ(bed.stage.fluid_clamps(), below);
}

TEST(CouplingPorosity, FeltByALoneGrainIsOneToTheBit) {
  Bed bed(30, 30);
  bed.add({15.2e-3, 15.4e-3});
  bed.find_forces();
  EXPECT_EQ(bed.force().porosity, 1.0);
  bed.c.exclude_own_volume = false;
  bed.find_forces();
  EXPECT_NEAR(bed.force().porosity, 1 - 7.0 / 16, 1e-14);
}

TEST(CouplingDrag, OfACorrectedSlipIsThatOfTheSlipWithoutTheDisturbance) {
  const double slip = 0.05, factor = undisturbed_slip(1.25e-3, 2.5e-3);
  EXPECT_NEAR(factor, 1 / (1 - 0.53685), 1e-12);
  Bed bed(30, 30);
  bed.add({15.2e-3, 15.4e-3}, {0, factor * slip});
  bed.find_forces();
  const double wanted = bed.force().coefficient * factor * slip;  // K(u) u at the true slip
  bed.c.species[0].slip_factor = factor;
  bed.state.grains.velocity[0] = {0, slip};
  bed.find_forces();
  EXPECT_NEAR(bed.force().coefficient * slip, wanted, 1e-12 * wanted);
}

TEST(CouplingPorosity, FeltInAPackedArrayIsNearThatOfTheArray) {
  // Leaving the own volume out alone would say 0.65; divided by what the others could fill at most,
  // the array's 0.2146 comes back.
  Bed bed(40, 40);
  bed.c.porosity_floor = 0.01;
  const double d = bed.c.species[0].diameter;
  for (int j = 0; j < 7; ++j)
    for (int i = 0; i < 7; ++i) bed.add({0.02 + (i - 3) * d, 0.02 + (j - 3) * d});
  bed.find_forces();
  double solid = 0;
  for (int j = -2; j <= 2; ++j)
    for (int i = -2; i <= 2; ++i)
      if (i != 0 || j != 0)
        solid += bed.c.species[0].volume * wendland(d, d * std::sqrt(i * i + j * j));
  const GrainForce<2>& middle = bed.force(24);
  EXPECT_NEAR(middle.porosity, 1 - solid / (1 - 7.0 / 16), 1e-12);
  EXPECT_LT(middle.porosity, 0.5);
}

// ---- forces ----

TEST(CouplingForces, AUniformFlowIsSampledExactlyWhereverTheGrainIs) {
  for (const V2& place : {V2(15.2e-3, 15.4e-3), V2(0.1e-3, 29.9e-3), V2(1.3e-3, 1.4e-3)}) {
    Bed bed(30, 30);
    bed.walls = box_walls(30e-3);
    for (V2& v : bed.state.fluid.velocity) v = {0.03, -0.07};
    bed.add(place, {0.01, 0.02});
    bed.find_forces();
    EXPECT_NEAR(bed.force().fluid_velocity[0], 0.03, 1e-15);
    EXPECT_NEAR(bed.force().fluid_velocity[1], -0.07, 1e-15);
    const double speed = std::sqrt(0.02 * 0.02 + 0.09 * 0.09);
    EXPECT_NEAR(bed.force().coefficient,
                drag_coefficient<2>(make_drag_law<2>(Drag::dallavalle_di_felice),
                                    {speed, 1.0, bed.c.species[0].diameter, 1000, 0.01}),
                1e-12);
  }
}

TEST(CouplingForces, AUniformPressureGradientPushesWithTheGrainsVolume) {
  for (const V2& place : {V2(15.2e-3, 15.4e-3), V2(0.1e-3, 29.9e-3)}) {
    Bed bed(30, 30);
    const V2 per_volume{12.0, -9810.0};  // [N/m3]
    for (std::size_t a = 0; a < bed.stress.size(); ++a) bed.stress[a] = bed.volume[a] * per_volume;
    bed.add(place);
    bed.find_forces();
    const V2 expected = bed.c.species[0].volume * per_volume;
    EXPECT_LT((bed.force().hydrodynamic - expected).norm(), 1e-13 * expected.norm());
  }
}

TEST(CouplingForces, AGrainOutsideTheFluidFeelsNoneAndGivesNone) {
  Bed bed(10, 10);
  for (V2& v : bed.state.fluid.velocity) v = {1, 1};
  bed.add({0.05, 0.05}, {0.3, 0});
  bed.find_forces();
  EXPECT_EQ(bed.force().weight, 0);
  EXPECT_EQ(bed.force().coefficient, 0);
  EXPECT_EQ(bed.force().hydrodynamic, V2(V2::Zero()));
  EXPECT_EQ(bed.stage.weak_grains(), 1u);
  bed.stage.set_drag(std::vector<V2>{V2::Zero()});
  for (std::size_t a = 0; a < bed.volume.size(); ++a)
    EXPECT_EQ(bed.stage.reaction(a, bed.volume[a]), V2(V2::Zero()));
}

/// A disturbed bed with a few grains, one of them half out of the fluid.
struct DisturbedBed : Bed {
  DisturbedBed() : Bed(25, 25) {
    for (std::size_t a = 0; a < volume.size(); ++a) {
      for (int k = 0; k < 2; ++k) {
        const auto draw = static_cast<std::uint64_t>(k);
        state.fluid.position[a][k] += 3e-4 * symmetric(1, a, draw);
        state.fluid.velocity[a][k] = 0.1 * symmetric(2, a, draw);
        stress[a][k] = 1e-3 * symmetric(3, a, draw);
      }
      volume[a] *= 1 + 0.05 * symmetric(4, a, 0);
    }
    add({12e-3, 12e-3}, {0.02, -0.1});
    add({14.6e-3, 12.3e-3}, {0.05, 0.1});
    add({3e-3, 3e-3}, {0, 0.01});
    add({25e-3, 10e-3}, {0.3, 0});
  }
};

/// |sum of reactions + sum of forces| over the sum of |forces|, with volumes given for the
/// reaction.
double imbalance(const Bed& bed, const std::vector<double>& reaction_volume) {
  V2 sum = V2::Zero();
  double scale = 0;
  for (const GrainForce<2>& f : bed.stage.grain_forces()) {
    sum += f.hydrodynamic + f.drag;
    scale += (f.hydrodynamic + f.drag).norm();
  }
  for (std::size_t a = 0; a < reaction_volume.size(); ++a)
    sum += bed.stage.reaction(a, reaction_volume[a]);
  return sum.norm() / scale;
}

TEST(CouplingReaction, IsMinusTheForceOnTheGrains) {
  for (const Drag drag : {Drag::stokes, Drag::schiller_naumann, Drag::dallavalle_di_felice,
                          Drag::gidaspow, Drag::cylinder}) {
    DisturbedBed bed;
    bed.find_forces(drag);
    std::vector<V2> mean_drag;
    for (std::size_t i = 0; i < bed.state.grains.size(); ++i)
      mean_drag.push_back(bed.force(i).coefficient *
                          (bed.force(i).fluid_velocity - bed.state.grains.velocity[i]));
    bed.stage.set_drag(mean_drag);
    EXPECT_LT(imbalance(bed, bed.volume), 1e-13);
    // A law that is not symmetric must fail the same check: volumes of another time level in the
    // reaction than in the Shepard sum.
    std::vector<double> lagged = bed.volume;
    for (std::size_t a = 0; a < lagged.size(); ++a) lagged[a] *= 1 + 1e-6 * symmetric(5, a, 0);
    EXPECT_GT(imbalance(bed, lagged), 1e-12);
  }
}

TEST(CouplingReaction, FallsOnTheFluidAroundTheGrainAlone) {
  DisturbedBed bed;
  bed.find_forces();
  std::vector<V2> drag(bed.state.grains.size(), V2::Zero());
  drag[0] = {0, 1};
  // Only grain 0 pushes.
  bed.stress.assign(bed.stress.size(), V2::Zero());
  bed.find_forces();
  bed.stage.set_drag(drag);
  const double reach = 2 * bed.c.coupling_length;
  for (std::size_t a = 0; a < bed.volume.size(); ++a) {
    const double r = (bed.state.fluid.position[a] - bed.state.grains.position[0]).norm();
    EXPECT_EQ(bed.stage.reaction(a, bed.volume[a])[1] < 0, r < reach) << "r " << r;
  }
}

// ---- what must not reach a bit ----

std::vector<double> numbers_of(Bed& bed) {
  std::vector<double> all = bed.porosity;
  for (const GrainForce<2>& f : bed.stage.grain_forces())
    all.insert(all.end(), {f.hydrodynamic[0], f.hydrodynamic[1], f.fluid_velocity[0],
                           f.fluid_velocity[1], f.porosity, f.coefficient, f.weight});
  return all;
}

TEST(CouplingBits, TheSkinOfTheListsReachesNone) {
  DisturbedBed bed;
  bed.find_forces();
  const std::vector<double> bare = numbers_of(bed);
  const DragLaw<2> law = make_drag_law<2>(Drag::dallavalle_di_felice);
  for (const double skin : {1e-4, 1e-3, 1e-2}) {
    DisturbedBed wide;
    wide.find_porosity(skin);
    wide.stage.forces(wide.c, wide.state,
                      {wide.state.fluid.position, wide.state.fluid.velocity, wide.volume,
                       wide.stress}, law, wide.workers);
    EXPECT_EQ(numbers_of(wide), bare);
  }
}

TEST(CouplingBits, TheNumberOfThreadsReachesNone) {
  DisturbedBed bed;
  bed.find_forces();
  const std::vector<double> alone = numbers_of(bed);
  const DragLaw<2> law = make_drag_law<2>(Drag::dallavalle_di_felice);
  for (const unsigned threads : {2u, 3u, 4u}) {
    DisturbedBed shared;
    Workers workers(threads);
    shared.porosity = shared.floored = std::vector<double>(shared.volume.size());
    shared.stage.rebuild(shared.c, shared.state, shared.walls, 0, workers);
    shared.stage.porosity(shared.c, shared.state, shared.volume, shared.porosity, shared.floored,
                          workers);
    shared.stage.forces(shared.c, shared.state,
                        {shared.state.fluid.position, shared.state.fluid.velocity, shared.volume,
                         shared.stress}, law, workers);
    EXPECT_EQ(numbers_of(shared), alone) << threads << " threads";
  }
}

TEST(CouplingLists, AreStaleOnceAGrainMovedByHalfTheSkinOrANumberChanged) {
  DisturbedBed bed;
  const double skin = 1e-3;
  EXPECT_TRUE(bed.stage.stale(bed.c, bed.state, skin));
  bed.find_porosity(skin);
  EXPECT_FALSE(bed.stage.stale(bed.c, bed.state, skin));
  bed.state.grains.position[1][0] += 0.4 * skin;
  EXPECT_FALSE(bed.stage.stale(bed.c, bed.state, skin));
  bed.state.grains.position[1][0] += 0.2 * skin;
  EXPECT_TRUE(bed.stage.stale(bed.c, bed.state, skin));
  bed.find_porosity(skin);
  bed.state.fluid.id.pop_back();
  EXPECT_TRUE(bed.stage.stale(bed.c, bed.state, skin));
}

TEST(CouplingPeriodic, AGrainOnTheSeamIsLikeOneInTheMiddle) {
  Bed middle(32, 32), seam(32, 32);
  for (Bed* bed : {&middle, &seam}) {
    bed->c.period.length[0] = bed->c.period.length[1] = 32e-3;
    for (V2& v : bed->state.fluid.velocity) v = {0.02, 0};
  }
  middle.add({16e-3, 16e-3});
  seam.add({0, 0});
  for (Bed* bed : {&middle, &seam}) bed->find_forces();
  EXPECT_NEAR(middle.force().weight, seam.force().weight, 1e-13);
  EXPECT_NEAR(middle.force().fluid_velocity[0], seam.force().fluid_velocity[0], 1e-15);
  EXPECT_NEAR(middle.solid(), seam.solid(), 1e-18);
}

}  // namespace
}  // namespace varve::core
