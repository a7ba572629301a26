// The project's own elementary functions against a reference of much higher precision: MPFR at 200
// bits, or where that is not installed the C library's long double with a looser bound.
#include "core/math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/random.h"

#ifdef VARVE_HAVE_MPFR
#include <mpfr.h>
#endif

namespace varve::core {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr int samples = 20000;

/// Spacing of doubles around x, that of the subnormals at the bottom.
double ulp_at(double x) {
  int exponent = 0;
  std::frexp(x, &exponent);
  return std::ldexp(1.0, std::max(exponent - 53, -1074));
}

#ifdef VARVE_HAVE_MPFR
constexpr double slack = 0.0;
class Reference {
 public:
  Reference() { mpfr_inits2(200, x_, y_, r_, static_cast<mpfr_ptr>(nullptr)); }
  ~Reference() { mpfr_clears(x_, y_, r_, static_cast<mpfr_ptr>(nullptr)); }
  Reference(const Reference&) = delete;
  Reference& operator=(const Reference&) = delete;

  using Unary = int (*)(mpfr_ptr, mpfr_srcptr, mpfr_rnd_t);
  double error(Unary f, double x, double got) {
    mpfr_set_d(x_, x, MPFR_RNDN);
    f(r_, x_, MPFR_RNDN);
    return in_ulps(got);
  }
  double error_of_pow(double x, double y, double got) {
    mpfr_set_d(x_, x, MPFR_RNDN);
    mpfr_set_d(y_, y, MPFR_RNDN);
    mpfr_pow(r_, x_, y_, MPFR_RNDN);
    return in_ulps(got);
  }

 private:
  double in_ulps(double got) {
    const double nearest = mpfr_get_d(r_, MPFR_RNDN);
    mpfr_sub_d(r_, r_, got, MPFR_RNDN);
    return std::abs(mpfr_get_d(r_, MPFR_RNDN)) / ulp_at(nearest);
  }
  mpfr_t x_, y_, r_;
};
#define REFERENCE(name) mpfr_##name
#else
constexpr double slack = 1.0;
class Reference {
 public:
  using Unary = long double (*)(long double);
  double error(Unary f, double x, double got) { return in_ulps(f(x), got); }
  double error_of_pow(double x, double y, double got) {
    return in_ulps(std::pow(static_cast<long double>(x), static_cast<long double>(y)), got);
  }

 private:
  static double in_ulps(long double exact, double got) {
    return static_cast<double>(std::abs(exact - got)) / ulp_at(static_cast<double>(exact));
  }
};
#define REFERENCE(name) [](long double x) { return std::name(x); }
#endif

/// Largest error in ulp over random points of [low, high].
double worst(double (*f)(double), Reference::Unary exact, double low, double high) {
  Reference reference;
  double most = 0;
  for (int i = 0; i < samples; ++i) {
    const double x = low + (high - low) * uniform(7, static_cast<std::uint64_t>(i), 0);
    const double error = reference.error(exact, x, f(x));
    if (!(error <= most)) most = error;
  }
  return most;
}

/// The same over points spread evenly in the logarithm, e^low to e^high.
double worst_over_scales(double (*f)(double), Reference::Unary exact, double low, double high) {
  Reference reference;
  double most = 0;
  for (int i = 0; i < samples; ++i) {
    const double x = std::exp(low + (high - low) * uniform(8, static_cast<std::uint64_t>(i), 0));
    const double error = reference.error(exact, x, f(x));
    if (!(error <= most)) most = error;
  }
  return most;
}

TEST(Exp, IsWithinOneUlp) {
  EXPECT_LE(worst(exp, REFERENCE(exp), -1, 1), 1 + slack);
  EXPECT_LE(worst(exp, REFERENCE(exp), -40, 40), 1 + slack);
  EXPECT_LE(worst(exp, REFERENCE(exp), -708, 709.7), 1 + slack);
}

TEST(Exp, IsWithinTwoUlpWhereSubnormal) {
  EXPECT_LE(worst(exp, REFERENCE(exp), -745, -708.4), 2 + slack);
}

TEST(Exp, HasItsLimits) {
  EXPECT_EQ(exp(0), 1);
  EXPECT_EQ(exp(-0.0), 1);
  EXPECT_EQ(exp(710), infinity);
  EXPECT_EQ(exp(infinity), infinity);
  EXPECT_EQ(exp(-746), 0);
  EXPECT_EQ(exp(-infinity), 0);
  EXPECT_GT(exp(-745), 0);
  EXPECT_LT(exp(709.78), infinity);
  EXPECT_TRUE(std::isnan(exp(std::nan(""))));
}

TEST(Log, IsWithinOneUlp) {
  EXPECT_LE(worst(log, REFERENCE(log), 0.5, 2), 1 + slack);
  EXPECT_LE(worst(log, REFERENCE(log), 0.999, 1.001), 1 + slack);
  EXPECT_LE(worst_over_scales(log, REFERENCE(log), -740, 709), 1 + slack);
}

TEST(Log, HasItsLimits) {
  EXPECT_EQ(log(1), 0);
  EXPECT_EQ(log(0), -infinity);
  EXPECT_EQ(log(infinity), infinity);
  EXPECT_TRUE(std::isnan(log(-1)));
  EXPECT_TRUE(std::isnan(log(std::nan(""))));
}

TEST(Log10, IsWithinOneUlp) {
  EXPECT_LE(worst(log10, REFERENCE(log10), 0.5, 2), 1 + slack);
  EXPECT_LE(worst_over_scales(log10, REFERENCE(log10), -740, 709), 1 + slack);
}

TEST(Log10, OfPowersOfTenIsWhole) {
  double power = 1;
  for (int n = 0; n <= 22; ++n, power *= 10) EXPECT_EQ(log10(power), n);
}

/// y chosen so that |y ln x| <= reach.
double worst_pow(double reach) {
  Reference reference;
  double most = 0;
  for (int i = 0; i < samples; ++i) {
    const auto id = static_cast<std::uint64_t>(i);
    const bool near_one = i % 3 == 0;
    const double x = near_one ? 1 + 0.5 * symmetric(9, id, 0) : std::exp(30 * symmetric(9, id, 0));
    const double y = reach * symmetric(9, id, 1) / std::log(x);
    const double error = reference.error_of_pow(x, y, pow(x, y));
    if (!(error <= most)) most = error;
  }
  return most;
}

TEST(Pow, IsWithinOneUlpInTheWholeRange) {
  EXPECT_LE(worst_pow(1), 1 + slack);
  EXPECT_LE(worst_pow(30), 1 + slack);
  EXPECT_LE(worst_pow(708), 1 + slack);
}

TEST(Pow, HasItsLimits) {
  EXPECT_EQ(pow(0, 0), 1);
  EXPECT_EQ(pow(0, 2), 0);
  EXPECT_EQ(pow(0, -2), infinity);
  EXPECT_EQ(pow(infinity, 0.5), infinity);
  EXPECT_EQ(pow(infinity, -0.5), 0);
  EXPECT_EQ(pow(1, infinity), 1);
  EXPECT_EQ(pow(2, 1024), infinity);
  EXPECT_EQ(pow(2, -1080), 0);
  EXPECT_EQ(pow(3, 1e-300), 1);
  EXPECT_TRUE(std::isnan(pow(-1, 2)));
  EXPECT_TRUE(std::isnan(pow(2, std::nan(""))));
}

TEST(Pow, OfWholeExponentsIsExactWhereRepresentable) {
  EXPECT_EQ(pow(2, 10), 1024);
  EXPECT_EQ(pow(10, 15), 1e15);
  EXPECT_EQ(pow(3, 3), 27);
  EXPECT_EQ(pow(4, 0.5), 2);
  EXPECT_EQ(pow(2, -1074), 0x1p-1074);
}

TEST(SinCos, AreWithinOneUlp) {
  EXPECT_LE(worst(sin, REFERENCE(sin), -4, 4), 1 + slack);
  EXPECT_LE(worst(cos, REFERENCE(cos), -4, 4), 1 + slack);
  EXPECT_LE(worst(sin, REFERENCE(sin), -1e5, 1e5), 1 + slack);
  EXPECT_LE(worst(cos, REFERENCE(cos), -1e5, 1e5), 1 + slack);
}

TEST(SinCos, NearTheirZerosKeepAllDigits) {
  Reference reference;
  for (int n = 1; n < 30000; n = n * 3 + 1) {
    const double half_turns = n * pi, quarter = (n + 0.5) * pi;
    EXPECT_LE(reference.error(REFERENCE(sin), half_turns, sin(half_turns)), 1 + slack) << n;
    EXPECT_LE(reference.error(REFERENCE(cos), quarter, cos(quarter)), 1 + slack) << n;
  }
}

TEST(SinCos, HaveTheirLimits) {
  EXPECT_EQ(sin(0), 0);
  EXPECT_TRUE(std::signbit(sin(-0.0)));
  EXPECT_EQ(cos(0), 1);
  EXPECT_EQ(sin(1e-300), 1e-300);
  EXPECT_TRUE(std::isnan(sin(1.1e5)));
  EXPECT_TRUE(std::isnan(cos(infinity)));
  EXPECT_EQ(sin(-0.3), -sin(0.3));
  EXPECT_EQ(cos(-0.3), cos(0.3));
}

TEST(IntegerPower, MultipliesInAFixedOrder) {
  const double x = 1.1;
  EXPECT_EQ(integer_power<0>(x), 1);
  EXPECT_EQ(integer_power<1>(x), x);
  EXPECT_EQ(integer_power<4>(x), (x * x) * (x * x));
  EXPECT_EQ(integer_power<5>(x), x * ((x * x) * (x * x)));
}

TEST(NearestInteger, RoundsHalvesAwayFromZero) {
  EXPECT_EQ(nearest_integer(2.5), 3);
  EXPECT_EQ(nearest_integer(-2.5), -3);
  EXPECT_EQ(nearest_integer(2.4999), 2);
  EXPECT_EQ(nearest_integer(0.49999999999999994), 0);
  EXPECT_EQ(nearest_integer(4503599627370497.0), 4503599627370497);
}

}  // namespace
}  // namespace varve::core
