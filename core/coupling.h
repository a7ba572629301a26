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

/// Fluid quantities that the coupling reads (all of one size). What grains feel of the fluid's
/// stresses has two forms (coupling.pressure_force):
///   averaged   V times the mean of (-grad p + div tau) around the grain: `stress_force` is both;
///   conjugate  the pressure part from the work that moving the grain does on the fluid's density,
///              rho = rhob / eps: `stress_force` is the viscous part alone.
///
/// The conjugate forces are minus the derivatives of the fluid's internal energy, dU = sum_a V_a
/// p_a (eps_a drhob_a / rhob_a - deps_a), by the places of fluid and grains, with continuity for
/// drhob and E3' for deps: what the grains' motion does to the density comes back as work. (Sun,
/// Sakai and Yamada 2013 derive a coupling from an energy too.) With S_j = sum_b V_b w_bj and
/// p_j = sum_a V_a p_a w_aj / S_j:
///   pairs of fluid  -V_a V_b (q_a + q_b) grad W_ab, q_a = eps_a p_a + sum_j V_j w_aj p_j / S_j
///   grain on fluid  -V_a (p_a - p_j) (V_j / S_j) grad w_aj, the opposite on the grain
/// An even pressure exerts nothing on a grain and what it would without grains on the fluid. E3
/// takes the S_j written out here to be 1, which an even fluid has. Where eps_a is floored it does
/// not change with the grains: p_a counts as 0 in p_j and in the second line.
template <int D, class P>
struct FluidView {
  std::span<const Vec<typename P::Position, D>> position;
  std::span<const Vec<typename P::Real, D>> velocity;
  std::span<const typename P::Real> volume;        // [m3] m / rhob
  std::span<const Vec<typename P::Real, D>> stress_force;  // [N] on each fluid particle
  std::span<const typename P::Real> pressure = {}, porosity = {};  // conjugate: [Pa]; unfloored
};

/// What the fluid does to one grain during a step.
template <int D>
struct GrainForce {
  Vec<double, D> hydrodynamic = Vec<double, D>::Zero();  // [N] V (-grad p + div tau)
  Vec<double, D> pressure = Vec<double, D>::Zero();  // [N] of that, -V grad p; conjugate form
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

  explicit CouplingStage(InstructionSet set = best_instruction_set()) : set_(set) {}

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

  /// What pairs of fluid particles push each other with in the conjugate form [Pa], written to
  /// `push`; also finds the p_j.
  void share_pressure(const Constants<D>& c, std::span<const Real> volume,
                      std::span<const Real> pressure, std::span<const Real> porosity,
                      std::span<const Real> floored, std::span<Real> push, Workers& workers);

  /// E11, E12: hydrodynamic forces on all grains and their drag coefficients, at the slip that the
  /// step starts with. One-way coupling has its weights computed here. In the conjugate form the
  /// pressure part is, pair by pair, F = +-V_a (p_a - p_j) (V_j / S_j) grad w_aj.
  void forces(const Constants<D>& c, const State<D, P>& state, const FluidView<D, P>& fluid,
              const DragLaw<D>& law, Workers& workers);

  /// Takes over the drag that the grains really felt, from their motion.
  void set_drag(std::span<const Vec<double, D>> mean_drag);

  /// E13: reaction on fluid particle `a` [N]: -sum_i (F_hyd + F_drag)_i V_a w_ai / S_i, and in the
  /// conjugate form what grains push this very particle with.
  Vec<double, D> reaction(std::size_t a, double volume) const {
    Vec<double, D> sum = Vec<double, D>::Zero();
    for (std::uint32_t k = near_start_[a]; k < near_start_[a + 1]; ++k) {
      const Near& near = near_[k];
      sum += weights_[near.slot] * reaction_per_weight_[near.grain];
      if (!pushes_.empty()) sum += pushes_[near.slot];
    }
    return volume * sum;
  }
  /// Force [N] of walls on the fluid through the mirror images of grains: what of the conjugate
  /// forces on fluid is not matched by one on a grain.
  Vec<double, D> walls_on_fluid() const;

  /// Fluid particles that grain `i` has weights with, and those weights w_ai.
  std::span<const std::int32_t> fluid_of(std::size_t i) const { return fluid_of_.of(i); }
  std::span<const double> weights_of(std::size_t i) const {
    return std::span(weights_).subspan(fluid_of_.start[i], fluid_of_.of(i).size());
  }

  const std::vector<GrainForce<D>>& grain_forces() const { return forces_; }
  std::uint64_t fluid_clamps() const { return fluid_clamps_; }
  std::uint64_t grain_clamps() const { return grain_clamps_; }
  std::uint64_t weak_grains() const { return weak_; }

 private:
  InstructionSet set_;
  struct Near {
    std::uint32_t grain, slot;
  };
  /// Images of a point in walls nearer than 2 hc, in a corner also those in two or three at once;
  /// a curved wall is taken as the plane that touches it where it is nearest.
  struct Images {
    std::array<Vec<double, D>, 26> at;
    std::array<Vec<double, D>, 26> sign;  // -1 along axes that were mirrored, else 1
    std::array<bool, 26> curved{};        // mirrored also along `normal`, in a curved wall
    Vec<double, D> normal = Vec<double, D>::Zero();
    int count = 0;

    /// A vector at image n as its original has it.
    Vec<double, D> turned_back(std::size_t n, Vec<double, D> v) const {
      if (curved[n]) {
        double along = 0;
        for (int k = 0; k < D; ++k) along += v[k] * normal[k];
        v -= 2 * along * normal;
      }
      return sign[n].cwiseProduct(v);
    }
  };
  Images images(const Constants<D>& c, const Vec<double, D>& x) const;
  void compute_weights(const Constants<D>& c, const State<D, P>& state,
                       std::span<const Vec<Position, D>> fluid, Workers& workers);
  double others_porosity(const Constants<D>& c, const State<D, P>& state, std::size_t i) const;
  void push_apart(const Constants<D>& c, const State<D, P>& state, const FluidView<D, P>& fluid,
                  std::size_t i);
  GrainForce<D> force_on(const Constants<D>& c, const State<D, P>& state,
                         const FluidView<D, P>& fluid, const DragLaw<D>& law, std::size_t i) const;

  Rows fluid_of_, grains_of_;  // per grain
  CellGrid<D, Position> cells_;  // kept for their memory, as the parts
  RowParts parts_;
  std::vector<Wall> walls_;
  std::vector<Vec<Position, D>> listed_at_;  // grains
  std::size_t listed_fluid_ = 0;
  std::vector<double> weights_;           // per slot of fluid_of_
  std::vector<std::uint32_t> near_start_;  // per fluid particle
  std::vector<Near> near_;
  std::vector<double> spread_volume_;  // V_j, or V_j / sum_b V_b w_bj
  std::vector<double> mean_pressure_;  // [Pa] p_j of the conjugate form
  std::vector<GrainForce<D>> forces_;
  std::vector<Vec<double, D>> reaction_per_weight_;
  std::vector<Vec<double, D>> pushes_;  // [N/m3] per slot: -p_a V_j grad w_aj; empty if averaged
  std::vector<Vec<double, D>> pressure_force_, image_force_;  // [N] per grain; the same
  std::uint64_t fluid_clamps_ = 0, grain_clamps_ = 0, weak_ = 0;  // of the last step
};

}  // namespace varve::core
