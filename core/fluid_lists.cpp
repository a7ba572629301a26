#include "core/fluid_lists.h"

#include <atomic>
#include <cmath>

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

namespace {

/// Whether neighbours lie far from each other in memory: three in five of those that follow each
/// other in their cells. On a lattice at most every other one begins a row.
bool scattered(const std::int32_t* ids, std::size_t count) {
  constexpr std::int32_t far = 1024;  // particles; pairs read 64 bytes of each
  std::size_t found = 0;
  for (std::size_t k = 1; k < count; ++k) found += std::abs(ids[k] - ids[k - 1]) > far ? 1 : 0;
  return 5 * found > 3 * count;
}

}  // namespace

template <int D, class Position>
void FluidLists<D, Position>::find_order(std::span<const Vec<Position, D>> fluid,
                                         bool order_always, Workers& workers) {
  const std::size_t n = fluid.size();
  const std::int32_t* const ids = fluid_cells_.ids();
  order_.clear();
  places_.clear();
  if (!order_always && !scattered(ids, n)) return;
  order_.assign(ids, ids + n);
  places_.resize(n);
  ordered_.resize(n);
  workers.run(n, 2048, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t place = begin; place < end; ++place) {
      const auto index = static_cast<std::size_t>(order_[place]);
      places_[index] = static_cast<std::int32_t>(place);
      ordered_[place] = fluid[index];
    }
  });
}

template <int D, class Position>
void FluidLists<D, Position>::rebuild(std::span<const Vec<Position, D>> fluid,
                                      std::span<const Vec<Position, D>> walls, double support,
                                      double skin, const Periodicity<D>& period,
                                      bool order_always, Workers& workers) {
  const double radius = support + skin;
  const auto find = [&](std::span<const Vec<Position, D>> from,
                        const CellGrid<D, Position>& cells, bool same, Rows& rows) {
    find_candidates<D, Position>(from, cells, radius, period, same, workers, set_, parts_, rows,
                                 same && !order_.empty() ? order_.data() : nullptr);
  };
  fluid_cells_.build(fluid, radius, period, workers);
  find_order(fluid, order_always, workers);
  const auto by_place = order_.empty() ? fluid : std::span<const Vec<Position, D>>(ordered_);
  find(by_place, fluid_cells_, true, rows_);
  fluid_.assign(rows_, fluid.size(), Filler::own_index, 0, workers,
                places_.empty() ? nullptr : places_.data());
  wall_cells_.build(walls, radius, period, workers);
  find(by_place, wall_cells_, false, rows_near_walls_);
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
