#include "core/neighbors.h"

#include <algorithm>
#include <cmath>

namespace varve::core {

template <int D, class Position>
std::int64_t CellGrid<D, Position>::cell_along(double x, int axis) const {
  const double scaled = (x - origin_[axis]) * inverse_cell_[axis];
  if (!(scaled >= 0)) return 0;
  if (scaled >= static_cast<double>(size_[axis])) return size_[axis] - 1;
  return static_cast<std::int64_t>(scaled);
}

namespace {

/// Points that one thread takes at a time; fewer are not worth waking another.
constexpr std::size_t points_grain = 2048;

/// Least and largest finite coordinates; 0 and 0 where there are none.
template <int D>
struct Bounds {
  double low[D] = {}, high[D] = {};
  bool any[D] = {};

  void include(double x, int axis) {
    low[axis] = any[axis] ? std::min(low[axis], x) : x;
    high[axis] = any[axis] ? std::max(high[axis], x) : x;
    any[axis] = true;
  }
};

template <int D, class Position>
Bounds<D> bounds_of(std::span<const Vec<Position, D>> points, Workers& workers) {
  std::vector<Bounds<D>> of_parts(workers.parts());
  workers.run(points.size(), points_grain, [&](std::size_t begin, std::size_t end, unsigned part) {
    Bounds<D> bounds;
    for (std::size_t i = begin; i < end; ++i)
      for (int a = 0; a < D; ++a)
        if (const auto x = static_cast<double>(points[i][a]); std::isfinite(x))
          bounds.include(x, a);
    of_parts[part] = bounds;
  });
  Bounds<D> all;
  for (const Bounds<D>& part : of_parts)
    for (int a = 0; a < D; ++a)
      if (part.any[a]) {
        all.include(part.low[a], a);
        all.include(part.high[a], a);
      }
  return all;
}

}  // namespace

template <int D, class Position>
void CellGrid<D, Position>::choose_cells(std::span<const Vec<Position, D>> points, double cell,
                                         const Periodicity<D>& period, Workers& workers) {
  const Bounds<D> bounds = bounds_of<D, Position>(points, workers);
  double low[D] = {}, high[D] = {}, cells[D] = {};
  for (int a = 0; a < D; ++a) {
    periodic_[a] = period.length[a] > 0;
    low[a] = periodic_[a] ? period.origin[a] : bounds.low[a];
    high[a] = periodic_[a] ? low[a] + period.length[a] : bounds.high[a];
    cells[a] = std::clamp(std::floor((high[a] - low[a]) / cell), 1.0, 1e9);
  }
  // Points that have run away must not cost memory: no more cells than a few per point.
  const double most = 4 * static_cast<double>(points.size()) + 4096;
  // Multiplied afresh every time: a product beyond 2^53 is rounded and could not be divided back.
  const auto number = [&cells] {
    double product = 1;
    for (const double each : cells) product *= each;
    return product;
  };
  while (number() > most) {
    double* const longest = std::max_element(cells, cells + D);
    *longest = std::max(1.0, std::floor(0.5 * *longest));
  }
  for (int a = 0; a < D; ++a) {
    size_[a] = static_cast<std::int64_t>(cells[a]);
    origin_[a] = low[a];
    inverse_cell_[a] = high[a] > low[a] ? cells[a] / (high[a] - low[a]) : 0;
  }
  start_.assign(static_cast<std::size_t>(number()) + 1, 0);
}

template <int D, class Position>
void CellGrid<D, Position>::build(std::span<const Vec<Position, D>> points, double cell,
                                  const Periodicity<D>& period, Workers& workers) {
  choose_cells(points, cell, period, workers);
  cell_of_.resize(points.size());
  workers.run(points.size(), points_grain, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t i = begin; i < end; ++i) {
      std::int64_t index = 0;
      for (int a = D - 1; a >= 0; --a)
        index = index * size_[a] + cell_along(static_cast<double>(points[i][a]), a);
      cell_of_[i] = static_cast<std::uint32_t>(index);
    }
  });
  for (const std::uint32_t cell_of : cell_of_) ++start_[cell_of + 1];
  fullest_ = 0;
  for (std::size_t c = 0; c + 1 < start_.size(); ++c) {
    fullest_ = std::max<std::size_t>(fullest_, start_[c + 1]);
    start_[c + 1] += start_[c];
  }
  ids_.resize(points.size() + lanes);
  next_.assign(start_.begin(), start_.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i)
    ids_[next_[cell_of_[i]]++] = static_cast<std::int32_t>(i);
  for (auto& axis : coordinates_) axis.resize(points.size() + lanes);
  workers.run(points.size(), points_grain, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t place = begin; place < end; ++place) {
      const Vec<Position, D>& point = points[static_cast<std::size_t>(ids_[place])];
      for (int a = 0; a < D; ++a) coordinates_[a][place] = static_cast<double>(point[a]);
    }
  });
}

template <int D, class Position>
int CellGrid<D, Position>::around(const Vec<Position, D>& point, Stretch* stretches) const {
  // Along a periodic axis of one or two cells the neighbours repeat; each is visited once. Only
  // along x, where cells lie side by side, do several make one stretch.
  std::int64_t cells[3][3] = {};
  int counts[3] = {1, 1, 1};
  for (int a = 0; a < D; ++a) {
    const std::int64_t middle = cell_along(static_cast<double>(point[a]), a);
    counts[a] = 0;
    for (std::int64_t step = -1; step <= 1; ++step) {
      std::int64_t c = middle + step;
      if (c < 0 || c >= size_[a]) {
        if (!periodic_[a]) continue;
        c = (c + size_[a]) % size_[a];
      }
      if (periodic_[a] && counts[a] > 0 && c == cells[a][0]) continue;
      if (periodic_[a] && counts[a] > 1 && c == cells[a][1]) continue;
      cells[a][counts[a]++] = c;
    }
  }
  int count = 0;
  for (int z = 0; z < counts[2]; ++z)
    for (int y = 0; y < counts[1]; ++y) {
      std::int64_t row = cells[1][y] * size_[0];
      if constexpr (D == 3) row += cells[2][z] * size_[0] * size_[1];
      for (int x = 0; x < counts[0];) {
        const std::int64_t from = cells[0][x];
        std::int64_t to = from;
        while (x < counts[0] && cells[0][x] == to) ++x, ++to;
        stretches[count++] = {start_[static_cast<std::size_t>(row + from)],
                              start_[static_cast<std::size_t>(row + to)]};
      }
    }
  return count;
}

template <int D, class Position>
void find_candidates(std::span<const Vec<Position, D>> from, const CellGrid<D, Position>& grid,
                     double radius, const Periodicity<D>& period, bool same, Workers& workers,
                     InstructionSet set, RowParts& parts, Rows& rows, const std::int32_t* own) {
  // The parts are joined in order, so that the result does not depend on how many there are.
  parts.resize(workers.parts());
  rows.start.assign(from.size() + 1, 0);
  RowSearchData<D> data;
  for (int a = 0; a < D; ++a) {
    data.coordinates[a] = grid.coordinates(a);
    data.period[a] = period.length[a];
  }
  data.ids = grid.ids();
  data.radius2 = radius * radius;
  const RowSearch<D> search = row_search<D>(period.any(), set);
  constexpr std::size_t cells_around = D == 2 ? 9 : 27;
  const std::size_t most = cells_around * grid.fullest_cell() + lanes;
  constexpr std::size_t grain = 64;
  workers.run(from.size(), grain, [&](std::size_t begin, std::size_t end, unsigned number) {
    std::vector<std::int32_t>& part = parts[number];
    std::size_t used = 0;
    Stretch stretches[CellGrid<D, Position>::most_stretches];
    for (std::size_t i = begin; i < end; ++i) {
      if (part.size() < used + most) part.resize(std::max(used + most, 2 * part.size()));
      double point[D];
      for (int a = 0; a < D; ++a) point[a] = static_cast<double>(from[i][a]);
      std::int32_t* const first = part.data() + used;
      std::int32_t* const last = search(data, stretches, grid.around(from[i], stretches), point,
                                        !same ? -1 : own ? own[i] : static_cast<std::int32_t>(i),
                                        first);
      if (last - first > longest_sorted) std::sort(first, last);
      rows.start[i + 1] = static_cast<std::uint32_t>(last - first);
      used += static_cast<std::size_t>(last - first);
    }
  });
  for (std::size_t i = 0; i < from.size(); ++i) rows.start[i + 1] += rows.start[i];
  rows.index.resize(rows.start[from.size()]);
  // Divided as before, so that each part is copied where it belongs.
  workers.run(from.size(), grain, [&](std::size_t begin, std::size_t end, unsigned number) {
    std::copy_n(parts[number].begin(), rows.start[end] - rows.start[begin],
                rows.index.begin() + rows.start[begin]);
  });
}

template <int D, class Position>
Rows candidates(std::span<const Vec<Position, D>> from, const CellGrid<D, Position>& grid,
                double radius, const Periodicity<D>& period, bool same, Workers& workers,
                InstructionSet set) {
  RowParts parts;
  Rows rows;
  find_candidates<D, Position>(from, grid, radius, period, same, workers, set, parts, rows);
  return rows;
}

void GroupedStorage::assign(const Rows& rows, std::size_t points, Filler filler,
                            std::int32_t one_past, Workers& workers,
                            const std::int32_t* places) {
  const std::size_t groups = (points + lanes - 1) / lanes;
  start_.assign(groups + 1, 0);
  for (std::size_t g = 0; g < groups; ++g) {
    std::uint32_t longest = 0;
    for (std::size_t i = g * lanes; i < std::min(points, (g + 1) * lanes); ++i)
      longest = std::max(longest, rows.start[i + 1] - rows.start[i]);
    start_[g + 1] = start_[g] + longest;
  }
  index_.resize(static_cast<std::size_t>(start_[groups]) * lanes);
  workers.run(groups, 16, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t at = begin * lanes; at < end * lanes; ++at) {
      // Lanes past the last point repeat it, as the loops do; their sums are thrown away.
      const std::size_t g = at / lanes, i = std::min(at, points - 1);
      const std::uint32_t length = rows.start[i + 1] - rows.start[i];
      const std::uint32_t slots = start_[g + 1] - start_[g];
      const std::int32_t fill = filler == Filler::own_index  ? static_cast<std::int32_t>(i)
                                : filler == Filler::minus_one ? -1
                                                              : one_past;
      const std::int32_t* const from = rows.index.data() + rows.start[i];
      std::int32_t* const to =
          index_.data() + static_cast<std::size_t>(start_[g]) * lanes + at % lanes;
      for (std::uint32_t k = 0; k < slots; ++k)
        to[k * lanes] = k >= length ? fill : places ? places[from[k]] : from[k];
    }
  });
}

template class CellGrid<2, double>;
template class CellGrid<2, float>;
template class CellGrid<3, double>;
template class CellGrid<3, float>;
#define VARVE_INSTANTIATE(D, Position)                                                           \
  template Rows candidates<D, Position>(std::span<const Vec<Position, D>>,                       \
                                        const CellGrid<D, Position>&, double,                    \
                                        const Periodicity<D>&, bool, Workers&, InstructionSet);  \
  template void find_candidates<D, Position>(                                                    \
      std::span<const Vec<Position, D>>, const CellGrid<D, Position>&, double,                   \
      const Periodicity<D>&, bool, Workers&, InstructionSet, RowParts&, Rows&,                   \
      const std::int32_t*);
VARVE_INSTANTIATE(2, double)
VARVE_INSTANTIATE(2, float)
VARVE_INSTANTIATE(3, double)
VARVE_INSTANTIATE(3, float)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
