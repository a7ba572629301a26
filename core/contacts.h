// Grains within one step: sub-steps at a frozen fluid force, contacts by a spring, a dashpot and a
// Coulomb slider with a real tangential spring (core/contact_law.h). Every contact is computed once
// and added to both partners. Candidates are visited in ascending key, so that each grain's sum
// runs over ascending partner ids, walls last.
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
  double friction_loss = 0;    // [J] by sliding and rolling
};

template <int D, class P>
class Contacts {
 public:
  using Real = typename P::Real;
  using Position = typename P::Position;

  /// Forgets the candidate list, as after a change of the state from outside.
  void reset() {
    listed_at_.clear();
    candidates_.clear();
    stored_at_.clear();
  }

  /// Moves all grains through one step of constants.dt. Drag is implicit in every sub-step,
  ///   v' = (v + dt_s/m (F + F_contact + K u)) / (1 + dt_s K/m),
  /// so that it is stable for any K, exact at terminal speed and zero on a grain that rests on a
  /// contact. Mass is that of the grain and of the fluid that has to move with it. A grain of
  /// `grains.driven` keeps its velocity until something touches it. Throws NumericalFailure where
  /// an overlap exceeds `overlap_limit` times the smaller diameter.
  void advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
               const std::vector<Wall>& walls, double overlap_limit, std::uint64_t step,
               GrainState<D, P>& grains, ContactState<D, P>& contacts);

  /// Mean of drag and added-mass force on each grain over the last step [N]: what the fluid must
  /// lose.
  const std::vector<Vec<double, D>>& mean_drag() const { return mean_drag_; }
  /// Records of the last step, ascending key.
  const std::vector<ContactRecord<D>>& records() const { return records_; }
  /// Impulse of the walls on the grains in the last step [N s], lubrication included.
  Vec<double, D> wall_impulse() const;
  std::uint64_t list_builds() const { return list_builds_; }

 private:
  using Spin = Vec<double, spin_components<D>>;
  static constexpr std::uint32_t nothing = 0xffffffffu, wall_bit = 0x80000000u;
  /// A pair that may come to touch.
  struct Candidate {
    std::uint32_t i, j;   // indices of the grains; of the wall with wall_bit set
    std::uint32_t pair;   // into Constants::pairs
    std::uint32_t touch;  // into touches_ and records_
    bool is_wall() const { return (j & wall_bit) != 0; }
    std::uint32_t wall() const { return j & ~wall_bit; }
  };
  /// A contact that exists or has existed during the step.
  struct Touch {
    std::uint32_t candidate = nothing;
    bool touching = false;
    Vec<double, D> spring = Vec<double, D>::Zero();  // [m]
    Spin rolling = Spin::Zero();                     // [rad]
  };
  /// Everything that one contact is computed from.
  struct Meeting {
    const ContactPair* pair;
    Vec<double, D> normal, relative;  // relative: velocity of the centres
    double overlap;
  };
  struct PerSpecies {
    double per_mass, per_inertia, added_mass;
  };

  static ContactKey key_of(const Candidate& candidate, const std::vector<Wall>& walls,
                           const GrainState<D, P>& grains);
  bool list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const;
  void build_list(const Constants<D>& c, const std::vector<Wall>& walls,
                  const GrainState<D, P>& grains);
  void relink(const std::vector<Wall>& walls, const GrainState<D, P>& grains);
  void load(const std::vector<Wall>& walls, const GrainState<D, P>& grains,
            const ContactState<D, P>& contacts);
  bool load_where_stored(const std::vector<Wall>& walls, const GrainState<D, P>& grains,
                         const ContactState<D, P>& contacts);
  void take(const ContactState<D, P>& contacts, std::size_t from, std::uint32_t candidate);
  void store(const Constants<D>& c, ContactState<D, P>& contacts);
  std::uint32_t begin(const ContactKey& key, std::uint32_t candidate);
  template <class Law>
  void sum_forces(const Constants<D>& c, const std::vector<Wall>& walls, double dt,
                  double overlap_limit, std::uint64_t step, const GrainState<D, P>& grains);
  bool meet(const Constants<D>& c, const std::vector<Wall>& walls,
            const GrainState<D, P>& grains, const Candidate& candidate, Meeting& m) const;
  void lubricate(const Constants<D>& c, double dt, const Candidate& candidate, const Meeting& m);
  void end(const Constants<D>& c, const Candidate& candidate, const Meeting& m);
  template <class Law>
  void press(const Constants<D>& c, double dt, const GrainState<D, P>& grains,
             const Candidate& candidate, Meeting& m);
  void slide(const Constants<D>& c, double dt, const ContactResponse& response,
             const Candidate& candidate, const Meeting& m, double normal_speed,
             double normal_force, Vec<double, D>& force);
  void roll(const Constants<D>& c, double dt, const ContactResponse& response,
            const GrainState<D, P>& grains, const Candidate& candidate, const Meeting& m,
            double normal_force);
  void check_overlap(const Candidate& candidate, const Meeting& m, double limit,
                     std::uint64_t step) const;
  void move(const Constants<D>& c, std::span<const OuterForce<D>> outer, double dt,
            GrainState<D, P>& grains);

  std::vector<Candidate> candidates_;  // ascending key
  std::vector<Touch> touches_;
  std::vector<ContactRecord<D>> records_;  // one per touch; ascending key after the step
  std::vector<std::uint32_t> stored_at_;   // candidates of the contacts as last stored
  std::vector<Vec<Position, D>> listed_at_;
  std::vector<Vec<double, D>> force_;  // per grain, of this sub-step
  std::vector<Spin> torque_;
  std::vector<bool> touched_now_;      // per grain, where some are driven
  std::vector<PerSpecies> per_species_;
  std::vector<Vec<double, D>> mean_drag_;
  Vec<double, D> film_impulse_ = Vec<double, D>::Zero();
  std::uint64_t list_builds_ = 0;
};

}  // namespace varve::core
