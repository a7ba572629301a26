// Elementary functions from + - * / sqrt and bit operations only, so that every compiler, libm and
// CPU gives the same bits. Nothing in core/ calls the C library's exp, log, pow, sin or cos.
//
// Error bounds are in units in the last place of the exact result; the tests hold them against
// MPFR.
#pragma once

#include <cstdint>

namespace varve::core {

inline constexpr double pi = 3.14159265358979323846;

/// e^x. Within 1 ulp where the result is normal, 2 ulp where it is subnormal. +inf above 709.78,
/// 0 below -745.14, NaN for NaN.
double exp(double x);
/// Natural logarithm, within 1 ulp. -inf at 0, NaN below 0 and for NaN.
double log(double x);
/// Decimal logarithm, within 1 ulp. -inf at 0, NaN below 0 and for NaN.
double log10(double x);
/// x^y for x >= 0, within 1 ulp where the result is normal and 2 ulp where it is subnormal.
/// pow(x, 0) = pow(1, y) = 1 for all x, y; otherwise NaN for x < 0 or a NaN argument.
double pow(double x, double y);
/// Sine and cosine of x [rad], within 1 ulp for |x| <= 1e5; NaN beyond.
double sin(double x);
double cos(double x);

/// x^N by a fixed sequence of multiplications: N >= 0, known at compile time.
template <int N, class Real>
constexpr Real integer_power(Real x) {
  static_assert(N >= 0);
  if constexpr (N == 0) {
    return Real(1);
  } else if constexpr (N % 2 == 0) {
    const Real root = integer_power<N / 2>(x);
    return root * root;
  } else {
    return x * integer_power<N - 1>(x);
  }
}

/// Nearest integer, halves away from zero, whatever the rounding mode; |x| < 2^62.
constexpr std::int64_t nearest_integer(double x) {
  const std::int64_t whole = static_cast<std::int64_t>(x);
  const double rest = x - static_cast<double>(whole);
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

}  // namespace varve::core
