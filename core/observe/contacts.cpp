#include "core/observe/contacts.h"

#include <algorithm>

namespace varve::core {

ContactTotals contact_totals(std::span<const ContactRow> rows) {
  ContactTotals totals;
  std::vector<double> forces;
  for (const ContactRow& row : rows) {
    ++totals.contacts;
    ++(row.kind == 0 ? totals.with_grains : totals.with_walls);
    if (row.begin) ++totals.begun;
    if (row.end) ++totals.ended;
    forces.push_back(row.peak_force);
    totals.normal_loss += row.normal_loss;
    totals.tangential_loss += row.tangential_loss;
    totals.friction_loss += row.friction_loss;
    if (row.kind == 1)
      for (std::size_t k = 0; k < 3; ++k) totals.wall_impulse[k] += row.impulse[k];
  }
  totals.force = quartiles_of(forces);
  totals.mean_force = forces.empty() ? 0 : spread_of(forces).mean;
  return totals;
}

std::vector<WallHit> WallHits::take(double time, std::span<const ContactRow> rows) {
  std::vector<WallHit> ended;
  for (const ContactRow& row : rows) {
    if (row.kind != 1) continue;
    const std::pair key(row.grain, row.partner);
    auto found = open_.find(key);
    // A record that begins and ends may be a contact that ended and came again: one that is open
    // takes the end first.
    const bool was_open = found != open_.end();
    if (!was_open) {
      if (!row.begin) continue;
      WallHit hit;
      hit.grain = row.grain;
      hit.wall = row.partner;
      hit.begin = time;
      hit.impact_speed = row.impact_speed;
      found = open_.emplace(key, hit).first;
    }
    WallHit& hit = found->second;
    hit.peak_force = std::max(hit.peak_force, row.peak_force);
    hit.peak_overlap = std::max(hit.peak_overlap, row.peak_overlap);
    if (!row.end) continue;
    hit.end = time;
    hit.rebound_speed = row.rebound_speed;
    hit.restitution = hit.impact_speed > 0 ? hit.rebound_speed / hit.impact_speed : 0;
    ended.push_back(hit);
    open_.erase(found);
  }
  return ended;
}

}  // namespace varve::core
