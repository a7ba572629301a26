// Candidate lists against brute force: every awkward place of points, borders and periods.
#include "core/neighbors.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/fluid_lists.h"
#include "core/random.h"

namespace varve::core {
namespace {

template <int D, class T>
using Points = std::vector<Vec<T, D>>;

template <int D, class T>
double distance2(const Vec<T, D>& a, const Vec<T, D>& b, const Periodicity<D>& period) {
  double r2 = 0;
  for (int k = 0; k < D; ++k) {
    double d = static_cast<double>(a[k]) - static_cast<double>(b[k]);
    if (period.length[k] > 0) d -= period.length[k] * std::round(d / period.length[k]);
    r2 += d * d;
  }
  return r2;
}

template <int D, class T>
std::vector<std::vector<std::int32_t>> brute_force(const Points<D, T>& from, const Points<D, T>& to,
                                                   double radius, const Periodicity<D>& period,
                                                   bool same) {
  std::vector<std::vector<std::int32_t>> rows(from.size());
  for (std::size_t i = 0; i < from.size(); ++i)
    for (std::size_t j = 0; j < to.size(); ++j)
      if (!(same && i == j) && distance2<D, T>(from[i], to[j], period) < radius * radius)
        rows[i].push_back(static_cast<std::int32_t>(j));
  return rows;
}

template <int D, class T>
std::vector<std::vector<std::int32_t>> by_cells(const Points<D, T>& from, const Points<D, T>& to,
                                                double radius, const Periodicity<D>& period,
                                                bool same, unsigned threads = 1,
                                                InstructionSet set = best_instruction_set()) {
  Workers workers(threads);
  CellGrid<D, T> grid;
  grid.build(std::span<const Vec<T, D>>(to), radius, period, workers);
  const Rows rows = candidates<D, T>(std::span<const Vec<T, D>>(from), grid, radius, period, same,
                                     workers, set);
  std::vector<std::vector<std::int32_t>> lists(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    const auto row = rows.of(i);
    lists[i].assign(row.begin(), row.end());
  }
  return lists;
}

template <int D, class T>
void expect_equal_to_brute_force(const Points<D, T>& points, double radius,
                                 const Periodicity<D>& period, const std::string& what) {
  const auto expected = brute_force<D, T>(points, points, radius, period, true);
  for (const auto set : {InstructionSet::baseline, InstructionSet::v3, InstructionSet::v4}) {
    if (set > best_instruction_set()) continue;
    EXPECT_EQ((by_cells<D, T>(points, points, radius, period, true, 1, set)), expected)
        << what << ", D " << D << ", size of a coordinate " << sizeof(T) << ", "
        << name_of(set);
  }
}

template <int D, class T>
Points<D, T> random_points(std::size_t count, double extent, std::uint64_t seed) {
  Points<D, T> points(count);
  for (std::size_t i = 0; i < count; ++i)
    for (int k = 0; k < D; ++k)
      points[i][k] =
          static_cast<T>(extent * uniform(seed, i, static_cast<std::uint64_t>(k)));
  return points;
}

template <int D>
Periodicity<D> periodic_along(std::initializer_list<int> axes, double length, double origin = 0) {
  Periodicity<D> period;
  for (const int axis : axes) {
    period.origin[axis] = origin;
    period.length[axis] = length;
  }
  return period;
}

template <class Case>
class Neighbors : public testing::Test {};

template <int D_, class T_>
struct Case {
  static constexpr int D = D_;
  using T = T_;
};
using Cases = testing::Types<Case<2, double>, Case<2, float>, Case<3, double>, Case<3, float>>;
TYPED_TEST_SUITE(Neighbors, Cases);

TYPED_TEST(Neighbors, OfRandomPointsAreThoseOfBruteForce) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  for (const double radius : {0.03, 0.11, 0.26, 0.9, 2.0})
    expect_equal_to_brute_force<D, T>(random_points<D, T>(300, 1.0, 7), radius, {},
                                      "radius " + std::to_string(radius));
}

TYPED_TEST(Neighbors, AcrossPeriodicSeamsAreFoundOnce) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  const auto points = random_points<D, T>(300, 1.0, 3);
  // Cells along the period: many, three, two, one.
  for (const double radius : {0.07, 0.33, 0.4, 0.5}) {
    const std::string what = "radius " + std::to_string(radius);
    expect_equal_to_brute_force<D, T>(points, radius, periodic_along<D>({0}, 1.0), what + ", x");
    expect_equal_to_brute_force<D, T>(points, radius, periodic_along<D>({1}, 1.0), what + ", y");
    expect_equal_to_brute_force<D, T>(points, radius, periodic_along<D>({0, 1}, 1.0),
                                      what + ", x and y");
  }
}

TYPED_TEST(Neighbors, ADomainThatDoesNotStartAtZeroIsNoDifferent) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  auto points = random_points<D, T>(200, 1.0, 4);
  for (auto& x : points) x[0] -= T(0.5);
  expect_equal_to_brute_force<D, T>(points, 0.2, periodic_along<D>({0}, 1.0, -0.5), "origin -0.5");
}

TYPED_TEST(Neighbors, OnCellBordersSeamsAndCornersAreFoundOnce) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  // A lattice whose spacing divides the radius: every point lies on a border of the cells.
  Points<D, T> lattice;
  const int planes = D == 3 ? 5 : 1;
  for (int z = 0; z < planes; ++z)
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) {
        Vec<T, D> p = Vec<T, D>::Zero();
        p[0] = T(0.125) * T(x);
        p[1] = T(0.125) * T(y);
        if constexpr (D == 3) p[2] = T(0.125) * T(z);
        lattice.push_back(p);
      }
  for (const double radius : {0.125, 0.1250001, 0.25, 0.3}) {
    expect_equal_to_brute_force<D, T>(lattice, radius, {}, "lattice");
    expect_equal_to_brute_force<D, T>(lattice, radius, periodic_along<D>({0, 1}, 1.0),
                                      "periodic lattice");
  }
}

TYPED_TEST(Neighbors, CoincidentPointsSeeEachOtherButNotThemselves) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  Points<D, T> points(40, Vec<T, D>::Constant(T(0.25)));
  points.push_back(Vec<T, D>::Constant(T(0.9)));
  expect_equal_to_brute_force<D, T>(points, 0.1, {}, "forty on one spot");
  const auto lists = by_cells<D, T>(points, points, 0.1, {}, true);
  EXPECT_EQ(lists[7].size(), 39u);
  EXPECT_EQ(lists[40].size(), 0u);
}

TYPED_TEST(Neighbors, OfFewOrNoPoints) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  const Points<D, T> none, one{Vec<T, D>::Constant(T(1))}, two = random_points<D, T>(2, 0.1, 1);
  EXPECT_TRUE((by_cells<D, T>(none, none, 0.1, {}, true)).empty());
  EXPECT_THAT((by_cells<D, T>(one, one, 0.1, {}, true)), testing::ElementsAre(testing::IsEmpty()));
  EXPECT_THAT((by_cells<D, T>(one, none, 0.1, {}, false)),
              testing::ElementsAre(testing::IsEmpty()));
  EXPECT_THAT((by_cells<D, T>(one, one, 0.1, {}, false)),
              testing::ElementsAre(testing::ElementsAre(0)));
  expect_equal_to_brute_force<D, T>(two, 1.0, {}, "two");
}

TYPED_TEST(Neighbors, PointsOutsideTheOtherSetsBoundsFindTheirs) {
  // As dummies outside the walls look for fluid.
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  const auto inside = random_points<D, T>(200, 1.0, 5);
  auto outside = random_points<D, T>(200, 1.6, 6);
  for (auto& x : outside) x -= Vec<T, D>::Constant(T(0.3));
  EXPECT_EQ((by_cells<D, T>(outside, inside, 0.2, {}, false)),
            (brute_force<D, T>(outside, inside, 0.2, {}, false)));
}

TYPED_TEST(Neighbors, RunawaysAndNansHarmNobody) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  auto points = random_points<D, T>(100, 1.0, 8);
  points[17][0] = T(1e20);
  points[18][1] = T(-3e12);
  points[19][1] = std::numeric_limits<T>::quiet_NaN();
  points[20][0] = std::numeric_limits<T>::infinity();
  expect_equal_to_brute_force<D, T>(points, 0.2, {}, "runaways");
}

TYPED_TEST(Neighbors, DoNotDependOnTheNumberOfThreads) {
  constexpr int D = TypeParam::D;
  using T = typename TypeParam::T;
  const auto points = random_points<D, T>(1000, 1.0, 9);
  const auto alone = by_cells<D, T>(points, points, 0.12, {}, true);
  for (const unsigned threads : {2u, 3u, 4u, 8u})
    EXPECT_EQ((by_cells<D, T>(points, points, 0.12, {}, true, threads)), alone);
}

TEST(GroupedStorage, HoldsTheRowsInterleavedAndFillsShortLanes) {
  Rows rows;
  rows.start = {0};
  std::int32_t next = 100;
  const std::size_t lengths[] = {2, 0, 3, 1, 0, 0, 4, 1, /* second group */ 0, 2};
  for (const std::size_t length : lengths) {
    for (std::size_t k = 0; k < length; ++k) rows.index.push_back(next++);
    rows.start.push_back(static_cast<std::uint32_t>(rows.index.size()));
  }
  for (const Filler filler : {Filler::own_index, Filler::minus_one, Filler::one_past}) {
    GroupedStorage storage;
    Workers workers(2);
    storage.assign(rows, 10, filler, 777, workers);
    const GroupedLists view = storage.view();
    EXPECT_EQ(view.start[0], 0u);
    EXPECT_EQ(view.start[1], 4u);
    EXPECT_EQ(view.start[2], 6u);
    for (std::size_t i = 0; i < 10; ++i) {
      const std::size_t group = i / lanes, lane = i % lanes;
      const auto row = rows.of(i);
      for (std::uint32_t k = 0; k < view.start[group + 1] - view.start[group]; ++k) {
        const std::int32_t fill = filler == Filler::own_index   ? static_cast<std::int32_t>(i)
                                  : filler == Filler::minus_one ? -1
                                                                : 777;
        EXPECT_EQ(view.index[(view.start[group] + k) * lanes + lane],
                  k < row.size() ? row[k] : fill);
      }
    }
  }
}

TEST(FluidLists, AreStaleOnceAPointMovedByHalfTheSkinOrTheNumberChanged) {
  Workers workers(1);
  auto points = random_points<2, double>(50, 1.0, 2);
  const Points<2, double> walls{{0.5, -0.05}};
  FluidLists<2, double> lists;
  const double skin = 0.02;
  EXPECT_TRUE(lists.stale(points, skin, workers));
  lists.rebuild(points, walls, 0.2, skin, {}, false, workers);
  EXPECT_FALSE(lists.stale(points, skin, workers));
  points[31][1] += 0.49 * skin;
  EXPECT_FALSE(lists.stale(points, skin, workers));
  points[31][1] += 0.02 * skin;
  EXPECT_TRUE(lists.stale(points, skin, workers));
  lists.rebuild(points, walls, 0.2, skin, {}, false, workers);
  EXPECT_FALSE(lists.stale(points, skin, workers));
  points[3][0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(lists.stale(points, skin, workers));
  points[3][0] = 0.5;
  lists.rebuild(points, walls, 0.2, skin, {}, false, workers);
  points.pop_back();
  EXPECT_TRUE(lists.stale(points, skin, workers));
  points.push_back({0.1, 0.1});
  lists.rebuild(points, walls, 0.2, skin, {}, false, workers);
  lists.reset();
  EXPECT_TRUE(lists.stale(points, skin, workers));
}

/// The candidates of each point by index, from lists by place; those of the filler left out.
template <int D>
std::vector<std::vector<std::int32_t>> by_index(const FluidLists<D, double>& lists,
                                                std::size_t count) {
  std::vector<std::vector<std::int32_t>> rows(count);
  const GroupedLists fluid = lists.fluid();
  for (std::size_t a = 0; a < count; ++a) {
    const std::size_t place = lists.place_of(a), g = place / lanes, l = place % lanes;
    EXPECT_EQ(lists.index_at(static_cast<std::int32_t>(place)), a);
    for (std::uint32_t k = fluid.start[g]; k < fluid.start[g + 1]; ++k) {
      const std::int32_t other = fluid.index[std::size_t(k) * lanes + l];
      if (static_cast<std::size_t>(other) != place)
        rows[a].push_back(static_cast<std::int32_t>(lists.index_at(other)));
    }
  }
  return rows;
}

TEST(FluidLists, HoldTheSameInTheSameOrderOfIndicesInEitherOrderOfPlaces) {
  for (const unsigned threads : {1u, 3u}) {
    Workers workers(threads);
    const auto points = random_points<2, double>(700, 1.0, 5);
    const Points<2, double> walls{{0.5, -0.05}, {0.2, 1.02}};
    FluidLists<2, double> plain, ordered;
    plain.rebuild(points, walls, 0.1, 0.02, {}, false, workers);
    ordered.rebuild(points, walls, 0.1, 0.02, {}, true, workers);
    EXPECT_FALSE(plain.ordered());
    ASSERT_TRUE(ordered.ordered());
    EXPECT_EQ(by_index(plain, 700), by_index(ordered, 700));
    EXPECT_EQ(by_index(plain, 700),
              (brute_force<2, double>(points, points, 0.12, Periodicity<2>{}, true)));
    // Of dummies and, by place, beside them.
    for (std::size_t w = 0; w < walls.size(); ++w)
      EXPECT_THAT(ordered.fluid_near_wall(w), testing::ElementsAreArray(plain.fluid_near_wall(w)));
    std::vector<std::vector<bool>> near(2, std::vector<bool>(700 * walls.size(), false));
    for (const FluidLists<2, double>* lists : {&plain, &ordered})
      for (std::size_t place = 0; place < 700; ++place) {
        const GroupedLists beside = lists->walls();
        const std::size_t g = place / lanes;
        for (std::uint32_t k = beside.start[g]; k < beside.start[g + 1]; ++k) {
          const std::int32_t w = beside.index[std::size_t(k) * lanes + place % lanes];
          if (static_cast<std::size_t>(w) < walls.size())
            near[lists == &plain ? 0 : 1][lists->index_at(static_cast<std::int32_t>(place)) *
                                              walls.size() +
                                          static_cast<std::size_t>(w)] = true;
        }
      }
    EXPECT_EQ(near[0], near[1]);
    EXPECT_THAT(near[0], testing::Contains(true));
  }
}

TEST(FluidLists, AreOrderedOnceNeighboursAreScatteredOverTheMemory) {
  Workers workers(2);
  const Points<2, double> walls;
  // 20,000 points of a lattice, row by row, and the same stirred.
  Points<2, double> lattice, stirred;
  for (std::size_t i = 0; i < 20000; ++i)
    lattice.push_back({0.01 * static_cast<double>(i % 200), 0.01 * static_cast<double>(i / 200)});
  stirred = lattice;
  for (std::size_t i = stirred.size(); i-- > 1;)
    std::swap(stirred[i], stirred[random_bits(3, i, 0) % (i + 1)]);
  FluidLists<2, double> lists;
  lists.rebuild(lattice, walls, 0.025, 0.003, {}, false, workers);
  EXPECT_FALSE(lists.ordered());
  lists.rebuild(stirred, walls, 0.025, 0.003, {}, false, workers);
  EXPECT_TRUE(lists.ordered());
  lists.rebuild(lattice, walls, 0.025, 0.003, {}, false, workers);
  EXPECT_FALSE(lists.ordered());
}

}  // namespace
}  // namespace varve::core
