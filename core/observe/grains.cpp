#include "core/observe/grains.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace varve::core {
namespace {

double length(const double* v, std::size_t n) {
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k) sum += v[k] * v[k];
  return std::sqrt(sum);
}

}  // namespace

GroupMotion group_motion(const GrainView& grains, std::span<const double> down) {
  GroupMotion group;
  const std::size_t n = grains.size(), d = grains.dimension;
  if (n == 0) return group;
  const double count = static_cast<double>(n);
  group.lowest = group.highest = grains.position[1];
  for (std::size_t i = 0; i < n; ++i) {
    const double* x = grains.position.data() + i * d;
    const double* v = grains.velocity.data() + i * d;
    for (std::size_t k = 0; k < d; ++k) {
      group.mean_velocity[k] += v[k];
      group.centroid[k] += x[k];
    }
    const double speed = length(v, d);
    group.mean_speed += speed;
    group.max_speed = std::max(group.max_speed, speed);
    group.lowest = std::min(group.lowest, x[1]);
    group.highest = std::max(group.highest, x[1]);
  }
  group.mean_speed /= count;
  for (std::size_t k = 0; k < d; ++k) {
    group.mean_velocity[k] /= count;
    group.centroid[k] /= count;
    group.settling_speed += group.mean_velocity[k] * down[k];
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < d; ++k) {
      const double off = grains.position[i * d + k] - group.centroid[k];
      group.spread[k] += off * off;
    }
  for (std::size_t k = 0; k < d; ++k) group.spread[k] = std::sqrt(group.spread[k] / count);
  return group;
}

GrainEnergy grain_energy(const GrainView& grains, double inertia_factor,
                         std::span<const double> gravity) {
  GrainEnergy energy;
  const std::size_t d = grains.dimension, spins = d == 2 ? 1 : 3;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const double v = length(grains.velocity.data() + i * d, d);
    energy.translation += 0.5 * grains.mass[i] * v * v;
    for (std::size_t k = 0; k < d; ++k)
      energy.potential -= grains.mass[i] * gravity[k] * grains.position[i * d + k];
    if (grains.spin.empty()) continue;
    const double w = length(grains.spin.data() + i * spins, spins);
    energy.rotation +=
        0.5 * inertia_factor * grains.mass[i] * grains.radius[i] * grains.radius[i] * w * w;
  }
  return energy;
}

std::vector<double> nearest_gaps(const GrainView& grains, std::span<const double> period) {
  const std::size_t n = grains.size(), d = grains.dimension;
  std::vector<double> gaps(n, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) {
      double r2 = 0;
      for (std::size_t k = 0; k < d; ++k) {
        double off = std::abs(grains.position[i * d + k] - grains.position[j * d + k]);
        if (period[k] > 0 && off > 0.5 * period[k]) off = period[k] - off;
        r2 += off * off;
      }
      const double gap = std::sqrt(r2) - grains.radius[i] - grains.radius[j];
      gaps[i] = std::min(gaps[i], gap);
      gaps[j] = std::min(gaps[j], gap);
    }
  return gaps;
}

ClusterPorosity cluster_porosity(const GrainView& grains) {
  ClusterPorosity porosity;
  const std::size_t n = grains.size(), d = grains.dimension;
  if (n == 0) return porosity;
  constexpr double pi = 3.14159265358979323846;
  std::array<double, 3> low{}, high{};
  for (std::size_t k = 0; k < d; ++k) {
    low[k] = std::numeric_limits<double>::infinity();
    high[k] = -low[k];
  }
  const auto volume_of = [&](std::size_t i) {
    const double r = grains.radius[i];
    return d == 2 ? pi * r * r : 4 * pi * r * r * r / 3;
  };
  double solid = 0, box = 1;
  for (std::size_t i = 0; i < n; ++i) {
    solid += volume_of(i);
    for (std::size_t k = 0; k < d; ++k) {
      low[k] = std::min(low[k], grains.position[i * d + k] - grains.radius[i]);
      high[k] = std::max(high[k], grains.position[i * d + k] + grains.radius[i]);
    }
  }
  for (std::size_t k = 0; k < d; ++k) box *= high[k] - low[k];
  porosity.box = 1 - solid / box;
  double middle = 0;
  for (std::size_t i = 0; i < n; ++i) {
    bool inside = true;
    for (std::size_t k = 0; k < d; ++k) {
      const double quarter = 0.25 * (high[k] - low[k]), x = grains.position[i * d + k];
      inside = inside && x >= low[k] + quarter && x < high[k] - quarter;
    }
    if (inside) middle += volume_of(i);
  }
  porosity.middle = 1 - middle / (box / (d == 2 ? 4 : 8));
  return porosity;
}

GrainLabel label_of(const Scenario& scenario, std::uint64_t id) {
  const Grains& g = scenario.grains;
  const auto n = static_cast<std::int64_t>(id);
  const std::int64_t layers = scenario.domain.dimension == 3 ? g.layers : 1;
  if (n < 0 || n >= g.rows * g.columns * layers) return {};
  // Ids run along x, then z, then upwards (core/initial.h).
  return {n / (g.columns * layers), n % g.columns, (n / g.columns) % layers};
}

}  // namespace varve::core
