#include "core/observe/flow.h"

#include <algorithm>
#include <cmath>

namespace varve::core {
namespace {

constexpr double least_swirl = 0.6;

std::size_t cells_across(double length, double spacing) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(length / spacing + 0.5));
}

void push_point(std::vector<double>& points, std::size_t dimension, double x, double y, double z) {
  points.push_back(x);
  points.push_back(y);
  if (dimension == 3) points.push_back(z);
}

/// Gamma_1 at a cell; 0 where less than three quarters of the disc lie in the fluid.
double swirl_at(const FlowLattice& f, std::size_t column, std::size_t row, double radius) {
  const auto reach = static_cast<std::ptrdiff_t>(radius / f.spacing);
  double sum = 0, used = 0, all = 0;
  for (std::ptrdiff_t dj = -reach; dj <= reach; ++dj)
    for (std::ptrdiff_t di = -reach; di <= reach; ++di) {
      const double x = static_cast<double>(di), y = static_cast<double>(dj);
      if ((di == 0 && dj == 0) || (x * x + y * y) * f.spacing * f.spacing > radius * radius)
        continue;
      ++all;
      const std::ptrdiff_t i = static_cast<std::ptrdiff_t>(column) + di;
      const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(row) + dj;
      if (i < 0 || j < 0 || i >= static_cast<std::ptrdiff_t>(f.columns) ||
          j >= static_cast<std::ptrdiff_t>(f.rows))
        continue;
      const FluidAtPoint& at = f.cell(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
      const double u = at.velocity[0], v = at.velocity[1], speed = std::sqrt(u * u + v * v);
      if (!(speed > 0)) continue;
      ++used;
      sum += (x * v - y * u) / (std::sqrt(x * x + y * y) * speed);
    }
  return used >= 0.75 * all && used > 0 ? sum / used : 0;
}

void take_core(VortexCore& core, const FlowLattice& f, std::size_t column, std::size_t row,
               double swirl) {
  if (core.found && std::abs(swirl) <= std::abs(core.swirl)) return;
  core.found = true;
  core.x = f.x(column);
  core.y = f.y(row);
  core.swirl = swirl;
}

double circulation_around(const FlowLattice& f, const VortexCore& core, double radius) {
  double sum = 0;
  for (std::size_t j = 0; j < f.rows; ++j)
    for (std::size_t i = 0; i < f.columns; ++i) {
      const double x = f.x(i) - core.x, y = f.y(j) - core.y;
      if (x * x + y * y <= radius * radius) sum += f.cell(i, j).vorticity[2];
    }
  return sum * f.spacing * f.spacing;
}

}  // namespace

FlowLattice flow_lattice(const FluidPoints& fluid, const Domain& walls, double spacing) {
  FlowLattice lattice;
  lattice.left = walls.left;
  lattice.columns = cells_across(walls.width, spacing);
  lattice.spacing = walls.width / static_cast<double>(lattice.columns);
  lattice.rows = cells_across(walls.height, lattice.spacing);
  std::vector<double> points;
  for (std::size_t j = 0; j < lattice.rows; ++j)
    for (std::size_t i = 0; i < lattice.columns; ++i)
      push_point(points, fluid.dimension, lattice.x(i), lattice.y(j), 0.5 * walls.depth);
  lattice.at = sample_fluid(fluid, points);
  return lattice;
}

FlowFeatures flow_features(const FlowLattice& f, double radius) {
  FlowFeatures features;
  const double cell = f.spacing * f.spacing;
  double along = 0, squares = 0;
  for (std::size_t j = 0; j < f.rows; ++j)
    for (std::size_t i = 0; i < f.columns; ++i) {
      const FluidAtPoint& here = f.cell(i, j);
      const FluidAtPoint& there = f.cell(f.columns - 1 - i, j);
      const double u = here.velocity[0], v = here.velocity[1], w = here.vorticity[2];
      along += -u * there.velocity[0] + v * there.velocity[1];
      squares += u * u + v * v;
      features.max_speed = std::max(features.max_speed, std::sqrt(u * u + v * v));
      if (2 * i + 1 < f.columns) features.circulation_left += w * cell;
      if (2 * i + 1 > f.columns) features.circulation_right += w * cell;
      if (std::abs(w) > std::abs(features.peak_vorticity)) {
        features.peak_vorticity = w;
        features.peak_x = f.x(i);
        features.peak_y = f.y(j);
      }
      const double swirl = swirl_at(f, i, j, radius);
      if (swirl >= least_swirl) take_core(features.positive, f, i, j, swirl);
      if (swirl <= -least_swirl) take_core(features.negative, f, i, j, swirl);
    }
  if (squares > 0) features.symmetry = along / squares;
  for (VortexCore* core : {&features.positive, &features.negative})
    if (core->found) core->circulation = circulation_around(f, *core, radius);
  return features;
}

FlowThrough flow_through(const FluidPoints& superficial, const Domain& walls, double spacing,
                         double y, double from, double to, double speed) {
  FlowThrough flow;
  const std::size_t count = cells_across(walls.width, spacing);
  const double step = walls.width / static_cast<double>(count);
  std::vector<double> points, at;
  for (std::size_t i = 0; i < count; ++i) {
    at.push_back(walls.left + (static_cast<double>(i) + 0.5) * step);
    push_point(points, superficial.dimension, at.back(), y, 0.5 * walls.depth);
  }
  const std::vector<FluidAtPoint> values = sample_fluid(superficial, points);
  for (std::size_t i = 0; i < count; ++i) {
    const double passing = values[i].weight * (values[i].velocity[1] - speed) * step;
    (at[i] >= from && at[i] <= to ? flow.through : flow.beside) += passing;
  }
  const double sum = flow.through + flow.beside;
  if (sum != 0) flow.share = flow.through / sum;
  return flow;
}

}  // namespace varve::core
