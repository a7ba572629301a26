// Small resolved scenes for tests of the engine.
#pragma once

#include <gtest/gtest.h>

#include "core/parameters.h"
#include "core/scenario.h"

namespace varve::core::scenes {

/// A box of fluid, 2 x 3 cm at 1 mm, closed, excess pressure.
inline Scenario box() {
  Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.03;
  s.fluid.sound_speed = 1;
  s.time.until = 1;
  return s;
}

/// The box with a lattice of discs in it: d 2.5 mm, hc = d.
inline Scenario box_with_grains(int rows, int columns) {
  Scenario s = box();
  s.grains.rows = rows;
  s.grains.columns = columns;
  s.grains.density = 1250;
  s.grains.gap = 0.1;
  return s;
}

/// Water under a free surface, full pressure.
inline Scenario tank() {
  Scenario s = box();
  s.domain.top = Boundary::free;
  s.fluid.level = 0.02;
  s.fluid.sound_speed = 6;
  return s;
}

inline Scenario resolved(Scenario s) {
  for (const Problem& problem : resolve(s)) ADD_FAILURE() << problem.key << ": " << problem.text;
  return s;
}

}  // namespace varve::core::scenes
