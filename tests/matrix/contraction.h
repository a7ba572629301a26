// The probe itself, in a header: units with different flags instantiate it.
#pragma once

#include <limits>

namespace varve::tests {
namespace {

/// x*x - round(x*x) for an x whose square needs more bits than the type has: exactly 0 unless the
/// multiplication and the subtraction are fused. Every factor is read anew, so that the second
/// product cannot be taken from the first. Internal linkage, so that every unit keeps its own.
template <class T>
T residue() {
  volatile T x = 1 + 3 * std::numeric_limits<T>::epsilon();
  volatile T rounded = x * x;
  const T left = x, right = x, minus = -rounded;
  return left * right + minus;
}

}  // namespace
}  // namespace varve::tests
