// The two pair sweeps and the wall extrapolation: the hot loops of the fluid. They exist once, as
// templates over dimension, precision, kernel and periodicity (core/pair_sweeps_impl.h), and are
// compiled once per instruction set; the widest one that the processor has is chosen at run time.
//
// Eight particles are worked on side by side, each lane summing its own neighbours one after the
// other in ascending id. A lane therefore does exactly what a plain scalar loop does, at every
// vector width; a candidate beyond the kernel's support adds an exact zero, so that the skin of the
// lists reaches no bit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/instruction_sets.h"
#include "core/kernel_names.h"
#include "core/state.h"

namespace varve::core {

inline constexpr std::size_t lanes = 8;

/// What pairs ask of a particle, side by side in memory, so that a neighbour costs one load of a
/// vector as long: its position where that has the numbers' type, its velocity, then two numbers
/// that differ from sweep to sweep. Only for loops that have such vectors.
inline constexpr std::size_t record_length = 8;
template <class Real>
struct alignas(record_length * sizeof(Real)) PairRecord {
  Real number[record_length] = {};
};
template <int D, class P>
inline constexpr std::size_t record_velocity =
    sizeof(typename P::Position) == sizeof(typename P::Real) ? std::size_t(D) : 0;
template <int D, class P>
inline constexpr std::size_t record_first = record_velocity<D, P> + std::size_t(D);

/// Neighbour candidates of groups of `lanes` consecutive particles, interleaved: entry k of lane l
/// in group g is index[(start[g] + k) * lanes + l]; short lanes are filled with `filler` entries
/// that contribute nothing (the particle itself, or a padding point far away).
struct GroupedLists {
  const std::uint32_t* start = nullptr;   // groups + 1
  const std::int32_t* index = nullptr;
};

/// Numbers that a symmetric D x D matrix has.
template <int D>
inline constexpr int symmetric_numbers = D * (D + 1) / 2;

/// Arrays and numbers of a sweep. Pointers to vectors are particle-major with D components.
template <int D, class P>
struct SweepData {
  using Real = typename P::Real;
  using Position = typename P::Position;

  std::size_t count = 0;                  // fluid particles
  const Position* position = nullptr;     // [m]
  const Real* velocity = nullptr;         // [m/s]
  const Real* mass = nullptr;             // [kg]
  const Real* superficial_density = nullptr;  // rhob(n)
  const Real* porosity = nullptr;         // floored; nullptr: 1 everywhere
  /// Lists name particles by their places, which may be in another order than their indices
  /// (core/fluid_lists.h): the index at each place, or nullptr where they are the same.
  const std::int32_t* order = nullptr;
  /// What pairs read of each other, by place, in records where `reads_records`. The two numbers
  /// are rho(n) = rhob / eps and V(n) = m / rhob for `density`, push and volume for `stress`.
  const PairRecord<Real>* records = nullptr;
  const Position* place_position = nullptr;
  const Real *place_velocity = nullptr, *first = nullptr, *second = nullptr;
  GroupedLists fluid, walls;              // of fluid by place: places and dummies as candidates
  GroupedLists of_walls;                  // of dummies: fluid candidates

  std::size_t wall_count = 0;
  const Position* wall_position = nullptr;
  const Real* wall_own_velocity = nullptr;  // motion of the wall itself
  const Real* wall_volume = nullptr;        // [m3] dx^D; the padding point has 0
  const Real* wall_viscous_volume = nullptr;  // the same where no slip holds, else 0

  // What the density sweep finds, by place, and by index what others read of it.
  Real *density_out = nullptr, *volume_out = nullptr;
  Real *pressure_out = nullptr, *push_out = nullptr;  // the same numbers
  const Real* superficial_density_next = nullptr;  // rhob(n+1)
  const Real* volume = nullptr;                    // m / rhob(n+1)
  const Real* pressure = nullptr;                  // [Pa]
  Real* wall_push = nullptr;                 // [Pa] `push` extrapolated
  Real* wall_velocity = nullptr;             // for viscosity: 2 v_wall - extrapolated
  const Real* push = nullptr;  // [Pa] what pairs push each other with: p, unless `conjugate`
  Real* stress_force = nullptr;  // [N] pressure and viscous force on a particle, by place
  Real* viscous_force = nullptr;  // [N] the viscous part of it; only where `conjugate`
  Real* gradient_correction = nullptr;  // [-] symmetric_numbers<D> a place; where `corrected`
  Real* shift_velocity = nullptr;       // [m/s] with which a particle moves beside its own

  Real smoothing_length = 0, dt = 0, reference_density = 0, sound_speed = 0, viscosity = 0;
  Real diffusion = 0;               // delta of delta-SPH
  Real tait_pressure = 0;           // [Pa] B of the Tait equation of state; 0: linear
  Real artificial_alpha = 0, artificial_beta = 0;  // of Monaghan's viscosity
  Real shifting_speed = 0;          // [m/s] U of shifting
  bool conjugate = false;           // pairs push as core/coupling.h says, and so do grains
  Real gravity[D] = {};             // felt by the fluid (0 in the excess-pressure form)
  Real hydrostatic_gradient[D] = {};  // d rho / dx of the fluid at rest (full pressure), else 0
  Position period[D] = {};          // [m] 0 where not periodic
};

/// How pairs push. `conjugate`: with what core/coupling.h puts in place of p; `corrected`: along
/// gradients that are exact for linear fields (fluid.shifting).
enum class PressureSum { plain, conjugate, corrected };

/// One implementation of the loops; each works on a range of groups.
template <int D, class P>
struct PairSweeps {
  using Loop = void (*)(const SweepData<D, P>&, std::size_t group_begin, std::size_t group_end);
  Loop density = nullptr;        // fluid groups: rhob(n+1), volume, pressure, push
  Loop extrapolate = nullptr;    // wall groups: wall_push, wall_velocity
  Loop stress = nullptr;         // fluid groups: stress_force, viscous_force
  Loop artificial = nullptr;     // fluid groups: adds artificial viscosity to stress_force
  Loop shift = nullptr;          // fluid groups: shift_velocity
  bool reads_records = false;
};

template <int D, class P>
PairSweeps<D, P> pair_sweeps(Kernel kernel, bool periodic, PressureSum sum, InstructionSet set);

}  // namespace varve::core
