#include "core/walls.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/kernel.h"
#include "core/math.h"
#include "core/simulation.h"
#include "core/units.h"

namespace varve::core {
namespace {

int layers_within(double radius, double spacing) {
  // A ratio such as 2.5 must not become 4 layers, nor 5 become 6, by a rounding error.
  return static_cast<int>(std::ceil(radius / spacing - 1e-9));
}

}  // namespace

template <int D>
Box<D> domain_box(const Scenario& scenario) {
  const Domain& d = scenario.domain;
  Box<D> box;
  box.lower[0] = d.left;
  box.lower[1] = 0.0;
  box.upper[0] = d.left + d.width;
  box.upper[1] = d.height;
  box.periodic[0] = d.sides == Boundary::periodic;
  box.periodic[1] = d.bottom == Boundary::periodic;
  if constexpr (D == 3) {
    box.lower[2] = 0.0;
    box.upper[2] = d.depth;
    box.periodic[2] = d.shape == Shape::box && d.faces == Boundary::periodic;
  }
  return box;
}

std::vector<Wall> domain_walls(const Scenario& scenario) {
  const Domain& d = scenario.domain;
  const bool solid = d.dimension == 3, pipe = solid && d.shape == Shape::pipe;
  std::vector<Wall> walls;
  if (is_wall(d.sides) && !pipe) {
    walls.push_back({wall_left, d.sides, 0, d.left, 1.0});
    walls.push_back({wall_right, d.sides, 0, d.left + d.width, -1.0});
  }
  if (is_wall(d.bottom)) walls.push_back({wall_bottom, d.bottom, 1, 0.0, 1.0, d.floor_speed});
  if (is_wall(d.top)) walls.push_back({wall_top, d.top, 1, d.height, -1.0, d.lid_speed});
  if (solid && !pipe && is_wall(d.faces)) {
    walls.push_back({wall_front, d.faces, 2, 0.0, 1.0});
    walls.push_back({wall_back, d.faces, 2, d.depth, -1.0});
  }
  if (pipe)
    walls.push_back({wall_pipe, d.sides, 1, 0.0, 1.0, 0.0, 0.5 * d.width,
                     d.left + 0.5 * d.width, 0.5 * d.depth});
  return walls;
}

template <int D>
Box<D> clear_of_walls(const std::vector<Wall>& walls) {
  constexpr double endless = std::numeric_limits<double>::infinity();
  Box<D> clear;
  clear.lower.setConstant(-endless);
  clear.upper.setConstant(endless);
  for (const Wall& wall : walls) {
    if (wall.is_pipe()) {
      const double inscribed = 0.7 * wall.radius;  // below the half side of the square in the round
      const double centre[] = {wall.centre_x, 0, wall.centre_z};
      for (int k = 0; k < D; k += 2) {
        clear.lower[k] = centre[k] - inscribed;
        clear.upper[k] = centre[k] + inscribed;
      }
    } else if (wall.inward > 0) {
      clear.lower[wall.axis] = wall.at;
    } else {
      clear.upper[wall.axis] = wall.at;
    }
  }
  return clear;
}
template Box<2> clear_of_walls<2>(const std::vector<Wall>&);
template Box<3> clear_of_walls<3>(const std::vector<Wall>&);

int fluid_dummy_layers(const Scenario& scenario) {
  const Fluid& f = scenario.fluid;
  return layers_within(support_ratio(f.kernel) * f.smoothing_ratio * f.spacing, f.spacing);
}

int coupling_dummy_layers(const Scenario& scenario) {
  if (!scenario.is_coupled()) return 0;
  return layers_within(2.0 * scenario.coupling.length, scenario.fluid.spacing);
}

std::int64_t whole_spacings(const char* key, double length, double spacing) {
  const std::int64_t n = nearest_integer(length / spacing);
  const double exact = static_cast<double>(n) * spacing;
  if (n >= 1 && std::abs(length - exact) <= 1e-6 * spacing) return n;
  const double below = std::floor(length / spacing) * spacing;
  std::string text = std::string(key) + ": " + rough_number(length) +
                     " m is not a whole number of fluid spacings (" + rough_number(spacing) +
                     " m); nearest: ";
  if (below > 0.5 * spacing) text += rough_number(below) + " m or ";
  throw ModelError(text + rough_number(below + spacing) + " m");
}

namespace {

/// How many sites of the dummies' lattice lie along each axis, and how many layers beyond either
/// end.
struct DummyLattice {
  std::int64_t columns, rows, layers;
  std::int64_t beside, below, above, across;
};

template <int D>
DummyLattice dummy_lattice(const Scenario& scenario, int layers) {
  const Domain& d = scenario.domain;
  const double dx = scenario.fluid.spacing;
  DummyLattice lattice;
  lattice.columns = whole_spacings("domain.width", d.width, dx);
  // A height that is no multiple of dx is legal where the fluid does not reach the top.
  const double exact_rows = d.height / dx;
  const double whole_rows =
      d.top == Boundary::free ? std::ceil(exact_rows - 1e-6) : std::floor(exact_rows + 1e-6);
  lattice.rows = static_cast<std::int64_t>(whole_rows);
  lattice.layers = 1;
  lattice.beside = is_wall(d.sides) ? layers : 0;
  lattice.below = is_wall(d.bottom) ? layers : 0;
  lattice.above = is_wall(d.top) ? layers : 0;
  lattice.across = 0;
  if constexpr (D == 3) {
    lattice.layers = whole_spacings("domain.depth", d.depth, dx);
    const bool pipe = d.shape == Shape::pipe;
    lattice.across = pipe ? lattice.beside : is_wall(d.faces) ? layers : 0;
  }
  return lattice;
}

/// The wall that site (i, j, k) belongs to, or nothing where it lies in the domain or too far out.
std::optional<std::uint32_t> wall_of_site(const Domain& d, const DummyLattice& n, std::int64_t i,
                                          std::int64_t j, std::int64_t k) {
  const bool pipe = d.dimension == 3 && d.shape == Shape::pipe;
  if (pipe && !in_pipe(i, k, n.columns, n.beside)) return std::nullopt;
  if (j < 0) return wall_bottom;
  if (j >= n.rows) return wall_top;
  if (pipe)
    return in_pipe(i, k, n.columns) ? std::nullopt : std::optional<std::uint32_t>(wall_pipe);
  if (i < 0) return wall_left;
  if (i >= n.columns) return wall_right;
  if (k < 0) return wall_front;
  if (k >= n.layers) return wall_back;
  return std::nullopt;
}

}  // namespace

template <int D>
std::vector<WallDummy<D>> wall_dummies(const Scenario& scenario, int layers) {
  std::vector<WallDummy<D>> dummies;
  if (!scenario.has_fluid() || layers <= 0) return dummies;
  const Domain& d = scenario.domain;
  const double dx = scenario.fluid.spacing;
  const Box<D> box = domain_box<D>(scenario);
  const DummyLattice n = dummy_lattice<D>(scenario, layers);
  std::array<Wall, wall_pipe + 1> walls{};
  for (const Wall& wall : domain_walls(scenario)) walls[wall.number] = wall;
  // Each coordinate is counted from its own wall, so that moving a wall moves its dummies exactly.
  const auto at = [dx](std::int64_t k, std::int64_t count, double low, double high) {
    return k < count ? low + (static_cast<double>(k) + 0.5) * dx
                     : high + (static_cast<double>(k - count) + 0.5) * dx;
  };
  for (std::int64_t j = -n.below; j < n.rows + n.above; ++j)
    for (std::int64_t k = -n.across; k < n.layers + n.across; ++k)
      for (std::int64_t i = -n.beside; i < n.columns + n.beside; ++i) {
        const std::optional<std::uint32_t> wall = wall_of_site(d, n, i, j, k);
        if (!wall) continue;
        WallDummy<D> dummy{{}, *wall, walls[*wall].kind, walls[*wall].speed_x};
        dummy.position[0] = at(i, n.columns, box.lower[0], box.upper[0]);
        dummy.position[1] = at(j, n.rows, box.lower[1], box.upper[1]);
        if constexpr (D == 3) dummy.position[2] = at(k, n.layers, box.lower[2], box.upper[2]);
        dummies.push_back(dummy);
      }
  return dummies;
}

template Box<2> domain_box<2>(const Scenario&);
template Box<3> domain_box<3>(const Scenario&);
template std::vector<WallDummy<2>> wall_dummies<2>(const Scenario&, int);
template std::vector<WallDummy<3>> wall_dummies<3>(const Scenario&, int);

}  // namespace varve::core
