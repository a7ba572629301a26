// Neighbour lists of the fluid and of the wall dummies, rebuilt when something has moved by half
// the skin. When that happens reaches no bit (core/pair_sweeps.h).
#pragma once

#include <span>
#include <vector>

#include "core/neighbors.h"

namespace varve::core {

template <int D, class Position>
class FluidLists {
 public:
  explicit FluidLists(InstructionSet set = best_instruction_set()) : set_(set) {}

  /// True if a point may have come within `support` of another that its list lacks.
  bool stale(std::span<const Vec<Position, D>> fluid, double skin, Workers& workers) const;
  void rebuild(std::span<const Vec<Position, D>> fluid, std::span<const Vec<Position, D>> walls,
               double support, double skin, const Periodicity<D>& period, Workers& workers);
  void reset() { listed_at_.clear(); }

  GroupedLists fluid() const { return fluid_.view(); }
  GroupedLists walls() const { return walls_.view(); }
  GroupedLists of_walls() const { return of_walls_.view(); }
  /// Fluid candidates of dummy `w`, ascending: for passes that are not hot.
  std::span<const std::int32_t> fluid_near_wall(std::size_t w) const { return wall_rows_.of(w); }

 private:
  InstructionSet set_;
  GroupedStorage fluid_, walls_, of_walls_;
  Rows wall_rows_;
  // Kept for their memory, each for one use: what grows again is filled with zeros.
  Rows rows_, rows_near_walls_;
  RowParts parts_;
  CellGrid<D, Position> fluid_cells_, wall_cells_;
  std::vector<Vec<Position, D>> listed_at_;
};

}  // namespace varve::core
