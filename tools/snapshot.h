// A picture of one state: grains, coloured by their speed, over the velocity of the fluid.
#pragma once

#include <string>

#include "tools/analysis.h"

namespace varve::tools {

/// SVG of the x-y plane; in 3D the fluid is taken through the middle of the depth and the grains
/// are projected. `now` must be a state decoded whole with its lattice, where the scene has fluid.
std::string snapshot_svg(const core::Scenario& scenario, const ObservedStep& now);

}  // namespace varve::tools
