// Sets of defaults under names: scenario.model and scenario.fidelity. Each is a piece of a scenario
// file that lies under everything the scenario says itself.
#pragma once

#include <string_view>

namespace varve::tools {

struct ScenarioLevel {
  std::string_view key, value;  ///< such as scenario.fidelity, draft
  std::string_view text;        ///< INI; empty: the defaults of the parameters
};

/// The level of that name, or nullptr where the value is none (the parameter says so then).
const ScenarioLevel* find_level(std::string_view key, std::string_view value);

inline constexpr std::string_view level_keys[] = {"scenario.model", "scenario.fidelity"};

}  // namespace varve::tools
