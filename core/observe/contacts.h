// What the engine's contact records say: how many, how strong, what was lost, and how each hit of a
// wall ended.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/observe/series.h"

namespace varve::core {

/// One contact during one step, as recorded (core/contacts.h, ContactRecord).
struct ContactRow {
  std::uint64_t grain = 0, partner = 0;
  std::uint8_t kind = 0;  ///< 0: partner is a grain, 1: a wall's number
  bool begin = false, end = false;
  double peak_force = 0;    ///< [N]
  double peak_overlap = 0;  ///< [m]
  std::array<double, 3> impulse{};               ///< [N s] on `grain`
  double impact_speed = 0, rebound_speed = 0;    ///< [m/s]
  double normal_loss = 0, tangential_loss = 0, friction_loss = 0;  ///< [J]
};

struct ContactTotals {
  std::size_t contacts = 0, with_grains = 0, with_walls = 0;  ///< that held at any time of the step
  std::size_t begun = 0, ended = 0;
  Quartiles force;      ///< [N] of peak normal forces
  double mean_force = 0;
  std::array<double, 3> wall_impulse{};  ///< [N s] of walls on grains
  double normal_loss = 0, tangential_loss = 0, friction_loss = 0;  ///< [J] in the step
};
ContactTotals contact_totals(std::span<const ContactRow> rows);

/// A grain that hit a wall and left it again.
struct WallHit {
  std::uint64_t grain = 0, wall = 0;
  double begin = 0, end = 0;  ///< [s] ends of the steps in which it began and ended
  double impact_speed = 0, rebound_speed = 0;
  double restitution = 0;     ///< rebound over impact speed; 0 where it had no impact speed
  double peak_force = 0, peak_overlap = 0;
};

/// Puts the steps' records together into hits. Contacts that are open at the first step have no
/// known impact and are left out.
class WallHits {
 public:
  /// Takes one step; returns the hits that ended in it, ascending grain and wall.
  std::vector<WallHit> take(double time, std::span<const ContactRow> rows);

 private:
  std::map<std::pair<std::uint64_t, std::uint64_t>, WallHit> open_;
};

}  // namespace varve::core
