// Observables against numbers worked out by hand.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/observe/contacts.h"
#include "core/observe/drag_numbers.h"
#include "core/observe/fluid.h"
#include "core/observe/grains.h"
#include "core/observe/series.h"

namespace varve::core {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;

// ---- curves ----

TEST(ObserveSeries, SpreadIsMeanAndSampleDeviation) {
  const Spread spread = spread_of(std::vector<double>{2, 4, 4, 4, 5, 5, 7, 9});
  EXPECT_DOUBLE_EQ(spread.mean, 5);
  EXPECT_NEAR(spread.deviation, std::sqrt(32.0 / 7), 1e-15);
  EXPECT_EQ(spread_of(std::vector<double>{3}).deviation, 0);
  EXPECT_TRUE(std::isnan(spread_of({}).mean));
}

TEST(ObserveSeries, QuartilesLieBetweenOrderStatistics) {
  const Quartiles q = quartiles_of(std::vector<double>{4, 1, 3, 2});
  EXPECT_THAT((std::vector<double>{q.least, q.lower, q.median, q.upper, q.greatest}),
              ElementsAre(1, 1.75, 2.5, 3.25, 4));
  EXPECT_EQ(quartiles_of(std::vector<double>{7}).upper, 7);
  EXPECT_EQ(quartiles_of({}).greatest, 0);
}

TEST(ObserveSeries, FitOfFivePointsHasTheIntervalOfTheTables) {
  // x 1..5, y 2, 4, 5, 4, 5: slope 0.6, residual sum 2.4, s^2 = 0.8, t(3) = 3.182.
  const std::vector<double> x{1, 2, 3, 4, 5}, y{2, 4, 5, 4, 5};
  const auto fit = linear_fit(x, y);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->slope, 0.6, 1e-15);
  EXPECT_NEAR(fit->intercept, 2.2, 1e-14);
  EXPECT_NEAR(fit->slope_half_width, 3.182 * std::sqrt(0.8 / 10), 1e-12);
  EXPECT_NEAR(fit->intercept_half_width, 3.182 * std::sqrt(0.8 * (0.2 + 0.9)), 1e-12);
  EXPECT_NEAR(fit->correlation, 6 / std::sqrt(60.0), 1e-15);
  EXPECT_FALSE(linear_fit(std::vector<double>{1}, std::vector<double>{1}));
  EXPECT_FALSE(linear_fit(std::vector<double>{1, 1}, std::vector<double>{1, 2}));
}

TEST(ObserveSeries, StudentsTJoinsItsExpansion) {
  EXPECT_EQ(student_t95(1), 12.706);
  EXPECT_NEAR(student_t95(31), 2.0395, 1e-4);
  EXPECT_NEAR(student_t95(120), 1.9799, 1e-4);
  EXPECT_NEAR(student_t95(1000000), 1.95996, 1e-5);
}

TEST(ObserveSeries, AWindowIsStationaryWhereItsLineIsNearlyLevel) {
  std::vector<double> t, level, rising;
  for (int k = 0; k <= 10; ++k) {
    t.push_back(0.1 * k);
    level.push_back(2 + (k % 2 ? 0.01 : -0.01));
    rising.push_back(2 + 0.1 * k);
  }
  const auto flat = window_of(t, level, 0.45, 1);
  ASSERT_TRUE(flat);
  EXPECT_EQ(flat->points, 6u);
  EXPECT_TRUE(flat->stationary);
  const auto slope = window_of(t, rising, 0, 1);
  EXPECT_NEAR(slope->mean, 2.5, 1e-14);
  EXPECT_NEAR(slope->drift, 1, 1e-12);
  EXPECT_FALSE(slope->stationary);
  EXPECT_FALSE(window_of(t, level, 3, 4));
}

TEST(ObserveSeries, RiseTimeIsBetweenPoints) {
  const std::vector<double> t{0, 1, 2, 3}, v{0, -4, -8, -8};
  EXPECT_NEAR(*rise_time(t, v, -8, 0.95), 1.9, 1e-15);
  EXPECT_NEAR(*rise_time(t, v, 8, 0.25), 0.5, 1e-15);
  EXPECT_FALSE(rise_time(t, v, 10, 0.95));
  EXPECT_EQ(*rise_time(t, v, 0, 0.95), 0);
}

TEST(ObserveSeries, TurnsAreThoseLargerThanTheStep) {
  std::vector<double> t, y;
  for (int k = 0; k <= 400; ++k) {
    t.push_back(0.01 * k);
    // Period 1, amplitude 1, with a ripple of 0.01 that is no turn.
    y.push_back(std::sin(2 * 3.14159265358979 * 0.01 * k) + (k % 2 ? 0.005 : -0.005));
  }
  const std::vector<TurningPoint> turns = turning_points(t, y, 0.1);
  ASSERT_EQ(turns.size(), 8u);
  EXPECT_TRUE(turns[0].maximum);
  EXPECT_NEAR(turns[0].time, 0.25, 0.015);
  EXPECT_FALSE(turns[1].maximum);
  const auto swing = oscillation_of(turns);
  ASSERT_TRUE(swing);
  EXPECT_NEAR(swing->amplitude, 1, 0.01);
  EXPECT_NEAR(swing->period, 1, 0.01);
  EXPECT_THAT(turning_points(t, y, 3), testing::IsEmpty());
  EXPECT_FALSE(oscillation_of({}));
}

TEST(ObserveSeries, RestIsForGood) {
  const std::vector<double> t{0, 1, 2, 3, 4};
  EXPECT_EQ(*rest_time(t, std::vector<double>{5, 0, 5, 0.5, -0.5}, 1), 3);
  EXPECT_FALSE(rest_time(t, std::vector<double>{0, 0, 0, 0, 2}, 1));
}

// ---- grains ----

/// Two discs of radius 1 and mass 2 at (0, 1) and (3, 5).
struct Two {
  std::vector<std::uint64_t> id{4, 9};
  std::vector<double> x{0, 1, 3, 5}, v{3, -4, 0, -2}, w{0.5, 2}, radius{1, 1}, mass{2, 2};
  GrainView view() const { return {2, id, x, v, w, radius, mass}; }
};

TEST(ObserveGrains, GroupMotionOfTwo) {
  const Two two;
  const std::vector<double> down{0, -1, 0};
  const GroupMotion group = group_motion(two.view(), down);
  EXPECT_DOUBLE_EQ(group.mean_velocity[0], 1.5);
  EXPECT_DOUBLE_EQ(group.mean_velocity[1], -3);
  EXPECT_DOUBLE_EQ(group.settling_speed, 3);
  EXPECT_DOUBLE_EQ(group.mean_speed, 3.5);
  EXPECT_DOUBLE_EQ(group.max_speed, 5);
  EXPECT_DOUBLE_EQ(group.centroid[0], 1.5);
  EXPECT_DOUBLE_EQ(group.spread[1], 2);
  EXPECT_DOUBLE_EQ(group.lowest, 1);
  EXPECT_DOUBLE_EQ(group.highest, 5);
  EXPECT_EQ(group_motion({}, down).mean_speed, 0);
}

TEST(ObserveGrains, EnergyOfTwo) {
  const Two two;
  const GrainEnergy energy = grain_energy(two.view(), 0.5, std::vector<double>{0, -10, 0});
  EXPECT_DOUBLE_EQ(energy.translation, 25 + 4);
  EXPECT_DOUBLE_EQ(energy.rotation, 0.5 * 1 * (0.25 + 4));  // I = 1/2 m R^2 = 1
  EXPECT_DOUBLE_EQ(energy.potential, 2 * 10 * (1 + 5));
}

TEST(ObserveGrains, GapsAreFromSurfaceToSurfaceAndOverTheSeam) {
  const Two two;
  const std::vector<double> open{0, 0, 0}, seam{0, 5, 0};
  EXPECT_THAT(nearest_gaps(two.view(), open), ElementsAre(DoubleEq(3), DoubleEq(3)));
  // Across a period of 5 the distance in y is 1.
  EXPECT_THAT(nearest_gaps(two.view(), seam),
              ElementsAre(DoubleEq(std::sqrt(10.0) - 2), DoubleEq(std::sqrt(10.0) - 2)));
}

TEST(ObserveGrains, PorosityOfASquareOfFourTouchingDiscs) {
  const std::vector<std::uint64_t> id{0, 1, 2, 3};
  const std::vector<double> x{1, 1, 3, 1, 1, 3, 3, 3}, v(8, 0.0), radius(4, 1.0), mass(4, 1.0);
  const ClusterPorosity porosity = cluster_porosity({2, id, x, v, {}, radius, mass});
  EXPECT_NEAR(porosity.box, 1 - 3.14159265358979 / 4, 1e-14);
  // The middle half is [1, 3) along each axis: the centre of one disc lies in it.
  EXPECT_NEAR(porosity.middle, 1 - 3.14159265358979 / 4, 1e-14);
}

TEST(ObserveGrains, LabelsFollowTheIds) {
  Scenario scenario;
  scenario.grains.rows = 2;
  scenario.grains.columns = 3;
  const GrainLabel label = label_of(scenario, 4);
  EXPECT_EQ(label.row, 1);
  EXPECT_EQ(label.column, 1);
  EXPECT_EQ(label_of(scenario, 6).row, -1);
}

// ---- contacts ----

ContactRow touch(std::uint64_t grain, std::uint8_t kind, double force) {
  ContactRow row;
  row.grain = grain;
  row.kind = kind;
  row.partner = kind == 1 ? 2 : grain + 1;
  row.peak_force = force;
  row.normal_loss = 0.25;
  row.impulse = {0, 0.5, 0};
  return row;
}

TEST(ObserveContacts, TotalsAreSumsAndQuartiles) {
  std::vector<ContactRow> rows{touch(0, 0, 1), touch(0, 1, 3), touch(1, 1, 5)};
  rows[1].begin = rows[2].begin = rows[2].end = true;
  const ContactTotals totals = contact_totals(rows);
  EXPECT_EQ(totals.contacts, 3u);
  EXPECT_EQ(totals.with_walls, 2u);
  EXPECT_EQ(totals.begun, 2u);
  EXPECT_EQ(totals.ended, 1u);
  EXPECT_EQ(totals.force.median, 3);
  EXPECT_EQ(totals.mean_force, 3);
  EXPECT_EQ(totals.normal_loss, 0.75);
  EXPECT_EQ(totals.wall_impulse[1], 1);
  EXPECT_EQ(contact_totals({}).mean_force, 0);
}

TEST(ObserveContacts, AHitIsPutTogetherFromItsSteps) {
  WallHits hits;
  ContactRow row = touch(3, 1, 1);
  row.begin = true;
  row.impact_speed = 2;
  EXPECT_THAT(hits.take(0.1, std::vector{row}), testing::IsEmpty());
  row = touch(3, 1, 7);
  EXPECT_THAT(hits.take(0.2, std::vector{row}), testing::IsEmpty());
  row = touch(3, 1, 4);
  row.end = true;
  row.rebound_speed = 1.5;
  const std::vector<WallHit> ended = hits.take(0.3, std::vector{row});
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].restitution, 0.75);
  EXPECT_EQ(ended[0].peak_force, 7);
  EXPECT_EQ(ended[0].begin, 0.1);
  EXPECT_EQ(ended[0].end, 0.3);
}

TEST(ObserveContacts, AContactThatWasOpenAtTheStartIsNoHit) {
  WallHits hits;
  ContactRow row = touch(3, 1, 1);
  row.end = true;
  row.rebound_speed = 1;
  EXPECT_THAT(hits.take(0.1, std::vector{row}), testing::IsEmpty());
  // One within a single step is.
  row.begin = true;
  row.impact_speed = 2;
  EXPECT_EQ(hits.take(0.2, std::vector{row}).size(), 1u);
}

// ---- fluid ----

/// A lattice 1 mm apart, 20 x 20, with a linear velocity field and pressure.
struct LinearFlow {
  std::vector<double> x, v, volume, pressure;
  LinearFlow() {
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 20; ++i) {
        const double at[] = {(i + 0.5) * 1e-3, (j + 0.5) * 1e-3};
        x.insert(x.end(), {at[0], at[1]});
        v.insert(v.end(), {3 * at[1], 5 * at[0]});  // curl 2
        volume.push_back(1e-6);
        pressure.push_back(100 + 1e4 * at[1]);
      }
  }
  FluidPoints points() const {
    return {2, x, v, volume, pressure, 1.5e-3, Kernel::wendland_c2, {0, 0, 0}};
  }
};

TEST(ObserveFluid, ALinearFlowHasItsValuesAndItsCurl) {
  const LinearFlow flow;
  const std::vector<double> places{0.01, 0.01, 0.0103, 0.0088};
  const std::vector<FluidAtPoint> values = sample_fluid(flow.points(), places);
  ASSERT_EQ(values.size(), 2u);
  for (std::size_t p = 0; p < 2; ++p) {
    EXPECT_NEAR(values[p].weight, 1, 0.01);
    EXPECT_NEAR(values[p].velocity[0], 3 * places[2 * p + 1], 2e-5);
    EXPECT_NEAR(values[p].velocity[1], 5 * places[2 * p], 3e-5);
    EXPECT_NEAR(values[p].pressure, 100 + 1e4 * places[2 * p + 1], 0.1);
    EXPECT_NEAR(values[p].vorticity[2], 2, 0.05);
    EXPECT_EQ(values[p].vorticity[0], 0);
  }
}

TEST(ObserveFluid, OutsideThereIsNone) {
  const LinearFlow flow;
  const std::vector<FluidAtPoint> values =
      sample_fluid(flow.points(), std::vector<double>{0.05, 0.05});
  EXPECT_EQ(values.at(0).weight, 0);
  EXPECT_EQ(values.at(0).velocity[0], 0);
}

TEST(ObserveFluid, OverAPeriodicSeamItIsTheSame) {
  LinearFlow flow;
  for (std::size_t a = 0; a < flow.volume.size(); ++a) flow.v[2 * a] = flow.v[2 * a + 1] = 0.3;
  FluidPoints points = flow.points();
  points.period = {0.02, 0.02, 0};
  const auto values = sample_fluid(points, std::vector<double>{0.0, 0.01, 0.01, 0.01});
  EXPECT_NEAR(values[0].weight, values[1].weight, 1e-12);
  EXPECT_NEAR(values[0].velocity[0], 0.3, 1e-14);
}

TEST(ObserveFluid, LatticePointsAreCellCentres) {
  const std::vector<double> lower{1, 0}, upper{2, 1};
  EXPECT_THAT(lattice_points(2, lower, upper, 0.5),
              ElementsAre(1.25, 0.25, 1.75, 0.25, 1.25, 0.75, 1.75, 0.75));
}

TEST(ObserveDrag, NumbersOfALoneSphereInStokesFlow) {
  Scenario scenario;
  scenario.domain.dimension = 3;
  scenario.fluid.density = 1000;
  scenario.fluid.viscosity = 1;
  scenario.coupling.drag = Drag::stokes;
  const double d = 1e-3, slip = 1e-2, drag = 3 * 3.14159265358979323846 * 1 * d * slip;
  const DragNumbers numbers = drag_numbers(scenario, d, slip, 1, drag);
  EXPECT_NEAR(numbers.reynolds, 0.01, 1e-15);
  EXPECT_NEAR(numbers.coefficient, 24 / 0.01, 1e-9);
  EXPECT_NEAR(numbers.shielding, 1, 1e-12);
  EXPECT_NEAR(drag_numbers(scenario, d, slip, 1, 0.5 * drag).shielding, 0.5, 1e-12);
  EXPECT_EQ(drag_numbers(scenario, d, 0, 1, 0).coefficient, 0);
}

}  // namespace
}  // namespace varve::core
