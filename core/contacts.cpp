#include "core/contacts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/simulation.h"

namespace varve::core {

namespace {

// The candidate list reaches this far beyond touching; it is rebuilt when a grain has moved by half
// of it. Pairs that do not touch exert nothing, so that the reach changes no bit.
constexpr double list_skin_per_diameter = 0.2;

// Share of critical damping of a rolling spring that has not yielded (Ai et al. 2011, model C).
constexpr double rolling_damping = 0.3;

/// Written out, since the order of a sum is part of the contract.
template <int N>
double dot(const Vec<double, N>& a, const Vec<double, N>& b) {
  double sum = 0;
  for (int k = 0; k < N; ++k) sum += a[k] * b[k];
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

/// Rotated into the plane across `normal`, at its length.
template <int D>
Vec<double, D> into_plane(const Vec<double, D>& v, const Vec<double, D>& normal) {
  const double length2 = dot<D>(v, v);
  Vec<double, D> flat = v - dot<D>(v, normal) * normal;
  const double flat2 = dot<D>(flat, flat);
  if (flat2 > 0) flat *= std::sqrt(length2 / flat2);
  return flat;
}
/// An angle about z stays what it is.
Vec<double, 1> into_plane(const Vec<double, 1>& v, const Vec<double, 2>&) { return v; }

/// What of a rate of turning is rolling: not the part about the normal.
Vec<double, 1> rolling_part(const Vec<double, 1>& turning, const Vec<double, 2>&) {
  return turning;
}
Vec<double, 3> rolling_part(const Vec<double, 3>& turning, const Vec<double, 3>& normal) {
  return turning - dot<3>(turning, normal) * normal;
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
ContactKey Contacts<D, P>::key_of(const Candidate& candidate, const std::vector<Wall>& walls,
                                  const GrainState<D, P>& grains) {
  const std::uint64_t id = grains.id[candidate.i];
  if (candidate.is_wall()) return {id, 1, walls[candidate.wall()].number};
  return {id, 0, grains.id[candidate.j]};
}

template <int D, class P>
bool Contacts<D, P>::list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const {
  if (listed_at_.size() != grains.size()) return true;
  const double reach = 0.5 * list_skin_per_diameter * c.least_diameter;
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
  const double skin = list_skin_per_diameter * c.least_diameter;
  double reach = 0;
  for (const ContactPair& pair : c.pairs) reach = std::max(reach, pair.sight + skin);
  const std::span<const Vec<Position, D>> points(grains.position);
  CellGrid<D, Position> cells;
  cells.build(points, reach, c.period);
  const Rows rows = candidates<D, Position>(points, cells, reach, c.period, true, alone);
  const auto species = static_cast<std::uint32_t>(c.species.size());
  candidates_.clear();
  for (std::uint32_t i = 0; i < grains.size(); ++i) {
    const std::uint32_t row = grains.species[i] * (species + 1);
    for (const std::int32_t each : rows.of(i)) {
      const auto j = static_cast<std::uint32_t>(each);
      if (j < i) continue;
      const std::uint32_t pair = row + grains.species[j];
      if (species > 1) {
        const Vec<double, D> apart = difference(c, grains.position[i], grains.position[j]);
        const double far = c.pairs[pair].sight + skin;
        if (dot<D>(apart, apart) > far * far) continue;
      }
      candidates_.push_back({i, j, pair, nothing});
    }
    const Vec<double, D> x = grains.position[i].template cast<double>();
    for (std::uint32_t w = 0; w < walls.size(); ++w) {
      if (distance_inside<D>(walls[w], x) > c.pairs[row + species].sight + skin) continue;
      candidates_.push_back({i, w | wall_bit, row + species, nothing});
    }
  }
  listed_at_ = grains.position;
  stored_at_.clear();
  ++list_builds_;
}

/// A list made within a step takes over what its contacts have been through.
template <int D, class P>
void Contacts<D, P>::relink(const std::vector<Wall>& walls, const GrainState<D, P>& grains) {
  std::vector<std::uint32_t> order(touches_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return records_[a].key < records_[b].key;
  });
  std::size_t into = 0;
  for (const std::uint32_t t : order) {
    const ContactKey& key = records_[t].key;
    while (into < candidates_.size() && key_of(candidates_[into], walls, grains) < key) ++into;
    const bool found =
        into < candidates_.size() && key_of(candidates_[into], walls, grains) == key;
    touches_[t].candidate = found ? static_cast<std::uint32_t>(into) : nothing;
    if (found) candidates_[into].touch = t;
  }
}

template <int D, class P>
std::uint32_t Contacts<D, P>::begin(const ContactKey& key, std::uint32_t candidate) {
  const auto t = static_cast<std::uint32_t>(touches_.size());
  touches_.emplace_back();
  touches_.back().candidate = candidate;
  touches_.back().touching = true;
  records_.emplace_back();
  records_.back().key = key;
  candidates_[candidate].touch = t;
  return t;
}

template <int D, class P>
void Contacts<D, P>::take(const ContactState<D, P>& contacts, std::size_t from,
                          std::uint32_t candidate) {
  Touch& touch = touches_[begin(contacts.key[from], candidate)];
  if (!contacts.spring.empty()) touch.spring = contacts.spring[from].template cast<double>();
  if (!contacts.rolling.empty()) touch.rolling = contacts.rolling[from].template cast<double>();
}

/// The usual case: the contacts are those stored last, and the list is still the same.
template <int D, class P>
bool Contacts<D, P>::load_where_stored(const std::vector<Wall>& walls,
                                       const GrainState<D, P>& grains,
                                       const ContactState<D, P>& contacts) {
  if (stored_at_.size() != contacts.size()) return false;
  for (std::size_t k = 0; k < contacts.size(); ++k)
    if (key_of(candidates_[stored_at_[k]], walls, grains) != contacts.key[k]) return false;
  for (std::size_t k = 0; k < contacts.size(); ++k) take(contacts, k, stored_at_[k]);
  return true;
}

template <int D, class P>
void Contacts<D, P>::load(const std::vector<Wall>& walls, const GrainState<D, P>& grains,
                          const ContactState<D, P>& contacts) {
  for (const Touch& touch : touches_)
    if (touch.candidate < candidates_.size()) candidates_[touch.candidate].touch = nothing;
  touches_.clear();
  records_.clear();
  if (contacts.size() == 0 || load_where_stored(walls, grains, contacts)) return;
  std::size_t into = 0;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    while (into < candidates_.size() &&
           key_of(candidates_[into], walls, grains) < contacts.key[k])
      ++into;
    if (into < candidates_.size() && key_of(candidates_[into], walls, grains) == contacts.key[k])
      take(contacts, k, static_cast<std::uint32_t>(into));
  }
}

template <int D, class P>
void Contacts<D, P>::store(const Constants<D>& c, ContactState<D, P>& contacts) {
  // Contacts that began in this step stand at the end, wherever their keys belong.
  const auto before = [this](std::size_t a, std::size_t b) {
    return records_[a].key < records_[b].key;
  };
  std::vector<std::uint32_t> order(touches_.size());
  std::iota(order.begin(), order.end(), 0u);
  if (!std::is_sorted(order.begin(), order.end(), before)) {
    std::sort(order.begin(), order.end(), before);
    std::vector<ContactRecord<D>> sorted;
    std::vector<Touch> touches;
    for (const std::uint32_t t : order) {
      sorted.push_back(records_[t]);
      touches.push_back(touches_[t]);
    }
    records_.swap(sorted);
    touches_.swap(touches);
  }
  contacts.key.clear();
  contacts.spring.clear();
  contacts.rolling.clear();
  stored_at_.clear();
  const bool rolls = c.contact.rotation && c.contact.rolling_friction > 0;
  for (std::size_t t = 0; t < touches_.size(); ++t) {
    if (!touches_[t].touching) continue;
    stored_at_.push_back(touches_[t].candidate);
    contacts.key.push_back(records_[t].key);
    if (c.contact.rotation)
      contacts.spring.push_back(touches_[t].spring.template cast<Real>());
    if (rolls) contacts.rolling.push_back(touches_[t].rolling.template cast<Real>());
  }
}

/// Where two partners are and how they move. False if nothing can come of it.
template <int D, class P>
bool Contacts<D, P>::meet(const Constants<D>& c, const std::vector<Wall>& walls,
                          const GrainState<D, P>& grains, const Candidate& candidate,
                          Meeting& m) const {
  m.pair = &c.pairs[candidate.pair];
  const bool alone = candidate.touch == nothing;
  if (candidate.is_wall()) {
    const Wall& wall = walls[candidate.wall()];
    const Vec<double, D> x = grains.position[candidate.i].template cast<double>();
    const double distance = distance_inside<D>(wall, x);
    if (alone && distance > m.pair->sight) return false;
    m.normal = inward_normal<D>(wall, x);
    m.overlap = m.pair->reach - distance;
    m.relative = grains.velocity[candidate.i].template cast<double>();
    m.relative[0] -= wall.speed_x;
    return true;
  }
  const Vec<double, D> d =
      difference(c, grains.position[candidate.i], grains.position[candidate.j]);
  const double r2 = dot<D>(d, d);
  if (alone && r2 > m.pair->sight2) return false;
  const double r = std::sqrt(r2);
  // Two grains on one point have no normal of their own; x is as good as any and always the same.
  m.normal = r > 0 ? Vec<double, D>(d / r) : Vec<double, D>(Vec<double, D>::Unit(0));
  m.overlap = m.pair->reach - r;
  m.relative = grains.velocity[candidate.i].template cast<double>();
  m.relative -= grains.velocity[candidate.j].template cast<double>();
  return true;
}

/// The film between two partners that do not touch yet resists their approach and their parting.
template <int D, class P>
void Contacts<D, P>::lubricate(const Constants<D>& c, double dt, const Candidate& candidate,
                               const Meeting& m) {
  const double gap = -m.overlap, range = c.contact.lubrication_range * m.pair->effective_radius;
  if (!(gap < range)) return;
  const double rough = std::max(gap, c.contact.lubrication_gap * m.pair->effective_radius);
  // Less its value at the range, so that the film begins without a jump.
  double thinness = 1 / rough - 1 / range;
  if (D == 2) thinness = 1 / (rough * std::sqrt(rough)) - 1 / (range * std::sqrt(range));
  const Vec<double, D> force = -(c.viscosity * m.pair->lubrication * thinness *
                                 dot<D>(m.relative, m.normal)) * m.normal;
  force_[candidate.i] += force;
  if (candidate.is_wall())
    film_impulse_ += dt * force;
  else
    force_[candidate.j] -= force;
}

template <int D, class P>
void Contacts<D, P>::end(const Constants<D>& c, const Candidate& candidate, const Meeting& m) {
  Touch& touch = touches_[candidate.touch];
  if (!touch.touching) return;
  ContactRecord<D>& record = records_[candidate.touch];
  record.end = true;
  record.rebound_speed = dot<D>(m.relative, m.normal);
  // What the tangential spring still holds goes with it.
  const double stiffness =
      c.contact.law == ContactLaw::linear ? m.pair->tangential_stiffness : 0.0;
  record.tangential_loss += 0.5 * stiffness * dot<D>(touch.spring, touch.spring);
  touch.touching = false;
  touch.spring.setZero();
  touch.rolling.setZero();
}

/// E10. n points to grain i. F_n = max(0, elastic - eta v_n): the dashpot never pulls.
template <int D, class P>
template <class Law>
void Contacts<D, P>::press(const Constants<D>& c, double dt, const GrainState<D, P>& grains,
                           const Candidate& candidate, Meeting& m) {
  const ContactPair& pair = *m.pair;
  Touch& touch = touches_[candidate.touch];
  ContactRecord<D>& record = records_[candidate.touch];
  if (c.contact.rotation) {
    m.relative += spin_velocity(grains.spin[candidate.i].template cast<double>(),
                                Vec<double, D>(-pair.radius_i * m.normal));
    if (!candidate.is_wall())
      m.relative -= spin_velocity(grains.spin[candidate.j].template cast<double>(),
                                  Vec<double, D>(pair.radius_j * m.normal));
  }
  const double normal_speed = dot<D>(m.relative, m.normal);
  if (!touch.touching) {
    record.begin = true;
    record.impact_speed = -normal_speed;
    touch.touching = true;
  }
  const ContactResponse response = Law::at(pair, m.overlap);
  const double normal_force = std::max(0.0, response.elastic - response.damping * normal_speed);
  Vec<double, D> force = normal_force * m.normal;
  record.peak_force = std::max(record.peak_force, normal_force);
  record.peak_overlap = std::max(record.peak_overlap, m.overlap);
  record.normal_loss += (response.elastic - normal_force) * normal_speed * dt;
  if (c.contact.rotation) {
    slide(c, dt, response, candidate, m, normal_speed, normal_force, force);
    if (c.contact.rolling_friction > 0)
      roll(c, dt, response, grains, candidate, m, normal_force);
  }
  record.impulse += dt * force;
  force_[candidate.i] += force;
  if (!candidate.is_wall()) force_[candidate.j] -= force;
}

/// F_t = -k_t xi - eta v_t, cut at mu F_n with the spring shortened to match.
template <int D, class P>
void Contacts<D, P>::slide(const Constants<D>& c, double dt, const ContactResponse& response,
                           const Candidate& candidate, const Meeting& m, double normal_speed,
                           double normal_force, Vec<double, D>& force) {
  const double stiffness = response.tangential_stiffness, eta = response.tangential_damping;
  Touch& touch = touches_[candidate.touch];
  ContactRecord<D>& record = records_[candidate.touch];
  const Vec<double, D> sliding = m.relative - normal_speed * m.normal;
  // Rotated into the present tangent plane at its length, then stretched.
  Vec<double, D> spring = into_plane<D>(touch.spring, m.normal);
  const Vec<double, D> before = spring;
  spring += dt * sliding;
  const Vec<double, D> tried = spring;
  Vec<double, D> drag = -stiffness * spring - eta * sliding;
  const double size = std::sqrt(dot<D>(drag, drag));
  if (size > c.contact.friction * normal_force) {
    drag *= c.contact.friction * normal_force / size;
    if (stiffness > 0) spring = -(drag + eta * sliding) / stiffness;
  }
  // What the spring is shortened by is slip, and the slider's work on it friction; what the
  // spring takes and does not store is the dashpot's.
  const double stored = 0.5 * stiffness * (dot<D>(spring, spring) - dot<D>(before, before));
  record.friction_loss -= dot<D>(drag, tried - spring);
  record.tangential_loss -= dot<D>(drag, spring - before) + stored;
  touch.spring = spring;
  force += drag;
  torque_[candidate.i] += torque(Vec<double, D>(-m.pair->radius_i * m.normal), drag);
  if (!candidate.is_wall())
    torque_[candidate.j] +=
        torque(Vec<double, D>(m.pair->radius_j * m.normal), Vec<double, D>(-drag));
}

/// A rolling spring that yields at mu_r R* F_n (Ai et al. 2011, model C): M = -k_r theta, with a
/// dashpot as long as it has not yielded.
template <int D, class P>
void Contacts<D, P>::roll(const Constants<D>& c, double dt, const ContactResponse& response,
                          const GrainState<D, P>& grains, const Candidate& candidate,
                          const Meeting& m, double normal_force) {
  Touch& touch = touches_[candidate.touch];
  Spin turning = grains.spin[candidate.i].template cast<double>();
  if (!candidate.is_wall()) turning -= grains.spin[candidate.j].template cast<double>();
  turning = rolling_part(turning, m.normal);
  const double stiffness = m.pair->rolling_stiffness * response.normal_stiffness;
  const double most = c.contact.rolling_friction * m.pair->effective_radius * normal_force;
  const Spin before = into_plane(touch.rolling, m.normal);
  Spin angle = before + dt * turning;
  Spin moment = -stiffness * angle;
  const double size = std::sqrt(dot<spin_components<D>>(moment, moment));
  if (size > most) {
    moment *= most / size;
    angle = -moment / stiffness;
  } else {
    moment -= 2 * rolling_damping * std::sqrt(stiffness * m.pair->rolling_inertia) * turning;
  }
  constexpr int n = spin_components<D>;
  records_[candidate.touch].friction_loss -=
      dt * dot<n>(moment, turning) +
      0.5 * stiffness * (dot<n>(angle, angle) - dot<n>(before, before));
  touch.rolling = angle;
  torque_[candidate.i] += moment;
  if (!candidate.is_wall()) torque_[candidate.j] -= moment;
}

template <int D, class P>
void Contacts<D, P>::check_overlap(const Candidate& candidate, const Meeting& m, double limit,
                                   std::uint64_t step) const {
  if (!(m.overlap > limit * m.pair->least_diameter)) return;
  const ContactKey& key = records_[candidate.touch].key;
  throw NumericalFailure(
      "overlap with " + std::string(candidate.is_wall() ? "wall " : "grain ") +
          std::to_string(key.partner),
      step, "grains.position", key.grain, m.overlap, limit * m.pair->least_diameter,
      "raise contact.stiffness or lower the impact speed");
}

template <int D, class P>
template <class Law>
void Contacts<D, P>::sum_forces(const Constants<D>& c, const std::vector<Wall>& walls, double dt,
                                double overlap_limit, std::uint64_t step,
                                const GrainState<D, P>& grains) {
  for (std::uint32_t k = 0; k < candidates_.size(); ++k) {
    Candidate& candidate = candidates_[k];
    Meeting m;
    if (!meet(c, walls, grains, candidate, m)) continue;
    if (!(m.overlap > 0)) {
      if (candidate.touch != nothing) end(c, candidate, m);
      if (c.contact.lubrication) lubricate(c, dt, candidate, m);
      continue;
    }
    if (candidate.touch == nothing) {
      const std::uint32_t t = begin(key_of(candidate, walls, grains), k);
      touches_[t].touching = false;
    }
    press<Law>(c, dt, grains, candidate, m);
    check_overlap(candidate, m, overlap_limit, step);
    if (touched_now_.empty()) continue;
    touched_now_[candidate.i] = true;
    if (!candidate.is_wall()) touched_now_[candidate.j] = true;
  }
}

/// One sub-step of the motion under the forces summed.
template <int D, class P>
void Contacts<D, P>::move(const Constants<D>& c, std::span<const OuterForce<D>> outer, double dt,
                          GrainState<D, P>& grains) {
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const PerSpecies& one = per_species_[grains.species[i]];
    const double coefficient = outer[i].coefficient;
    const Vec<double, D> v = grains.velocity[i].template cast<double>();
    const bool held = !grains.driven.empty() && grains.driven[i] != 0 && !touched_now_[i];
    if (!grains.driven.empty() && !held) grains.driven[i] = 0;
    const Vec<double, D> moved =
        held ? v
             : Vec<double, D>((v + one.per_mass * (force_[i] +
                                                   coefficient * outer[i].fluid_velocity)) /
                              (1 + one.per_mass * coefficient));
    mean_drag_[i] += dt / c.dt * (coefficient * (outer[i].fluid_velocity - moved));
    if (one.added_mass > 0) mean_drag_[i] -= one.added_mass / c.dt * (moved - v);
    grains.velocity[i] = moved.template cast<Real>();
    grains.position[i] +=
        (dt * grains.velocity[i].template cast<double>()).template cast<Position>();
    if (c.contact.rotation)
      grains.spin[i] += (one.per_inertia * torque_[i]).template cast<Real>();
  }
}

template <int D, class P>
void Contacts<D, P>::advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
                             const std::vector<Wall>& walls, double overlap_limit,
                             std::uint64_t step, GrainState<D, P>& grains,
                             ContactState<D, P>& contacts) {
  const std::size_t n = grains.size();
  if (list_is_stale(c, grains)) build_list(c, walls, grains);
  load(walls, grains, contacts);
  mean_drag_.assign(n, Vec<double, D>::Zero());
  film_impulse_.setZero();
  const double dt = c.dt / static_cast<double>(c.substeps);
  per_species_.clear();
  for (const SpeciesConstants<D>& one : c.species)
    per_species_.push_back(
        {dt / (one.mass + one.added_mass), dt / one.inertia, one.added_mass});
  for (std::int64_t substep = 0; substep < c.substeps; ++substep) {
    if (substep > 0 && list_is_stale(c, grains)) {
      build_list(c, walls, grains);
      relink(walls, grains);
    }
    force_.resize(n);
    for (std::size_t i = 0; i < n; ++i) force_[i] = outer[i].force;
    if (c.contact.rotation) torque_.assign(n, Spin::Zero());
    touched_now_.assign(grains.driven.size(), false);
    if (c.contact.law == ContactLaw::linear)
      sum_forces<LinearLaw>(c, walls, dt, overlap_limit, step, grains);
    else
      sum_forces<HertzLaw>(c, walls, dt, overlap_limit, step, grains);
    move(c, outer, dt, grains);
  }
  store(c, contacts);
}

template <int D, class P>
Vec<double, D> Contacts<D, P>::wall_impulse() const {
  Vec<double, D> sum = film_impulse_;
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
