// T3 liquid at rest around a frozen block, T16 the collapse of a column: fluid under gravity with
// its full pressure.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/criteria.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

// ---- T3 ----

core::Scenario tank() {
  core::Scenario s;
  s.domain.width = 0.04;
  s.domain.height = 0.06;
  s.fluid.spacing = 2e-3;
  s.fluid.smoothing_ratio = 1.5;
  s.fluid.pressure = core::PressureForm::full;
  s.fluid.jitter = 0.05;
  s.time.steps = 1;
  return s;
}

/// Pressure over height of the last 0.2 s, speeds at the end, force on the block.
std::vector<ValidationRow> at_rest(const core::Scenario& scene, const std::string& name) {
  Experiment run(scene);
  const core::Scenario& s = run.scenario();
  const double h = core::kernel_support(s), scale = s.fluid.density * standard_gravity;
  run.run_until(0.8);
  std::vector<double> heights, pressures;
  double buoyancy = 0, squares = 0;
  int looks = 0, speeds = 0;
  for (double next = 0.8; next < 1.0; next += 5e-3) {
    run.run_until(next);
    run.step();
    ++looks;
    const std::vector<double> p = run.simulation().fluid_report().pressure;
    const std::vector<double> x = run.field("fluid.position");
    for (std::size_t a = 0; a < p.size(); ++a) {
      if (std::min(x[2 * a + 1], s.domain.height - x[2 * a + 1]) < h) continue;
      heights.push_back(x[2 * a + 1]);
      pressures.push_back(p[a]);
    }
    for (const double v : run.field("fluid.velocity")) squares += v * v;
    speeds += static_cast<int>(p.size());
    for (const core::GrainReport& grain : run.simulation().grain_reports())
      buoyancy += grain.hydrodynamic[1] + grain.drag[1];
  }
  const Line line = fit_line(heights, pressures);
  std::vector<ValidationRow> rows;
  rows.push_back(relative_row(name + ": slope of p over depth", "Pa/m", scale, -line.slope, 0.01));
  rows.push_back(relative_row(name + ": p at the bottom", "Pa", scale * s.domain.height,
                              line.intercept, 0.01));
  rows.push_back(scaled_row(name + ": rms speed", "m/s", 0, std::sqrt(squares / speeds),
                            std::sqrt(standard_gravity * s.domain.height), "sqrt(g H)", 0.01));
  if (s.has_grains()) {
    const double count = static_cast<double>(s.grains.rows * s.grains.columns);
    rows.push_back(relative_row(name + ": buoyancy of the block", "N/m",
                                scale * count * core::grain_volume(s), buoyancy / looks, 0.01));
  }
  return rows;
}

std::vector<ValidationRow> hydrostatic() {
  std::vector<ValidationRow> rows = at_rest(tank(), "liquid alone");
  core::Scenario block = tank();
  block.grains.rows = block.grains.columns = 4;
  block.grains.gap = 0.1;
  block.grains.motion = core::GrainMotion::frozen;
  block.coupling.length = 5e-3;  // 2.5 spacings
  const std::vector<ValidationRow> more = at_rest(block, "frozen block");
  rows.insert(rows.end(), more.begin(), more.end());
  return rows;
}

// ---- T16 ----

std::vector<ValidationRow> dam_break() {
  constexpr double length = 0.1;  // [m] L
  struct Instant {
    double time, front;  // t sqrt(2 g / L), z / L
    bool experiment;
  };
  constexpr Instant instants[] = {
      {0.381, 1.111, true},  {0.769, 1.252, true},  {0.958, 1.512, false}, {1.153, 1.505, true},
      {1.381, 1.931, false}, {1.537, 1.892, true},  {1.858, 2.480, false}, {1.935, 2.241, true},
      {2.278, 3.004, false}, {2.323, 2.615, true},  {2.719, 3.003, true},  {2.752, 3.700, false},
      {3.096, 3.624, true}};
  core::Scenario s;
  s.domain.width = 0.5;
  s.domain.height = 0.24;
  s.domain.sides = s.domain.bottom = core::Boundary::free_slip;
  s.domain.top = core::Boundary::free;
  s.fluid.viscosity = 1e-3;
  s.fluid.spacing = 4e-3;
  s.fluid.width = length;
  s.fluid.level = 2 * length;
  s.time.steps = 1;
  Experiment run(s);
  std::vector<ValidationRow> rows;
  for (const Instant& instant : instants) {
    run.run_until(instant.time / std::sqrt(2 * standard_gravity / length));
    const std::vector<double> x = run.field("fluid.position");
    double front = 0;
    for (std::size_t a = 0; a < x.size(); a += 2) front = std::max(front, x[a]);
    ValidationRow row =
        relative_row(fmt::format("front / L at t sqrt(2 g / L) = {:g}, {}", instant.time,
                                 instant.experiment ? "experiment" : "MPS"),
                     "", instant.front, (front + 0.5 * s.fluid.spacing) / length, 0.1);
    if (instant.experiment)
      row.excuse = "the experiment lifts a gate and has a rough bed; halved spacing, h = 1.5 dx, "
                   "halved c0 and walls without slip leave our front within 3 %";
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

void add_surface_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"hydrostatic", "T3", CaseKind::fast,
                   "liquid at rest, full pressure, alone and around a frozen block; h = 1.5 dx",
                   "p = rho g depth; Archimedes", hydrostatic});
  cases.push_back({"dam_break", "T16", CaseKind::fast,
                   "a column of water 2 L high loses its dam, 25 x 50",
                   "Koshizuka and Oka 1996: experiment; their MPS, which has no gate either",
                   dam_break});
}

}  // namespace varve::tools
