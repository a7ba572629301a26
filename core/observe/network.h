// Grains as a network of contacts, and as clusters of near neighbours. Pure functions of one state
// and of the contact records of the step that led to it; SI, vectors particle-major.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/observe/contacts.h"
#include "core/observe/grains.h"
#include "core/scenario.h"

namespace varve::core {

/// One contact that held at the end of the step.
struct ContactLink {
  static constexpr std::size_t wall = static_cast<std::size_t>(-1);
  std::size_t i = 0, j = wall;       ///< indices into the grains
  std::uint64_t partner = 0;         ///< id of the grain, number of the wall
  std::array<double, 3> normal{};    ///< towards grain i
  std::array<double, 3> force{};     ///< [N] on grain i, mean over the step
  double push = 0;                   ///< [N] force along the normal
};
/// Links of the records that did not end, in their order; those of grains that are not there are
/// left out. `walls`: where the walls stand now. `dt` [s] of the step; without one there are none.
std::vector<ContactLink> contact_links(const GrainView& grains, std::span<const ContactRow> rows,
                                       double dt, const Domain& walls,
                                       std::span<const double> period);

/// What contacts do to one grain.
struct GrainStress {
  std::uint32_t contacts = 0;  ///< coordination number, walls included
  double pressure = 0;         ///< [Pa] (1 / (D V)) sum R push
  double vertical = 0;         ///< [Pa] (1 / V) sum R f_y n_y: compression along y is positive
};
/// Love-Weber stress of each grain with V its own volume (area in 2D).
std::vector<GrainStress> grain_stresses(const GrainView& grains,
                                        std::span<const ContactLink> links);

/// Chains of strong contacts: those between grains that push with more than the mean over all
/// contacts between grains of the step (Radjai et al. 1998). Grains linked by them form a chain if
/// there are three or more.
struct ForceChains {
  double mean_push = 0;          ///< [N] over contacts between grains
  std::size_t strong = 0;        ///< contacts above it
  std::size_t chains = 0;
  std::size_t longest = 0;       ///< grains of the largest chain
  std::size_t grains = 0;        ///< in chains
  std::vector<std::int32_t> chain_of;  ///< per grain; -1: in none. Numbered by their least grain
};
ForceChains force_chains(std::size_t grains, std::span<const ContactLink> links);

/// Cluster of each grain: grains whose surfaces are at most `link` [m] apart belong together.
/// Numbered by size, the largest 0 (of equals the one with the least index).
std::vector<std::uint32_t> clusters_of(const GrainView& grains, double link,
                                       std::span<const double> period);

/// A grain that left the main cluster, or came back to it.
struct Departure {
  std::uint64_t grain = 0;
  bool left = true;
  std::size_t cluster_size = 0;  ///< of the main cluster now
};
/// Follows membership of the largest cluster from state to state. Grains apart from the first state
/// on have not left.
class Departures {
 public:
  /// `clusters` as by clusters_of(); returns changes since the state before, ascending id.
  std::vector<Departure> take(const GrainView& grains, std::span<const std::uint32_t> clusters);
  /// Grains of the first main cluster that are not in the main cluster now.
  std::size_t apart() const;

 private:
  bool begun_ = false;
  std::map<std::uint64_t, bool> inside_;  ///< grains of the first main cluster
};

}  // namespace varve::core
