// The shape that a cluster of grains takes while it settles, and where it stands between the walls.
// Pure functions; SI.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/observe/grains.h"
#include "core/scenario.h"

namespace varve::core {

/// Of the grains that started in one row.
struct RowShape {
  std::int64_t row = 0;
  std::size_t grains = 0;
  double mean_y = 0, spread_y = 0;  ///< [m] mean and standard deviation (of the row, not a sample)
  double settling_speed = 0;        ///< [m/s] mean along gravity
  /// How far the middle of the row is ahead of its ends along gravity [m], and how much faster
  /// [m/s]: mean over the one or two middle columns less that over the first and the last. NaN for
  /// fewer than three columns.
  double protrusion = 0, centre_minus_edge_speed = 0;
};
/// Rows of the scenario's first array that have grains, ascending; `down` is the unit vector along
/// gravity.
std::vector<RowShape> row_shapes(const Scenario& scenario, const GrainView& grains,
                                 std::span<const double> down);

/// The same over all rows together: protrusion and speed of the middle columns against the ends.
RowShape cluster_shape(const Scenario& scenario, const GrainView& grains,
                       std::span<const double> down);

/// Part [-] of the cross-section of the pipe that lies in the grains' shadow along y: in 2D the
/// union of their extents along x over the width. In 3D the shadow is taken on a lattice of a
/// thirty-second of the least diameter.
double compactness(const GrainView& grains, const Domain& walls);

/// [m] From each grain's centre to the nearest side wall (x, in 3D also z; a pipe's curved wall).
/// Infinite where there is none.
std::vector<double> wall_distances(const GrainView& grains, const Domain& walls);

}  // namespace varve::core
