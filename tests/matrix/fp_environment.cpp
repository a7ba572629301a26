#include "tests/matrix/fp_environment.h"

#include <cfenv>
#include <cfloat>
#include <limits>
#include <stdexcept>

#include "tests/matrix/contraction.h"

namespace varve::tests {

// Excess precision (x87) would round sums to other values than the state holds.
static_assert(FLT_EVAL_METHOD == 0);
static_assert(std::numeric_limits<double>::is_iec559 && std::numeric_limits<float>::is_iec559);

double contraction_residue() { return residue<double>(); }
float contraction_residue_float() { return residue<float>(); }

bool rounds_to_nearest() {
  // By the register and by arithmetic: 1 + half an ulp is a tie that goes to the even 1.
  volatile double one = 1, half = DBL_EPSILON / 2, three_halves = 1.5 * DBL_EPSILON;
  volatile float one_float = 1, half_float = FLT_EPSILON / 2;
  const bool even_down = one + half == 1 && -one - half == -1 && one_float + half_float == 1;
  const bool even_up = one + three_halves == 1 + 2 * DBL_EPSILON;
  return std::fegetround() == FE_TONEAREST && even_down && even_up;
}

bool keeps_subnormals() {
  volatile double least = DBL_MIN, half = 0.5;
  volatile float least_float = FLT_MIN, half_float = 0.5F;
  volatile double result = least * half;  // subnormal made
  volatile float result_float = least_float * half_float;
  volatile double back = result * 2;      // subnormal read
  volatile float back_float = result_float * 2;
  return result > 0 && back == DBL_MIN && result_float > 0 && back_float == FLT_MIN;
}

void require_strict_floating_point() {
  if (contraction_residue() != 0 || contraction_residue_float() != 0) {
    throw std::runtime_error("the compiler fused a*b + c");
  }
  if (!rounds_to_nearest()) throw std::runtime_error("rounding is not to nearest even");
  if (!keeps_subnormals()) throw std::runtime_error("subnormal numbers are flushed to zero");
}

}  // namespace varve::tests
