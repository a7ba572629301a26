// The smoothing kernels by name, alone: the pair sweeps take long to compile and need no more of a
// scenario.
#pragma once

namespace varve::core {

enum class Kernel { wendland_c2, cubic, quintic };

}  // namespace varve::core
