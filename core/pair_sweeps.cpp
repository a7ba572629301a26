#include "core/pair_sweeps.h"

#include "core/instruction_sets.h"

namespace varve::core {

VARVE_DECLARE_FOR_ALL_SETS(template <int D, class P> PairSweeps<D, P> sweeps(
    Kernel kernel, bool periodic, bool conjugate))

template <int D, class P>
PairSweeps<D, P> pair_sweeps(Kernel kernel, bool periodic, bool conjugate, InstructionSet set) {
  return VARVE_OF_SET(set, sweeps<D, P>(kernel, periodic, conjugate));
}

#define VARVE_INSTANTIATE(D, P) \
  template PairSweeps<D, P> pair_sweeps<D, P>(Kernel, bool, bool, InstructionSet);
VARVE_INSTANTIATE(2, DoublePrecision)
VARVE_INSTANTIATE(2, FloatPrecision)
VARVE_INSTANTIATE(2, MixedPrecision)
VARVE_INSTANTIATE(3, DoublePrecision)
VARVE_INSTANTIATE(3, FloatPrecision)
VARVE_INSTANTIATE(3, MixedPrecision)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
