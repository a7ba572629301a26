// Smoothing kernels W(r, h) = sigma / h^D f(q), q = r / h, and their slopes, for pair loops.
//
//   Wendland C2 (q <= 2)  f = (1 - q/2)^4 (2 q + 1)      f'/q = -5 (1 - q/2)^3
//                         sigma = 7/(4 pi) in 2D, 21/(16 pi) in 3D          (Wendland 1995)
//   cubic (q <= 2)        f = 1 - 3/2 q^2 + 3/4 q^3 (q < 1), (2 - q)^3 / 4
//                         sigma = 10/(7 pi), 1/pi                           (Monaghan 1992)
//   quintic (q <= 3)      f = (3-q)^5 - 6 (2-q)^5 + 15 (1-q)^5, terms with a positive base only
//                         sigma = 7/(478 pi), 1/(120 pi)                   (Morris et al. 1997)
//
// The slope is given as F = (dW/dr) / r, so that grad_a W_ab = F (r_a - r_b) without a division and
// without a special case at r = 0. Beyond the support both are exactly 0, by max(0, .) rather than
// by a branch, so that pair loops vectorise.
#pragma once

#include "core/kernel_names.h"
#include "core/math.h"

namespace varve::core {

/// Support radius over smoothing length.
constexpr double support_ratio(Kernel kernel) { return kernel == Kernel::quintic ? 3.0 : 2.0; }

template <int D, Kernel K>
constexpr double kernel_sigma() {
  static_assert(D == 2 || D == 3);
  if constexpr (K == Kernel::wendland_c2) return D == 2 ? 7.0 / (4.0 * pi) : 21.0 / (16.0 * pi);
  if constexpr (K == Kernel::cubic) return D == 2 ? 10.0 / (7.0 * pi) : 1.0 / pi;
  if constexpr (K == Kernel::quintic) return D == 2 ? 7.0 / (478.0 * pi) : 1.0 / (120.0 * pi);
}

/// A kernel with its smoothing length h [m]. Real is the type of pair sums.
template <int D, Kernel K, class Real = double>
class SmoothingKernel {
 public:
  explicit constexpr SmoothingKernel(double h)
      : support_(static_cast<Real>(support_ratio(K) * h)),
        inverse_h_(static_cast<Real>(1.0 / h)),
        value_factor_(static_cast<Real>(kernel_sigma<D, K>() / integer_power<D>(h))),
        slope_factor_(static_cast<Real>(kernel_sigma<D, K>() / integer_power<D + 2>(h))) {}

  /// Radius [m] beyond which W and F are 0.
  constexpr Real support() const { return support_; }

  /// W [1/m^D] at distance r [m] >= 0.
  constexpr Real value(Real r) const { return value_factor_ * shape(r * inverse_h_); }

  /// F = (dW/dr) / r [1/m^(D+2)], never positive, finite at r = 0.
  constexpr Real slope(Real r) const { return slope_factor_ * slope_shape(r * inverse_h_); }

  /// f(q).
  static constexpr Real shape(Real q) {
    if constexpr (K == Kernel::wendland_c2) {
      const Real s = positive(Real(1) - Real(0.5) * q);
      const Real s2 = s * s;
      return s2 * s2 * (Real(2) * q + Real(1));
    } else if constexpr (K == Kernel::cubic) {
      const Real a = positive(Real(2) - q), b = positive(Real(1) - q);
      return Real(0.25) * (a * a * a) - b * b * b;
    } else {
      const Real a = positive(Real(3) - q), b = positive(Real(2) - q), c = positive(Real(1) - q);
      return fifth(a) - Real(6) * fifth(b) + Real(15) * fifth(c);
    }
  }

  /// f'(q) / q.
  static constexpr Real slope_shape(Real q) {
    if constexpr (K == Kernel::wendland_c2) {
      const Real s = positive(Real(1) - Real(0.5) * q);
      return Real(-5) * (s * s * s);
    } else if constexpr (K == Kernel::cubic) {
      const Real a = positive(Real(2) - q);
      const Real inner = Real(-3) + Real(2.25) * q;
      const Real outer = Real(-0.75) * (a * a) / at_least_one(q);
      return q < Real(1) ? inner : outer;
    } else {
      const Real a = positive(Real(3) - q), b = positive(Real(2) - q);
      const Real inner = Real(-5) * (Real(24) + q * q * (Real(10) * q - Real(24)));
      const Real outer = Real(-5) * (fourth(a) - Real(6) * fourth(b)) / at_least_one(q);
      return q < Real(1) ? inner : outer;
    }
  }

 private:
  static constexpr Real positive(Real x) { return x > Real(0) ? x : Real(0); }
  static constexpr Real at_least_one(Real x) { return x > Real(1) ? x : Real(1); }
  static constexpr Real fourth(Real x) { return (x * x) * (x * x); }
  static constexpr Real fifth(Real x) { return fourth(x) * x; }

  Real support_, inverse_h_, value_factor_, slope_factor_;
};

/// F = (dW/dr) / r of a kernel chosen at run time: for passes that are not hot.
template <int D>
double kernel_slope_of(Kernel kernel, double h, double r) {
  if (kernel == Kernel::cubic) return SmoothingKernel<D, Kernel::cubic>(h).slope(r);
  if (kernel == Kernel::quintic) return SmoothingKernel<D, Kernel::quintic>(h).slope(r);
  return SmoothingKernel<D, Kernel::wendland_c2>(h).slope(r);
}

}  // namespace varve::core
