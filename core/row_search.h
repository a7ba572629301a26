// The hot loop of list building: which points of a few stretches of memory are near one point. Like
// the pair sweeps it is compiled once per instruction set; what it finds, and in which order, is
// the same on all.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/pair_sweeps.h"

namespace varve::core {

/// Places [begin, end) in the cell-ordered arrays of a CellGrid.
struct Stretch {
  std::uint32_t begin = 0, end = 0;
};

/// What a search reads. A vector's worth of numbers beyond the last point may be read too.
template <int D>
struct RowSearchData {
  const double* coordinates[D] = {};    // [m] in cell order
  const std::int32_t* ids = nullptr;    // in cell order
  double period[D] = {};                // [m] 0 where not periodic
  double radius2 = 0;                   // [m2]
};

/// Longer rows are left in the order in which they are found.
inline constexpr int longest_sorted = 192;

/// Writes the ids of all points of `stretches` nearer to `point` than the radius to `out`, `own`
/// left out and ascending unless they are more than `longest_sorted`; returns their end. Up to
/// `lanes` numbers behind it are overwritten.
template <int D>
using RowSearch = std::int32_t* (*)(const RowSearchData<D>& data, const Stretch* stretches,
                                    int stretch_count, const double* point, std::int32_t own,
                                    std::int32_t* out);

template <int D>
RowSearch<D> row_search(bool periodic, InstructionSet set);

}  // namespace varve::core
