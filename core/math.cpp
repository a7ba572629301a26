#include "core/math.h"

#include <bit>
#include <limits>

namespace varve::core {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// ln 2 = high + low; high has 21 trailing zero bits, so that k * high is exact for every exponent
// k.
constexpr double ln2_high = 0x1.62e42fee00000p-1;
constexpr double ln2_low = 0x1.a39ef35793c76p-33;
constexpr double ln2_lowest = 0x1.cc01f97b57a08p-87;

/// A number as an unevaluated sum, |low| <= ulp(high)/2: about 106 bits.
struct Pair {
  double high, low;
};

constexpr Pair sum_ordered(double a, double b) {  // |a| >= |b|, or a = 0
  const double s = a + b;
  return {s, b - (s - a)};
}

constexpr Pair sum_exact(double a, double b) {
  const double s = a + b;
  const double t = s - a;
  return {s, (a - (s - t)) + (b - t)};
}

constexpr Pair product_exact(double a, double b) {  // Dekker: no fused operation is assumed
  constexpr double splitter = 134217729.0;          // 2^27 + 1
  const double ta = splitter * a, tb = splitter * b;
  const double a1 = ta - (ta - a), a2 = a - a1;
  const double b1 = tb - (tb - b), b2 = b - b1;
  const double p = a * b;
  return {p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2};
}

constexpr Pair product(Pair a, Pair b) {
  const Pair p = product_exact(a.high, b.high);
  return sum_ordered(p.high, p.low + (a.high * b.low + a.low * b.high));
}

constexpr Pair sum(Pair a, Pair b) {
  const Pair s = sum_exact(a.high, b.high);
  const Pair t = sum_exact(a.low, b.low);
  const Pair u = sum_ordered(s.high, s.low + t.high);
  return sum_ordered(u.high, u.low + t.low);
}

constexpr Pair quotient(Pair a, Pair b) {
  const double q = a.high / b.high;
  const Pair back = product_exact(q, b.high);
  const double rest = ((a.high - back.high) - back.low) + a.low - q * b.low;
  return sum_ordered(q, rest / b.high);
}

/// 2^k for a normal result.
constexpr double power_of_two(int k) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(k + 1023) << 52);
}

/// x 2^k, in steps that round at most once more (subnormal results).
constexpr double scaled(double x, int k) {
  if (k > 1023) return x * power_of_two(1023) * power_of_two(k - 1023);
  if (k < -1021) return x * power_of_two(k + 60) * power_of_two(-60);
  return x * power_of_two(k);
}

/// e^(x + tail), |tail| far below |x|. Reduction x = k ln 2 + r, |r| <= ln 2 / 2, then Taylor's
/// series of e^r to r^14, summed so that only the last addition rounds at the size of the result.
double exp_of_sum(double x, double tail) {
  if (x > 709.8) return infinity;
  if (x < -745.2) return 0;
  const int k = static_cast<int>(nearest_integer(x * 0x1.71547652b82fep+0));  // 1 / ln 2
  const double high = x - k * ln2_high;
  const Pair r = sum_exact(high, tail - k * ln2_low);
  double p = 1.0 / 87178291200.0;
  p = p * r.high + 1.0 / 6227020800.0;
  p = p * r.high + 1.0 / 479001600.0;
  p = p * r.high + 1.0 / 39916800.0;
  p = p * r.high + 1.0 / 3628800.0;
  p = p * r.high + 1.0 / 362880.0;
  p = p * r.high + 1.0 / 40320.0;
  p = p * r.high + 1.0 / 5040.0;
  p = p * r.high + 1.0 / 720.0;
  p = p * r.high + 1.0 / 120.0;
  p = p * r.high + 1.0 / 24.0;
  p = p * r.high + 1.0 / 6.0;
  const double square = r.high * r.high;
  const double curve = square * r.high * p + r.low * (1.0 + r.high);
  const Pair start = sum_ordered(1.0, r.high);
  return scaled(start.high + (start.low + (0.5 * square + curve)), k);
}

/// ln x as a pair with a relative error below 2^-62, for finite x > 0.
/// x = 2^k m with m in [sqrt(1/2), sqrt 2); ln m = 2 atanh s = 2 s + 2/3 s^3 + ..., s =
/// (m-1)/(m+1).
Pair log_pair(double x) {
  int k = 0;
  if (x < 0x1p-1022) {
    x *= 0x1p54;
    k = -54;
  }
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  k += static_cast<int>(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (m > 0x1.6a09e667f3bcdp+0) {
    m *= 0.5;
    ++k;
  }
  const Pair s = quotient({m - 1.0, 0.0}, sum_exact(m, 1.0));
  const Pair z = product(s, s);
  double q = 2.0 / 27.0;
  q = q * z.high + 2.0 / 25.0;
  q = q * z.high + 2.0 / 23.0;
  q = q * z.high + 2.0 / 21.0;
  q = q * z.high + 2.0 / 19.0;
  q = q * z.high + 2.0 / 17.0;
  q = q * z.high + 2.0 / 15.0;
  q = q * z.high + 2.0 / 13.0;
  q = q * z.high + 2.0 / 11.0;
  q = q * z.high + 2.0 / 9.0;
  q = q * z.high + 2.0 / 7.0;
  const double rest = z.high * q;  // 2/7 z + ...
  constexpr Pair two_thirds{2.0 / 3.0, 0x1.5555555555555p-55};
  constexpr Pair two_fifths{2.0 / 5.0, -0x1.999999999999ap-56};
  const Pair bracket = sum(two_thirds, product(z, sum(two_fifths, {rest, 0.0})));
  const Pair log_m = sum({2.0 * s.high, 2.0 * s.low}, product(product(s, z), bracket));
  const Pair whole = sum({k * ln2_high, 0.0}, product_exact(k, ln2_low));
  return sum(sum(whole, log_m), {k * ln2_lowest, 0.0});
}

bool log_is_special(double x, double& result) {
  if (!(x >= 0)) result = not_a_number;
  else if (x == 0) result = -infinity;
  else if (x == infinity) result = infinity;
  else return false;
  return true;
}

/// Reduction x = quadrant pi/2 + r in four parts of pi/2, the first three of 33 bits or fewer, so
/// that their products with the quadrant (17 bits) are exact; then Taylor's series on |r| <= pi/4.
struct Reduced {
  int quadrant;
  Pair r;
};
Reduced reduced_angle(double x) {
  const std::int64_t n = nearest_integer(x * 0x1.45f306dc9c883p-1);  // 2 / pi
  const double k = static_cast<double>(n);
  constexpr double part1 = 0x1.921fb544p+0, part2 = 0x1.0b4611a6p-34;
  constexpr double part3 = 0x1.3198a2ep-69, part4 = 0x1.b839a252049c1p-104;
  const Pair a = sum_exact(x - k * part1, -(k * part2));
  const Pair b = sum(a, sum_exact(-(k * part3), -(k * part4)));
  return {static_cast<int>(n & 3), b};
}

double sin_series(Pair r) {
  const double z = r.high * r.high;
  double p = -1.0 / 121645100408832000.0;
  p = p * z + 1.0 / 355687428096000.0;
  p = p * z - 1.0 / 1307674368000.0;
  p = p * z + 1.0 / 6227020800.0;
  p = p * z - 1.0 / 39916800.0;
  p = p * z + 1.0 / 362880.0;
  p = p * z - 1.0 / 5040.0;
  p = p * z + 1.0 / 120.0;
  p = p * z - 1.0 / 6.0;
  return r.high + (r.high * z * p + r.low * (1.0 - 0.5 * z));
}

double cos_series(Pair r) {
  const double z = r.high * r.high;
  double p = 1.0 / 2432902008176640000.0;
  p = p * z - 1.0 / 6402373705728000.0;
  p = p * z + 1.0 / 20922789888000.0;
  p = p * z - 1.0 / 87178291200.0;
  p = p * z + 1.0 / 479001600.0;
  p = p * z - 1.0 / 3628800.0;
  p = p * z + 1.0 / 40320.0;
  p = p * z - 1.0 / 720.0;
  p = p * z + 1.0 / 24.0;
  const Pair start = sum_ordered(1.0, -0.5 * z);
  return start.high + (start.low + (z * z * p - r.high * r.low));
}

constexpr double largest_angle = 1e5;

}  // namespace

double exp(double x) { return x == x ? exp_of_sum(x, 0.0) : x; }

double log(double x) {
  double special = 0;
  if (log_is_special(x, special)) return special;
  return log_pair(x).high;
}

double log10(double x) {
  double special = 0;
  if (log_is_special(x, special)) return special;
  return product(log_pair(x), {0x1.bcb7b1526e50ep-2, 0x1.95355baaafad3p-57}).high;  // 1 / ln 10
}

double pow(double x, double y) {
  if (y == 0 || x == 1) return 1;
  if (!(x >= 0) || y != y) return not_a_number;
  if (x == 0) return y > 0 ? 0 : infinity;
  if (x == infinity) return y > 0 ? infinity : 0;
  const Pair l = log_pair(x);
  const double rough = l.high * y;
  if (rough > 710.0) return infinity;
  if (rough < -746.0) return 0;
  if (rough > -1e-20 && rough < 1e-20) return 1;  // also keeps tiny y clear of underflow below
  const Pair t = product(l, {y, 0.0});
  return exp_of_sum(t.high, t.low);
}

double sin(double x) {
  if (!(x >= -largest_angle && x <= largest_angle)) return not_a_number;
  if (x > -1e-9 && x < 1e-9) return x;
  const Reduced a = reduced_angle(x);
  const double value = a.quadrant & 1 ? cos_series(a.r) : sin_series(a.r);
  return a.quadrant & 2 ? -value : value;
}

double cos(double x) {
  if (!(x >= -largest_angle && x <= largest_angle)) return not_a_number;
  const Reduced a = reduced_angle(x);
  const double value = a.quadrant & 1 ? sin_series(a.r) : cos_series(a.r);
  return ((a.quadrant + 1) & 2) ? -value : value;
}

}  // namespace varve::core
