#include "tests/matrix/fp_environment.h"

#include <stdexcept>

#include "core/arithmetic.h"
#include "tests/matrix/contraction.h"

namespace varve::tests {

double contraction_residue() { return residue<double>(); }
float contraction_residue_float() { return residue<float>(); }

void require_strict_floating_point() {
  if (contraction_residue() != 0 || contraction_residue_float() != 0) {
    throw std::runtime_error("the compiler fused a*b + c");
  }
  core::require_exact_arithmetic();
}

}  // namespace varve::tests
