#include "core/contact_sweeps.h"

namespace varve::core {

#define VARVE_DECLARE(isa)            \
  namespace isa {                     \
  template <int D, class P>           \
  ContactSweeps<D, P> touch_sweeps(); \
  }
VARVE_DECLARE(isa_baseline)
#ifdef VARVE_X86_64
VARVE_DECLARE(isa_v3)
VARVE_DECLARE(isa_v4)
#endif
#undef VARVE_DECLARE

template <int D, class P>
ContactSweeps<D, P> contact_sweeps(InstructionSet set) {
#ifdef VARVE_X86_64
  if (set == InstructionSet::v4) return isa_v4::touch_sweeps<D, P>();
  if (set == InstructionSet::v3) return isa_v3::touch_sweeps<D, P>();
#endif
  static_cast<void>(set);
  return isa_baseline::touch_sweeps<D, P>();
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
