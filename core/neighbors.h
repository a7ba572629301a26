// Neighbour candidates as a pure function of positions: everything within a radius, in ascending
// id. The radius is larger than the kernel's support by a skin, so that lists live for several
// steps; the pair loops filter by the current distance, hence a list is only an accelerator.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/pair_sweeps.h"
#include "core/row_search.h"
#include "core/workers.h"

namespace varve::core {

/// Periods of a domain [m], 0 along axes that are not periodic, and its lower corner.
template <int D>
struct Periodicity {
  double origin[D] = {};
  double length[D] = {};
  bool any() const {
    for (double each : length)
      if (each > 0) return true;
    return false;
  }
};

/// Uniform cells over a set of points. Coordinates and ids are copied in cell order, a row of cells
/// after the other, so that the cells around a point are a few contiguous stretches of memory.
template <int D, class Position>
class CellGrid {
 public:
  /// Cells no smaller than `cell` [m]. Along a periodic axis the cells divide the period. Points
  /// with a coordinate that is not finite are put in the first cell.
  void build(std::span<const Vec<Position, D>> points, double cell, const Periodicity<D>& period,
             Workers& workers);

  /// Where the points within one cell of `point` are in the cell-ordered arrays, each once, in no
  /// particular order of id; returns how many stretches these are.
  static constexpr int most_stretches = D == 2 ? 9 : 27;
  int around(const Vec<Position, D>& point, Stretch* stretches) const;

  /// [m] and ids in cell order; a vector's worth of numbers behind the last point may be read.
  const double* coordinates(int axis) const { return coordinates_[axis].data(); }
  const std::int32_t* ids() const { return ids_.data(); }
  /// Points in the fullest cell: no more than 3^D of these lie around any point.
  std::size_t fullest_cell() const { return fullest_; }

 private:
  std::int64_t cell_along(double x, int axis) const;
  void choose_cells(std::span<const Vec<Position, D>> points, double cell,
                    const Periodicity<D>& period, Workers& workers);

  double origin_[D] = {}, inverse_cell_[D] = {};
  std::int64_t size_[D] = {};
  bool periodic_[D] = {};
  std::size_t fullest_ = 0;
  std::vector<std::uint32_t> start_;
  std::vector<double> coordinates_[D];
  std::vector<std::int32_t> ids_;
  std::vector<std::uint32_t> cell_of_, next_;  // while building
};

/// Candidates per point, compressed rows: of point i they are index[start[i] .. start[i+1]).
struct Rows {
  std::vector<std::uint32_t> start;
  std::vector<std::int32_t> index;
  std::span<const std::int32_t> of(std::size_t i) const {
    return {index.data() + start[i], index.data() + start[i + 1]};
  }
};

/// For every point of `from`, the points of a grid nearer than `radius` (no more than its cell),
/// ascending; a point's own index is left out where `same` says that the grid holds the same
/// points, in the order that `own` says if not in this one.
template <int D, class Position>
Rows candidates(std::span<const Vec<Position, D>> from, const CellGrid<D, Position>& grid,
                double radius, const Periodicity<D>& period, bool same, Workers& workers,
                InstructionSet set = best_instruction_set());

/// What each part of a search has found, kept from one search to the next for its memory.
using RowParts = std::vector<std::vector<std::int32_t>>;
/// The same into rows that may hold memory already.
template <int D, class Position>
void find_candidates(std::span<const Vec<Position, D>> from, const CellGrid<D, Position>& grid,
                     double radius, const Periodicity<D>& period, bool same, Workers& workers,
                     InstructionSet set, RowParts& parts, Rows& rows,
                     const std::int32_t* own = nullptr);

/// What short lanes are filled with.
enum class Filler { own_index, minus_one, one_past };

/// The same rows, eight at a time and interleaved, as the pair sweeps read them.
class GroupedStorage {
 public:
  /// `one_past` is the index used by Filler::one_past; `places`, if any, replaces what the rows
  /// hold.
  void assign(const Rows& rows, std::size_t points, Filler filler, std::int32_t one_past,
              Workers& workers, const std::int32_t* places = nullptr);
  GroupedLists view() const { return {start_.data(), index_.data()}; }

 private:
  std::vector<std::uint32_t> start_;
  std::vector<std::int32_t> index_;
};

}  // namespace varve::core
