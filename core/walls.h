// Where the domain ends: the box, its wall planes and the lattice of dummy particles outside them.
//
// Walls are numbered 0 left, 1 right, 2 bottom, 3 top; contacts name them by that number. A side is
// a wall if its boundary is no_slip or free_slip; periodic sides and a free top are none. The
// bottom lies at y = 0, the left wall at domain.left. Coordinates in m.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/scenario.h"
#include "core/state.h"

namespace varve::core {

inline constexpr std::uint32_t wall_left = 0, wall_right = 1, wall_bottom = 2, wall_top = 3;

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

/// The box of a resolved scenario.
Box<2> domain_box(const Scenario& scenario);

struct WallPlane {
  std::uint32_t number;  ///< wall_left ...
  Boundary kind;         ///< no_slip or free_slip
  int axis;              ///< 0: x, 1: y
  double at;             ///< [m] coordinate of the plane along `axis`
  double inward;         ///< +1 or -1: direction of the domain along `axis`
};

/// The walls of a resolved scenario, in ascending number.
std::vector<WallPlane> wall_planes(const Scenario& scenario);

/// Signed distance [m] of a point from a wall, positive inside the domain.
template <int D>
double distance_inside(const WallPlane& wall, const Vec<double, D>& x) {
  return wall.inward * (x[wall.axis] - wall.at);
}

/// A fixed particle of Adami's wall model. In a corner it belongs to the bottom or top wall.
template <int D>
struct WallDummy {
  Vec<double, D> position;  ///< [m]
  std::uint32_t wall;       ///< wall number
  Boundary kind;            ///< of that wall
};

/// Layers of dummies that a fluid particle at a wall can see: kernel support / dx, rounded up.
int fluid_dummy_layers(const Scenario& scenario);
/// Layers that a grain at a wall can see within 2 hc, for porosity; 0 if the scene is not coupled.
int coupling_dummy_layers(const Scenario& scenario);

/// `layers` layers of dummies dx apart outside each wall, the first dx/2 outside, corners included,
/// none beyond periodic sides or a free top. Side walls stand as high as the domain. Row by row
/// from the bottom, each row from the left. Empty without fluid. Throws ModelError if the domain is
/// not a whole number of spacings wide.
std::vector<WallDummy<2>> wall_dummies(const Scenario& scenario, int layers);

/// length / spacing, which must be whole to 1e-6; otherwise throws ModelError naming `key` and the
/// nearest lengths that are.
std::int64_t whole_spacings(const char* key, double length, double spacing);

}  // namespace varve::core
