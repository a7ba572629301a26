#include "core/observe/fluid.h"

#include <algorithm>
#include <cmath>

#include "core/kernel.h"
#include "core/neighbors.h"

namespace varve::core {
namespace {

template <int D, Kernel K>
void sample_with(const FluidPoints& fluid, std::span<const double> points,
                 std::vector<FluidAtPoint>& result) {
  const SmoothingKernel<D, K, double> kernel(fluid.smoothing_length);
  const auto vectors = [](std::span<const double> numbers) {
    return std::span(reinterpret_cast<const Vec<double, D>*>(numbers.data()), numbers.size() / D);
  };
  const std::span<const Vec<double, D>> particles = vectors(fluid.position);
  const std::span<const Vec<double, D>> places = vectors(points);
  Periodicity<D> period;
  for (int k = 0; k < D; ++k) period.length[k] = fluid.period[static_cast<std::size_t>(k)];
  Workers alone(1);
  CellGrid<D, double> cells;
  cells.build(particles, kernel.support(), period, alone);
  const Rows near = candidates<D, double>(places, cells, kernel.support(), period, false, alone);
  for (std::size_t p = 0; p < places.size(); ++p) {
    FluidAtPoint& at = result[p];
    const auto separation = [&](std::size_t b) {
      Vec<double, D> d = places[p] - particles[b];
      for (int k = 0; k < D; ++k) {
        if (d[k] > 0.5 * period.length[k]) d[k] -= period.length[k];
        if (d[k] < -0.5 * period.length[k]) d[k] += period.length[k];
      }
      return d;
    };
    for (const std::int32_t index : near.of(p)) {
      const auto b = static_cast<std::size_t>(index);
      const double w = fluid.volume[b] * kernel.value(separation(b).norm());
      at.weight += w;
      for (std::size_t k = 0; k < D; ++k) at.velocity[k] += w * fluid.velocity[b * D + k];
      if (!fluid.pressure.empty()) at.pressure += w * fluid.pressure[b];
    }
    if (!(at.weight > 0)) continue;
    for (std::size_t k = 0; k < D; ++k) at.velocity[k] /= at.weight;
    at.pressure /= at.weight;
    for (const std::int32_t index : near.of(p)) {
      const auto b = static_cast<std::size_t>(index);
      const Vec<double, D> d = separation(b);
      const double slope = fluid.volume[b] * kernel.slope(d.norm()) / at.weight;
      std::array<double, 3> gradient{}, dv{};
      for (std::size_t k = 0; k < D; ++k) {
        gradient[k] = slope * d[static_cast<int>(k)];
        dv[k] = fluid.velocity[b * D + k] - at.velocity[k];
      }
      at.vorticity[0] += gradient[1] * dv[2] - gradient[2] * dv[1];
      at.vorticity[1] += gradient[2] * dv[0] - gradient[0] * dv[2];
      at.vorticity[2] += gradient[0] * dv[1] - gradient[1] * dv[0];
    }
  }
}

template <int D>
void sample(const FluidPoints& fluid, std::span<const double> points,
            std::vector<FluidAtPoint>& result) {
  switch (fluid.kernel) {
    case Kernel::cubic: return sample_with<D, Kernel::cubic>(fluid, points, result);
    case Kernel::quintic: return sample_with<D, Kernel::quintic>(fluid, points, result);
    case Kernel::wendland_c2: break;
  }
  sample_with<D, Kernel::wendland_c2>(fluid, points, result);
}

}  // namespace

std::vector<FluidAtPoint> sample_fluid(const FluidPoints& fluid, std::span<const double> points) {
  std::vector<FluidAtPoint> result(points.size() / fluid.dimension);
  if (fluid.volume.empty()) return result;
  if (fluid.dimension == 2)
    sample<2>(fluid, points, result);
  else
    sample<3>(fluid, points, result);
  return result;
}

std::vector<double> lattice_points(std::size_t dimension, std::span<const double> lower,
                                   std::span<const double> upper, double spacing) {
  std::array<std::size_t, 3> count{1, 1, 1};
  for (std::size_t k = 0; k < dimension; ++k)
    count[k] = std::max<std::size_t>(
        1, static_cast<std::size_t>((upper[k] - lower[k]) / spacing + 1e-9));
  std::vector<double> points;
  points.reserve(count[0] * count[1] * count[2] * dimension);
  for (std::size_t z = 0; z < count[2]; ++z)
    for (std::size_t y = 0; y < count[1]; ++y)
      for (std::size_t x = 0; x < count[0]; ++x) {
        const std::size_t at[] = {x, y, z};
        for (std::size_t k = 0; k < dimension; ++k)
          points.push_back(lower[k] + (static_cast<double>(at[k]) + 0.5) * spacing);
      }
  return points;
}

}  // namespace varve::core
