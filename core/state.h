// The state of a run as a defined set: everything the next step reads and nothing that can be
// recomputed. Only the integrator (and a change at a step's end) writes it. All arrays are in
// ascending id, which is also memory order: recording is a copy.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace varve::core {

/// Precision policies: the scalar of everything, and of positions.
struct DoublePrecision {
  using Real = double;
  using Position = double;
};
struct FloatPrecision {
  using Real = float;
  using Position = float;
};
struct MixedPrecision {
  using Real = float;
  using Position = double;
};

template <class T, int D>
using Vec = Eigen::Matrix<T, D, 1>;

/// Spin has one component in 2D, three in 3D.
template <int D>
inline constexpr int spin_components = D == 2 ? 1 : 3;

struct ClockState {
  std::uint64_t step = 0;
  double time = 0;               // [s]
  double dt = 0;                 // [s]
  std::uint64_t since_step = 0;  // n_s: step of the last change of dt
  double since_time = 0;         // [s] t_s: time at n_s; time = t_s + (step - n_s) dt
};

template <int D, class P>
struct FluidState {
  using Real = typename P::Real;
  std::vector<std::uint64_t> id;
  std::vector<Real> mass;                               // [kg] (kg per m depth in 2D)
  std::vector<Vec<typename P::Position, D>> position;   // [m]
  std::vector<Vec<Real, D>> velocity;                   // [m/s]
  std::vector<Real> superficial_density;                // [kg/m3] rhob = eps rho
  std::size_t size() const { return id.size(); }
};

template <int D, class P>
struct GrainState {
  using Real = typename P::Real;
  std::vector<std::uint64_t> id;
  std::vector<std::uint32_t> species;
  std::vector<Vec<typename P::Position, D>> position;
  std::vector<Vec<Real, D>> velocity;
  std::vector<Vec<Real, spin_components<D>>> spin;  // [rad/s]; empty without rotation
  std::vector<std::uint32_t> driven;  // 1 until first touched; empty unless some are driven
  std::size_t size() const { return id.size(); }
};

/// What a grain touches: kind 0 another grain (partner: its id, larger than `grain`), kind 1 a wall
/// (partner: wall number, core/walls.h).
struct ContactKey {
  std::uint64_t grain = 0, kind = 0, partner = 0;
  auto operator<=>(const ContactKey&) const = default;
};

/// Touching contacts only, ascending key.
template <int D, class P>
struct ContactState {
  std::vector<ContactKey> key;
  std::vector<Vec<typename P::Real, D>>
      spring;  // [m] tangential elongation; empty without rotation
  std::vector<Vec<typename P::Real, spin_components<D>>>
      rolling;  // [rad] of the rolling spring; empty without rolling friction
  std::size_t size() const { return key.size(); }
};

template <int D, class P>
struct State {
  ClockState clock;
  FluidState<D, P> fluid;
  GrainState<D, P> grains;
  ContactState<D, P> contacts;
};

}  // namespace varve::core
