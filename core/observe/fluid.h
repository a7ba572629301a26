// The fluid of one state between its particles: velocity, pressure and vorticity at any point, by
// the kernel the run used. Pure functions; vectors are particle-major with `dimension` components,
// SI.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/kernel_names.h"

namespace varve::core {

struct FluidPoints {
  std::size_t dimension = 2;
  std::span<const double> position, velocity;
  std::span<const double> volume;    ///< [m3, m2 in 2D] m / rhob
  std::span<const double> pressure;  ///< [Pa]; empty: none
  double smoothing_length = 0;       ///< [m]
  Kernel kernel = Kernel::wendland_c2;
  std::array<double, 3> period{};    ///< [m] 0 where not periodic
};

struct FluidAtPoint {
  /// [-] S = sum_b V_b W: about 1 in the fluid, 0 outside; everything else is 0 where S is.
  double weight = 0;
  std::array<double, 3> velocity{};   ///< [m/s] sum_b V_b v_b W / S
  double pressure = 0;                ///< [Pa] likewise
  /// [1/s] curl of sum_b V_b (v_b - v) grad W / S; in 2D its third component.
  std::array<double, 3> vorticity{};
};

/// Values at `points` (point-major, dimension components). Sums run in ascending particle.
std::vector<FluidAtPoint> sample_fluid(const FluidPoints& fluid, std::span<const double> points);

/// Points of a lattice of `spacing` that fills the box [lower, upper), cell centres, x fastest.
std::vector<double> lattice_points(std::size_t dimension, std::span<const double> lower,
                                   std::span<const double> upper, double spacing);

}  // namespace varve::core
