#include "core/random.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <set>

namespace varve::core {
namespace {

TEST(Random, IsAPureFunctionWithPinnedBits) {
  // On disk in every log of a jittered scene: these never change.
  static_assert(random_bits(1, 0, 0) == random_bits(1, 0, 0));
  EXPECT_EQ(random_bits(0, 0, 0), 0x6d7b157700eef977u);
  EXPECT_EQ(random_bits(1, 2, 3), 0x384ec0a8d40af01eu);
  EXPECT_EQ(random_bits(~0ull, 1ull << 40, 7), 0x1c0790b90e481d29u);
}

TEST(Random, StaysInItsRange) {
  for (std::uint64_t i = 0; i < 100000; ++i) {
    EXPECT_GE(uniform(1, i, 0), 0);
    EXPECT_LT(uniform(1, i, 0), 1);
    EXPECT_GE(symmetric(1, i, 1), -1);
    EXPECT_LT(symmetric(1, i, 1), 1);
  }
}

TEST(Random, IsUniform) {
  constexpr int bins = 64, n = 64000;
  int count[bins] = {};
  double mean = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    const double u = uniform(42, i, 0);
    ++count[static_cast<int>(u * bins)];
    mean += u / n;
  }
  EXPECT_NEAR(mean, 0.5, 5 * std::sqrt(1.0 / 12 / n));
  double chi2 = 0;
  for (int c : count) chi2 += (c - 1000.0) * (c - 1000.0) / 1000.0;
  EXPECT_LT(chi2, 63 + 5 * std::sqrt(2.0 * 63));
  EXPECT_GT(chi2, 63 - 5 * std::sqrt(2.0 * 63));
}

/// Correlation of two sequences of draws, which should vanish like 1 / sqrt n.
template <class F, class G>
double correlation(F&& f, G&& g) {
  constexpr int n = 20000;
  double sum = 0;
  for (std::uint64_t i = 0; i < n; ++i) sum += f(i) * g(i) * 3;
  return sum / n * std::sqrt(static_cast<double>(n));
}

TEST(Random, NeighbouringIdsDrawsAndSeedsAreUnrelated) {
  const auto base = [](std::uint64_t i) { return symmetric(5, i, 0); };
  EXPECT_LT(std::abs(correlation(base, [](std::uint64_t i) { return symmetric(5, i + 1, 0); })), 5);
  EXPECT_LT(std::abs(correlation(base, [](std::uint64_t i) { return symmetric(5, i, 1); })), 5);
  EXPECT_LT(std::abs(correlation(base, [](std::uint64_t i) { return symmetric(6, i, 0); })), 5);
  EXPECT_LT(std::abs(correlation(base, [](std::uint64_t i) { return symmetric(i, 5, 0); })), 5);
  EXPECT_LT(std::abs(correlation(base, [](std::uint64_t i) { return symmetric(5, 0, i); })), 5);
}

TEST(Random, DoesNotRepeatOverSeedsIdsAndDraws) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t s = 0; s < 20; ++s)
    for (std::uint64_t i = 0; i < 100; ++i)
      for (std::uint64_t k = 0; k < 10; ++k) seen.insert(random_bits(s, i, k));
  EXPECT_EQ(seen.size(), 20u * 100 * 10);
}

TEST(Random, ChangesHalfTheBitsForOneBitOfInput) {
  double flips = 0;
  int n = 0;
  for (std::uint64_t i = 0; i < 50; ++i)
    for (int b = 0; b < 64; ++b, ++n)
      flips += std::popcount(random_bits(3, i, 0) ^ random_bits(3, i ^ (1ull << b), 0));
  EXPECT_NEAR(flips / n, 32, 0.5);
}

}  // namespace
}  // namespace varve::core
