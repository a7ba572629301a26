#include "core/fluid_lists.h"

#include <atomic>

namespace varve::core {

template <int D, class Position>
bool FluidLists<D, Position>::stale(std::span<const Vec<Position, D>> fluid, double skin,
                                    Workers& workers) const {
  if (listed_at_.size() != fluid.size()) return true;
  const double reach = 0.5 * skin;
  std::atomic<bool> moved_far = false;  // whether anyone did, which has no order
  workers.run(fluid.size(), 2048, [&](std::size_t begin, std::size_t end, unsigned) {
    bool far = false;
    for (std::size_t i = begin; i < end; ++i) {
      double r2 = 0;
      for (int k = 0; k < D; ++k) {
        const double d =
            static_cast<double>(fluid[i][k]) - static_cast<double>(listed_at_[i][k]);
        r2 += d * d;
      }
      // A point that crossed a periodic seam counts as moved: rare, and a rebuild is always right.
      far = far || !(r2 < reach * reach);
    }
    if (far) moved_far = true;
  });
  return moved_far;
}

template <int D, class Position>
void FluidLists<D, Position>::rebuild(std::span<const Vec<Position, D>> fluid,
                                      std::span<const Vec<Position, D>> walls, double support,
                                      double skin, const Periodicity<D>& period,
                                      Workers& workers) {
  const double radius = support + skin;
  const auto find = [&](std::span<const Vec<Position, D>> from,
                        const CellGrid<D, Position>& cells, bool same, Rows& rows) {
    find_candidates<D, Position>(from, cells, radius, period, same, workers, set_, parts_,
                                 rows);
  };
  fluid_cells_.build(fluid, radius, period, workers);
  find(fluid, fluid_cells_, true, rows_);
  fluid_.assign(rows_, fluid.size(), Filler::own_index, 0, workers);
  wall_cells_.build(walls, radius, period, workers);
  find(fluid, wall_cells_, false, rows_near_walls_);
  walls_.assign(rows_near_walls_, fluid.size(), Filler::one_past,
                static_cast<std::int32_t>(walls.size()), workers);
  find(walls, fluid_cells_, false, wall_rows_);
  of_walls_.assign(wall_rows_, walls.size(), Filler::minus_one, 0, workers);
  listed_at_.assign(fluid.begin(), fluid.end());
}

template class FluidLists<2, double>;
template class FluidLists<2, float>;
template class FluidLists<3, double>;
template class FluidLists<3, float>;

}  // namespace varve::core
