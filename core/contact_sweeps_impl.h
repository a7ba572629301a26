// The contact loops, included once per instruction set (core/lanes_impl.h says what may be called
// here). The equations are core/PHYSICS.md's; a sum is written out in the order of its terms.
#pragma once

#include "core/contact_sweeps.h"
#include "core/lanes_impl.h"

namespace varve::core::VARVE_ISA {
namespace {

using Reals = Lane<double>;
using Bytes = LaneVector<std::uint8_t>::type;
using Mask = LaneVector<std::int64_t>::type;

template <int N>
struct Triple {  // N numbers per lane
  Reals at[N];
};

template <int N>
inline __attribute__((always_inline)) Reals dot(const Triple<N>& a, const Triple<N>& b) {
  Reals sum{};
  for (int k = 0; k < N; ++k) sum += a.at[k] * b.at[k];
  return sum;
}
inline __attribute__((always_inline)) Reals root(Reals value) {
  square_root<double>(value);
  return value;
}
inline __attribute__((always_inline)) Reals choose(Mask mask, Reals yes, Reals no) {
  return mask ? yes : no;
}
/// As std::max(a, b).
inline __attribute__((always_inline)) Reals larger(Reals a, Reals b) { return a < b ? b : a; }

template <class T>
inline __attribute__((always_inline)) Reals gather_wide(const T* data, const std::int32_t* index,
                                                        int stride, int component) {
  return narrow<double, T>(gather(data, index, stride, component));
}
inline __attribute__((always_inline)) Reals load(const double* from) {
  Reals value;
  __builtin_memcpy(&value, from, sizeof value);
  return value;
}
inline __attribute__((always_inline)) void store(double* to, Reals value) {
  __builtin_memcpy(to, &value, sizeof value);
}
/// Eight flags of 0 or 1.
inline __attribute__((always_inline)) std::uint64_t flags_of(const std::uint8_t* from) {
  std::uint64_t flags;
  __builtin_memcpy(&flags, from, sizeof flags);
  return flags;
}
inline __attribute__((always_inline)) std::uint64_t flags_of(Mask mask) {
  const Bytes bytes = __builtin_convertvector(mask & 1, Bytes);
  std::uint64_t flags;
  __builtin_memcpy(&flags, &bytes, sizeof flags);
  return flags;
}
inline __attribute__((always_inline)) Mask mask_of(std::uint64_t flags) {
  Bytes bytes;
  __builtin_memcpy(&bytes, &flags, sizeof bytes);
  return __builtin_convertvector(bytes, Mask) != 0;
}
inline __attribute__((always_inline)) void store_flags(std::uint8_t* to, std::uint64_t flags) {
  __builtin_memcpy(to, &flags, sizeof flags);
}

/// x_i - x_j over the nearest periodic image.
template <int D, class P>
inline __attribute__((always_inline)) Triple<D> separation(const ContactSweepData<D, P>& s,
                                                           const std::int32_t* i,
                                                           const std::int32_t* j) {
  Triple<D> d;
  for (int k = 0; k < D; ++k) {
    d.at[k] = gather_wide(s.position, i, D, k) - gather_wide(s.position, j, D, k);
    if (!s.periodic) continue;
    const double length = s.period[k];
    const Reals lengths = length - Reals{};
    d.at[k] = d.at[k] > 0.5 * length ? d.at[k] - lengths : d.at[k];
    d.at[k] = d.at[k] < -0.5 * length ? d.at[k] + lengths : d.at[k];
  }
  return d;
}

constexpr int pair_stride = static_cast<int>(sizeof(ContactPair) / sizeof(double));
static_assert(sizeof(ContactPair) % sizeof(double) == 0);

template <int D, class P>
void mark_loop(const ContactSweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  for (std::size_t at = group_begin * lanes; at < group_end * lanes; at += lanes) {
    const Triple<D> d = separation(s, s.first + at, s.second + at);
    const Mask beyond =
        dot(d, d) > gather(&s.pairs->sight2, s.kind + at, pair_stride, 0);
    store_flags(s.near + at, flags_of(~beyond));
  }
}

inline __attribute__((always_inline)) Triple<2> spin_velocity(const Triple<1>& spin,
                                                              const Triple<2>& arm) {
  return {{-spin.at[0] * arm.at[1], spin.at[0] * arm.at[0]}};
}
inline __attribute__((always_inline)) Triple<3> spin_velocity(const Triple<3>& spin,
                                                              const Triple<3>& arm) {
  return {{spin.at[1] * arm.at[2] - spin.at[2] * arm.at[1],
           spin.at[2] * arm.at[0] - spin.at[0] * arm.at[2],
           spin.at[0] * arm.at[1] - spin.at[1] * arm.at[0]}};
}
inline __attribute__((always_inline)) Triple<1> torque(const Triple<2>& arm,
                                                       const Triple<2>& force) {
  return {{arm.at[0] * force.at[1] - arm.at[1] * force.at[0]}};
}
inline __attribute__((always_inline)) Triple<3> torque(const Triple<3>& arm,
                                                       const Triple<3>& force) {
  return spin_velocity(arm, force);
}
/// Rotated into the plane across `normal`, at its length; an angle about z stays what it is.
template <int D>
inline __attribute__((always_inline)) Triple<D> into_plane(const Triple<D>& v,
                                                           const Triple<D>& normal) {
  const Reals length2 = dot(v, v), along = dot(v, normal);
  Triple<D> flat;
  for (int k = 0; k < D; ++k) flat.at[k] = v.at[k] - along * normal.at[k];
  const Reals flat2 = dot(flat, flat), scale = root(length2 / flat2);
  for (int k = 0; k < D; ++k) flat.at[k] = choose(flat2 > 0.0, flat.at[k] * scale, flat.at[k]);
  return flat;
}
inline __attribute__((always_inline)) Triple<1> into_plane(const Triple<1>& v, const Triple<2>&) {
  return v;
}
/// What of a rate of turning is rolling: not the part about the normal.
inline __attribute__((always_inline)) Triple<1> rolling_part(const Triple<1>& turning,
                                                             const Triple<2>&) {
  return turning;
}
inline __attribute__((always_inline)) Triple<3> rolling_part(const Triple<3>& turning,
                                                             const Triple<3>& normal) {
  const Reals about = dot(turning, normal);
  Triple<3> rest;
  for (int k = 0; k < 3; ++k) rest.at[k] = turning.at[k] - about * normal.at[k];
  return rest;
}

/// Eight touches in one sub-step.
template <int D, class P>
struct Press {
  static constexpr int spins = D == 2 ? 1 : 3;
  using At = TouchColumns<D>;
  using Out = PushColumns<D>;
  const ContactSweepData<D, P>& s;
  const std::size_t at;
  std::int32_t j[lanes];  // of a wall the grain itself
  bool walled = false;
  Triple<D> normal, relative;
  Triple<spins> spin_i, spin_j;
  Reals overlap, closing;
  Mask pressed;
  // Spring and dashpot (core/contact_law.h).
  Reals elastic, damping, tangential_stiffness, tangential_damping, normal_stiffness;

  inline __attribute__((always_inline)) Press(const ContactSweepData<D, P>& data,
                                              std::size_t group)
      : s(data), at(group * lanes) {}

  inline __attribute__((always_inline)) Reals coefficient(const double* first) const {
    return gather(first, s.pair + at, pair_stride, 0);
  }
  double* column(std::size_t number) const { return s.columns + number * s.stride + at; }
  /// A sum of the step as it stands.
  inline __attribute__((always_inline)) Reals sum(std::size_t number) const {
    return s.fresh ? Reals{} : load(column(number));
  }
  /// Written where partners overlap; elsewhere a sum stays.
  inline __attribute__((always_inline)) void update(std::size_t number, Reals value) const {
    store(column(number), choose(pressed, value, sum(number)));
  }
  inline __attribute__((always_inline)) void push(std::size_t number, Reals value) const {
    store(s.pushes + number * s.push_stride + (at - s.window), value);
  }

  /// Where the partners are and how they move.
  inline __attribute__((always_inline)) void meet() {
    const std::int32_t* const i = s.grain + at;
    for (std::size_t l = 0; l < lanes; ++l) {
      const std::int32_t partner = s.partner[at + l];
      j[l] = partner < 0 ? i[l] : partner;
      walled = walled || partner < 0;
    }
    const Triple<D> d = separation(s, i, j);
    Reals distance = root(dot(d, d));
    // Two grains on one point have no normal of their own; x is as good as any, always the same.
    for (int k = 0; k < D; ++k)
      normal.at[k] =
          choose(distance > 0.0, d.at[k] / distance, (k == 0 ? 1.0 : 0.0) - Reals{});
    Triple<D> other;
    for (int k = 0; k < D; ++k) other.at[k] = gather_wide(s.velocity, j, D, k);
    for (int k = 0; k < spins; ++k) {
      spin_i.at[k] = s.spin ? gather_wide(s.spin, i, spins, k) : Reals{};
      spin_j.at[k] = s.spin ? gather_wide(s.spin, j, spins, k) : Reals{};
    }
    if (walled)
      for (std::size_t l = 0; l < lanes; ++l) {
        const std::int32_t partner = s.partner[at + l];
        if (partner >= 0) continue;
        const WallMeeting<D>& meeting = s.meetings[-1 - partner];
        distance[l] = meeting.distance;
        for (int k = 0; k < D; ++k) {
          normal.at[k][l] = meeting.normal[k];
          other.at[k][l] = k == 0 ? meeting.speed_x : 0;
        }
        for (int k = 0; k < spins; ++k) spin_j.at[k][l] = 0;
      }
    overlap = coefficient(&s.pairs->reach) - distance;
    for (int k = 0; k < D; ++k)
      relative.at[k] = gather_wide(s.velocity, i, D, k) - other.at[k];
    pressed = overlap > 0.0;
    closing = dot(relative, normal);
  }

  /// Contacts that end: what the tangential spring still holds goes with them.
  inline __attribute__((always_inline)) void let_go(std::uint64_t ending) const {
    const Mask ended = mask_of(ending);
    store(column(At::rebound_speed), choose(ended, closing, load(column(At::rebound_speed))));
    Triple<D> spring;
    for (int k = 0; k < D; ++k) spring.at[k] = load(column(At::spring + std::size_t(k)));
    const Reals stiffness =
        s.hertz ? Reals{} : coefficient(&s.pairs->tangential_stiffness);
    const Reals loss = load(column(At::tangential_loss));
    store(column(At::tangential_loss),
          choose(ended, loss + 0.5 * stiffness * dot(spring, spring), loss));
    for (std::size_t k = At::spring; k < At::peak_force; ++k)
      store(column(k), choose(ended, Reals{}, load(column(k))));
  }

  inline __attribute__((always_inline)) void respond() {
    const Reals stiffness = coefficient(&s.pairs->stiffness),
                dashpot = coefficient(&s.pairs->damping);
    tangential_stiffness = coefficient(&s.pairs->tangential_stiffness);
    if (s.hertz) {
      const Reals width = root(overlap), stretched = stiffness * width;
      tangential_stiffness = tangential_stiffness * width;
      elastic = 2.0 / 3.0 * stretched * overlap;
      damping = dashpot * root(stretched);
      tangential_damping = dashpot * root(tangential_stiffness);
      normal_stiffness = stretched;
    } else {
      elastic = stiffness * overlap;
      damping = tangential_damping = dashpot;
      normal_stiffness = stiffness;
    }
  }

  /// Adds what the partners' turning moves the place of contact by.
  inline __attribute__((always_inline)) void turn() {
    const Reals first = -coefficient(&s.pairs->radius_i), second = coefficient(&s.pairs->radius_j);
    Triple<D> arm;
    for (int k = 0; k < D; ++k) arm.at[k] = first * normal.at[k];
    const Triple<D> of_first = spin_velocity(spin_i, arm);
    for (int k = 0; k < D; ++k) arm.at[k] = second * normal.at[k];
    Triple<D> of_second = spin_velocity(spin_j, arm);
    if (walled)
      for (std::size_t l = 0; l < lanes; ++l)
        for (int k = 0; k < D; ++k)
          if (s.partner[at + l] < 0) of_second.at[k][l] = 0;
    for (int k = 0; k < D; ++k) {
      relative.at[k] += of_first.at[k];
      relative.at[k] -= of_second.at[k];
    }
  }

  /// F_t = -k_t xi - eta v_t, cut at mu F_n with the spring shortened to match; added to `force`.
  inline __attribute__((always_inline)) void slide(Reals normal_speed, Reals normal_force,
                                                   Triple<D>& force) const {
    const Reals stiffness = tangential_stiffness, eta = tangential_damping;
    Triple<D> before, sliding, tried, spring, drag, change;
    for (int k = 0; k < D; ++k) {
      sliding.at[k] = relative.at[k] - normal_speed * normal.at[k];
      before.at[k] = load(column(At::spring + std::size_t(k)));
    }
    before = into_plane<D>(before, normal);
    for (int k = 0; k < D; ++k) {
      tried.at[k] = before.at[k] + s.dt * sliding.at[k];
      drag.at[k] = -stiffness * tried.at[k] - eta * sliding.at[k];
    }
    const Reals size = root(dot(drag, drag)), most = s.friction * normal_force;
    const Mask cut = size > most;
    const Reals factor = most / size;
    for (int k = 0; k < D; ++k) {
      drag.at[k] = choose(cut, drag.at[k] * factor, drag.at[k]);
      spring.at[k] = choose(cut & (stiffness > 0.0),
                            -(drag.at[k] + eta * sliding.at[k]) / stiffness, tried.at[k]);
    }
    // What the spring is shortened by is slip, and the slider's work on it friction; what the
    // spring takes and does not store is the dashpot's.
    const Reals stored = 0.5 * stiffness * (dot(spring, spring) - dot(before, before));
    for (int k = 0; k < D; ++k) change.at[k] = tried.at[k] - spring.at[k];
    update(At::friction_loss, sum(At::friction_loss) - dot(drag, change));
    for (int k = 0; k < D; ++k) change.at[k] = spring.at[k] - before.at[k];
    update(At::tangential_loss, sum(At::tangential_loss) - (dot(drag, change) + stored));
    const Reals first = -coefficient(&s.pairs->radius_i), second = coefficient(&s.pairs->radius_j);
    Triple<D> arm, back;
    for (int k = 0; k < D; ++k) {
      double* const to = column(At::spring + std::size_t(k));
      store(to, choose(pressed, spring.at[k], load(to)));
      force.at[k] += drag.at[k];
      back.at[k] = -drag.at[k];
      arm.at[k] = first * normal.at[k];
    }
    const Triple<spins> on_first = torque(arm, drag);
    for (int k = 0; k < D; ++k) arm.at[k] = second * normal.at[k];
    const Triple<spins> on_second = torque(arm, back);
    for (int k = 0; k < spins; ++k) {
      push(Out::torque_first + std::size_t(k), on_first.at[k]);
      push(Out::torque_second + std::size_t(k), on_second.at[k]);
    }
  }

  /// A rolling spring that yields at mu_r R* F_n (Ai et al. 2011, model C): M = -k_r theta, with a
  /// dashpot as long as it has not yielded.
  inline __attribute__((always_inline)) void roll(Reals normal_force) const {
    Triple<spins> turning, before, angle, moment;
    for (int k = 0; k < spins; ++k) {
      turning.at[k] = spin_i.at[k] - spin_j.at[k];
      before.at[k] = load(column(At::rolling + std::size_t(k)));
    }
    turning = rolling_part(turning, normal);
    before = into_plane(before, normal);
    const Reals stiffness = coefficient(&s.pairs->rolling_stiffness) * normal_stiffness;
    const Reals most =
        s.rolling_friction * coefficient(&s.pairs->effective_radius) * normal_force;
    for (int k = 0; k < spins; ++k) {
      angle.at[k] = before.at[k] + s.dt * turning.at[k];
      moment.at[k] = -stiffness * angle.at[k];
    }
    const Reals size = root(dot(moment, moment)), factor = most / size;
    const Reals dashpot = 2 * s.rolling_damping *
                          root(stiffness * coefficient(&s.pairs->rolling_inertia));
    const Mask cut = size > most;
    for (int k = 0; k < spins; ++k) {
      const Reals yielded = moment.at[k] * factor;
      angle.at[k] = choose(cut, -yielded / stiffness, angle.at[k]);
      moment.at[k] = choose(cut, yielded, moment.at[k] - dashpot * turning.at[k]);
    }
    update(At::friction_loss, load(column(At::friction_loss)) -
                                  (s.dt * dot(moment, turning) +
                                   0.5 * stiffness * (dot(angle, angle) - dot(before, before))));
    for (int k = 0; k < spins; ++k) {
      double* const to = column(At::rolling + std::size_t(k));
      store(to, choose(pressed, angle.at[k], load(to)));
      push(Out::moment + std::size_t(k), moment.at[k]);
    }
  }

  /// E10. The normal points to the first partner. F_n = max(0, elastic - eta v_n): the dashpot
  /// never pulls.
  inline __attribute__((always_inline)) void exert(std::uint64_t beginning) {
    if (s.spin) turn();
    const Reals normal_speed = dot(relative, normal);
    update(At::impact_speed,
           choose(mask_of(beginning), -normal_speed, sum(At::impact_speed)));
    respond();
    const Reals normal_force = larger(Reals{}, elastic - damping * normal_speed);
    Triple<D> force;
    for (int k = 0; k < D; ++k) force.at[k] = normal_force * normal.at[k];
    update(At::peak_force, larger(sum(At::peak_force), normal_force));
    update(At::peak_overlap, larger(sum(At::peak_overlap), overlap));
    update(At::normal_loss,
           sum(At::normal_loss) + (elastic - normal_force) * normal_speed * s.dt);
    if (s.spin) {
      slide(normal_speed, normal_force, force);
      if (s.rolls) roll(normal_force);
    }
    for (int k = 0; k < D; ++k) {
      const std::size_t number = At::impulse + std::size_t(k);
      update(number, sum(number) + s.dt * force.at[k]);
      push(Out::force + std::size_t(k), force.at[k]);
    }
  }
};

template <int D, class P>
std::size_t press_loop(const ContactSweepData<D, P>& s, std::size_t group_begin,
                       std::size_t group_end) {
  using At = TouchColumns<D>;
  std::size_t worst = s.count;
  for (std::size_t group = group_begin; group < group_end; ++group) {
    Press<D, P> eight(s, group);
    const std::size_t at = group * lanes;
    eight.meet();
    const std::uint64_t pressed = flags_of(eight.pressed), touching = flags_of(s.touching + at);
    const std::uint64_t none = s.fresh ? 0 : ~std::uint64_t(0);
    if (s.fresh) {
      store(eight.column(At::rebound_speed), Reals{});
      if (!s.spin) {
        store(eight.column(At::tangential_loss), Reals{});
        store(eight.column(At::friction_loss), Reals{});
      }
    }
    eight.exert(pressed & ~touching);
    if ((touching & ~pressed) != 0) eight.let_go(touching & ~pressed);
    store_flags(s.begin + at, (flags_of(s.begin + at) & none) | (pressed & ~touching));
    store_flags(s.end + at, (flags_of(s.end + at) & none) | (touching & ~pressed));
    store_flags(s.exists + at, flags_of(s.exists + at) | pressed);
    store_flags(s.touching + at, pressed);
    store_flags(s.pressed + at, pressed);
    const std::uint64_t beyond =
        flags_of(eight.overlap >
                 s.overlap_limit * eight.coefficient(&s.pairs->least_diameter)) & pressed;
    if (beyond == 0 || worst < s.count) continue;
    for (std::size_t l = lanes; l-- > 0;)
      if (s.touching[at + l] != 0 && eight.overlap[l] > s.overlap_limit *
                                         s.pairs[s.pair[at + l]].least_diameter)
        if (at + l < s.count) worst = at + l;
  }
  return worst;
}

}  // namespace

template <int D, class P>
ContactSweeps<D, P> touch_sweeps() {
  return {mark_loop<D, P>, press_loop<D, P>};
}
template ContactSweeps<2, DoublePrecision> touch_sweeps<2, DoublePrecision>();
template ContactSweeps<2, FloatPrecision> touch_sweeps<2, FloatPrecision>();
template ContactSweeps<2, MixedPrecision> touch_sweeps<2, MixedPrecision>();
template ContactSweeps<3, DoublePrecision> touch_sweeps<3, DoublePrecision>();
template ContactSweeps<3, FloatPrecision> touch_sweeps<3, FloatPrecision>();
template ContactSweeps<3, MixedPrecision> touch_sweeps<3, MixedPrecision>();

}  // namespace varve::core::VARVE_ISA
