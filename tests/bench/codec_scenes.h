// Two small flows whose states feed the codec's benchmark where no log is given: a dam break (free
// surface, artificial viscosity with its switch, density diffusion, stiff equation of state) and a
// cluster of grains that settles in a closed box (laminar viscosity, linear equation of state).
// Weakly compressible SPH, v += dt a, x += dt v, density by continuity. Not the engine: only states
// that are as smooth, and as rough, as an engine's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace varve::bench {

struct SceneOptions {
  std::string scene = "dam";    ///< "dam" or "cluster"
  std::size_t particles = 5750; ///< of fluid, about
  double dt = 1e-5;             ///< [s]; 0: the largest that the scene's criterion allows
  std::size_t settle = 1500;    ///< steps at the largest dt before the first state
  std::size_t steps = 300;      ///< states to emit
  std::size_t every = 1;        ///< steps between two states
};

/// One state of the fluid.
template <class Real>
struct SceneState {
  double time = 0, dt = 0;
  std::vector<Real> x, v;  ///< x0 y0 x1 y1 ...
  std::vector<Real> rho;
};

/// Runs a scene and hands every state to `visit`. Throws std::invalid_argument for an unknown
/// scene.
template <class Real>
void run_scene(const SceneOptions& options,
               const std::function<void(const SceneState<Real>&)>& visit);

}  // namespace varve::bench
