// Distance between floating-point numbers counted in representable values.
#pragma once

#include <cstdint>

namespace varve::io {

/// The bits of `x` as an unsigned number that grows with IEEE-754's total order:
/// -NaN < -inf < ... < -0 < +0 < ... < +inf < +NaN, NaNs by payload; neighbours differ by one.
std::uint64_t ordered_bits(double x);
std::uint32_t ordered_bits(float x);

/// Number of steps between neighbours in that order from `a` to `b`: 0 if and only if the bits are
/// equal, 1 between -0 and +0, exact for every pair of numbers, infinities and NaNs, across zero as
/// well. All 64 bits are used: the two ends of the order are 2^64 - 1 apart, which is the largest
/// result. Symmetric.
std::uint64_t ulp_distance(double a, double b);
std::uint64_t ulp_distance(float a, float b);

}  // namespace varve::io
