#include "core/contacts.h"

#include <algorithm>
#include <cmath>

#include "core/simulation.h"

namespace varve::core {

namespace {

// The candidate list reaches this far beyond touching; it is rebuilt when a grain has moved by half
// of it. Pairs that do not touch exert nothing, so that the reach changes no bit.
constexpr double list_skin_per_diameter = 0.2;

/// Written out, since the order of a sum is part of the contract.
template <int D>
double dot(const Vec<double, D>& a, const Vec<double, D>& b) {
  double sum = 0;
  for (int k = 0; k < D; ++k) sum += a[k] * b[k];
  return sum;
}

/// Velocity at arm r of a body spinning with `spin`: spin x r.
Vec<double, 2> spin_velocity(const Vec<double, 1>& spin, const Vec<double, 2>& arm) {
  return {-spin[0] * arm[1], spin[0] * arm[0]};
}
Vec<double, 3> spin_velocity(const Vec<double, 3>& spin, const Vec<double, 3>& arm) {
  return {spin[1] * arm[2] - spin[2] * arm[1], spin[2] * arm[0] - spin[0] * arm[2],
          spin[0] * arm[1] - spin[1] * arm[0]};
}
/// Torque of a force at arm r: r x f.
Vec<double, 1> torque(const Vec<double, 2>& arm, const Vec<double, 2>& force) {
  return Vec<double, 1>(arm[0] * force[1] - arm[1] * force[0]);
}
Vec<double, 3> torque(const Vec<double, 3>& arm, const Vec<double, 3>& force) {
  return spin_velocity(arm, force);
}

template <int D, class Position>
Vec<double, D> difference(const Constants<D>& c, const Vec<Position, D>& a,
                          const Vec<Position, D>& b) {
  Vec<double, D> d;
  for (int k = 0; k < D; ++k) {
    d[k] = static_cast<double>(a[k]) - static_cast<double>(b[k]);
    const double length = c.period.length[k];
    if (d[k] > 0.5 * length) d[k] -= length;
    if (d[k] < -0.5 * length) d[k] += length;
  }
  return d;
}

}  // namespace

template <int D, class P>
bool Contacts<D, P>::list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const {
  if (listed_at_.size() != grains.size()) return true;
  const double reach = 0.5 * list_skin_per_diameter * c.diameter;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const Vec<double, D> moved = difference(c, grains.position[i], listed_at_[i]);
    if (!(dot<D>(moved, moved) < reach * reach)) return true;
  }
  return false;
}

template <int D, class P>
void Contacts<D, P>::build_list(const Constants<D>& c, const std::vector<Wall>& walls,
                                const GrainState<D, P>& grains) {
  Workers alone(1);
  const double reach = (1 + list_skin_per_diameter) * c.diameter;
  const std::span<const Vec<Position, D>> points(grains.position);
  CellGrid<D, Position> cells;
  cells.build(points, reach, c.period);
  const Rows rows = candidates<D, Position>(points, cells, reach, c.period, true, alone);
  std::vector<Slot> old;
  old.swap(slots_);
  std::vector<std::vector<std::uint32_t>> pairs(grains.size()), with_walls(grains.size());
  for (std::uint32_t i = 0; i < grains.size(); ++i) {
    for (const std::int32_t each : rows.of(i)) {
      const auto j = static_cast<std::uint32_t>(each);
      if (j < i) continue;
      Slot slot;
      slot.key = {grains.id[i], 0, grains.id[j]};
      slot.i = i;
      slot.j = j;
      slots_.push_back(slot);
    }
    for (std::uint32_t w = 0; w < walls.size(); ++w) {
      const Vec<double, D> x = grains.position[i].template cast<double>();
      if (distance_inside<D>(walls[w], x) > reach - c.radius) continue;
      Slot slot;
      slot.key = {grains.id[i], 1, walls[w].number};
      slot.i = i;
      slot.j = w;
      slot.is_wall = true;
      slots_.push_back(slot);
    }
  }
  for (std::uint32_t k = 0; k < slots_.size(); ++k) {
    if (slots_[k].is_wall) {
      with_walls[slots_[k].i].push_back(k);
      continue;
    }
    pairs[slots_[k].i].push_back(k);
    pairs[slots_[k].j].push_back(k);
  }
  start_.assign(grains.size() + 1, 0);
  of_grain_.clear();
  for (std::uint32_t i = 0; i < grains.size(); ++i) {
    // Slots of lower partners come first in slot order, then those of higher ones: ascending
    // partner.
    of_grain_.insert(of_grain_.end(), pairs[i].begin(), pairs[i].end());
    of_grain_.insert(of_grain_.end(), with_walls[i].begin(), with_walls[i].end());
    start_[i + 1] = static_cast<std::uint32_t>(of_grain_.size());
  }
  take_over(old);
  listed_at_ = grains.position;
  ++list_builds_;
}

/// A list made within a step takes over what its contacts have been through.
template <int D, class P>
void Contacts<D, P>::take_over(const std::vector<Slot>& old) {
  std::size_t into = 0;
  for (const Slot& slot : old) {
    while (into < slots_.size() && slots_[into].key < slot.key) ++into;
    if (into < slots_.size() && slots_[into].key == slot.key)
      slots_[into] = slot;
    else if (slot.touched)
      retired_.push_back(slot.record);
  }
}

template <int D, class P>
void Contacts<D, P>::load(const ContactState<D, P>& contacts) {
  std::size_t from = 0;
  for (Slot& slot : slots_) {
    while (from < contacts.size() && contacts.key[from] < slot.key) ++from;
    const bool held = from < contacts.size() && contacts.key[from] == slot.key;
    slot.touching = slot.touched = held;
    slot.spring = held && !contacts.spring.empty()
                      ? Vec<double, D>(contacts.spring[from].template cast<double>())
                      : Vec<double, D>(Vec<double, D>::Zero());
    slot.record = {};
    slot.record.key = slot.key;
  }
}

template <int D, class P>
void Contacts<D, P>::store(const Constants<D>& c, ContactState<D, P>& contacts) const {
  contacts.key.clear();
  contacts.spring.clear();
  for (const Slot& slot : slots_) {
    if (!slot.touching) continue;
    contacts.key.push_back(slot.key);
    if (c.rotation) contacts.spring.push_back(slot.spring.template cast<Real>());
  }
}

template <int D, class P>
typename Contacts<D, P>::Geometry Contacts<D, P>::geometry(
    const Constants<D>& c, const std::vector<Wall>& walls, const GrainState<D, P>& grains,
    const Slot& slot) const {
  Geometry g;
  if (slot.is_wall) {
    const Wall& wall = walls[slot.j];
    const Vec<double, D> x = grains.position[slot.i].template cast<double>();
    g.normal = inward_normal<D>(wall, x);
    g.overlap = c.radius - distance_inside<D>(wall, x);
    return g;
  }
  const Vec<double, D> d = difference(c, grains.position[slot.i], grains.position[slot.j]);
  const double r = std::sqrt(dot<D>(d, d));
  // Two grains on one point have no normal of their own; x is as good as any and always the same.
  g.normal = r > 0 ? Vec<double, D>(d / r) : Vec<double, D>(Vec<double, D>::Unit(0));
  g.overlap = c.diameter - r;
  return g;
}

/// E10. n points to grain i. F_n = max(0, k delta - eta v_n), eta = alpha sqrt(m_eff k); the
/// dashpot never pulls. F_t = -k_t xi - eta v_t, cut at mu F_n with the spring shortened to match.
template <int D, class P>
void Contacts<D, P>::evaluate(const Constants<D>& c, const std::vector<Wall>& walls,
                              const GrainState<D, P>& grains, double dt, Slot& slot) const {
  const Geometry g = geometry(c, walls, grains, slot);
  slot.force.setZero();
  slot.torque_i.setZero();
  slot.torque_j.setZero();
  Vec<double, D> relative = grains.velocity[slot.i].template cast<double>();
  if (slot.is_wall)
    relative[0] -= walls[slot.j].speed_x;
  else
    relative -= grains.velocity[slot.j].template cast<double>();
  if (!(g.overlap > 0)) {
    if (slot.touching) {
      slot.record.end = true;
      slot.record.rebound_speed = dot<D>(relative, g.normal);
      // What the tangential spring still holds goes with it.
      slot.record.tangential_loss +=
          0.5 * c.tangential_stiffness * dot<D>(slot.spring, slot.spring);
    }
    slot.touching = false;
    slot.spring.setZero();
    return;
  }
  const Vec<double, D> arm_i = -c.radius * g.normal, arm_j = c.radius * g.normal;
  if (c.rotation) {
    relative += spin_velocity(grains.spin[slot.i].template cast<double>(), arm_i);
    if (!slot.is_wall)
      relative -= spin_velocity(grains.spin[slot.j].template cast<double>(), arm_j);
  }
  const double normal_speed = dot<D>(relative, g.normal);
  if (!slot.touching) {
    slot.record.begin = true;
    slot.record.impact_speed = -normal_speed;
    slot.touching = slot.touched = true;
  }
  const double effective = slot.is_wall ? c.grain_mass : 0.5 * c.grain_mass;
  const double eta = c.damping * std::sqrt(effective * c.stiffness);
  const double elastic = c.stiffness * g.overlap;
  const double normal_force = std::max(0.0, elastic - eta * normal_speed);
  slot.force = normal_force * g.normal;
  slot.record.peak_force = std::max(slot.record.peak_force, normal_force);
  slot.record.peak_overlap = std::max(slot.record.peak_overlap, g.overlap);
  slot.record.normal_loss += (elastic - normal_force) * normal_speed * dt;
  if (c.rotation) {
    const Vec<double, D> sliding = relative - normal_speed * g.normal;
    // Rotated into the present tangent plane at its length, then stretched.
    const double length2 = dot<D>(slot.spring, slot.spring);
    Vec<double, D> spring = slot.spring - dot<D>(slot.spring, g.normal) * g.normal;
    const double flat2 = dot<D>(spring, spring);
    if (flat2 > 0) spring *= std::sqrt(length2 / flat2);
    const Vec<double, D> before = spring;
    spring += dt * sliding;
    const Vec<double, D> tried = spring;
    Vec<double, D> force = -c.tangential_stiffness * spring - eta * sliding;
    const double size = std::sqrt(dot<D>(force, force));
    if (size > c.friction * normal_force) {
      force *= c.friction * normal_force / size;
      if (c.tangential_stiffness > 0) spring = -(force + eta * sliding) / c.tangential_stiffness;
    }
    // What the spring is shortened by is slip, and the slider's work on it friction; what the
    // spring takes and does not store is the dashpot's.
    const double stored =
        0.5 * c.tangential_stiffness * (dot<D>(spring, spring) - dot<D>(before, before));
    slot.record.friction_loss -= dot<D>(force, tried - spring);
    slot.record.tangential_loss -= dot<D>(force, spring - before) + stored;
    slot.spring = spring;
    slot.force += force;
    slot.torque_i = torque(arm_i, force);
    slot.torque_j = torque(arm_j, -force);
  }
  slot.record.impulse += dt * slot.force;
}

template <int D, class P>
void Contacts<D, P>::check_overlap(const Slot& slot, double overlap, double limit,
                                   std::uint64_t step) const {
  if (!(overlap > limit)) return;
  const std::string partner = slot.is_wall ? "wall " + std::to_string(slot.key.partner)
                                           : "grain " + std::to_string(slot.key.partner);
  throw NumericalFailure("overlap with " + partner, step, "grains.position", slot.key.grain,
                         overlap, limit, "raise contact.stiffness or lower the impact speed");
}

template <int D, class P>
void Contacts<D, P>::collect() {
  records_.swap(retired_);
  retired_.clear();
  for (const Slot& slot : slots_)
    if (slot.touched) records_.push_back(slot.record);
  std::sort(records_.begin(), records_.end(),
            [](const auto& a, const auto& b) { return a.key < b.key; });
}

/// One sub-step of the motion under the contact forces in the slots.
template <int D, class P>
void Contacts<D, P>::move(const Constants<D>& c, std::span<const OuterForce<D>> outer, double dt,
                          GrainState<D, P>& grains) {
  const double per_mass = dt / c.grain_mass, per_inertia = dt / c.grain_inertia;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    Vec<double, D> total = outer[i].force;
    Vec<double, spin_components<D>> turning = Vec<double, spin_components<D>>::Zero();
    for (std::uint32_t k = start_[i]; k < start_[i + 1]; ++k) {
      const Slot& slot = slots_[of_grain_[k]];
      if (!slot.touching) continue;
      if (slot.i == i) {
        total += slot.force;
        turning += slot.torque_i;
      } else {
        total -= slot.force;
        turning += slot.torque_j;
      }
    }
    const double coefficient = outer[i].coefficient;
    const Vec<double, D> v = grains.velocity[i].template cast<double>();
    const Vec<double, D> moved = (v + per_mass * (total + coefficient * outer[i].fluid_velocity)) /
                                 (1 + per_mass * coefficient);
    mean_drag_[i] += dt / c.dt * (coefficient * (outer[i].fluid_velocity - moved));
    grains.velocity[i] = moved.template cast<Real>();
    grains.position[i] +=
        (dt * grains.velocity[i].template cast<double>()).template cast<Position>();
    if (c.rotation) grains.spin[i] += (per_inertia * turning).template cast<Real>();
  }
}

template <int D, class P>
void Contacts<D, P>::advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
                             const std::vector<Wall>& walls, double overlap_limit,
                             std::uint64_t step, GrainState<D, P>& grains,
                             ContactState<D, P>& contacts) {
  if (list_is_stale(c, grains)) {
    slots_.clear();
    build_list(c, walls, grains);
  }
  retired_.clear();
  load(contacts);
  mean_drag_.assign(grains.size(), Vec<double, D>::Zero());
  const double dt = c.dt / static_cast<double>(c.substeps);
  for (std::int64_t substep = 0; substep < c.substeps; ++substep) {
    if (substep > 0 && list_is_stale(c, grains)) build_list(c, walls, grains);
    for (Slot& slot : slots_) {
      evaluate(c, walls, grains, dt, slot);
      check_overlap(slot, slot.touching ? slot.record.peak_overlap : 0, overlap_limit, step);
    }
    move(c, outer, dt, grains);
  }
  store(c, contacts);
  collect();
}

template <int D, class P>
Vec<double, D> Contacts<D, P>::wall_impulse() const {
  Vec<double, D> sum = Vec<double, D>::Zero();
  for (const ContactRecord<D>& record : records_)
    if (record.key.kind == 1) sum += record.impulse;
  return sum;
}

template class Contacts<2, DoublePrecision>;
template class Contacts<2, FloatPrecision>;
template class Contacts<2, MixedPrecision>;
template class Contacts<3, DoublePrecision>;
template class Contacts<3, FloatPrecision>;
template class Contacts<3, MixedPrecision>;

}  // namespace varve::core
