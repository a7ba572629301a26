#include "core/contacts.h"

#include <algorithm>
#include <cmath>

#include "core/contact_lists_impl.h"
#include "core/simulation.h"

namespace varve::core {

using namespace contact_detail;

namespace {

// Share of critical damping of a rolling spring that has not yielded (Ai et al. 2011, model C).
constexpr double rolling_damping = 0.3;

// Groups of touches that one thread works on before it sums what they exert: few enough that their
// pushes stay in the nearest cache.
constexpr std::size_t groups_at_once = 32;

template <class T, int N>
const T* numbers(const std::vector<Vec<T, N>>& values) {
  return reinterpret_cast<const T*>(values.data());
}

}  // namespace

// ---- a sub-step ----

template <int D, class P>
ContactSweepData<D, P> Contacts<D, P>::sweep_data(const Step& step,
                                                  const GrainState<D, P>& grains) {
  ContactSweepData<D, P> s;
  const Contact& contact = step.c.contact;
  s.position = numbers(grains.position);
  s.velocity = numbers(grains.velocity);
  s.spin = contact.rotation ? numbers(grains.spin) : nullptr;
  s.pairs = step.c.pairs.data();
  s.first = list_.first.data();
  s.second = list_.second.data();
  s.kind = list_.kind.data();
  s.near = list_.near.data();
  s.count = touches_.count;
  s.grain = touches_.grain.data();
  s.partner = touches_.partner.data();
  s.pair = touches_.pair.data();
  s.meetings = meetings_.data();
  s.touching = touches_.touching.data();
  s.exists = touches_.exists.data();
  s.begin = touches_.begin.data();
  s.end = touches_.end.data();
  s.pressed = touches_.pressed.data();
  s.columns = touches_.columns.data();
  s.stride = touches_.stride;
  s.dt = step.dt;
  s.friction = contact.friction;
  s.rolling_friction = contact.rolling_friction;
  s.rolling_damping = rolling_damping;
  s.overlap_limit = step.overlap_limit;
  s.hertz = contact.law != ContactLaw::linear;
  s.rolls = contact.rotation && contact.rolling_friction > 0;
  s.periodic = step.c.period.any();
  for (int k = 0; k < D; ++k) s.period[k] = step.c.period.length[k];
  return s;
}

template <int D, class P>
void Contacts<D, P>::meet_walls(const Step& step, const GrainState<D, P>& grains) {
  meetings_.resize(touches_.walls.size());
  for (std::size_t q = 0; q < meetings_.size(); ++q) {
    const Pairing pairing = touches_.pairing[touches_.walls[q]];
    const Wall& wall = step.walls[pairing & (wall_bit - 1)];
    const Vec<double, D> x = grains.position[pairing >> 32].template cast<double>();
    meetings_[q].distance = distance_inside<D>(wall, x);
    const Vec<double, D> normal = inward_normal<D>(wall, x);
    for (int k = 0; k < D; ++k) meetings_[q].normal[k] = normal[k];
    meetings_[q].speed_x = wall.speed_x;
  }
}

template <int D, class P>
void Contacts<D, P>::report_overlap(const Step& step, std::size_t t,
                                    const GrainState<D, P>& grains) const {
  const auto i = static_cast<std::size_t>(touches_.grain[t]);
  const ContactPair& pair = step.c.pairs[static_cast<std::size_t>(touches_.pair[t])];
  double distance = 0;
  std::string partner = "grain ";
  if (is_wall(t)) {
    const Wall& wall = step.walls[touches_.pairing[t] & (wall_bit - 1)];
    distance = distance_inside<D>(wall, grains.position[i].template cast<double>());
    partner = "wall " + std::to_string(wall.number);
  } else {
    const auto j = static_cast<std::size_t>(touches_.partner[t]);
    const Vec<double, D> d = difference(step.c, grains.position[i], grains.position[j]);
    distance = std::sqrt(dot<D>(d, d));
    partner += std::to_string(grains.id[j]);
  }
  throw NumericalFailure("overlap with " + partner, step.number, "grains.position", grains.id[i],
                         pair.reach - distance, step.overlap_limit * pair.least_diameter,
                         "raise contact.stiffness or lower the impact speed");
}

/// The film between two partners that do not touch yet resists their approach and their parting.
template <int D, class P>
void Contacts<D, P>::lubricate(const Step& step, std::size_t t, const GrainState<D, P>& grains,
                               Load& own) {
  const Constants<D>& c = step.c;
  const auto i = static_cast<std::size_t>(touches_.grain[t]);
  const ContactPair& pair = c.pairs[static_cast<std::size_t>(touches_.pair[t])];
  Vec<double, D> normal, relative = grains.velocity[i].template cast<double>();
  double distance = 0;
  if (is_wall(t)) {
    const auto q = static_cast<std::size_t>(-1 - touches_.partner[t]);
    distance = meetings_[q].distance;
    for (int k = 0; k < D; ++k) normal[k] = meetings_[q].normal[k];
    relative[0] -= meetings_[q].speed_x;
  } else {
    const auto j = static_cast<std::size_t>(touches_.partner[t]);
    const Vec<double, D> d = difference(c, grains.position[i], grains.position[j]);
    distance = std::sqrt(dot<D>(d, d));
    normal = d / distance;
    relative -= grains.velocity[j].template cast<double>();
  }
  const double gap = -(pair.reach - distance);
  const double range = c.contact.lubrication_range * pair.effective_radius;
  if (!(gap < range)) return;
  const double rough = std::max(gap, c.contact.lubrication_gap * pair.effective_radius);
  // Less its value at the range, so that the film begins without a jump.
  double thinness = 1 / rough - 1 / range;
  if (D == 2) thinness = 1 / (rough * std::sqrt(rough)) - 1 / (range * std::sqrt(range));
  const Vec<double, D> force =
      -(c.viscosity * pair.lubrication * thinness * dot<D>(relative, normal)) * normal;
  for (int k = 0; k < D; ++k) own.force[k] += force[k];
  if (is_wall(t)) {
    film_impulse_ += step.dt * force;
    return;
  }
  Load& other = loads_[static_cast<std::size_t>(touches_.partner[t])];
  for (int k = 0; k < D; ++k) other.force[k] -= force[k];
}

/// Adds what touch `t` exerts to its grain's load and to its partner's.
template <int D, class P>
void Contacts<D, P>::add_touch(const Step& step, const ContactSweepData<D, P>& data, std::size_t t,
                               const GrainState<D, P>& grains, Load& own) {
  if (touches_.pressed[t] == 0) {
    if (step.c.contact.lubrication) lubricate(step, t, grains, own);
    return;
  }
  const double* const push = data.pushes + (t - data.window);
  const auto at = [&](std::size_t column, int k) {
    return push[(column + static_cast<std::size_t>(k)) * data.push_stride];
  };
  const std::int32_t partner = touches_.partner[t];
  for (int k = 0; k < D; ++k) own.force[k] += at(Out::force, k);
  if (data.spin)
    for (int k = 0; k < spin_components<D>; ++k) {
      own.torque[k] += at(Out::torque_first, k);
      if (data.rolls) own.torque[k] += at(Out::moment, k);
    }
  if (!touched_now_.empty()) touched_now_[static_cast<std::size_t>(touches_.grain[t])] = true;
  if (partner < 0) return;
  Load& other = loads_[static_cast<std::size_t>(partner)];
  for (int k = 0; k < D; ++k) other.force[k] -= at(Out::force, k);
  if (data.spin)
    for (int k = 0; k < spin_components<D>; ++k) {
      other.torque[k] += at(Out::torque_second, k);
      if (data.rolls) other.torque[k] -= at(Out::moment, k);
    }
  if (!touched_now_.empty()) touched_now_[static_cast<std::size_t>(partner)] = true;
}

/// Motion of a grain under the load summed.
template <int D, class P>
void Contacts<D, P>::move(const Step& step, std::size_t i, const GrainState<D, P>& grains,
                          GrainState<D, P>& after) {
  const PerSpecies& one = per_species_[grains.species[i]];
  const OuterForce<D>& outer = step.outer[i];
  const double coefficient = outer.coefficient;
  const bool held = !after.driven.empty() && after.driven[i] != 0 && !touched_now_[i];
  if (!after.driven.empty() && !held) after.driven[i] = 0;
  const double divisor = 1 + one.per_mass * coefficient;
  for (int k = 0; k < D; ++k) {
    const auto v = static_cast<double>(grains.velocity[i][k]);
    double moved = v;
    if (!held) {
      moved += one.per_mass * (loads_[i].force[k] + coefficient * outer.fluid_velocity[k]);
      if (coefficient != 0) moved /= divisor;
    }
    if (coefficient != 0)
      mean_drag_[i][k] +=
          step.dt / step.c.dt * (coefficient * (outer.fluid_velocity[k] - moved));
    if (one.added_mass > 0) mean_drag_[i][k] -= one.added_mass / step.c.dt * (moved - v);
    const auto velocity = static_cast<Real>(moved);
    after.velocity[i][k] = velocity;
    after.position[i][k] =
        grains.position[i][k] + static_cast<Position>(step.dt * static_cast<double>(velocity));
  }
  if (step.c.contact.rotation)
    for (int k = 0; k < spin_components<D>; ++k)
      after.spin[i][k] =
          grains.spin[i][k] + static_cast<Real>(one.per_inertia * loads_[i].torque[k]);
}

/// Partners of touch (i, j) have j > i: once the touches of i are summed, so are all before, and
/// nothing reads grain i any more.
template <int D, class P>
void Contacts<D, P>::sub_step(const Step& step, bool fresh, const GrainState<D, P>& grains,
                              GrainState<D, P>& after) {
  const std::size_t n = grains.size(), groups = groups_of(touches_.count);
  meet_walls(step, grains);
  loads_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < D; ++k) loads_[i].force[k] = step.outer[i].force[k];
    for (double& each : loads_[i].torque) each = 0;
  }
  touched_now_.assign(grains.driven.size(), false);
  ContactSweepData<D, P> data = sweep_data(step, grains);
  data.fresh = fresh;
  const std::size_t at_once = step.workers.count() > 1 ? groups : groups_at_once;
  data.push_stride = stride_for(at_once * lanes);
  pushes_.resize(data.push_stride * Out::count);
  data.pushes = pushes_.data();
  std::vector<std::size_t> worst(step.workers.parts());
  std::size_t i = 0, t = 0;
  for (std::size_t group = 0; group < groups; group += at_once) {
    data.window = group * lanes;
    std::fill(worst.begin(), worst.end(), touches_.count);
    step.workers.run(std::min(at_once, groups - group), groups_per_thread,
                     [&](std::size_t begin, std::size_t end, unsigned part) {
                       worst[part] = sweeps_.press(data, group + begin, group + end);
                     });
    const std::size_t bad = *std::min_element(worst.begin(), worst.end());
    if (bad < touches_.count) report_overlap(step, bad, grains);
    const std::size_t end = std::min(touches_.count, data.window + at_once * lanes);
    while (t < end) {
      const auto of = static_cast<std::size_t>(touches_.grain[t]);
      while (i < of) move(step, i++, grains, after);
      Load own = loads_[of];
      for (; t < end && static_cast<std::size_t>(touches_.grain[t]) == of; ++t)
        add_touch(step, data, t, grains, own);
      loads_[of] = own;
    }
  }
  while (i < n) move(step, i++, grains, after);
}

template <int D, class P>
void Contacts<D, P>::advance(const Constants<D>& c, std::span<const OuterForce<D>> outer,
                             const std::vector<Wall>& walls, double overlap_limit,
                             std::uint64_t number, const GrainState<D, P>& grains,
                             const ContactState<D, P>& contacts, GrainState<D, P>& grains_after,
                             ContactState<D, P>& contacts_after, Workers& workers) {
  const std::size_t n = grains.size();
  const double dt = c.dt / static_cast<double>(c.substeps);
  const Step step{c, outer, walls, dt, overlap_limit, number, workers};
  if (list_is_stale(c, grains)) build_list(step, grains);
  find_stored(step, grains, contacts);
  stored_is_valid_ = false;  // until this step is done, and so with the records
  record_grain_.clear();
  mean_drag_.assign(n, Vec<double, D>::Zero());
  film_impulse_.setZero();
  per_species_.clear();
  for (const SpeciesConstants<D>& one : c.species)
    per_species_.push_back(
        {dt / (one.mass + one.added_mass), dt / one.inertia, one.added_mass});
  if (&grains_after != &grains) {
    grains_after.id = grains.id;
    grains_after.species = grains.species;
    grains_after.driven = grains.driven;
    grains_after.position.resize(n);
    grains_after.velocity.resize(n);
    grains_after.spin.resize(grains.spin.size());
  }
  mark_near(step, grains);
  take_up(step, grains, contacts);
  sub_step(step, true, grains, grains_after);
  for (std::int64_t substep = 1; substep < c.substeps; ++substep) {
    if (list_is_stale(c, grains_after)) relist(step, grains_after);
    mark_near(step, grains_after);
    if (any_new()) widen(step, grains_after);
    sub_step(step, false, grains_after, grains_after);
  }
  store(step, grains, contacts_after);
}

// ---- after the step ----

template <int D, class P>
void Contacts<D, P>::store(const Step& step, const GrainState<D, P>& grains,
                           ContactState<D, P>& contacts) {
  std::size_t exist = 0, touching = 0;
  for (std::size_t t = 0; t < touches_.count; ++t) {
    exist += touches_.exists[t];
    touching += touches_.touching[t];
    if (touches_.touching[t] == 0 && touches_.candidate[t] != nothing)
      known(touches_.candidate[t]) = 0;
  }
  if (exist < touches_.count) touches_.keep_existing();
  const bool turns = step.c.contact.rotation, rolls = turns && step.c.contact.rolling_friction > 0;
  record_grain_.resize(exist);
  record_kind_.resize(exist);
  record_partner_.resize(exist);
  contacts.key.resize(touching);
  contacts.spring.resize(turns ? touching : 0);
  contacts.rolling.resize(rolls ? touching : 0);
  stored_.resize(touching);
  stored_at_.resize(touching);
  stored_from_.clear();
  std::size_t s = 0;
  for (std::size_t t = 0; t < exist; ++t) {
    const Pairing pairing = touches_.pairing[t];
    const bool wall = (pairing & wall_bit) != 0;
    const std::size_t partner = pairing & (wall_bit - 1);
    const ContactKey key{grains.id[pairing >> 32], wall ? 1u : 0u,
                         wall ? step.walls[partner].number : grains.id[partner]};
    record_grain_[t] = key.grain;
    record_kind_[t] = wall ? 1 : 0;
    record_partner_[t] = key.partner;
    if (touches_.touching[t] == 0) continue;
    contacts.key[s] = key;
    if (turns)
      for (int k = 0; k < D; ++k)
        contacts.spring[s][k] =
            static_cast<Real>(touches_.column(At::spring + static_cast<std::size_t>(k))[t]);
    if (rolls)
      for (int k = 0; k < spin_components<D>; ++k)
        contacts.rolling[s][k] =
            static_cast<Real>(touches_.column(At::rolling + static_cast<std::size_t>(k))[t]);
    stored_[s] = pairing;
    stored_at_[s] = touches_.candidate[t];
    ++s;
  }
  stored_keys_ = contacts.key;
  stored_is_valid_ = stored_is_listed_ = true;
}

template <int D, class P>
std::vector<ContactRecord<D>> Contacts<D, P>::records() const {
  std::vector<ContactRecord<D>> all(record_count());
  for (std::size_t t = 0; t < all.size(); ++t) {
    const auto at = [&](std::size_t column) { return touches_.column(column)[t]; };
    ContactRecord<D>& record = all[t];
    record.key = {record_grain_[t], record_kind_[t], record_partner_[t]};
    record.begin = touches_.begin[t] != 0;
    record.end = touches_.end[t] != 0;
    record.peak_force = at(At::peak_force);
    record.peak_overlap = at(At::peak_overlap);
    for (int k = 0; k < D; ++k) record.impulse[k] = at(At::impulse + static_cast<std::size_t>(k));
    record.impact_speed = at(At::impact_speed);
    record.rebound_speed = at(At::rebound_speed);
    record.normal_loss = at(At::normal_loss);
    record.tangential_loss = at(At::tangential_loss);
    record.friction_loss = at(At::friction_loss);
  }
  return all;
}

template <int D, class P>
std::vector<std::span<const std::byte>> Contacts<D, P>::record_columns() const {
  const std::size_t n = record_count();
  std::vector<std::span<const std::byte>> columns;
  const auto add = [&](const auto* values) {
    columns.push_back(std::as_bytes(std::span(values, n)));
  };
  add(record_grain_.data());
  add(record_kind_.data());
  add(record_partner_.data());
  add(touches_.begin.data());
  add(touches_.end.data());
  for (std::size_t k = At::peak_force; k < At::count; ++k) add(touches_.column(k));
  return columns;
}

template <int D, class P>
Vec<double, D> Contacts<D, P>::wall_impulse() const {
  Vec<double, D> sum = film_impulse_;
  for (std::size_t t = 0; t < record_count(); ++t)
    if (record_kind_[t] == 1)
      for (int k = 0; k < D; ++k)
        sum[k] += touches_.column(At::impulse + static_cast<std::size_t>(k))[t];
  return sum;
}

template class Contacts<2, DoublePrecision>;
template class Contacts<2, FloatPrecision>;
template class Contacts<2, MixedPrecision>;
template class Contacts<3, DoublePrecision>;
template class Contacts<3, FloatPrecision>;
template class Contacts<3, MixedPrecision>;

}  // namespace varve::core
