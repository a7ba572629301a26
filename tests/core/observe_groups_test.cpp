// Networks of contacts, clusters, shapes and flows against numbers worked out by hand.
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/observe/flow.h"
#include "core/observe/network.h"
#include "core/observe/series.h"
#include "core/observe/shape.h"
#include "core/walls.h"

namespace varve::core {
namespace {

using ::testing::ElementsAre;

constexpr double pi_ = std::numbers::pi;
const std::vector<double> no_period{0, 0, 0};

/// Discs of radius 1 and mass 1 at given places; all at rest.
struct Discs {
  std::vector<std::uint64_t> id;
  std::vector<double> x, v, radius, mass;
  explicit Discs(std::vector<double> places) : x(std::move(places)), v(x.size(), 0.0) {
    for (std::size_t i = 0; i < x.size() / 2; ++i) id.push_back(i);
    radius.assign(id.size(), 1);
    mass.assign(id.size(), 1);
  }
  GrainView view() const { return {2, id, x, v, {}, radius, mass}; }
};

ContactRow pushed(std::uint64_t grain, std::uint8_t kind, std::uint64_t partner, double impulse_x,
                  double impulse_y) {
  ContactRow row;
  row.grain = grain;
  row.kind = kind;
  row.partner = partner;
  row.impulse = {impulse_x, impulse_y, 0};
  return row;
}

Domain box() {
  Domain d;
  d.width = 10;
  d.height = 20;
  return d;
}

// ---- contacts ----

TEST(ObserveNetwork, StressOfAStackOfTwoOnTheFloor) {
  const Discs discs({5, 1, 5, 3});
  // Within 0.5 s the floor pushes grain 0 with 3 N, and grain 1 pushes it down with 2 N.
  const std::vector<ContactRow> rows{pushed(0, 0, 1, 0, -1), pushed(0, 1, wall_bottom, 0, 1.5)};
  const auto links = contact_links(discs.view(), rows, 0.5, box(), no_period);
  ASSERT_EQ(links.size(), 2u);
  EXPECT_EQ(links[0].push, 2);
  EXPECT_EQ(links[0].normal[1], -1);
  EXPECT_EQ(links[1].push, 3);
  EXPECT_EQ(links[1].j, ContactLink::wall);
  const std::vector<GrainStress> stresses = grain_stresses(discs.view(), links);
  EXPECT_EQ(stresses[0].contacts, 2u);
  EXPECT_EQ(stresses[1].contacts, 1u);
  EXPECT_NEAR(stresses[0].pressure, 5 / (2 * pi_), 1e-15);
  EXPECT_NEAR(stresses[0].vertical, 5 / pi_, 1e-15);
  EXPECT_NEAR(stresses[1].vertical, 2 / pi_, 1e-15);
  EXPECT_TRUE(contact_links(discs.view(), rows, 0, box(), no_period).empty());
}

TEST(ObserveNetwork, AContactThatEndedHoldsNoMore) {
  const Discs discs({5, 1});
  ContactRow row = pushed(0, 1, wall_bottom, 0, 1);
  row.end = true;
  EXPECT_TRUE(contact_links(discs.view(), std::vector{row}, 1, box(), no_period).empty());
}

TEST(ObserveNetwork, ChainsAreOfContactsStrongerThanTheMean) {
  const Discs discs({1, 1, 3, 1, 5, 1, 7, 1});
  const auto chains = [&](double a, double b, double c) {
    const std::vector<ContactRow> rows{pushed(0, 0, 1, -a, 0), pushed(1, 0, 2, -b, 0),
                                       pushed(2, 0, 3, -c, 0),
                                       pushed(0, 1, wall_left, 100, 0)};
    return force_chains(4, contact_links(discs.view(), rows, 1, box(), no_period));
  };
  const ForceChains split = chains(4, 1, 3);  // mean 8/3, walls do not count
  EXPECT_NEAR(split.mean_push, 8.0 / 3, 1e-15);
  EXPECT_EQ(split.strong, 2u);
  EXPECT_EQ(split.chains, 0u);
  const ForceChains one = chains(4, 3.5, 0.5);
  EXPECT_EQ(one.chains, 1u);
  EXPECT_EQ(one.longest, 3u);
  EXPECT_THAT(one.chain_of, ElementsAre(0, 0, 0, -1));
  EXPECT_EQ(force_chains(3, {}).chains, 0u);
}

TEST(ObserveNetwork, ClustersAreJoinedByGapsAndGrainsLeaveThem) {
  Discs discs({0, 0, 2.5, 0, 8, 0, 4.9, 0});
  EXPECT_THAT(clusters_of(discs.view(), 1, no_period), ElementsAre(0, 0, 1, 0));
  // Over a seam of length 11 the one at 8 is 1 from the one at 0.
  EXPECT_THAT(clusters_of(discs.view(), 1, std::vector<double>{11, 0, 0}),
              ElementsAre(0, 0, 0, 0));
  Departures departures;
  const auto now = [&] {
    return departures.take(discs.view(), clusters_of(discs.view(), 1, no_period));
  };
  EXPECT_TRUE(now().empty());
  EXPECT_EQ(departures.apart(), 0u);
  discs.x[6] = 6;  // gap 1.5 to grain 1; it joins the one at 8
  auto changes = now();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].grain, 3u);
  EXPECT_TRUE(changes[0].left);
  EXPECT_EQ(changes[0].cluster_size, 2u);
  EXPECT_EQ(departures.apart(), 1u);
  discs.x[6] = 4.9;
  changes = now();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_FALSE(changes[0].left);
  EXPECT_EQ(departures.apart(), 0u);
}

// ---- shape ----

TEST(ObserveShape, MiddleColumnsAgainstTheEdges) {
  Scenario scenario;
  scenario.grains.rows = 1;
  scenario.grains.columns = 4;
  Discs discs({1, 4, 4, 3, 7, 3, 10, 4});
  discs.v = {0, -1, 0, -4, 0, -4, 0, -2};
  const std::vector<double> down{0, -1, 0};
  const std::vector<RowShape> rows = row_shapes(scenario, discs.view(), down);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_DOUBLE_EQ(rows[0].mean_y, 3.5);
  EXPECT_DOUBLE_EQ(rows[0].spread_y, 0.5);
  EXPECT_DOUBLE_EQ(rows[0].settling_speed, 2.75);
  EXPECT_DOUBLE_EQ(rows[0].protrusion, 1);  // the middle is lower: ahead
  EXPECT_DOUBLE_EQ(rows[0].centre_minus_edge_speed, 2.5);
  scenario.grains.columns = 2;
  scenario.grains.rows = 2;
  EXPECT_TRUE(std::isnan(cluster_shape(scenario, discs.view(), down).protrusion));
}

TEST(ObserveShape, ShadowsOverlapAndWallsAreNear) {
  const Discs discs({1, 1, 2, 5, 8, 5});
  EXPECT_DOUBLE_EQ(compactness(discs.view(), box()), (3 + 2) / 10.0);
  EXPECT_THAT(wall_distances(discs.view(), box()), ElementsAre(1, 2, 2));
  Domain open = box();
  open.sides = Boundary::periodic;
  EXPECT_TRUE(std::isinf(wall_distances(discs.view(), open)[0]));
}

TEST(ObserveShape, ShadowOfASphereIsItsDisc) {
  const std::vector<std::uint64_t> id{0};
  const std::vector<double> x{5, 5, 5}, v(3, 0.0), r{1}, m{1};
  Domain d = box();
  d.depth = 10;
  EXPECT_NEAR(compactness({3, id, x, v, {}, r, m}, d), pi_ / 100, 0.02 * pi_ / 100);
}

// ---- curves ----

TEST(ObserveSums, FitAsThePointsThemselvesDo) {
  const std::vector<double> x{1, 2, 3, 4, 5}, y{2, 4, 5, 4, 5};
  const auto direct = linear_fit(x, y);
  FitSums sums, first, second;
  sums.origin_x = first.origin_x = second.origin_x = 2.5;
  for (std::size_t k = 0; k < 5; ++k) (k < 2 ? first : second).add(x[k], y[k]);
  sums.add(first);
  sums.add(second);
  const auto fit = sums.fit(5);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->slope, direct->slope, 1e-14);
  EXPECT_NEAR(fit->intercept, direct->intercept, 1e-13);
  EXPECT_NEAR(fit->slope_half_width, direct->slope_half_width, 1e-13);
  EXPECT_NEAR(fit->intercept_half_width, direct->intercept_half_width, 1e-12);
  // Every point twice says no more.
  sums.add(first);
  sums.add(second);
  EXPECT_NEAR(sums.fit(5)->slope_half_width, direct->slope_half_width, 1e-13);
  EXPECT_LT(sums.fit(10)->slope_half_width, direct->slope_half_width);
}

TEST(ObserveSums, RoughQuantilesAreWithinABin) {
  RoughQuantiles quantiles;
  for (int k = 1; k <= 1001; ++k) quantiles.add(1e-3 * k);
  quantiles.add(-1);
  quantiles.add(0);
  EXPECT_EQ(quantiles.count(), 1001u);
  EXPECT_NEAR(quantiles.at(0.5), 0.501, 0.008 * 0.501);
  EXPECT_NEAR(quantiles.at(0.25), 0.251, 0.008 * 0.251);
  EXPECT_EQ(RoughQuantiles().at(0.5), 0);
}

// ---- flow ----

/// A lattice of fluid over the unit square with a velocity field.
template <class Field>
FlowFeatures features_of(const Field& field, double radius) {
  std::vector<double> x, v, volume;
  for (int j = 0; j < 40; ++j)
    for (int i = 0; i < 40; ++i) {
      const double at[] = {(i + 0.5) / 40, (j + 0.5) / 40};
      x.insert(x.end(), {at[0], at[1]});
      const auto [u, w] = field(at[0], at[1]);
      v.insert(v.end(), {u, w});
      volume.push_back(1.0 / 1600);
    }
  Domain d;
  d.width = d.height = 1;
  const FluidPoints fluid{2, x, v, volume, {}, 1.5 / 40, Kernel::wendland_c2, {0, 0, 0}};
  return flow_features(flow_lattice(fluid, d, 1.0 / 40), radius);
}

TEST(ObserveFlow, ASwirlHasItsCoreItsCirculationAndNoMirrorImage) {
  const FlowFeatures f = features_of(
      [](double x, double y) { return std::pair(-3 * (y - 0.5), 3 * (x - 0.5)); }, 0.2);
  ASSERT_TRUE(f.positive.found);
  EXPECT_FALSE(f.negative.found);
  EXPECT_NEAR(f.positive.x, 0.5, 0.02);
  EXPECT_NEAR(f.positive.y, 0.5, 0.02);
  EXPECT_NEAR(f.positive.swirl, 1, 0.02);
  EXPECT_NEAR(f.positive.circulation, 6 * pi_ * 0.04, 0.05 * 6 * pi_ * 0.04);
  EXPECT_NEAR(f.symmetry, -1, 0.01);
  EXPECT_NEAR(f.circulation_left, f.circulation_right, 1e-9);
}

TEST(ObserveFlow, ACounterRotatingPairMirrorsItself) {
  // Stream function sin(2 pi x) sin(pi y).
  const FlowFeatures f = features_of(
      [](double x, double y) {
        return std::pair(pi_ * std::sin(2 * pi_ * x) * std::cos(pi_ * y),
                         -2 * pi_ * std::cos(2 * pi_ * x) * std::sin(pi_ * y));
      },
      0.1);
  EXPECT_NEAR(f.symmetry, 1, 1e-9);
  EXPECT_NEAR(f.circulation_left, -f.circulation_right, 1e-9);
  ASSERT_TRUE(f.positive.found && f.negative.found);
  EXPECT_NEAR(f.positive.x, 0.25, 0.03);
  EXPECT_NEAR(f.negative.x, 0.75, 0.03);
  EXPECT_NEAR(f.positive.y, 0.5, 0.03);
  EXPECT_GT(f.positive.circulation, 0);
  // 5 pi^2 at the cores, a little less by the kernel.
  EXPECT_NEAR(std::abs(f.peak_vorticity), 5 * pi_ * pi_, 0.05 * 5 * pi_ * pi_);
}

TEST(ObserveFlow, FluidThroughAndBesideAClusterRelativeToIt) {
  std::vector<double> x, v, volume;
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i < 20; ++i) {
      x.insert(x.end(), {i + 0.5, j + 0.5});
      v.insert(v.end(), {0, 0.2});
      volume.push_back(0.5);  // m / rho0: porosity 0.5
    }
  Domain d;
  d.width = d.height = 20;
  const FluidPoints fluid{2, x, v, volume, {}, 1.5, Kernel::wendland_c2, {20, 0, 0}};
  const FlowThrough flow = flow_through(fluid, d, 1, 10, 5, 10, -0.1);
  EXPECT_NEAR(flow.through, 0.5 * 0.3 * 5, 0.01);
  EXPECT_NEAR(flow.beside, 0.5 * 0.3 * 15, 0.02);
  EXPECT_NEAR(flow.share, 0.25, 1e-9);
}

}  // namespace
}  // namespace varve::core
