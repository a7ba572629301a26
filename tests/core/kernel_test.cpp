#include "core/kernel.h"

#include <gtest/gtest.h>

#include <cmath>

namespace varve::core {
namespace {

template <int D_, Kernel K_>
struct Case {
  static constexpr int D = D_;
  static constexpr Kernel K = K_;
  using Smoothing = SmoothingKernel<D_, K_>;
};

template <class C>
class EveryKernel : public testing::Test {};
using Cases = testing::Types<Case<2, Kernel::wendland_c2>, Case<3, Kernel::wendland_c2>,
                             Case<2, Kernel::cubic>, Case<3, Kernel::cubic>,
                             Case<2, Kernel::quintic>, Case<3, Kernel::quintic>>;
TYPED_TEST_SUITE(EveryKernel, Cases);

/// Integral of f(r) over D-dimensional space out to `radius`, by the midpoint rule.
template <int D, class F>
double integral(double radius, F&& f) {
  constexpr int parts = 20000;
  double sum = 0;
  for (int i = 0; i < parts; ++i) {
    const double r = (i + 0.5) * radius / parts;
    sum += f(r) * (D == 2 ? 2 * pi * r : 4 * pi * r * r);
  }
  return sum * radius / parts;
}

TYPED_TEST(EveryKernel, IsNormalised) {
  const typename TypeParam::Smoothing kernel(0.7);
  const double whole =
      integral<TypeParam::D>(kernel.support(), [&](double r) { return kernel.value(r); });
  EXPECT_NEAR(whole, 1, 1e-7);
}

TYPED_TEST(EveryKernel, EndsAtItsSupport) {
  const double h = 0.3;
  const typename TypeParam::Smoothing kernel(h);
  const double support = support_ratio(TypeParam::K) * h;
  EXPECT_DOUBLE_EQ(kernel.support(), support);
  EXPECT_GT(kernel.value(0.99 * support), 0);
  EXPECT_LT(kernel.slope(0.99 * support), 0);
  for (double beyond : {1.0001, 1.5, 10.0, 1e6}) {
    EXPECT_EQ(kernel.value(beyond * support), 0);
    EXPECT_EQ(kernel.slope(beyond * support), 0);
  }
}

TYPED_TEST(EveryKernel, FallsMonotonically) {
  const typename TypeParam::Smoothing kernel(1);
  double last = kernel.value(0);
  for (double r = 0.01; r < kernel.support(); r += 0.01) {
    EXPECT_LT(kernel.value(r), last);
    EXPECT_LT(kernel.slope(r), 0);
    last = kernel.value(r);
  }
}

TYPED_TEST(EveryKernel, SlopeIsTheDerivativeOverR) {
  const double h = 0.4, step = 1e-6;
  const typename TypeParam::Smoothing kernel(h);
  const double scale = kernel.value(0) / h;
  for (double r = 0.005; r < 1.05 * kernel.support(); r += 0.0071) {
    const double derivative = (kernel.value(r + step) - kernel.value(r - step)) / (2 * step);
    EXPECT_NEAR(kernel.slope(r) * r, derivative, 1e-7 * scale) << "r = " << r;
  }
}

TYPED_TEST(EveryKernel, SlopeIsFiniteAndContinuousAtZero) {
  const typename TypeParam::Smoothing kernel(1);
  EXPECT_TRUE(std::isfinite(kernel.slope(0)));
  EXPECT_LT(kernel.slope(0), 0);
  EXPECT_NEAR(kernel.slope(1e-9), kernel.slope(0), 1e-6 * std::abs(kernel.slope(0)));
}

TYPED_TEST(EveryKernel, PiecesMeet) {
  const typename TypeParam::Smoothing kernel(1);
  for (double knot : {1.0, 2.0}) {
    const double w = kernel.value(0), below = std::nextafter(knot, 0),
                 above = std::nextafter(knot, 9);
    EXPECT_NEAR(kernel.value(below), kernel.value(above), 1e-14 * w);
    EXPECT_NEAR(kernel.slope(below), kernel.slope(above), 1e-13 * w);
  }
}

/// Sum of f over the sites of a lattice with spacing 1 around a point that is on no site.
template <int D, class F>
double lattice_sum(double radius, F&& f) {
  const int n = static_cast<int>(std::ceil(radius)) + 1;
  double sum = 0;
  for (int k = D == 3 ? -n : 0; k <= (D == 3 ? n : 0); ++k)
    for (int j = -n; j <= n; ++j)
      for (int i = -n; i <= n; ++i) {
        const double x = i - 0.31, y = j - 0.17, z = D == 3 ? k - 0.43 : 0;
        sum += f(x, std::sqrt(x * x + y * y + z * z));
      }
  return sum;
}

TYPED_TEST(EveryKernel, SumsToOneOverALattice) {
  const typename TypeParam::Smoothing kernel(2);
  const double sum = lattice_sum<TypeParam::D>(kernel.support(),
                                               [&](double, double r) { return kernel.value(r); });
  EXPECT_NEAR(sum, 1, 2e-3);
}

TYPED_TEST(EveryKernel, GradientSumsReproduceALinearField) {
  const typename TypeParam::Smoothing kernel(2);
  // sum_b V_b (x_b - x_a) grad_x W with grad_a W = F (x_a - x_b) is 1 in the continuum.
  const double sum = lattice_sum<TypeParam::D>(
      kernel.support(), [&](double x, double r) { return -x * x * kernel.slope(r); });
  EXPECT_NEAR(sum, 1, 2e-2);
}

TYPED_TEST(EveryKernel, FloatFollowsDouble) {
  const typename TypeParam::Smoothing kernel(1.25e-3);
  const SmoothingKernel<TypeParam::D, TypeParam::K, float> single(1.25e-3);
  for (double r = 0; r < kernel.support(); r += 1e-4) {
    EXPECT_NEAR(single.value(static_cast<float>(r)) / kernel.value(0),
                kernel.value(r) / kernel.value(0), 2e-6);
    EXPECT_NEAR(single.slope(static_cast<float>(r)) / kernel.slope(0),
                kernel.slope(r) / kernel.slope(0), 2e-6);
  }
}

TEST(WendlandC2, HasItsTabulatedValues) {
  const SmoothingKernel<2, Kernel::wendland_c2> two(1);
  const SmoothingKernel<3, Kernel::wendland_c2> three(1);
  const double q[] = {0, 0.5, 1, 1.5};
  const double w2[] = {0.557042, 0.352503, 0.104445, 0.008704};
  const double w3[] = {0.417782, 0.264377, 0.078334, 0.006528};
  const double d2[] = {0, -0.587506, -0.348151, -0.065278};
  const double d3[] = {0, -0.440629, -0.261114, -0.048959};
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(two.value(q[i]), w2[i], 6e-7);
    EXPECT_NEAR(three.value(q[i]), w3[i], 6e-7);
    EXPECT_NEAR(two.slope(q[i]) * q[i], d2[i], 6e-7);
    EXPECT_NEAR(three.slope(q[i]) * q[i], d3[i], 6e-7);
  }
}

TEST(Cubic, HasItsTabulatedValues) {
  const SmoothingKernel<2, Kernel::cubic> two(1);
  const SmoothingKernel<3, Kernel::cubic> three(1);
  const double q[] = {0, 0.5, 1, 1.5};
  const double w2[] = {0.454728, 0.326836, 0.113682, 0.014210};
  const double w3[] = {0.318310, 0.228785, 0.079577, 0.009947};
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(two.value(q[i]), w2[i], 6e-7);
    EXPECT_NEAR(three.value(q[i]), w3[i], 6e-7);
  }
}

TEST(Quintic, HasItsValueAtZero) {
  // 3^5 - 6 2^5 + 15 = 66.
  EXPECT_NEAR((SmoothingKernel<2, Kernel::quintic>(1).value(0)), 66 * 7 / (478 * pi), 1e-15);
  EXPECT_NEAR((SmoothingKernel<3, Kernel::quintic>(1).value(0)), 66 / (120 * pi), 1e-15);
}

TEST(WendlandC2, HasItsIntegrals) {
  const SmoothingKernel<2, Kernel::wendland_c2> two(1);
  const SmoothingKernel<3, Kernel::wendland_c2> three(1);
  EXPECT_NEAR(integral<2>(2, [&](double r) { return two.value(r) * two.value(r); }), 0.275708,
              1e-6);
  EXPECT_NEAR(integral<3>(2, [&](double r) { return three.value(r) * three.value(r); }), 0.149973,
              1e-6);
  EXPECT_NEAR(integral<2>(2, [&](double r) { return two.value(r) * r * r / 2; }), 0.277778, 1e-6);
  EXPECT_NEAR(integral<3>(2, [&](double r) { return three.value(r) * r * r / 3; }), 0.266667, 1e-6);
}

}  // namespace
}  // namespace varve::core
