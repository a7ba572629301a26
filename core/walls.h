// Where the domain ends: the box, its walls and the lattice of dummy particles outside them.
//
// Walls are numbered 0 left, 1 right, 2 bottom, 3 top, in 3D also 4 front, 5 back, and 6 the curved
// wall of a pipe, which then stands for the sides and the faces; contacts name them by that number.
// A side is a wall if its boundary is no_slip or free_slip; periodic sides and a free top are none.
// The bottom lies at y = 0, the left wall at domain.left, the front at z = 0. Coordinates in m.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/scenario.h"
#include "core/state.h"

namespace varve::core {

inline constexpr std::uint32_t wall_left = 0, wall_right = 1, wall_bottom = 2, wall_top = 3,
                               wall_front = 4, wall_back = 5, wall_pipe = 6;

constexpr bool is_wall(Boundary b) { return b == Boundary::no_slip || b == Boundary::free_slip; }

/// The domain as an axis-parallel box. Periodic axes repeat with the box's length.
template <int D>
struct Box {
  Vec<double, D> lower, upper;
  std::array<bool, D> periodic{};

  double length(int axis) const { return upper[axis] - lower[axis]; }

  /// Shortest a - b over the periodic images; both points lie in the box along periodic axes.
  Vec<double, D> separation(const Vec<double, D>& a, const Vec<double, D>& b) const {
    Vec<double, D> s = a - b;
    for (int k = 0; k < D; ++k) {
      if (!periodic[static_cast<std::size_t>(k)]) continue;
      const double whole = length(k), half = 0.5 * whole;
      if (s[k] > half) s[k] -= whole;
      if (s[k] < -half) s[k] += whole;
    }
    return s;
  }

  /// The image of a point, at most one period away, in [lower, upper) along periodic axes.
  Vec<double, D> wrapped(Vec<double, D> x) const {
    for (int k = 0; k < D; ++k) {
      if (!periodic[static_cast<std::size_t>(k)]) continue;
      if (x[k] < lower[k]) x[k] += length(k);
      // Not else: a point just below `lower` may round to `upper` itself.
      if (x[k] >= upper[k]) x[k] -= length(k);
    }
    return x;
  }
};

/// The box of a resolved scenario; a pipe's is the one around it.
template <int D = 2>
Box<D> domain_box(const Scenario& scenario);

/// A plane across an axis or, where `radius` is positive, the inside of an upright round pipe.
struct Wall {
  std::uint32_t number;  ///< wall_left ...
  Boundary kind;         ///< no_slip or free_slip
  int axis;              ///< of a plane, 0: x, 1: y, 2: z; of a pipe 1
  double at;             ///< [m] coordinate of a plane along `axis`
  double inward;         ///< +1 or -1: direction of the domain along `axis`
  double speed_x = 0;    ///< [m/s] of the wall in its own plane
  double radius = 0;                  ///< [m] of a pipe, else 0
  double centre_x = 0, centre_z = 0;  ///< [m] of its axis

  bool is_pipe() const { return radius > 0; }
};

/// The walls of a resolved scenario, in ascending number.
std::vector<Wall> domain_walls(const Scenario& scenario);

/// [m] Distance of a point from the axis of a pipe.
inline double distance_from_axis(const Wall& pipe, const Vec<double, 3>& x) {
  const double out_x = x[0] - pipe.centre_x, out_z = x[2] - pipe.centre_z;
  return std::sqrt(out_x * out_x + out_z * out_z);
}

/// Signed distance [m] of a point from a wall, positive inside the domain.
template <int D>
double distance_inside(const Wall& wall, const Vec<double, D>& x) {
  if constexpr (D == 3)
    if (wall.is_pipe()) return wall.radius - distance_from_axis(wall, x);
  return wall.inward * (x[wall.axis] - wall.at);
}

/// Unit vector from the wall's nearest point towards `x` as seen from inside. On a pipe's axis,
/// where no point is nearest, it is +x.
template <int D>
Vec<double, D> inward_normal(const Wall& wall, const Vec<double, D>& x) {
  if constexpr (D == 3)
    if (wall.is_pipe()) {
      const double r = distance_from_axis(wall, x);
      if (!(r > 0)) return Vec<double, D>::Unit(0);
      return {(wall.centre_x - x[0]) / r, 0.0, (wall.centre_z - x[2]) / r};
    }
  return wall.inward * Vec<double, D>::Unit(wall.axis);
}

/// A box of which every point lies inside all walls, for a quick answer before any wall is asked:
/// the whole of a box-shaped domain, the part around the axis of a pipe. Endless where no wall is.
template <int D>
Box<D> clear_of_walls(const std::vector<Wall>& walls);

/// A fixed particle of Adami's wall model. In an edge or corner it belongs to the bottom or top
/// wall, else to the left or right one.
template <int D>
struct WallDummy {
  Vec<double, D> position;  ///< [m]
  std::uint32_t wall;       ///< wall number
  Boundary kind;            ///< of that wall
  double speed_x;           ///< [m/s] of that wall in its own plane
};

/// Layers of dummies that a fluid particle at a wall can see: kernel support / dx, rounded up.
int fluid_dummy_layers(const Scenario& scenario);
/// Layers that a grain at a wall can see within 2 hc, for porosity; 0 if the scene is not coupled.
int coupling_dummy_layers(const Scenario& scenario);

/// `layers` layers of dummies dx apart outside each wall, the first dx/2 outside, corners included,
/// none beyond periodic sides or a free top. Side walls stand as high as the domain. Row by row
/// from the bottom, in 3D each from the front, and each line from the left. Empty without fluid.
/// Throws ModelError if the domain is not a whole number of spacings wide or deep.
///
/// Around the fluid in a pipe its own lattice goes on: its wall is stepped by dx, round on the
/// mean.
template <int D = 2>
std::vector<WallDummy<D>> wall_dummies(const Scenario& scenario, int layers);

/// True if the site (i, k) of a lattice that is `count` spacings wide and deep lies within the
/// circle that the square holds, widened by `beyond` spacings. Whole numbers only: no rounding.
constexpr bool in_pipe(std::int64_t i, std::int64_t k, std::int64_t count,
                       std::int64_t beyond = 0) {
  const std::int64_t x = 2 * i + 1 - count, z = 2 * k + 1 - count, r = count + 2 * beyond;
  return x * x + z * z < r * r;
}

/// length / spacing, which must be whole to 1e-6; otherwise throws ModelError naming `key` and the
/// nearest lengths that are.
std::int64_t whole_spacings(const char* key, double length, double spacing);

}  // namespace varve::core
