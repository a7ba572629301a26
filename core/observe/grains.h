// What the grains of one state do as a group and each among the others. Pure functions of positions
// and velocities; vectors are particle-major with `dimension` components, SI.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/scenario.h"

namespace varve::core {

/// The grains of a decoded state, ascending id; `spin` is empty without rotation.
struct GrainView {
  std::size_t dimension = 2;
  std::span<const std::uint64_t> id;
  std::span<const double> position, velocity, spin;
  std::span<const double> radius, mass;  ///< per grain [m], [kg, per metre of depth in 2D]
  std::size_t size() const { return id.size(); }
};

/// Of all grains together, each counting once.
struct GroupMotion {
  std::array<double, 3> mean_velocity{};  ///< [m/s]
  double mean_speed = 0, max_speed = 0;   ///< [m/s] of |v|
  double settling_speed = 0;              ///< [m/s] mean velocity along gravity
  std::array<double, 3> centroid{};       ///< [m]
  std::array<double, 3> spread{};         ///< [m] standard deviation of positions
  double lowest = 0, highest = 0;         ///< [m] of the centres' y
};
/// `down`: unit vector along gravity (dimension components). All zero without grains.
GroupMotion group_motion(const GrainView& grains, std::span<const double> down);

/// Energies of the grains [J, per metre of depth in 2D].
struct GrainEnergy {
  double translation = 0, rotation = 0;  ///< 1/2 m v^2, 1/2 I w^2
  double potential = 0;  ///< -m g . x, with `gravity` as the grains feel it
};
/// `inertia_factor`: I = factor m R^2. `gravity` [m/s2], dimension components.
GrainEnergy grain_energy(const GrainView& grains, double inertia_factor,
                         std::span<const double> gravity);

/// Free space between each grain's surface and that of its nearest neighbour [m], negative where
/// they overlap; infinite for a lone grain. Periodic lengths of 0 are none.
std::vector<double> nearest_gaps(const GrainView& grains, std::span<const double> period);

/// Porosity of two regions around the grains: the least box that holds all discs or spheres, and
/// the middle half of it along each axis (a grain counts there by its centre).
struct ClusterPorosity {
  double box = 1, middle = 1;
};
ClusterPorosity cluster_porosity(const GrainView& grains);

/// Row, column and layer that a grain of the scenario's array started in, from its id; ids beyond
/// the array have none.
struct GrainLabel {
  std::int64_t row = -1, column = -1, layer = -1;
};
GrainLabel label_of(const Scenario& scenario, std::uint64_t id);

}  // namespace varve::core
