#include "core/walls.h"

#include <cmath>

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

Box<2> domain_box(const Scenario& scenario) {
  const Domain& d = scenario.domain;
  return {{d.left, 0.0},
          {d.left + d.width, d.height},
          {d.sides == Boundary::periodic, d.bottom == Boundary::periodic}};
}

std::vector<WallPlane> wall_planes(const Scenario& scenario) {
  const Domain& d = scenario.domain;
  const Box<2> box = domain_box(scenario);
  std::vector<WallPlane> walls;
  if (is_wall(d.sides)) {
    walls.push_back({wall_left, d.sides, 0, box.lower[0], 1.0});
    walls.push_back({wall_right, d.sides, 0, box.upper[0], -1.0});
  }
  if (is_wall(d.bottom)) walls.push_back({wall_bottom, d.bottom, 1, box.lower[1], 1.0});
  if (is_wall(d.top)) walls.push_back({wall_top, d.top, 1, box.upper[1], -1.0});
  return walls;
}

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

std::vector<WallDummy<2>> wall_dummies(const Scenario& scenario, int layers) {
  std::vector<WallDummy<2>> dummies;
  if (!scenario.has_fluid() || layers <= 0) return dummies;
  const Domain& d = scenario.domain;
  const double dx = scenario.fluid.spacing;
  const Box<2> box = domain_box(scenario);
  const std::int64_t columns = whole_spacings("domain.width", d.width, dx);
  // A height that is no multiple of dx is legal where the fluid does not reach the top.
  const double exact_rows = d.height / dx;
  const double whole_rows =
      d.top == Boundary::free ? std::ceil(exact_rows - 1e-6) : std::floor(exact_rows + 1e-6);
  const auto rows = static_cast<std::int64_t>(whole_rows);
  const std::int64_t beside = is_wall(d.sides) ? layers : 0;
  const std::int64_t below = is_wall(d.bottom) ? layers : 0;
  const std::int64_t above = is_wall(d.top) ? layers : 0;
  // Each coordinate is counted from its own wall, so that moving a wall moves its dummies exactly.
  const auto at = [dx](std::int64_t k, std::int64_t count, double low, double high) {
    return k < count ? low + (static_cast<double>(k) + 0.5) * dx
                     : high + (static_cast<double>(k - count) + 0.5) * dx;
  };
  for (std::int64_t j = -below; j < rows + above; ++j) {
    for (std::int64_t i = -beside; i < columns + beside; ++i) {
      WallDummy<2> dummy;
      if (j < 0) dummy = {{}, wall_bottom, d.bottom};
      else if (j >= rows) dummy = {{}, wall_top, d.top};
      else if (i < 0) dummy = {{}, wall_left, d.sides};
      else if (i >= columns) dummy = {{}, wall_right, d.sides};
      else continue;
      dummy.position = {at(i, columns, box.lower[0], box.upper[0]),
                        at(j, rows, box.lower[1], box.upper[1])};
      dummies.push_back(dummy);
    }
  }
  return dummies;
}

}  // namespace varve::core
