// T8: two-way coupling disturbs the fluid that it samples. In Stokes flow the excess speed has a
// closed form.
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "core/math.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

constexpr double reynolds = 0.005;
constexpr double side_ratio = 8;  // L / hc

/// A sphere in a periodic cube, its submerged weight held by a force on the fluid: no net force,
/// no mean flow. hc is `resolution` spacings, whatever it is of d.
core::Scenario periodic_cube(double length_ratio, int resolution) {
  core::Scenario s;
  s.domain.dimension = 3;
  s.domain.sides = s.domain.faces = s.domain.bottom = s.domain.top = core::Boundary::periodic;
  s.grains.rows = s.grains.columns = 1;
  s.grains.diameter = 1e-3;
  s.coupling.length = length_ratio * s.grains.diameter;
  s.coupling.drag = core::Drag::stokes;
  s.fluid.viscosity = 0.1;
  s.fluid.spacing = s.coupling.length / resolution;
  s.fluid.smoothing_ratio = 1.5;
  s.domain.width = s.domain.height = s.domain.depth = side_ratio * s.coupling.length;
  const double d = s.grains.diameter;
  const double speed = reynolds * s.fluid.viscosity / (s.fluid.density * d);
  const double drag = 3 * core::pi * s.fluid.viscosity * d * speed;
  const double volume = core::pi * d * d * d / 6;
  s.grains.density = s.fluid.density + drag / (volume * standard_gravity);
  const double cube = s.domain.width * s.domain.width * s.domain.width;
  s.fluid.body_force_y = drag / (s.fluid.density * (cube - volume));
  // Sound crosses a spacing about as fast as momentum does.
  const double h = s.fluid.smoothing_ratio * s.fluid.spacing;
  s.fluid.sound_speed = 2 * s.fluid.viscosity / (s.fluid.density * h);
  s.time.steps = 1;
  return s;
}

struct Settled {
  double speed = 0;     // over the closure's
  double images = 0;    // of that, what the other cubes' spheres take away
  double own = 0;       // and what the sphere's own disturbance adds
};

Settled settle(core::Scenario scene) {
  Experiment run(std::move(scene));
  const core::Scenario& s = run.scenario();
  const double side = s.domain.width, nu = s.fluid.viscosity / s.fluid.density;
  const double slowest = side * side / (4 * core::pi * core::pi * nu);  // [s] of a wave of one side
  const double closure = reynolds * nu / s.grains.diameter;
  run.run_until(5 * slowest);
  double sum = 0;
  int steps = 0;
  for (; run.time() < 6 * slowest; ++steps) {
    run.step();
    sum -= run.field("grains.velocity")[1];
  }
  const double radius = 0.5 * s.grains.diameter;
  // The last term is Hasimoto's, 4 pi/3 (R/L)^3 for a sphere's surface, whose points are 2 R^2
  // apart in the mean square; those of the kernel are 1.6 hc^2.
  const double hc = s.coupling.length;
  Settled settled;
  settled.own = 1.0737 * radius / hc;
  settled.images = radius * (-2.837 / side +
                             2 * core::pi / 3 * 1.6 * hc * hc / (side * side * side));
  settled.speed = sum / steps / closure;
  return settled;
}

ValidationRow excess_row(double length_ratio, int resolution, double tolerance) {
  const Settled sphere = settle(periodic_cube(length_ratio, resolution));
  return relative_row(fmt::format("hc = {:g} d = {} dx: V / V_closure - 1", length_ratio,
                                  resolution),
                      "", sphere.own + sphere.images, sphere.speed - 1, tolerance);
}

/// With the correction only the images are left, which are no error.
ValidationRow corrected_row(double length_ratio) {
  core::Scenario s = periodic_cube(length_ratio, 3);
  s.coupling.self_disturbance = true;
  const Settled sphere = settle(std::move(s));
  return relative_row(fmt::format("hc = {:g} d = 3 dx, corrected: V / V_closure", length_ratio),
                      "", 1 + sphere.images, sphere.speed, 0.03);
}

std::vector<ValidationRow> disturbance() {
  return {excess_row(2, 3, 0.1), excess_row(4, 3, 0.1), corrected_row(1), corrected_row(2)};
}
std::vector<ValidationRow> disturbance_sweep() {
  return {excess_row(3, 3, 0.1), excess_row(6, 3, 0.1), excess_row(4, 2, no_gate),
          excess_row(4, 4, 0.1)};
}

}  // namespace

void add_disturbance_cases(std::vector<ValidationCase>& cases) {
  const char* source =
      "Stokeslet smeared and sampled by the kernel, 1.0737 R / hc; periodic images, Hasimoto 1959";
  cases.push_back({"disturbance", "T8", CaseKind::fast,
                   "a sphere in a periodic cube, two-way, Re = 0.005: the excess over its closure",
                   source, disturbance});
  cases.push_back({"disturbance_sweep", "T8", CaseKind::slow,
                   "the same at two more coupling lengths", source, disturbance_sweep});
}

}  // namespace varve::tools
