// One disc sinks for 100 steps: varve's engine, driven without files.
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>

#include "core/parameters.h"
#include "core/simulation.h"

namespace {

/// Height of the first grain. [m]
double height(const varve::core::Simulation& simulation) {
  for (std::size_t f = 0; f < simulation.fields().size(); ++f) {
    if (simulation.fields()[f].name != "grains.position") continue;
    double y = 0;
    std::memcpy(&y, simulation.field(f).bytes.data() + sizeof y, sizeof y);
    return y;
  }
  throw std::runtime_error("no field 'grains.position'");
}

int run() {
  varve::core::Scenario scenario;
  scenario.domain.width = 0.01;
  scenario.domain.height = 0.012;
  scenario.fluid.sound_speed = 1;
  scenario.grains.rows = scenario.grains.columns = 1;
  scenario.grains.density = 2000;
  scenario.time.steps = 100;
  for (const auto& problem : varve::core::resolve(scenario)) {
    std::fprintf(stderr, "%s: %s\n", problem.key.c_str(), problem.text.c_str());
    return 1;
  }
  const auto simulation = varve::core::Simulation::create(scenario, {});
  const double before = height(*simulation);
  for (int n = 0; n < 100; ++n) simulation->advance();
  std::printf("sank by %.3g m in %.3g s\n", before - height(*simulation),
              simulation->clock().time);
  return height(*simulation) < before ? 0 : 1;
}

}  // namespace

int main() {
  try {
    return run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
