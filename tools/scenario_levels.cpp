#include "tools/scenario_levels.h"

namespace varve::tools {
namespace {

constexpr ScenarioLevel levels[] = {
    {"scenario.model", "standard", ""},
    // Each line undoes one of our deviations from the study; what it does not state (the fluid's
    // kernel, how much artificial viscosity) is a choice.
    {"scenario.model", "study", R"(
[fluid]
pressure = full
density_diffusion = 0
artificial_alpha = 0.1
[coupling]
exclude_own_volume = false
pressure_force = averaged
[time]
cfl = 0.1
substeps = 1
)"},
    // What the levels cost and how wrong they are: `varve tradeoff`.
    {"scenario.fidelity", "draft", R"(
[scenario]
precision = float
[fluid]
spacing = auto
resolution = 2
sound_speed_factor = 0.5
[time]
cfl = 0.5
)"},
    {"scenario.fidelity", "standard", R"(
[fluid]
spacing = auto
resolution = 2.5
)"},
    {"scenario.fidelity", "fine", R"(
[fluid]
spacing = auto
resolution = 4
sound_speed_factor = 1.5
)"},
    {"scenario.fidelity", "reference", R"(
[fluid]
spacing = auto
resolution = 5
sound_speed_factor = 2
[time]
cfl = 0.125
)"},
};

}  // namespace

const ScenarioLevel* find_level(std::string_view key, std::string_view value) {
  for (const ScenarioLevel& level : levels)
    if (level.key == key && level.value == value) return &level;
  return nullptr;
}

}  // namespace varve::tools
