#include "core/row_search.h"

namespace varve::core {

#define VARVE_DECLARE(isa)                 \
  namespace isa {                          \
  template <int D>                         \
  RowSearch<D> search_row(bool periodic);  \
  }
VARVE_DECLARE(isa_baseline)
#ifdef VARVE_X86_64
VARVE_DECLARE(isa_v3)
VARVE_DECLARE(isa_v4)
#endif
#undef VARVE_DECLARE

template <int D>
RowSearch<D> row_search(bool periodic, InstructionSet set) {
#ifdef VARVE_X86_64
  if (set == InstructionSet::v4) return isa_v4::search_row<D>(periodic);
  if (set == InstructionSet::v3) return isa_v3::search_row<D>(periodic);
#endif
  static_cast<void>(set);
  return isa_baseline::search_row<D>(periodic);
}

template RowSearch<2> row_search<2>(bool, InstructionSet);
template RowSearch<3> row_search<3>(bool, InstructionSet);

}  // namespace varve::core
