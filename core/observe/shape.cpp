#include "core/observe/shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/walls.h"

namespace varve::core {
namespace {

/// Sums over a row, its middle and its ends.
struct RowSums {
  double count = 0, y = 0, y2 = 0, speed = 0, origin = 0;
  double middle_count = 0, middle_along = 0, middle_speed = 0;
  double end_count = 0, end_along = 0, end_speed = 0;

  void add(const Scenario& scenario, std::int64_t column, double height, double along,
           double settling) {
    // Heights from the first one: a spread is small beside them.
    if (count == 0) origin = height;
    ++count;
    y += height - origin;
    y2 += (height - origin) * (height - origin);
    speed += settling;
    const std::int64_t last = scenario.grains.columns - 1;
    if (last < 2) return;
    if (column == 0 || column == last) {
      ++end_count;
      end_along += along;
      end_speed += settling;
    } else if (column == last / 2 || column == (last + 1) / 2) {
      ++middle_count;
      middle_along += along;
      middle_speed += settling;
    }
  }
  RowShape shape(std::int64_t row) const {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    RowShape s;
    s.row = row;
    s.grains = static_cast<std::size_t>(count);
    s.mean_y = origin + y / count;
    s.spread_y = std::sqrt(std::max(0.0, y2 / count - (y / count) * (y / count)));
    s.settling_speed = speed / count;
    s.protrusion = s.centre_minus_edge_speed = none;
    if (middle_count > 0 && end_count > 0) {
      s.protrusion = middle_along / middle_count - end_along / end_count;
      s.centre_minus_edge_speed = middle_speed / middle_count - end_speed / end_count;
    }
    return s;
  }
};

template <class RowOf>
std::map<std::int64_t, RowSums> sums_by(const Scenario& scenario, const GrainView& grains,
                                        std::span<const double> down, const RowOf& row_of) {
  std::map<std::int64_t, RowSums> sums;
  const std::size_t d = grains.dimension;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const GrainLabel label = label_of(scenario, grains.id[i]);
    if (label.row < 0) continue;
    double along = 0, settling = 0;
    for (std::size_t k = 0; k < d; ++k) {
      along += grains.position[i * d + k] * down[k];
      settling += grains.velocity[i * d + k] * down[k];
    }
    sums[row_of(label)].add(scenario, label.column, grains.position[i * d + 1], along, settling);
  }
  return sums;
}

double shadow_length(const GrainView& grains) {
  std::vector<std::pair<double, double>> extents;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const double x = grains.position[i * grains.dimension];
    extents.emplace_back(x - grains.radius[i], x + grains.radius[i]);
  }
  std::sort(extents.begin(), extents.end());
  double covered = 0, reached = -std::numeric_limits<double>::infinity();
  for (const auto& [from, to] : extents) {
    covered += std::max(0.0, to - std::max(from, reached));
    reached = std::max(reached, to);
  }
  return covered;
}

double shadow_area(const GrainView& grains, double step) {
  std::vector<std::pair<std::int64_t, std::int64_t>> cells;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const double x = grains.position[3 * i], z = grains.position[3 * i + 2], r = grains.radius[i];
    const auto cell = [&](double at) { return static_cast<std::int64_t>(std::floor(at / step)); };
    for (std::int64_t a = cell(x - r); a <= cell(x + r); ++a)
      for (std::int64_t b = cell(z - r); b <= cell(z + r); ++b) {
        const double dx = (static_cast<double>(a) + 0.5) * step - x;
        const double dz = (static_cast<double>(b) + 0.5) * step - z;
        if (dx * dx + dz * dz <= r * r) cells.emplace_back(a, b);
      }
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  return static_cast<double>(cells.size()) * step * step;
}

}  // namespace

std::vector<RowShape> row_shapes(const Scenario& scenario, const GrainView& grains,
                                 std::span<const double> down) {
  std::vector<RowShape> shapes;
  for (const auto& [row, sums] : sums_by(scenario, grains, down,
                                         [](const GrainLabel& label) { return label.row; }))
    shapes.push_back(sums.shape(row));
  return shapes;
}

RowShape cluster_shape(const Scenario& scenario, const GrainView& grains,
                       std::span<const double> down) {
  const auto sums = sums_by(scenario, grains, down, [](const GrainLabel&) { return 0; });
  if (!sums.empty()) return sums.begin()->second.shape(-1);
  RowShape none;
  none.row = -1;
  none.protrusion = none.centre_minus_edge_speed = std::numeric_limits<double>::quiet_NaN();
  return none;
}

double compactness(const GrainView& grains, const Domain& walls) {
  if (grains.size() == 0) return 0;
  if (grains.dimension == 2) return shadow_length(grains) / walls.width;
  double least = std::numeric_limits<double>::infinity();
  for (const double r : grains.radius) least = std::min(least, 2 * r);
  constexpr double pi = 3.14159265358979323846;
  const double section = walls.shape == Shape::pipe ? 0.25 * pi * walls.width * walls.width
                                                    : walls.width * walls.depth;
  return shadow_area(grains, least / 32) / section;
}

std::vector<double> wall_distances(const GrainView& grains, const Domain& walls) {
  Scenario place;
  place.domain = walls;
  place.domain.dimension = static_cast<std::int64_t>(grains.dimension);
  std::vector<double> distances(grains.size(), std::numeric_limits<double>::infinity());
  for (const Wall& wall : domain_walls(place)) {
    if (wall.number == wall_bottom || wall.number == wall_top) continue;
    for (std::size_t i = 0; i < grains.size(); ++i) {
      const double* x = grains.position.data() + i * grains.dimension;
      const double distance =
          grains.dimension == 2
              ? distance_inside<2>(wall, Vec<double, 2>(x[0], x[1]))
              : distance_inside<3>(wall, Vec<double, 3>(x[0], x[1], x[2]));
      distances[i] = std::min(distances[i], distance);
    }
  }
  return distances;
}

}  // namespace varve::core
