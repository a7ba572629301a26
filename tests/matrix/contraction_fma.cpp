// The same probe with the engine's flags on a target that has fused instructions.
#include "tests/matrix/contraction.h"

namespace varve::tests {

double fma_target_residue() { return residue<double>(); }
float fma_target_residue_float() { return residue<float>(); }

}  // namespace varve::tests
