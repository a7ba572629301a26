// Grains within one step: sub-steps at a frozen fluid force, contacts by a spring, a dashpot and a
// Coulomb slider with a real tangential spring (core/contact_law.h). Every contact is computed once
// and added to both partners. Contacts are visited in ascending key, so that each grain's sum runs
// over ascending partner ids, walls last.
//
// Candidates come from a list with a skin, which lives for many steps. Touches are those of them
// that touch now or did at the step's start: they are worked on eight at a time, on as many threads
// as there are, and what they exert is then summed by one thread, which moves each grain as soon as
// its sum is complete. Neither the list nor the threads reach a bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/constants.h"
#include "core/contact_sweeps.h"
#include "core/neighbors.h"
#include "core/state.h"
#include "core/walls.h"
#include "core/workers.h"

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

  explicit Contacts(InstructionSet set = best_instruction_set())
      : set_(set), sweeps_(contact_sweeps<D, P>(set)) {}

  /// Forgets the candidate list, as after a change of the state from outside.
  void reset();

  /// Moves all grains through one step of constants.dt, from the first pair of states into the
  /// second, which may be the same one. Drag is implicit in every sub-step,
  ///   v' = (v + dt_s/m (F + F_contact + K u)) / (1 + dt_s K/m),
  /// so that it is stable for any K, exact at terminal speed and zero on a grain that rests on a
  /// contact. Mass is that of the grain and of the fluid that has to move with it. A grain of
  /// `grains.driven` keeps its velocity until something touches it. Throws NumericalFailure where
  /// an overlap exceeds `overlap_limit` times the smaller diameter.
  void advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
               const std::vector<Wall>& walls, double overlap_limit, std::uint64_t step,
               const GrainState<D, P>& grains, const ContactState<D, P>& contacts,
               GrainState<D, P>& grains_after, ContactState<D, P>& contacts_after,
               Workers& workers);
  /// In place, on the caller's thread.
  void advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
               const std::vector<Wall>& walls, double overlap_limit, std::uint64_t step,
               GrainState<D, P>& grains, ContactState<D, P>& contacts) {
    Workers alone(1);
    advance(c, outer, walls, overlap_limit, step, grains, contacts, grains, contacts, alone);
  }

  /// Mean of drag and added-mass force on each grain over the last step [N]: what the fluid must
  /// lose.
  const std::vector<Vec<double, D>>& mean_drag() const { return mean_drag_; }
  /// Records of the last step, ascending key.
  std::vector<ContactRecord<D>> records() const;
  std::size_t record_count() const { return record_grain_.size(); }
  /// The same as bytes of one array per component, in the order of ContactRecord's members, for
  /// tables: valid until the next step.
  std::vector<std::span<const std::byte>> record_columns() const;
  /// Impulse of the walls on the grains in the last step [N s], lubrication included.
  Vec<double, D> wall_impulse() const;
  std::uint64_t list_builds() const { return list_builds_; }

 private:
  using Spin = Vec<double, spin_components<D>>;
  using At = TouchColumns<D>;
  using Out = PushColumns<D>;
  static constexpr std::uint32_t nothing = 0xffffffffu;
  /// A grain and its partner as indices, in the order of keys: walls after grains.
  using Pairing = std::uint64_t;
  static constexpr Pairing wall_bit = 0x80000000u;

  /// Pairs of grains that may come to touch, ascending, and those with a wall apart.
  struct Candidates {
    std::vector<std::int32_t> first, second, kind;  // kind: into Constants::pairs
    std::vector<std::uint32_t> wall_grain, wall;    // index of the wall
    std::vector<std::uint8_t> near, known;          // known: among the touches
    std::vector<std::uint8_t> wall_near, wall_known;
    std::size_t count = 0;
    Pairing pairing(std::size_t k) const {
      return static_cast<Pairing>(first[k]) << 32 | static_cast<Pairing>(second[k]);
    }
    Pairing wall_pairing(std::size_t w) const {
      return static_cast<Pairing>(wall_grain[w]) << 32 | wall_bit | wall[w];
    }
  };
  /// Contacts that exist or have existed during the step, or may in this sub-step; ascending. All
  /// arrays are as long as a multiple of `lanes`.
  struct Touches {
    std::vector<Pairing> pairing;
    std::vector<std::int32_t> grain, partner, pair;
    std::vector<std::uint32_t> candidate;  // of a wall with wall_bit; `nothing`: no longer listed
    std::vector<std::uint8_t> touching, exists, begin, end, pressed;
    std::vector<double> columns;  // TouchColumns, `stride` apart
    std::vector<std::uint32_t> walls;  // touches with walls
    std::size_t count = 0, stride = 0;
    void clear_for(std::size_t most);
    void add(Pairing pairing_of, std::int32_t pair_of, std::uint32_t candidate_of);
    void copy(const Touches& from, std::size_t t);
    void keep_existing();
    void pad();
    double* column(std::size_t number) { return columns.data() + number * stride; }
    const double* column(std::size_t number) const { return columns.data() + number * stride; }
  };
  struct Finder;
  struct PerSpecies {
    double per_mass, per_inertia, added_mass;
  };
  /// Force and torque on a grain.
  struct Load {
    double force[D];
    double torque[spin_components<D>];
  };
  /// What a step is computed from, for all its stages.
  struct Step {
    const Constants<D>& c;
    std::span<const OuterForce<D>> outer;
    const std::vector<Wall>& walls;
    double dt, overlap_limit;
    std::uint64_t number;
    Workers& workers;
  };

  bool list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const;
  void build_list(const Step& step, const GrainState<D, P>& grains);
  void find_stored(const Step& step, const GrainState<D, P>& grains,
                   const ContactState<D, P>& contacts);
  void mark_near(const Step& step, const GrainState<D, P>& grains);
  void take_up(const Step& step, const GrainState<D, P>& grains,
               const ContactState<D, P>& contacts);
  template <class Add>
  void each_marked(Add&& add) const;
  bool any_new() const;
  void widen(const Step& step, const GrainState<D, P>& grains);
  void relist(const Step& step, const GrainState<D, P>& grains);
  void meet_walls(const Step& step, const GrainState<D, P>& grains);
  ContactSweepData<D, P> sweep_data(const Step& step, const GrainState<D, P>& grains);
  void sub_step(const Step& step, bool fresh, const GrainState<D, P>& grains,
                GrainState<D, P>& after);
  void lubricate(const Step& step, std::size_t t, const GrainState<D, P>& grains, Load& own);
  void add_touch(const Step& step, const ContactSweepData<D, P>& data, std::size_t t,
                 const GrainState<D, P>& grains, Load& own);
  void move(const Step& step, std::size_t i, const GrainState<D, P>& grains,
            GrainState<D, P>& after);
  [[noreturn]] void report_overlap(const Step& step, std::size_t t,
                                   const GrainState<D, P>& grains) const;
  void store(const Step& step, const GrainState<D, P>& grains, ContactState<D, P>& contacts);
  bool is_wall(std::size_t t) const { return (touches_.pairing[t] & wall_bit) != 0; }
  std::uint8_t& known(std::uint32_t candidate);

  InstructionSet set_;
  ContactSweeps<D, P> sweeps_;
  Candidates list_;
  std::vector<Vec<Position, D>> listed_at_;
  CellGrid<D, Position> cells_;  // these three kept for their memory
  Rows rows_;
  RowParts parts_;
  Touches touches_, spare_;
  std::vector<WallMeeting<D>> meetings_;  // of touches_.walls
  std::vector<double> pushes_;
  std::vector<Load> loads_;  // per grain, of this sub-step
  std::vector<bool> touched_now_;  // per grain, where some are driven
  std::vector<PerSpecies> per_species_;
  std::vector<Vec<double, D>> mean_drag_;
  Vec<double, D> film_impulse_ = Vec<double, D>::Zero();

  // Contacts as last stored: their keys, pairings and places in the list. `stored_from_` says which
  // of the state's contacts they are where they are not all of them.
  std::vector<ContactKey> stored_keys_;
  std::vector<Pairing> stored_;
  std::vector<std::uint32_t> stored_at_, stored_from_;
  bool stored_is_valid_ = false, stored_is_listed_ = false;
  // Keys of the last step's records, as tables show them.
  std::vector<std::uint64_t> record_grain_, record_partner_;
  std::vector<std::uint8_t> record_kind_;
  std::uint64_t list_builds_ = 0;
};

}  // namespace varve::core
