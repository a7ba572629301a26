// A scene of fluid alone or of grains alone, for a number of steps: what tests/bench/pays counts
// the instructions of. varve_instructions fluid|grains STEPS
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>

#include "core/parameters.h"
#include "core/simulation.h"

namespace {

using namespace varve;

core::Scenario scene(const std::string& which) {
  core::Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.03;
  s.fluid.sound_speed = 2.5;
  if (which == "fluid") {
    s.fluid.jitter = 0.05;
    s.fluid.pressure = core::PressureForm::full;
  } else {
    s.fluid.present = false;
    s.grains.rows = 8;
    s.grains.columns = 6;
    s.grains.gap = 0.02;
    s.grains.jitter = 0.005;
    s.grains.lowest_y = 1.4e-3;
    s.grains.velocity_y = -0.2;
  }
  return s;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string which = argc == 3 ? argv[1] : "";
  if (which != "fluid" && which != "grains") {
    std::cerr << "usage: varve_instructions fluid|grains STEPS\n";
    return 2;
  }
  core::Scenario s = scene(which);
  for (const core::Problem& problem : core::resolve(s)) {
    std::cerr << problem.key << ": " << problem.text << "\n";
    return 3;
  }
  const auto simulation = core::Simulation::create(s, {});
  const long steps = std::strtol(argv[2], nullptr, 10);
  for (long n = 0; n < steps; ++n) simulation->advance();
  std::cout << simulation->clock().time << "\n";
}
