// T9 a block of spheres settles, T10 fluid driven through a fixed bed: the closure at a porosity.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/criteria.h"
#include "core/math.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

/// A cubic lattice of spheres that fills a box, periodic sideways, at a porosity; hc = 4 d, two
/// spacings or more.
core::Scenario lattice_of_spheres(double porosity, double diameter, std::int64_t across,
                                  std::int64_t high) {
  core::Scenario s;
  s.domain.dimension = 3;
  s.domain.sides = s.domain.faces = core::Boundary::periodic;
  s.grains.diameter = diameter;
  // Tabled porosities of touching spheres are rounded: 0.4764 would overlap by 10^-6 d.
  const double gap = std::cbrt(core::pi / 6 / (1 - porosity)) - 1;
  s.grains.gap = gap > -1e-5 ? std::max(gap, 0.0) : gap;
  const double pitch = diameter * (1 + s.grains.gap);
  s.grains.columns = s.grains.layers = across;
  s.grains.rows = high;
  s.domain.width = s.domain.depth = static_cast<double>(across) * pitch;
  s.domain.height = static_cast<double>(high) * pitch;
  s.fluid.smoothing_ratio = 1.5;
  use_closure_set(s);
  s.time.steps = 1;
  return s;
}

/// The largest spacing of at most 2 d that divides both pitches' multiples.
void set_spacing(core::Scenario& s) {
  for (std::int64_t cells = 1;; ++cells) {
    const double spacing = s.domain.width / static_cast<double>(cells);
    const double high = s.domain.height / spacing;
    if (spacing > 2.05 * s.grains.diameter || std::abs(high - std::round(high)) > 1e-9) continue;
    s.fluid.spacing = spacing;
    return;
  }
}

// ---- T9 ----

struct Suspension {
  const char* name;
  double density, viscosity;
};
constexpr Suspension glycerol{"water-glycerol", 1150, 8.9e-3};
constexpr Suspension water{"water", 1000, 8.9e-4};

/// Superficial slip in the middle of a block that fills a closed box: its settling speed, since no
/// volume flows on the whole. It starts under the excess pressure that carries it, in the published
/// motion, which a wrong drag or pressure force leaves within a relaxation time; from rest the box
/// would ring with sound.
void start_settling(Experiment& run, double porosity, double excess, double speed) {
  const core::Scenario& s = run.scenario();
  std::vector<double> mass = run.field("fluid.mass");
  std::vector<double> density = run.field("fluid.superficial_density");
  const std::vector<double> x = run.field("fluid.position");
  std::vector<double> u(x.size(), 0.0), v(run.field("grains.velocity").size(), 0.0);
  for (std::size_t a = 0; a < mass.size(); ++a) {
    const double pressure = excess * (0.5 * s.domain.height - x[3 * a + 1]);
    const double factor =
        1 + pressure / (s.fluid.density * s.fluid.sound_speed * s.fluid.sound_speed);
    mass[a] *= factor;
    density[a] *= factor;
    u[3 * a + 1] = speed * (1 - porosity) / porosity;
  }
  for (std::size_t i = 1; i < v.size(); i += 3) v[i] = -speed;
  run.set_field("fluid.mass", mass);
  run.set_field("fluid.superficial_density", density);
  run.set_field("fluid.velocity", u);
  run.set_field("grains.velocity", v);
}

ValidationRow settling_row(const Suspension& fluid, double porosity, std::int64_t across,
                           std::int64_t high, double published) {
  core::Scenario s = lattice_of_spheres(porosity, 1e-4, across, high);
  set_spacing(s);
  s.domain.bottom = s.domain.top = core::Boundary::free_slip;
  s.grains.density = 2500;
  s.fluid.density = fluid.density;
  s.fluid.viscosity = fluid.viscosity;
  const double excess = (1 - porosity) * (s.grains.density - fluid.density) * standard_gravity;
  const double relaxation =
      s.grains.density * s.grains.diameter * s.grains.diameter / (18 * fluid.viscosity);
  // Pressure within 1 % of rho0 c0^2.
  s.fluid.sound_speed = std::max(std::sqrt(excess * s.domain.height / (0.01 * fluid.density)),
                                 20 * published);
  s.time.dt = std::min(0.25 * s.fluid.smoothing_ratio * s.fluid.spacing / s.fluid.sound_speed,
                       0.5 * relaxation * porosity * porosity * porosity);
  // What the start leaves of sound, the mixture's first mode in the box, is averaged away.
  const double mixture = porosity * fluid.density + (1 - porosity) * s.grains.density;
  const double period = 2 * s.domain.height / s.fluid.sound_speed *
                        std::sqrt(porosity * mixture / fluid.density);
  Experiment run(s);
  start_settling(run, porosity, excess, published);
  run.run_until(5 * relaxation + period);
  double sum = 0, lab = 0, count = 0;
  while (run.time() < 5 * relaxation + period + std::max(period, 2 * relaxation)) {
    run.step();
    const std::vector<double> v = run.field("grains.velocity");
    const std::vector<double> at = run.field("grains.position");
    const std::vector<core::GrainReport> felt = run.simulation().grain_reports();
    for (std::size_t i = 0; i < felt.size(); ++i) {
      if (std::abs(at[3 * i + 1] - 0.5 * s.domain.height) > 0.1 * s.domain.height) continue;
      sum += porosity * (felt[i].fluid_velocity[1] - v[3 * i + 1]);
      lab -= v[3 * i + 1];
      count += 1;
    }
  }
  return relative_row(fmt::format("{}, porosity {:g}: V", fluid.name, porosity), "m/s", published,
                      sum / count, 0.05,
                      fmt::format("grains alone: {:.4g} m/s over the floor", lab / count));
}

std::vector<ValidationRow> block_dilute() {
  return {settling_row(glycerol, 0.95, 8, 16, 6.6058e-4),
          settling_row(water, 0.9, 10, 16, 4.9124e-3)};
}

std::vector<ValidationRow> block_dense() {
  return {settling_row(glycerol, 0.8, 13, 20, 2.9689e-4),
          settling_row(glycerol, 0.5, 18, 26, 3.2952e-5),
          settling_row(water, 0.7, 15, 22, 1.6350e-3)};
}

// ---- T10 ----

/// Superficial speed of fluid that a body force drives through a periodic bed held in place.
ValidationRow bed_row(double porosity, std::int64_t across, double gradient, double published) {
  core::Scenario s = lattice_of_spheres(porosity, 1e-3, across, across);
  set_spacing(s);
  s.domain.bottom = s.domain.top = core::Boundary::periodic;
  s.grains.motion = core::GrainMotion::frozen;
  s.gravity.magnitude = 0;
  s.fluid.viscosity = 1e-3;
  s.fluid.body_force_x = gradient / s.fluid.density;
  s.coupling.drag = core::Drag::gidaspow;
  s.fluid.sound_speed = 20 * published / porosity;
  const double relaxation = published / porosity / s.fluid.body_force_x;  // [s] of the fluid
  s.time.dt = std::min(0.1 * relaxation,
                       0.25 * s.fluid.smoothing_ratio * s.fluid.spacing / s.fluid.sound_speed);
  Experiment run(s);
  run.run_until(6 * relaxation);
  const std::vector<double> u = run.field("fluid.velocity"), m = run.field("fluid.mass");
  double momentum = 0, mass = 0;
  for (std::size_t a = 0; a < m.size(); ++a) {
    momentum += m[a] * u[3 * a];
    mass += m[a];
  }
  return relative_row(fmt::format("porosity {:g}, dp/dx = {:g} Pa/m: U", porosity, gradient),
                      "m/s", published, porosity * momentum / mass, 0.03);
}

/// Ergun's pressure drop [Pa/m] at superficial speed U through spheres of 1 mm in water.
double ergun(double porosity, double speed) {
  constexpr double d = 1e-3, density = 1000, viscosity = 1e-3;
  const double solid = 1 - porosity, cube = porosity * porosity * porosity;
  return 150 * solid * solid * viscosity * speed / (cube * d * d) +
         1.75 * solid * density * speed * speed / (cube * d);
}

std::vector<ValidationRow> bed_dilute() { return {bed_row(0.7, 15, ergun(0.7, 0.01), 0.01)}; }

std::vector<ValidationRow> bed_dense() {
  return {bed_row(0.5, 18, 307.0, 0.001), bed_row(0.5, 18, 3700.0, 0.01),
          bed_row(0.4764, 18, 388.8, 0.001), bed_row(0.4764, 18, 4650.9, 0.01)};
}

}  // namespace

void add_swarm_cases(std::vector<ValidationCase>& cases) {
  const char* block =
      "Robinson, Ramaioli and Luding 2014: DallaValle and Di Felice at the block's porosity";
  cases.push_back({"block", "T9", CaseKind::fast,
                   "a block of spheres of 0.1 mm settles in a closed box, hc = 4 d", block,
                   block_dilute});
  cases.push_back({"block_dense", "T9", CaseKind::slow, "the same at lower porosities", block,
                   block_dense});
  const char* bed = "Ergun 1952; drag law Gidaspow, whose dense branch is Ergun's";
  cases.push_back({"bed", "T10", CaseKind::fast,
                   "a body force drives water through a fixed bed of spheres, hc = 4 d", bed,
                   bed_dilute});
  cases.push_back({"bed_dense", "T10", CaseKind::slow,
                   "the same at lower porosities and two speeds", bed, bed_dense});
}

}  // namespace varve::tools
