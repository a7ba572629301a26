// Unresolved coupling: porosity of the fluid from the grains, hydrodynamic force and drag on each
// grain from the fluid around it, and the exact opposite on that fluid. Equation numbers as in
// core/PHYSICS.md. W is the Wendland C2 kernel with the coupling length hc, support 2 hc.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/constants.h"
#include "core/drag.h"
#include "core/neighbors.h"
#include "core/state.h"
#include "core/walls.h"
#include "core/workers.h"

namespace varve::core {

/// Fluid quantities that the coupling reads (all of one size).
template <int D, class P>
struct FluidView {
  std::span<const Vec<typename P::Position, D>> position;
  std::span<const Vec<typename P::Real, D>> velocity;
  std::span<const typename P::Real> volume;        // [m3] m / rhob
  std::span<const Vec<typename P::Real, D>> stress_force;  // [N] on each fluid particle
};

/// What the fluid does to one grain during a step.
template <int D>
struct GrainForce {
  Vec<double, D> hydrodynamic = Vec<double, D>::Zero();  // [N] V (-grad p + div tau)
  Vec<double, D> drag = Vec<double, D>::Zero();          // [N] mean of K (u - v) over the sub-steps
  Vec<double, D> fluid_velocity = Vec<double, D>::Zero();  // [m/s] u at the grain
  double porosity = 1;     // [-] felt by the grain, floored
  double coefficient = 0;  // [N s/m] K
  double weight = 0;       // [-] S_i, sum of V_a w
};

template <int D, class P>
class CouplingStage {
 public:
  using Real = typename P::Real;
  using Position = typename P::Position;

  /// True if a grain or a fluid particle may have come within 2 hc of another that its list lacks.
  bool stale(const Constants<D>& c, const State<D, P>& state, double skin) const;
  /// Candidates within `skin` beyond the support, by positions as they are now; `walls` mirror
  /// grains until the next call.
  void rebuild(const Constants<D>& c, const State<D, P>& state, std::span<const Wall> walls,
               double skin, Workers& workers);

  /// E3: eps_a = 1 - sum_j V_j w_aj, written floored to `floored` and as it is to `porosity`. w_aj
  /// is W(r_a - r_j) and, near walls, the same of the grain's images in them: what the kernel would
  /// spread beyond a wall falls to the fluid inside, and porosity is level across it. The
  /// conservative form E3' divides by sum_b V_b w_bj. Also computes all weights w of the step.
  void porosity(const Constants<D>& c, const State<D, P>& state,
                std::span<const Real> volume_before, std::span<Real> porosity,
                std::span<Real> floored, Workers& workers);

  /// E11, E12: hydrodynamic forces on all grains and their drag coefficients, at the slip that the
  /// step starts with. One-way coupling has its weights computed here.
  void forces(const Constants<D>& c, const State<D, P>& state, const FluidView<D, P>& fluid,
              const DragLaw<D>& law, Workers& workers);

  /// Takes over the drag that the grains really felt, from their motion.
  void set_drag(std::span<const Vec<double, D>> mean_drag);

  /// E13: reaction on fluid particle `a` [N]: -sum_i (F_hyd + F_drag)_i V_a w_ai / S_i.
  Vec<double, D> reaction(std::size_t a, double volume) const {
    Vec<double, D> sum = Vec<double, D>::Zero();
    for (std::uint32_t k = near_start_[a]; k < near_start_[a + 1]; ++k) {
      const Near& near = near_[k];
      sum += weights_[near.slot] * reaction_per_weight_[near.grain];
    }
    return volume * sum;
  }

  const std::vector<GrainForce<D>>& grain_forces() const { return forces_; }
  std::uint64_t fluid_clamps() const { return fluid_clamps_; }
  std::uint64_t grain_clamps() const { return grain_clamps_; }
  std::uint64_t weak_grains() const { return weak_; }

 private:
  struct Near {
    std::uint32_t grain, slot;
  };
  /// Images of a point in walls nearer than 2 hc, in a corner also those in two or three at once;
  /// a curved wall is taken as the plane that touches it where it is nearest.
  struct Images {
    std::array<Vec<double, D>, 26> at;
    int count = 0;
  };
  Images images(const Constants<D>& c, const Vec<double, D>& x) const;
  void compute_weights(const Constants<D>& c, const State<D, P>& state,
                       std::span<const Vec<Position, D>> fluid, Workers& workers);
  double others_porosity(const Constants<D>& c, const State<D, P>& state, std::size_t i) const;
  GrainForce<D> force_on(const Constants<D>& c, const State<D, P>& state,
                         const FluidView<D, P>& fluid, const DragLaw<D>& law, std::size_t i) const;

  Rows fluid_of_, grains_of_;  // per grain
  std::vector<Wall> walls_;
  std::vector<Vec<Position, D>> listed_at_;  // grains
  std::size_t listed_fluid_ = 0;
  std::vector<double> weights_;           // per slot of fluid_of_
  std::vector<std::uint32_t> near_start_;  // per fluid particle
  std::vector<Near> near_;
  std::vector<double> spread_volume_;  // V_j, or V_j / sum_b V_b w_bj
  std::vector<GrainForce<D>> forces_;
  std::vector<Vec<double, D>> reaction_per_weight_;
  std::uint64_t fluid_clamps_ = 0, grain_clamps_ = 0, weak_ = 0;  // of the last step
};

}  // namespace varve::core
