// One page of HTML that shows runs side by side, with a time slider; needs nothing but itself.
#pragma once

#include <string>
#include <vector>

#include "tools/view_scene.h"

namespace varve::tools {

/// The page. It loads nothing, and no text of a run can become markup or script.
std::string view_page(const std::vector<ViewScene>& scenes);

}  // namespace varve::tools
