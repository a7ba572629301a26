#include "core/neighbors.h"

#include <algorithm>
#include <cmath>

namespace varve::core {

template <int D, class Position>
std::int64_t CellGrid<D, Position>::coordinate(double x, int axis) const {
  const double scaled = std::floor((x - origin_[axis]) * inverse_cell_[axis]);
  if (!(scaled >= 0)) return 0;
  if (scaled >= static_cast<double>(size_[axis])) return size_[axis] - 1;
  return static_cast<std::int64_t>(scaled);
}

template <int D, class Position>
void CellGrid<D, Position>::build(std::span<const Vec<Position, D>> points, double cell,
                                  const Periodicity<D>& period) {
  std::size_t total = 1;
  for (int a = 0; a < D; ++a) {
    double low = 0, high = 0;
    periodic_[a] = period.length[a] > 0;
    if (periodic_[a]) {
      low = period.origin[a];
      high = low + period.length[a];
    } else {
      bool first = true;
      for (const auto& p : points) {
        const double x = static_cast<double>(p[a]);
        if (!std::isfinite(x)) continue;
        low = first ? x : std::min(low, x);
        high = first ? x : std::max(high, x);
        first = false;
      }
    }
    // At most a thousand cells along an axis: points that have run away must not cost memory.
    const double cells = std::clamp(std::floor((high - low) / cell), 1.0, 1024.0);
    size_[a] = static_cast<std::int64_t>(cells);
    origin_[a] = low;
    inverse_cell_[a] = high > low ? cells / (high - low) : 0;
    total *= static_cast<std::size_t>(size_[a]);
  }
  std::vector<std::uint32_t> cell_of(points.size());
  start_.assign(total + 1, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::int64_t index = 0;
    for (int a = D - 1; a >= 0; --a)
      index = index * size_[a] + coordinate(static_cast<double>(points[i][a]), a);
    cell_of[i] = static_cast<std::uint32_t>(index);
    ++start_[cell_of[i] + 1];
  }
  for (std::size_t c = 0; c < total; ++c) start_[c + 1] += start_[c];
  points_.resize(points.size());
  std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i)
    points_[next[cell_of[i]]++] = static_cast<std::uint32_t>(i);
}

template <int D, class Position>
Rows candidates(std::span<const Vec<Position, D>> from, std::span<const Vec<Position, D>> to,
                const CellGrid<D, Position>& grid, double radius, const Periodicity<D>& period,
                bool same, Workers& workers) {
  // Each thread fills its own part; the parts are joined in order, so that the result does not depend
  // on how many there are.
  struct Part {
    std::size_t begin = 0, end = 0;
    std::vector<std::int32_t> index;
  };
  std::vector<Part> parts(workers.count());
  Rows rows;
  rows.start.assign(from.size() + 1, 0);
  const double limit = radius * radius;
  workers.run(from.size(), 64, [&](std::size_t begin, std::size_t end, unsigned thread) {
    Part& part = parts[thread];
    part.begin = begin;
    part.end = end;
    part.index.reserve((end - begin) * 32);
    std::vector<std::int32_t> found;
    for (std::size_t i = begin; i < end; ++i) {
      found.clear();
      grid.around(from[i], [&](std::uint32_t j) {
        double r2 = 0;
        for (int a = 0; a < D; ++a) {
          double d = static_cast<double>(from[i][a]) - static_cast<double>(to[j][a]);
          const double length = period.length[a];
          if (d > 0.5 * length) d -= length;
          if (d < -0.5 * length) d += length;
          r2 += d * d;
        }
        if (r2 < limit && !(same && j == i)) found.push_back(static_cast<std::int32_t>(j));
      });
      std::sort(found.begin(), found.end());
      rows.start[i + 1] = static_cast<std::uint32_t>(found.size());
      part.index.insert(part.index.end(), found.begin(), found.end());
    }
  });
  for (std::size_t i = 0; i < from.size(); ++i) rows.start[i + 1] += rows.start[i];
  rows.index.reserve(rows.start[from.size()]);
  for (const Part& part : parts)
    rows.index.insert(rows.index.end(), part.index.begin(), part.index.end());
  return rows;
}

void GroupedStorage::assign(const Rows& rows, std::size_t points, Filler filler,
                            std::int32_t one_past) {
  const std::size_t groups = (points + lanes - 1) / lanes;
  start_.assign(groups + 1, 0);
  for (std::size_t g = 0; g < groups; ++g) {
    std::uint32_t longest = 0;
    for (std::size_t i = g * lanes; i < std::min(points, (g + 1) * lanes); ++i)
      longest = std::max(longest, rows.start[i + 1] - rows.start[i]);
    start_[g + 1] = start_[g] + longest;
  }
  index_.resize(static_cast<std::size_t>(start_[groups]) * lanes);
  for (std::size_t g = 0; g < groups; ++g)
    for (std::size_t l = 0; l < lanes; ++l) {
      // Lanes past the last point repeat it, as the loops do; their sums are thrown away.
      const std::size_t i = std::min(g * lanes + l, points - 1);
      const std::uint32_t length = rows.start[i + 1] - rows.start[i];
      const std::int32_t fill = filler == Filler::own_index  ? static_cast<std::int32_t>(i)
                                : filler == Filler::minus_one ? -1
                                                              : one_past;
      for (std::uint32_t k = 0; k < start_[g + 1] - start_[g]; ++k)
        index_[(static_cast<std::size_t>(start_[g]) + k) * lanes + l] =
            k < length ? rows.index[rows.start[i] + k] : fill;
    }
}

template class CellGrid<2, double>;
template Rows candidates<2, double>(std::span<const Vec<double, 2>>,
                                    std::span<const Vec<double, 2>>, const CellGrid<2, double>&,
                                    double, const Periodicity<2>&, bool, Workers&);
template class CellGrid<2, float>;
template Rows candidates<2, float>(std::span<const Vec<float, 2>>, std::span<const Vec<float, 2>>,
                                   const CellGrid<2, float>&, double, const Periodicity<2>&, bool,
                                   Workers&);

}  // namespace varve::core
