// The same probe under flags that allow fusing: shows that the probe can find it.
#include "tests/matrix/contraction.h"

namespace varve::tests {

double fused_residue() { return residue<double>(); }

}  // namespace varve::tests
