#include "core/row_search.h"

#include "core/instruction_sets.h"

namespace varve::core {

VARVE_DECLARE_FOR_ALL_SETS(template <int D> RowSearch<D> search_row(bool periodic))

template <int D>
RowSearch<D> row_search(bool periodic, InstructionSet set) {
  return VARVE_OF_SET(set, search_row<D>(periodic));
}

template RowSearch<2> row_search<2>(bool, InstructionSet);
template RowSearch<3> row_search<3>(bool, InstructionSet);

}  // namespace varve::core
