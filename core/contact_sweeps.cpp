#include "core/contact_sweeps.h"

#include "core/instruction_sets.h"

namespace varve::core {

VARVE_DECLARE_FOR_ALL_SETS(template <int D, class P> ContactSweeps<D, P> touch_sweeps())

template <int D, class P>
ContactSweeps<D, P> contact_sweeps(InstructionSet set) {
  return VARVE_OF_SET(set, touch_sweeps<D, P>());
}

#define VARVE_INSTANTIATE(D, P) template ContactSweeps<D, P> contact_sweeps<D, P>(InstructionSet);
VARVE_INSTANTIATE(2, DoublePrecision)
VARVE_INSTANTIATE(2, FloatPrecision)
VARVE_INSTANTIATE(2, MixedPrecision)
VARVE_INSTANTIATE(3, DoublePrecision)
VARVE_INSTANTIATE(3, FloatPrecision)
VARVE_INSTANTIATE(3, MixedPrecision)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
