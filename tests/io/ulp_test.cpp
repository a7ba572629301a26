#include "io/ulp.h"

#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace varve::io {
namespace {

__extension__ typedef __int128 Wide;

// Reference in 128-bit integers that takes a number apart by value, not by its bits: the position
// of |x| among the representable numbers from +0 upwards, negative numbers below -0 at -1.
template <class Real>
Wide position(Real x) {
  using Limits = std::numeric_limits<Real>;
  constexpr int mantissa_bits = Limits::digits - 1;
  constexpr Wide binade = Wide{1} << mantissa_bits;
  const Wide infinite = (Wide{Limits::max_exponent} - Limits::min_exponent + 2) * binade;
  Wide magnitude;
  if (std::isnan(x)) {
    using Bits = std::conditional_t<sizeof(Real) == 8, std::uint64_t, std::uint32_t>;
    magnitude =
        infinite + static_cast<Wide>(std::bit_cast<Bits>(x) & (static_cast<Bits>(binade) - 1));
  } else if (std::isinf(x)) {
    magnitude = infinite;
  } else {
    int exponent = 0;
    const Real fraction = std::frexp(std::abs(x), &exponent);
    const int biased = x == 0 ? 0 : exponent - Limits::min_exponent + 1;
    magnitude =
        biased > 0
            ? biased * binade + static_cast<Wide>(std::ldexp(fraction * 2 - 1, mantissa_bits))
            : static_cast<Wide>(std::ldexp(std::abs(x), mantissa_bits + 1 - Limits::min_exponent));
  }
  return std::signbit(x) ? -1 - magnitude : magnitude;
}

template <class Real>
std::uint64_t reference(Real a, Real b) {
  const Wide d = position(a) - position(b);
  return static_cast<std::uint64_t>(d < 0 ? -d : d);
}

template <class Real>
std::vector<Real> specials() {
  using L = std::numeric_limits<Real>;
  using Bits = std::conditional_t<sizeof(Real) == 8, std::uint64_t, std::uint32_t>;
  const Bits infinite = std::bit_cast<Bits>(L::infinity());
  std::vector<Real> out;
  for (const Real x :
       {Real{0}, L::denorm_min(), L::denorm_min() * 2, L::min() - L::denorm_min(), L::min(),
        std::nextafter(L::min(), Real{1}), Real(0.1), Real{1}, 1 + L::epsilon(),
        std::nextafter(Real{1}, Real{0}), Real{2}, Real{4294967296.0}, Real(4503599627370496.0),
        L::max(), L::infinity(), L::quiet_NaN(), L::signaling_NaN(),
        std::bit_cast<Real>(static_cast<Bits>(infinite + 1)),
        std::bit_cast<Real>(static_cast<Bits>(~Bits{0} >> 1))}) {
    out.push_back(x);
    out.push_back(-x);
  }
  return out;
}

TEST(Ulp, EqualBitsAreZeroApartAndNothingElseIs) {
  for (const double a : specials<double>())
    for (const double b : specials<double>())
      EXPECT_EQ(ulp_distance(a, b) == 0,
                std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b));
}

TEST(Ulp, SpecialsOfBothWidthsEqualTheReference) {
  for (const double a : specials<double>())
    for (const double b : specials<double>()) {
      EXPECT_EQ(ulp_distance(a, b), reference(a, b)) << a << ' ' << b;
      EXPECT_EQ(ulp_distance(a, b), ulp_distance(b, a));
    }
  for (const float a : specials<float>())
    for (const float b : specials<float>()) {
      EXPECT_EQ(ulp_distance(a, b), reference(a, b)) << a << ' ' << b;
      EXPECT_EQ(ulp_distance(a, b), ulp_distance(b, a));
    }
}

TEST(Ulp, KnownDistances) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(ulp_distance(1.0, std::nextafter(1.0, 2.0)), 1u);
  EXPECT_EQ(ulp_distance(-0.0, 0.0), 1u);
  EXPECT_EQ(ulp_distance(-5e-324, 5e-324), 3u);
  EXPECT_EQ(ulp_distance(1.0, 2.0), std::uint64_t{1} << 52) << "a 32-bit distance would be 0 here";
  EXPECT_EQ(ulp_distance(std::numeric_limits<double>::max(), infinity), 1u);
  EXPECT_EQ(ulp_distance(-infinity, infinity), 2 * (std::uint64_t{0x7ff} << 52) + 1);
  EXPECT_EQ(ulp_distance(1.0f, 2.0f), std::uint64_t{1} << 23);
}

TEST(Ulp, TheTwoEndsOfTheOrderDoNotWrap) {
  const double lowest = std::bit_cast<double>(~std::uint64_t{0});
  const double highest = std::bit_cast<double>(~std::uint64_t{0} >> 1);
  EXPECT_EQ(ulp_distance(lowest, highest), ~std::uint64_t{0});
  EXPECT_EQ(ulp_distance(std::bit_cast<float>(~std::uint32_t{0}),
                         std::bit_cast<float>(~std::uint32_t{0} >> 1)),
            std::uint64_t{0xffffffff});
}

TEST(Ulp, OrderedBitsGrowWithTheValue) {
  float x = -std::numeric_limits<float>::infinity();
  std::uint32_t last = ordered_bits(x);
  for (int i = 0; !std::isinf(x) || x < 0; ++i) {
    const float next = std::nextafter(x, std::numeric_limits<float>::infinity());
    // nextafter steps from -denorm_min to -0 and on to +denorm_min: the order has +0 between.
    const std::uint32_t steps = x == 0 ? 2u : 1u;
    ASSERT_EQ(ordered_bits(next), last + steps) << x;
    last += steps;
    // Visit every binade: a few neighbours, then a jump.
    x = next;
    if (i % 500 == 499 && std::isfinite(x)) {
      x = x < 0 ? x / 2 : x * 2;
      last = ordered_bits(x);
    }
  }
  EXPECT_GT(x, 0.0f);
}

// Half of the pairs are any bits at all, half are near one another.
TEST(Ulp, RandomPairsEqualTheReference) {
  const bool is_long = std::getenv("VARVE_LONG") != nullptr;
  const long pairs = is_long ? 100'000'000 : 1'000'000;
  std::mt19937_64 random(20240611);
  for (long i = 0; i < pairs; ++i) {
    const std::uint64_t bits = random();
    const double a = std::bit_cast<double>(bits);
    const std::uint64_t other = i % 2 == 0 ? random() : bits + (random() >> (random() % 64)) / 2;
    const double b = std::bit_cast<double>(other);
    ASSERT_EQ(ulp_distance(a, b), reference(a, b)) << std::hex << bits << ' ' << other;
    const float c = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    const float d = std::bit_cast<float>(static_cast<std::uint32_t>(other));
    ASSERT_EQ(ulp_distance(c, d), reference(c, d)) << std::hex << bits << ' ' << other;
  }
}

}  // namespace
}  // namespace varve::io
