// Grains within one step: sub-steps at a frozen fluid force, contacts by a linear spring, dashpot
// and Coulomb slider with a real tangential spring (Cundall and Strack 1979). Every contact is
// computed once into a slot and summed per grain in ascending partner id, walls last.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/constants.h"
#include "core/neighbors.h"
#include "core/state.h"
#include "core/walls.h"

namespace varve::core {

/// What acts on a grain besides contacts, held through the sub-steps of a step: a constant force
/// and a drag K (u - v) towards the fluid's velocity u.
template <int D>
struct OuterForce {
  Vec<double, D> force = Vec<double, D>::Zero();           // [N] weight and hydrodynamic force
  Vec<double, D> fluid_velocity = Vec<double, D>::Zero();  // [m/s] u
  double coefficient = 0;                                  // [N s/m] K
};

/// What happened at one contact during one step: partial sums, a function of the state at its
/// start.
template <int D>
struct ContactRecord {
  ContactKey key;
  bool begin = false, end = false;
  double peak_force = 0;    // [N] largest normal force
  double peak_overlap = 0;  // [m]
  Vec<double, D> impulse = Vec<double, D>::Zero();  // [N s] on `key.grain`
  double impact_speed = 0;   // [m/s] normal approach speed where it begins
  double rebound_speed = 0;  // [m/s] normal separation speed where it ends
  double normal_loss = 0;      // [J] dissipated by the normal dashpot
  double tangential_loss = 0;  // [J] by the tangential dashpot
  double friction_loss = 0;    // [J] by sliding
};

template <int D, class P>
class Contacts {
 public:
  using Real = typename P::Real;
  using Position = typename P::Position;

  /// Forgets the candidate list, as after a change of the state from outside.
  void reset() {
    listed_at_.clear();
    slots_.clear();  // or a scene whose last grain was removed would keep the contacts of the dead
  }

  /// Moves all grains through one step of constants.dt. Drag is implicit in every sub-step,
  ///   v' = (v + dt_s/m (F + F_contact + K u)) / (1 + dt_s K/m),
  /// so that it is stable for any K, exact at terminal speed and zero on a grain that rests on a
  /// contact. Throws NumericalFailure where an overlap exceeds `overlap_limit` [m].
  void advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
               const std::vector<Wall>& walls, double overlap_limit, std::uint64_t step,
               GrainState<D, P>& grains, ContactState<D, P>& contacts);

  /// Mean drag on each grain over the last step [N]: what the fluid must lose.
  const std::vector<Vec<double, D>>& mean_drag() const { return mean_drag_; }
  /// Records of the last step, ascending key.
  const std::vector<ContactRecord<D>>& records() const { return records_; }
  /// Sum of contact impulses on the grains, wall contacts only [N s].
  Vec<double, D> wall_impulse() const;
  std::uint64_t list_builds() const { return list_builds_; }

 private:
  struct Slot {
    ContactKey key;
    std::uint32_t i = 0, j = 0;  // indices of the grains; j: wall index for walls
    bool is_wall = false, touching = false, touched = false;
    Vec<double, D> spring = Vec<double, D>::Zero();
    Vec<double, D> force = Vec<double, D>::Zero();                               // on grain i
    Vec<double, spin_components<D>> torque_i = Vec<double, spin_components<D>>::Zero();
    Vec<double, spin_components<D>> torque_j = Vec<double, spin_components<D>>::Zero();
    ContactRecord<D> record;
  };
  struct Geometry {
    Vec<double, D> normal;
    double overlap = 0;
  };
  bool list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const;
  void build_list(const Constants<D>& c, const std::vector<Wall>& walls,
                  const GrainState<D, P>& grains);
  void take_over(const std::vector<Slot>& old);
  void load(const ContactState<D, P>& contacts);
  void store(const Constants<D>& c, ContactState<D, P>& contacts) const;
  Geometry geometry(const Constants<D>& c, const std::vector<Wall>& walls,
                    const GrainState<D, P>& grains, const Slot& slot) const;
  void evaluate(const Constants<D>& c, const std::vector<Wall>& walls,
                const GrainState<D, P>& grains, double dt, Slot& slot) const;
  void check_overlap(const Slot& slot, double overlap, double limit, std::uint64_t step) const;
  void move(const Constants<D>& c, std::span<const OuterForce<D>> outer, double dt,
            GrainState<D, P>& grains);
  void collect();

  std::vector<Slot> slots_;               // ascending key
  std::vector<std::uint32_t> start_;      // per grain: entries of of_grain_
  std::vector<std::uint32_t> of_grain_;   // slots, pairs by ascending partner, then walls
  std::vector<Vec<Position, D>> listed_at_;
  std::vector<ContactRecord<D>> retired_;  // ended within the step and gone from the list
  std::vector<ContactRecord<D>> records_;
  std::vector<Vec<double, D>> mean_drag_;
  std::uint64_t list_builds_ = 0;
};

}  // namespace varve::core
