// The numbers a step uses, computed once from a resolved scenario. Nothing here is state.
#pragma once

#include <cstdint>

#include <vector>

#include "core/contact_law.h"
#include "core/neighbors.h"
#include "core/scenario.h"
#include "core/state.h"

namespace varve::core {

/// A grain of one species.
template <int D>
struct SpeciesConstants {
  double diameter = 0, radius = 0;  // [m]
  double volume = 0, mass = 0;      // [m3], [kg] (m2 and kg/m in 2D)
  double inertia = 0;               // [kg m2] 1/2 m R^2 disc, 2/5 m R^2 sphere
  double added_mass = 0;            // [kg] of fluid that has to move with it
  double slip_factor = 1;           // [-] of the slip that is sampled: E11b
  Vec<double, D> weight = Vec<double, D>::Zero();  // [N] submerged in the excess form
};
/// All but added mass, slip factor and weight.
template <int D>
SpeciesConstants<D> species_constants(double diameter, double density);

template <int D>
struct Constants {
  // fluid
  double smoothing_length = 0;   // [m] h
  double support = 0;            // [m] kernel radius
  double reference_density = 0;  // [kg/m3] rho0
  double sound_speed = 0;        // [m/s] c0
  double viscosity = 0;          // [Pa s] mu
  double diffusion = 0;          // [-] delta
  double tait_pressure = 0;      // [Pa] B; 0: linear equation of state
  double artificial_alpha = 0, artificial_beta = 0;  // [-] of Monaghan's viscosity
  double shifting_speed = 0;  // [m/s] U of particle shifting; 0: none
  double spacing = 0;            // [m] dx
  bool full_pressure = false;
  Vec<double, D> gravity = Vec<double, D>::Zero();           // [m/s2]
  Vec<double, D> fluid_acceleration = Vec<double, D>::Zero();  // gravity (full form) and body force
  // grains
  std::vector<SpeciesConstants<D>> species;
  double largest_diameter = 0, least_diameter = 0;  // [m]
  bool frozen = false;
  // contact
  Contact contact;
  std::vector<ContactPair> pairs;  // of species i, j at i (n + 1) + j; j = n: a wall
  std::int64_t substeps = 1;
  // coupling
  bool coupled = false, two_way = false;
  double coupling_length = 0;  // [m] hc
  double porosity_floor = 0;
  bool exclude_own_volume = true;
  bool conservative_porosity = false;
  bool conjugate_pressure = false;

  double dt = 0;
  Periodicity<D> period;

  /// Fills `pairs` and the extreme diameters from species and contact.
  void set_pairs();
  bool shifts() const { return shifting_speed > 0; }
};

template <int D>
Constants<D> constants_of(const Scenario& resolved);

}  // namespace varve::core
