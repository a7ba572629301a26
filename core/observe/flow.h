// What the fluid of one state does around the grains: vortices, circulation, symmetry, and how much
// of it goes through the cluster. Taken on the x-y plane (in 3D through the middle of the depth);
// SI.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/observe/fluid.h"
#include "core/scenario.h"

namespace varve::core {

/// Kernel means of the fluid at the centres of square cells that fill the domain's width and
/// height.
struct FlowLattice {
  std::size_t columns = 0, rows = 0;
  double left = 0, spacing = 0;     ///< [m] of the domain; side of a cell
  std::vector<FluidAtPoint> at;     ///< x fastest
  double x(std::size_t column) const {
    return left + (static_cast<double>(column) + 0.5) * spacing;
  }
  double y(std::size_t row) const { return (static_cast<double>(row) + 0.5) * spacing; }
  const FluidAtPoint& cell(std::size_t column, std::size_t row) const {
    return at[row * columns + column];
  }
};
/// Cells of about `spacing` [m], a whole number of them across `walls.width`.
FlowLattice flow_lattice(const FluidPoints& fluid, const Domain& walls, double spacing);

/// The middle of a swirl: where |Gamma_1| (Graftieaux, Michard and Grosjean 2001) is largest among
/// cells of one sense of turning, and at least 0.6. Gamma_1 is the mean of sin(angle from r to u)
/// over cells within `radius`.
struct VortexCore {
  bool found = false;
  double x = 0, y = 0;      ///< [m]
  double swirl = 0;         ///< [-] Gamma_1, positive counter-clockwise
  double circulation = 0;   ///< [m2/s] integral of the vorticity within the radius
};
struct FlowFeatures {
  double peak_vorticity = 0, peak_x = 0, peak_y = 0;  ///< [1/s] largest |w|, with its sign; [m]
  double circulation_left = 0, circulation_right = 0;  ///< [m2/s] of the halves of the width
  /// [-] 1: the right half mirrors the left, -1: its opposite; sum of u . mirrored u over sum u^2.
  double symmetry = 0;
  double max_speed = 0;  ///< [m/s] of the kernel means
  VortexCore positive, negative;
};
FlowFeatures flow_features(const FlowLattice& lattice, double radius);

/// Fluid that passes a level cut at height `y` upwards relative to grains that move with `speed`
/// [m/s] along y: integral of eps (u_y - speed) over x from `from` to `to` [m], and over the rest
/// of the width [m2/s, per depth].
struct FlowThrough {
  double through = 0, beside = 0;
  double share = 0;  ///< [-] through / (through + beside); 0 where nothing passes
};
/// `superficial`: the fluid with m / rho0 as volumes, so that its kernel mean weighs with eps.
FlowThrough flow_through(const FluidPoints& superficial, const Domain& walls, double spacing,
                         double y, double from, double to, double speed);

}  // namespace varve::core
