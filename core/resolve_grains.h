// The part of resolve() that concerns grains: species, where they lie, what their contacts are.
#pragma once

#include <vector>

#include "core/parameters.h"

namespace varve::core {

/// Replaces what is automatic about the grains of a scenario whose domain is resolved, and adds
/// what makes no sense to `problems`.
void resolve_grains(Scenario& scenario, std::vector<Problem>& problems);

}  // namespace varve::core
