#include "core/observe/drag_numbers.h"

#include "core/drag.h"

namespace varve::core {

DragNumbers drag_numbers(const Scenario& scenario, double diameter, double slip, double porosity,
                         double drag) {
  DragNumbers numbers;
  if (!(slip > 0)) return numbers;
  const bool flat = scenario.domain.dimension == 2;
  const Slip felt{slip, porosity, diameter, scenario.fluid.density, scenario.fluid.viscosity};
  numbers.reynolds = reynolds(felt);
  const double area = flat ? diameter : 0.25 * pi * diameter * diameter;
  const double superficial = porosity * slip;
  numbers.coefficient =
      drag / (0.5 * scenario.fluid.density * superficial * superficial * area);
  const Slip lone{slip, 1.0, diameter, scenario.fluid.density, scenario.fluid.viscosity};
  const double alone =
      slip * (flat ? drag_coefficient<2>(make_drag_law<2>(scenario.coupling.drag), lone)
                   : drag_coefficient<3>(make_drag_law<3>(scenario.coupling.drag), lone));
  if (alone > 0) numbers.shielding = drag / alone;
  return numbers;
}

}  // namespace varve::core
