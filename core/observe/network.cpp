#include "core/observe/network.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/walls.h"

namespace varve::core {
namespace {

constexpr double ball(std::size_t dimension, double r) {
  constexpr double pi = 3.14159265358979323846;
  return dimension == 2 ? pi * r * r : 4 * pi * r * r * r / 3;
}

double dot(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

std::size_t index_of(const GrainView& grains, std::uint64_t id) {
  const auto found = std::lower_bound(grains.id.begin(), grains.id.end(), id);
  if (found == grains.id.end() || *found != id) return ContactLink::wall;
  return static_cast<std::size_t>(found - grains.id.begin());
}

/// x_i - x_j over the nearest image.
std::array<double, 3> between(const GrainView& grains, std::size_t i, std::size_t j,
                              std::span<const double> period) {
  std::array<double, 3> d{};
  for (std::size_t k = 0; k < grains.dimension; ++k) {
    d[k] = grains.position[i * grains.dimension + k] - grains.position[j * grains.dimension + k];
    if (!(period[k] > 0)) continue;
    if (d[k] > 0.5 * period[k]) d[k] -= period[k];
    if (d[k] < -0.5 * period[k]) d[k] += period[k];
  }
  return d;
}

template <int D>
std::array<double, 3> normal_of(const std::vector<Wall>& walls, std::uint64_t number,
                                const double* x) {
  std::array<double, 3> normal{};
  for (const Wall& wall : walls) {
    if (wall.number != number) continue;
    Vec<double, D> place;
    for (int k = 0; k < D; ++k) place[k] = x[k];
    const Vec<double, D> n = inward_normal<D>(wall, place);
    for (int k = 0; k < D; ++k) normal[static_cast<std::size_t>(k)] = n[k];
  }
  return normal;
}

class Groups {
 public:
  explicit Groups(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The least index stands for its group.
  void join(std::size_t i, std::size_t j) {
    i = root(i);
    j = root(j);
    parent_[std::max(i, j)] = std::min(i, j);
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace

std::vector<ContactLink> contact_links(const GrainView& grains, std::span<const ContactRow> rows,
                                       double dt, const Domain& walls,
                                       std::span<const double> period) {
  std::vector<ContactLink> links;
  if (!(dt > 0) || rows.empty()) return links;
  Scenario place;
  place.domain = walls;
  place.domain.dimension = static_cast<std::int64_t>(grains.dimension);
  const std::vector<Wall> planes = domain_walls(place);
  for (const ContactRow& row : rows) {
    if (row.end) continue;
    ContactLink link;
    link.i = index_of(grains, row.grain);
    link.partner = row.partner;
    if (link.i == ContactLink::wall) continue;
    const double* x = grains.position.data() + link.i * grains.dimension;
    if (row.kind == 0) {
      link.j = index_of(grains, row.partner);
      if (link.j == ContactLink::wall) continue;
      link.normal = between(grains, link.i, link.j, period);
      const double r = std::sqrt(dot(link.normal, link.normal));
      for (double& each : link.normal) each = r > 0 ? each / r : 0;
    } else {
      link.normal = grains.dimension == 2 ? normal_of<2>(planes, row.partner, x)
                                          : normal_of<3>(planes, row.partner, x);
    }
    for (std::size_t k = 0; k < 3; ++k) link.force[k] = row.impulse[k] / dt;
    link.push = dot(link.force, link.normal);
    links.push_back(link);
  }
  return links;
}

std::vector<GrainStress> grain_stresses(const GrainView& grains,
                                        std::span<const ContactLink> links) {
  std::vector<GrainStress> stresses(grains.size());
  const auto add = [&](std::size_t i, const ContactLink& link) {
    const double r = grains.radius[i], per_volume = 1 / ball(grains.dimension, r);
    ++stresses[i].contacts;
    stresses[i].pressure += r * link.push * per_volume / static_cast<double>(grains.dimension);
    stresses[i].vertical += r * link.force[1] * link.normal[1] * per_volume;
  };
  for (const ContactLink& link : links) {
    add(link.i, link);
    if (link.j != ContactLink::wall) add(link.j, link);
  }
  return stresses;
}

ForceChains force_chains(std::size_t grains, std::span<const ContactLink> links) {
  ForceChains result;
  result.chain_of.assign(grains, -1);
  double sum = 0;
  std::size_t count = 0;
  for (const ContactLink& link : links)
    if (link.j != ContactLink::wall) {
      sum += link.push;
      ++count;
    }
  if (count == 0) return result;
  result.mean_push = sum / static_cast<double>(count);
  Groups groups(grains);
  for (const ContactLink& link : links) {
    if (link.j == ContactLink::wall || !(link.push > result.mean_push)) continue;
    ++result.strong;
    groups.join(link.i, link.j);
  }
  std::vector<std::size_t> size(grains, 0);
  for (std::size_t i = 0; i < grains; ++i) ++size[groups.root(i)];
  std::vector<std::int32_t> number(grains, -1);
  for (std::size_t i = 0; i < grains; ++i) {
    if (size[i] < 3) continue;
    number[i] = static_cast<std::int32_t>(result.chains++);
    result.longest = std::max(result.longest, size[i]);
    result.grains += size[i];
  }
  for (std::size_t i = 0; i < grains; ++i) result.chain_of[i] = number[groups.root(i)];
  return result;
}

std::vector<std::uint32_t> clusters_of(const GrainView& grains, double link,
                                       std::span<const double> period) {
  const std::size_t n = grains.size(), d = grains.dimension;
  Groups groups(n);
  double largest = 0;
  for (const double r : grains.radius) largest = std::max(largest, r);
  // Sorted along y, so that only grains within reach are looked at.
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const double ya = grains.position[a * d + 1], yb = grains.position[b * d + 1];
    return ya != yb ? ya < yb : a < b;
  });
  const bool seam = period[1] > 0;
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = a + 1; b < n; ++b) {
      const std::size_t i = order[a], j = order[b];
      const double far = 2 * largest + link;
      if (!seam && grains.position[j * d + 1] - grains.position[i * d + 1] > far) break;
      const std::array<double, 3> apart = between(grains, i, j, period);
      const double reach = grains.radius[i] + grains.radius[j] + link;
      if (dot(apart, apart) <= reach * reach) groups.join(i, j);
    }
  std::vector<std::size_t> size(n, 0), roots;
  for (std::size_t i = 0; i < n; ++i) ++size[groups.root(i)];
  for (std::size_t i = 0; i < n; ++i)
    if (size[i] > 0) roots.push_back(i);
  std::stable_sort(roots.begin(), roots.end(),
                   [&](std::size_t a, std::size_t b) { return size[a] > size[b]; });
  std::vector<std::uint32_t> number(n, 0), result(n);
  for (std::size_t k = 0; k < roots.size(); ++k) number[roots[k]] = static_cast<std::uint32_t>(k);
  for (std::size_t i = 0; i < n; ++i) result[i] = number[groups.root(i)];
  return result;
}

std::vector<Departure> Departures::take(const GrainView& grains,
                                        std::span<const std::uint32_t> clusters) {
  std::vector<Departure> changes;
  std::size_t size = 0;
  for (const std::uint32_t each : clusters) size += each == 0 ? 1 : 0;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const bool inside = clusters[i] == 0;
    if (!begun_) {
      if (inside) inside_[grains.id[i]] = true;
      continue;
    }
    const auto found = inside_.find(grains.id[i]);
    if (found == inside_.end() || found->second == inside) continue;
    found->second = inside;
    changes.push_back({grains.id[i], !inside, size});
  }
  begun_ = true;
  return changes;
}

std::size_t Departures::apart() const {
  return static_cast<std::size_t>(std::count_if(inside_.begin(), inside_.end(),
                                                [](const auto& each) { return !each.second; }));
}

}  // namespace varve::core
