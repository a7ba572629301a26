// Neighbour lists of the fluid and of the wall dummies, rebuilt when something has moved by half
// the skin. When that happens, and in which order particles are listed, reaches no bit
// (core/pair_sweeps.h).
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
               double support, double skin, const Periodicity<D>& period, bool order_always,
               Workers& workers);
  void reset() { listed_at_.clear(); }

  /// Once a flow has scattered neighbours over the memory, particles are listed in the order of
  /// their cells: each has a place, and fluid() and walls() know it by that alone. The index at
  /// each place and the place of each index; empty where places are indices. As a particle's
  /// neighbours are listed in the order of their indices either way, this too reaches no bit.
  std::span<const std::int32_t> order() const { return order_; }
  std::span<const std::int32_t> places() const { return places_; }
  bool ordered() const { return !order_.empty(); }
  std::size_t index_at(std::int32_t place) const {
    const auto at = static_cast<std::size_t>(place);
    return order_.empty() ? at : static_cast<std::size_t>(order_[at]);
  }
  std::size_t place_of(std::size_t index) const {
    return places_.empty() ? index : static_cast<std::size_t>(places_[index]);
  }

  /// By place, places as candidates, in ascending order of their indices.
  GroupedLists fluid() const { return fluid_.view(); }
  /// By place, dummies as candidates.
  GroupedLists walls() const { return walls_.view(); }
  GroupedLists of_walls() const { return of_walls_.view(); }
  /// Fluid candidates of dummy `w`, ascending: for passes that are not hot.
  std::span<const std::int32_t> fluid_near_wall(std::size_t w) const { return wall_rows_.of(w); }

 private:
  void find_order(std::span<const Vec<Position, D>> fluid, bool order_always, Workers& workers);

  InstructionSet set_;
  GroupedStorage fluid_, walls_, of_walls_;
  Rows wall_rows_;
  // Kept for their memory, each for one use: what grows again is filled with zeros.
  Rows rows_, rows_near_walls_;
  RowParts parts_;
  CellGrid<D, Position> fluid_cells_, wall_cells_;
  std::vector<Vec<Position, D>> listed_at_, ordered_;
  std::vector<std::int32_t> order_, places_;
};

}  // namespace varve::core
