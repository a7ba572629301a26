// The hot loops of the grains: which candidates are near, and what touching pairs exert. Like the
// fluid's (core/pair_sweeps.h) they work on eight at a time and are compiled once per instruction
// set. A contact depends on its own two partners and its own history only, so that a lane does what
// a plain scalar loop would; who sums what in which order is core/contacts.cpp's business.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/contact_law.h"
#include "core/pair_sweeps.h"

namespace varve::core {

/// Where a grain stands to a wall.
template <int D>
struct WallMeeting {
  double normal[D];  // into the domain
  double distance;   // [m]
  double speed_x;    // [m/s] of the wall
};

/// One number per touch and column: `number` is the touch's, `columns` apart from one another.
/// Spins and rolling springs have one component in 2D.
template <int D>
struct TouchColumns {
  static constexpr std::size_t spins = D == 2 ? 1 : 3;
  // What lasts beyond the step.
  static constexpr std::size_t spring = 0, rolling = spring + D;
  // What happened in the step.
  static constexpr std::size_t peak_force = rolling + spins, peak_overlap = peak_force + 1,
                               impulse = peak_overlap + 1, impact_speed = impulse + D,
                               rebound_speed = impact_speed + 1, normal_loss = rebound_speed + 1,
                               tangential_loss = normal_loss + 1,
                               friction_loss = tangential_loss + 1, count = friction_loss + 1;
};

/// What a touch exerts in one sub-step, the same way: force and torque on the first partner, torque
/// on the second, moment of rolling on the first.
template <int D>
struct PushColumns {
  static constexpr std::size_t spins = D == 2 ? 1 : 3;
  static constexpr std::size_t force = 0, torque_first = D, torque_second = D + spins,
                               moment = D + 2 * spins, count = D + 3 * spins;
};

/// Arrays and numbers of the contact loops. Those per candidate and per touch are as long as a
/// multiple of `lanes`; what stands beyond the last one must be a valid index.
template <int D, class P>
struct ContactSweepData {
  using Real = typename P::Real;
  using Position = typename P::Position;

  const Position* position = nullptr;  // [m] of grains, D components each
  const Real* velocity = nullptr;
  const Real* spin = nullptr;  // nullptr: grains do not turn
  const ContactPair* pairs = nullptr;

  // Candidates of grain pairs.
  const std::int32_t *first = nullptr, *second = nullptr, *kind = nullptr;  // kind: into pairs
  std::uint8_t* near = nullptr;  // 1 where not beyond sight

  // Touches.
  std::size_t count = 0;
  const std::int32_t *grain = nullptr, *partner = nullptr;  // partner: of a wall -1 - meeting
  const std::int32_t* pair = nullptr;
  const WallMeeting<D>* meetings = nullptr;
  std::uint8_t *touching = nullptr, *exists = nullptr, *begin = nullptr, *end = nullptr;
  std::uint8_t* pressed = nullptr;  // 1 where partners overlap in this sub-step
  double* columns = nullptr;        // TouchColumns, `stride` apart
  std::size_t stride = 0;
  double* pushes = nullptr;  // PushColumns of the touches from `window` on
  std::size_t push_stride = 0, window = 0;
  bool fresh = true;  // the first sub-step: there are no sums of the step yet

  double dt = 0, friction = 0, rolling_friction = 0, rolling_damping = 0;
  double overlap_limit = 0;  // over the smaller diameter
  bool hertz = false, rolls = false, periodic = false;
  double period[D] = {};     // [m]
};

template <int D, class P>
struct ContactSweeps {
  /// Marks the candidates of groups [begin, end).
  void (*mark)(const ContactSweepData<D, P>&, std::size_t begin, std::size_t end) = nullptr;
  /// Advances the touches of groups [begin, end) by a sub-step; returns the first one that overlaps
  /// beyond the limit, or `count`.
  std::size_t (*press)(const ContactSweepData<D, P>&, std::size_t begin, std::size_t end) = nullptr;
};

template <int D, class P>
ContactSweeps<D, P> contact_sweeps(InstructionSet set);

}  // namespace varve::core
