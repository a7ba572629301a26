// Digests of what each stage of a step computed, so that a difference between two builds can be
// traced to the stage that made it. Outputs only: never read by a step, never part of the state.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace varve::core {

/// In the order of a step. The numbers are recorded in logs.
enum class Stage : std::uint8_t {
  neighbours,   ///< pairs of fluid particles within the kernel's support
  porosity,     ///< eps of the fluid
  pressure,     ///< superficial density and pressure
  walls,        ///< pressure and velocity of the dummies
  stress,       ///< pressure and viscous forces
  coupling,     ///< hydrodynamic force, fluid velocity and drag coefficient of grains
  contacts,     ///< grains and contacts after their sub-steps
  integration,  ///< fluid velocities and positions
};
inline constexpr std::array<std::string_view, 8> stage_names = {
    "neighbours", "porosity", "pressure", "walls",
    "stress",     "coupling", "contacts", "integration"};

struct StageDigest {
  Stage stage = Stage::neighbours;
  std::uint64_t high = 0, low = 0;  ///< XXH3-128
};

/// Gathers canonical little-endian values of one stage after another.
class StageDigests {
 public:
  void begin() { digests_.clear(); }
  void values(std::span<const double> values);
  void values(std::span<const float> values);
  void values(std::span<const std::uint64_t> values);
  void values(std::span<const std::int32_t> values);
  /// Ends a stage: what was gathered since the last one is digested.
  void finish(Stage stage);
  const std::vector<StageDigest>& digests() const { return digests_; }

 private:
  template <class T>
  void add(std::span<const T> values);
  std::vector<std::byte> bytes_;
  std::vector<StageDigest> digests_;
};

}  // namespace varve::core
