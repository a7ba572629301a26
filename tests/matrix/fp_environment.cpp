#include "tests/matrix/fp_environment.h"

#include <stdexcept>

#include "core/arithmetic.h"
#include "tests/matrix/contraction.h"

namespace varve::tests {

double contraction_residue() { return residue<double>(); }
float contraction_residue_float() { return residue<float>(); }

namespace {

// Not inlined, and the values not known: the compiler has to write the conversions down.
__attribute__((noinline)) void through_float(float* narrow, double* sum, const double* wide) {
  for (int k = 0; k < 2; ++k) narrow[k] = static_cast<float>(wide[k]);
  for (int k = 0; k < 2; ++k) sum[k] += static_cast<double>(narrow[k]);
}

}  // namespace

double narrowing_residue() {
  float narrow[2];
  double sum[2] = {0, 0};
  const double wide[2] = {1.0 / 3, -1.0 / 7};
  through_float(narrow, sum, wide);
  return (wide[0] - sum[0]) * (wide[1] - sum[1]);
}

void require_strict_floating_point() {
  if (narrowing_residue() == 0)
    throw std::runtime_error("the compiler took a conversion to float and back for nothing");
  if (contraction_residue() != 0 || contraction_residue_float() != 0) {
    throw std::runtime_error("the compiler fused a*b + c");
  }
  core::require_exact_arithmetic();
}

}  // namespace varve::tests
