#include "core/pair_sweeps.h"

#include "core/instruction_sets.h"

namespace varve::core {

VARVE_DECLARE_FOR_ALL_SETS(template <int D, class P> PairSweeps<D, P> sweeps(
    Kernel kernel, bool periodic, PressureSum sum))

template <int D, class P>
PairSweeps<D, P> pair_sweeps(Kernel kernel, bool periodic, PressureSum sum, InstructionSet set) {
  return VARVE_OF_SET(set, sweeps<D, P>(kernel, periodic, sum));
}

#define VARVE_INSTANTIATE(D, P) \
  template PairSweeps<D, P> pair_sweeps<D, P>(Kernel, bool, PressureSum, InstructionSet);
VARVE_INSTANTIATE(2, DoublePrecision)
VARVE_INSTANTIATE(2, FloatPrecision)
VARVE_INSTANTIATE(2, MixedPrecision)
VARVE_INSTANTIATE(3, DoublePrecision)
VARVE_INSTANTIATE(3, FloatPrecision)
VARVE_INSTANTIATE(3, MixedPrecision)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
