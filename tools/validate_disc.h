// The benchmark of one disc in a box, as the gate and the study of convergence run it.
#pragma once

#include <vector>

#include "core/scenario.h"

namespace varve::tools {

/// A disc of 2.5 mm and 1250 kg/m3 released at (1, 4) cm in a closed box of 2 x 6 cm, c0 = 1 m/s.
core::Scenario disc_scene();

/// What one run of it gives.
struct DiscFall {
  std::vector<double> times, speeds;  // [s], [m/s] downwards, every step until `until`
  double contact_time = 0;            // [s] first contact with the floor
  double plateau = 0;                 // [m/s] mean over 0.3 to 0.5 s
  std::vector<double> impacts, rebounds;  // [m/s] of each contact that ended
};
DiscFall fall_of_disc(const core::Scenario& scenario, double until);

}  // namespace varve::tools
