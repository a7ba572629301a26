#include "core/arithmetic.h"

#include <cfloat>
#include <limits>
#include <string>

#include "core/workers.h"

namespace varve::core {

// Excess precision (x87) would round sums to other values than the state holds.
static_assert(FLT_EVAL_METHOD == 0);
static_assert(std::numeric_limits<double>::is_iec559 && std::numeric_limits<float>::is_iec559);

// The operands are volatile, so that nothing is computed by the compiler in its own mode.

bool rounds_to_nearest() {
  // 1 + half an ulp is a tie that goes to the even 1; 1 + 3/2 ulp one that goes up.
  volatile double one = 1, half = DBL_EPSILON / 2, three_halves = 1.5 * DBL_EPSILON;
  volatile float one_float = 1, half_float = FLT_EPSILON / 2,
                 three_halves_float = 1.5F * FLT_EPSILON;
  return one + half == 1 && -one - half == -1 && one + three_halves == 1 + 2 * DBL_EPSILON &&
         -one - three_halves == -1 - 2 * DBL_EPSILON && one_float + half_float == 1 &&
         -one_float - half_float == -1 &&
         one_float + three_halves_float == 1 + 2 * FLT_EPSILON;
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

void require_exact_arithmetic() {
  constexpr const char* cause =
      "; results would not be reproducible. Usually a library in the process sets this when it is "
      "loaded (linked with fast-math flags); look at LD_PRELOAD";
  if (!rounds_to_nearest())
    throw ArithmeticError(std::string("floating-point numbers are not rounded to nearest") + cause);
  if (!keeps_subnormals())
    throw ArithmeticError(
        std::string("subnormal numbers are flushed to zero (FTZ or DAZ is set)") + cause);
}

void require_exact_arithmetic(Workers& workers) {
  workers.run_on_each([] { require_exact_arithmetic(); });
}

}  // namespace varve::core
