// Which grains may touch and which do: the candidate list and the touches of a step, for
// core/contacts.cpp alone.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/contacts.h"

namespace varve::core {

namespace contact_detail {

// The candidate list reaches this far beyond touching; it is rebuilt when a grain has moved by half
// of it. Pairs that do not touch exert nothing, so that the reach changes no bit.
inline constexpr double list_skin_per_diameter = 0.2;

// Groups below which a second thread is not worth waking.
inline constexpr std::size_t groups_per_thread = 64;

constexpr std::size_t groups_of(std::size_t items) { return (items + lanes - 1) / lanes; }
/// Whole groups, and apart from a power of two, or columns would compete for the same cache lines.
constexpr std::size_t stride_for(std::size_t items) { return (items / 512 + 1) * 512 + 40; }

template <int D>
double dot(const Vec<double, D>& a, const Vec<double, D>& b) {
  double sum = 0;
  for (int k = 0; k < D; ++k) sum += a[k] * b[k];
  return sum;
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

inline std::uint64_t flags_at(const std::vector<std::uint8_t>& flags, std::size_t at) {
  std::uint64_t word;
  std::memcpy(&word, flags.data() + at, sizeof word);
  return word;
}
/// Which of eight flags is the first.
inline std::size_t first_of(std::uint64_t word) {
  if constexpr (std::endian::native == std::endian::little)
    return static_cast<std::size_t>(std::countr_zero(word)) / 8;
  else
    return static_cast<std::size_t>(std::countl_zero(word)) / 8;
}
inline std::uint64_t without_first(std::uint64_t word) {
  if constexpr (std::endian::native == std::endian::little) return word & (word - 1);
  return word & ~(std::uint64_t(1) << (63 - std::countl_zero(word)));
}

}  // namespace contact_detail

// ---- touches ----

template <int D, class P>
void Contacts<D, P>::Touches::clear_for(std::size_t most) {
  count = 0;
  walls.clear();
  if (most + lanes <= pairing.size()) return;
  stride = contact_detail::stride_for(most + most / 8 + lanes);
  pairing.resize(stride);
  for (auto* each : {&grain, &partner, &pair}) each->resize(stride);
  candidate.resize(stride);
  for (auto* each : {&touching, &exists, &begin, &end, &pressed}) each->resize(stride);
  columns.resize(stride * At::count);
}

template <int D, class P>
void Contacts<D, P>::Touches::add(Pairing pairing_of, std::int32_t pair_of,
                                  std::uint32_t candidate_of) {
  const std::size_t t = count++;
  pairing[t] = pairing_of;
  grain[t] = static_cast<std::int32_t>(pairing_of >> 32);
  if ((pairing_of & wall_bit) == 0) {
    partner[t] = static_cast<std::int32_t>(pairing_of & 0xffffffffu);
  } else {
    partner[t] = -1 - static_cast<std::int32_t>(walls.size());
    walls.push_back(static_cast<std::uint32_t>(t));
  }
  pair[t] = pair_of;
  candidate[t] = candidate_of;
  touching[t] = exists[t] = begin[t] = end[t] = 0;
}

/// Adds touch `t` of another set.
template <int D, class P>
void Contacts<D, P>::Touches::copy(const Touches& from, std::size_t t) {
  add(from.pairing[t], from.pair[t], from.candidate[t]);
  const std::size_t to = count - 1;
  touching[to] = from.touching[t];
  exists[to] = from.exists[t];
  begin[to] = from.begin[t];
  end[to] = from.end[t];
  for (std::size_t k = 0; k < At::count; ++k) column(k)[to] = from.column(k)[t];
}

/// Fills the last group with what may be computed and is never looked at.
template <int D, class P>
void Contacts<D, P>::Touches::pad() {
  for (std::size_t t = count; t < contact_detail::groups_of(count) * lanes; ++t) {
    grain[t] = grain[count - 1];
    partner[t] = partner[count - 1];
    pair[t] = pair[count - 1];
    touching[t] = exists[t] = begin[t] = end[t] = 0;
  }
}

/// Forgets what came near and never touched.
template <int D, class P>
void Contacts<D, P>::Touches::keep_existing() {
  std::size_t to = 0;
  for (std::size_t t = 0; t < count; ++t) {
    if (exists[t] == 0) continue;
    pairing[to] = pairing[t];
    candidate[to] = candidate[t];
    touching[to] = touching[t];
    begin[to] = begin[t];
    end[to] = end[t];
    for (std::size_t k = 0; k < At::count; ++k) column(k)[to] = column(k)[t];
    ++to;
  }
  count = to;
}

// ---- the list ----

template <int D, class P>
void Contacts<D, P>::reset() {
  list_ = {};  // where no grain is left, none is made again
  listed_at_.clear();
  stored_is_valid_ = false;
}

template <int D, class P>
bool Contacts<D, P>::list_is_stale(const Constants<D>& c, const GrainState<D, P>& grains) const {
  if (listed_at_.size() != grains.size()) return true;
  const double reach = 0.5 * contact_detail::list_skin_per_diameter * c.least_diameter;
  bool far = false;  // without a way out: it is rare, and loops without one are faster
  for (std::size_t i = 0; i < grains.size(); ++i) {
    double r2 = 0;
    for (int k = 0; k < D; ++k) {
      const double d = static_cast<double>(grains.position[i][k]) -
                       static_cast<double>(listed_at_[i][k]);
      r2 += d * d;
    }
    // A grain that crossed a periodic seam counts as moved: rare, and a new list is always right.
    far |= !(r2 < reach * reach);
  }
  return far;
}

template <int D, class P>
void Contacts<D, P>::build_list(const Step& step, const GrainState<D, P>& grains) {
  const Constants<D>& c = step.c;
  const double skin = contact_detail::list_skin_per_diameter * c.least_diameter;
  double reach = 0;
  for (const ContactPair& pair : c.pairs) reach = std::max(reach, pair.sight + skin);
  const std::span<const Vec<Position, D>> points(grains.position);
  cells_.build(points, reach, c.period, step.workers);
  find_candidates<D, Position>(points, cells_, reach, c.period, true, step.workers, set_, parts_,
                               rows_);
  const auto species = static_cast<std::uint32_t>(c.species.size());
  list_.first.clear();
  list_.second.clear();
  list_.kind.clear();
  list_.wall_grain.clear();
  list_.wall.clear();
  for (std::uint32_t i = 0; i < grains.size(); ++i) {
    const std::uint32_t row = grains.species[i] * (species + 1);
    for (const std::int32_t each : rows_.of(i)) {
      const auto j = static_cast<std::uint32_t>(each);
      if (j < i) continue;
      const std::uint32_t pair = row + grains.species[j];
      if (species > 1) {
        const Vec<double, D> apart =
            contact_detail::difference(c, grains.position[i], grains.position[j]);
        const double far = c.pairs[pair].sight + skin;
        if (contact_detail::dot<D>(apart, apart) > far * far) continue;
      }
      list_.first.push_back(static_cast<std::int32_t>(i));
      list_.second.push_back(each);
      list_.kind.push_back(static_cast<std::int32_t>(pair));
    }
    const Vec<double, D> x = grains.position[i].template cast<double>();
    for (std::uint32_t w = 0; w < step.walls.size(); ++w) {
      if (distance_inside<D>(step.walls[w], x) > c.pairs[row + species].sight + skin) continue;
      list_.wall_grain.push_back(i);
      list_.wall.push_back(w);
    }
  }
  list_.count = list_.first.size();
  for (auto* each : {&list_.first, &list_.second, &list_.kind})
    each->resize(contact_detail::groups_of(list_.count) * lanes, each->empty() ? 0 : each->back());
  list_.near.assign(list_.first.size(), 0);
  list_.known = list_.near;
  list_.wall_near.assign(list_.wall.size(), 0);
  list_.wall_known = list_.wall_near;
  listed_at_ = grains.position;
  stored_is_listed_ = false;
  ++list_builds_;
}

template <int D, class P>
std::uint8_t& Contacts<D, P>::known(std::uint32_t candidate) {
  if ((candidate & wall_bit) != 0) return list_.wall_known[candidate & ~wall_bit];
  return list_.known[candidate];
}

/// Where an ascending series of pairings stands in the list.
template <int D, class P>
struct Contacts<D, P>::Finder {
  const Candidates& list;
  std::size_t pair = 0, wall = 0;

  std::uint32_t find(Pairing p) {
    if ((p & wall_bit) != 0) {
      while (wall < list.wall.size() && list.wall_pairing(wall) < p) ++wall;
      return wall < list.wall.size() && list.wall_pairing(wall) == p
                 ? static_cast<std::uint32_t>(wall | wall_bit)
                 : nothing;
    }
    while (pair < list.count && list.pairing(pair) < p) ++pair;
    return pair < list.count && list.pairing(pair) == p ? static_cast<std::uint32_t>(pair)
                                                        : nothing;
  }
};

/// A list made within a step takes over the touches as they are.
template <int D, class P>
void Contacts<D, P>::relist(const Step& step, const GrainState<D, P>& grains) {
  build_list(step, grains);
  Finder finder{list_};
  for (std::size_t t = 0; t < touches_.count; ++t) {
    touches_.candidate[t] = finder.find(touches_.pairing[t]);
    if (touches_.candidate[t] != nothing) known(touches_.candidate[t]) = 1;
  }
}

/// Finds the state's contacts in the list. Usually they are those stored last, and it is the same.
template <int D, class P>
void Contacts<D, P>::find_stored(const Step& step, const GrainState<D, P>& grains,
                                 const ContactState<D, P>& contacts) {
  const auto index_of = [&grains](std::uint64_t id) {
    const auto found = std::lower_bound(grains.id.begin(), grains.id.end(), id);
    if (found == grains.id.end() || *found != id) return Pairing(nothing);
    return static_cast<Pairing>(found - grains.id.begin());
  };
  if (!stored_is_valid_ || stored_keys_ != contacts.key) {
    stored_.clear();
    for (const ContactKey& key : contacts.key) {
      Pairing partner = 0;
      if (key.kind == 0)
        partner = index_of(key.partner);
      else
        while (partner < step.walls.size() && step.walls[partner].number != key.partner) ++partner;
      const Pairing grain = index_of(key.grain);
      // A contact of nobody is dropped: no grain is its own partner, so that 0 is in no list.
      stored_.push_back(grain == nothing || partner == nothing
                            ? 0
                            : grain << 32 | (key.kind == 0 ? 0 : wall_bit) | partner);
    }
    stored_is_listed_ = false;
    stored_from_.clear();
  }
  if (stored_is_listed_) return;
  std::fill(list_.known.begin(), list_.known.end(), std::uint8_t(0));
  std::fill(list_.wall_known.begin(), list_.wall_known.end(), std::uint8_t(0));
  stored_at_.clear();
  std::vector<std::uint32_t> from;
  Finder finder{list_};
  for (std::size_t s = 0; s < stored_.size(); ++s) {
    const std::uint32_t candidate = finder.find(stored_[s]);
    if (candidate == nothing) continue;
    known(candidate) = 1;
    stored_at_.push_back(candidate);
    from.push_back(static_cast<std::uint32_t>(s));
  }
  if (from.size() < stored_.size()) stored_from_ = std::move(from);
}

// ---- what touches ----

template <int D, class P>
void Contacts<D, P>::mark_near(const Step& step, const GrainState<D, P>& grains) {
  const ContactSweepData<D, P> data = sweep_data(step, grains);
  step.workers.run(contact_detail::groups_of(list_.count), contact_detail::groups_per_thread,
                   [&](std::size_t begin, std::size_t end, unsigned) {
                     sweeps_.mark(data, begin, end);
                   });
  for (std::size_t k = list_.count; k < list_.near.size(); ++k) list_.near[k] = 0;
  const auto species = static_cast<std::uint32_t>(step.c.species.size());
  for (std::size_t w = 0; w < list_.wall.size(); ++w) {
    const std::size_t i = list_.wall_grain[w];
    const double sight = step.c.pairs[grains.species[i] * (species + 1) + species].sight;
    const double distance = distance_inside<D>(step.walls[list_.wall[w]],
                                               grains.position[i].template cast<double>());
    list_.wall_near[w] = distance > sight ? 0 : 1;
  }
}

/// Calls add(pairing, candidate) in ascending order for all candidates that are near or known.
template <int D, class P>
template <class Add>
void Contacts<D, P>::each_marked(Add&& add) const {
  std::size_t wall = 0;
  const auto walls_before = [&](Pairing pairing) {
    for (; wall < list_.wall.size() && list_.wall_pairing(wall) < pairing; ++wall)
      if ((list_.wall_near[wall] | list_.wall_known[wall]) != 0)
        add(list_.wall_pairing(wall), static_cast<std::uint32_t>(wall | wall_bit));
  };
  for (std::size_t at = 0; at < list_.near.size(); at += lanes) {
    std::uint64_t word =
        contact_detail::flags_at(list_.near, at) | contact_detail::flags_at(list_.known, at);
    for (; word != 0; word = contact_detail::without_first(word)) {
      const std::size_t k = at + contact_detail::first_of(word);
      walls_before(list_.pairing(k));
      add(list_.pairing(k), static_cast<std::uint32_t>(k));
    }
  }
  walls_before(~Pairing(0));
}

/// The touches of a step's first sub-step: the state's contacts and what is near.
template <int D, class P>
void Contacts<D, P>::take_up(const Step& step, const GrainState<D, P>& grains,
                             const ContactState<D, P>& contacts) {
  touches_.clear_for(list_.count + list_.wall.size());
  const auto species = static_cast<std::uint32_t>(step.c.species.size());
  const bool turns = !contacts.spring.empty(), rolls = !contacts.rolling.empty();
  std::size_t stored = 0;
  each_marked([&](Pairing pairing, std::uint32_t candidate) {
    const std::size_t t = touches_.count;
    if ((candidate & wall_bit) == 0)
      touches_.add(pairing, list_.kind[candidate], candidate);
    else
      touches_.add(pairing,
                   static_cast<std::int32_t>(
                       grains.species[pairing >> 32] * (species + 1) + species),
                   candidate);
    for (std::size_t k = At::spring; k < At::peak_force; ++k) touches_.column(k)[t] = 0;
    std::uint8_t& is_known = known(candidate);
    if (is_known != 0) {
      const std::size_t from = stored_from_.empty() ? stored : stored_from_[stored];
      ++stored;
      touches_.touching[t] = touches_.exists[t] = 1;
      if (turns)
        for (int k = 0; k < D; ++k)
          touches_.column(At::spring + static_cast<std::size_t>(k))[t] =
              static_cast<double>(contacts.spring[from][k]);
      if (rolls)
        for (int k = 0; k < spin_components<D>; ++k)
          touches_.column(At::rolling + static_cast<std::size_t>(k))[t] =
              static_cast<double>(contacts.rolling[from][k]);
    }
    is_known = 1;
  });
  touches_.pad();
}

template <int D, class P>
bool Contacts<D, P>::any_new() const {
  for (std::size_t at = 0; at < list_.near.size(); at += lanes)
    if ((contact_detail::flags_at(list_.near, at) &
         ~contact_detail::flags_at(list_.known, at)) != 0)
      return true;
  for (std::size_t w = 0; w < list_.wall.size(); ++w)
    if (list_.wall_near[w] != 0 && list_.wall_known[w] == 0) return true;
  return false;
}

/// Takes candidates that have come near within the step among the touches.
template <int D, class P>
void Contacts<D, P>::widen(const Step& step, const GrainState<D, P>& grains) {
  const auto species = static_cast<std::uint32_t>(step.c.species.size());
  spare_.clear_for(list_.count + list_.wall.size() + touches_.count);
  std::size_t t = 0;
  const auto old_before = [&](Pairing pairing) {
    for (; t < touches_.count && touches_.pairing[t] < pairing; ++t) spare_.copy(touches_, t);
  };
  each_marked([&](Pairing pairing, std::uint32_t candidate) {
    std::uint8_t& is_known = known(candidate);
    if (is_known != 0) return;
    is_known = 1;
    old_before(pairing);
    const bool wall = (candidate & wall_bit) != 0;
    const std::uint32_t of_wall = grains.species[pairing >> 32] * (species + 1) + species;
    spare_.add(pairing, wall ? static_cast<std::int32_t>(of_wall) : list_.kind[candidate],
               candidate);
    for (std::size_t k = 0; k < At::count; ++k) spare_.column(k)[spare_.count - 1] = 0;
  });
  old_before(~Pairing(0));
  spare_.pad();
  std::swap(touches_, spare_);
}

}  // namespace varve::core
