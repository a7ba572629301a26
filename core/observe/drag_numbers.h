// What a drag force comes to in the numbers of the literature.
#pragma once

#include "core/scenario.h"

namespace varve::core {

struct DragNumbers {
  double reynolds = 0;     ///< [-] rho0 eps |u - v| d / mu
  double coefficient = 0;  ///< [-] F / (1/2 rho0 (eps |u - v|)^2 A); 0 without slip
  double shielding = 0;    ///< [-] F over the closure's for a lone grain at this slip; 0 without
};

/// Of a grain of diameter `diameter` [m] at the slip |u - v| [m/s] and porosity that it feels, on
/// which the fluid exerts `drag` [N, per metre of depth in 2D].
DragNumbers drag_numbers(const Scenario& scenario, double diameter, double slip, double porosity,
                         double drag);

}  // namespace varve::core
