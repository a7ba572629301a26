// T7 one sphere in three fluids, T12 ten Cate's spheres: one-way, the closure and nothing else.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/criteria.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

using Law = double (*)(double);

// ---- T7 ----

struct Medium {
  const char* name;
  double density, viscosity;   // [kg/m3], [Pa s]
  double stokes, di_felice;    // [m/s] published settling speeds of one sphere
};
constexpr Medium media[] = {{"water-glycerol", 1150, 8.9e-3, 8.2669e-4, 8.3808e-4},
                            {"water", 1000, 8.9e-4, 9.1854e-3, 7.6092e-3},
                            {"air", 1.1839, 1.86e-5, 0.73218, 0.50062}};

/// One sphere of 0.1 mm and 2500 kg/m3 in a periodic box of fluid that it does not move.
core::Scenario lone_sphere(const Medium& medium, core::Drag drag) {
  core::Scenario s;
  s.domain.dimension = 3;
  s.domain.sides = s.domain.faces = s.domain.bottom = s.domain.top = core::Boundary::periodic;
  s.grains.rows = s.grains.columns = 1;
  s.grains.diameter = 1e-4;
  s.grains.density = 2500;
  s.fluid.spacing = 2 * s.grains.diameter;
  s.domain.width = s.domain.height = s.domain.depth = 9 * s.fluid.spacing;
  s.fluid.smoothing_ratio = 1.5;
  s.fluid.density = medium.density;
  s.fluid.viscosity = medium.viscosity;
  // The fluid stays at rest: sound that is slower than the grain allows long steps and changes
  // nothing else.
  s.fluid.sound_speed = 0.15 * medium.stokes;
  s.guards.speed = 10;
  s.coupling.mode = core::CouplingMode::one_way;
  s.coupling.drag = drag;
  use_closure_set(s);
  s.time.steps = 1;
  return s;
}

void add_fall(const Medium& medium, core::Drag drag, const char* law_name, Law law,
              double published, std::vector<ValidationRow>& rows) {
  core::Scenario s = lone_sphere(medium, drag);
  const Sphere sphere{s.grains.diameter, s.grains.density, medium.density, medium.viscosity};
  const double relaxation =
      s.grains.density * s.grains.diameter * s.grains.diameter / (18 * medium.viscosity);
  const double limit = 0.24 * s.fluid.smoothing_ratio * s.fluid.spacing / s.fluid.sound_speed;
  s.time.dt = std::min(relaxation / 120, limit);
  Experiment run(s);
  ValidationRow worst;
  const auto name = [&](const std::string& what) {
    return fmt::format("{}, {}: {}", medium.name, law_name, what);
  };
  double speed = 0;
  for (const double instant : {0.25, 0.5, 1.0, 2.0, 3.0, 6.0}) {
    run.run_until(instant * relaxation);
    speed = -run.field("grains.velocity")[1];
    const ValidationRow row = relative_row(name(fmt::format("V at {:g} tau, worst of 6", instant)),
                                           "m/s", falling_speed(sphere, law, run.time()), speed,
                                           0.01);
    if (worst.quantity.empty() || std::abs(row.deviation()) > std::abs(worst.deviation()))
      worst = row;
  }
  rows.push_back(worst);
  rows.push_back(relative_row(name("V in the end"), "m/s", published, speed, 0.01));
}

std::vector<ValidationRow> three_fluids() {
  std::vector<ValidationRow> rows;
  for (const Medium& medium : media) {
    add_fall(medium, core::Drag::stokes, "Stokes", stokes_cd, medium.stokes, rows);
    add_fall(medium, core::Drag::dallavalle_di_felice, "Di Felice", dallavalle_cd,
             medium.di_felice, rows);
  }
  return rows;
}

// ---- T12 ----

struct TenCate {
  const char* name;
  double density, viscosity;
  double naumann, dallavalle;  // [m/s] unbounded settling speeds
  double measured, end;        // [m/s] largest speed; [s] end of the track
};
constexpr TenCate ten_cate[] = {{"E1", 970, 0.373, 0.0409, 0.0382, 0.03599, 4.09},
                                {"E2", 965, 0.212, 0.0635, 0.0586, 0.05718, 2.47},
                                {"E3", 962, 0.113, 0.0939, 0.0866, 0.08727, 1.61},
                                {"E4", 960, 0.058, 0.1290, 0.1197, 0.12224, 1.19}};

core::Scenario ten_cate_box(const TenCate& e, core::Drag drag, double spacing) {
  core::Scenario s;
  s.domain.dimension = 3;
  s.domain.width = s.domain.depth = 0.1;
  s.domain.height = 0.16;
  s.fluid.spacing = spacing;
  s.fluid.density = e.density;
  s.fluid.viscosity = e.viscosity;
  s.grains.rows = s.grains.columns = 1;
  s.grains.diameter = 0.015;
  s.grains.density = 1120;
  s.grains.lowest_y = 0.1275;
  s.coupling.drag = drag;
  s.time.steps = 1;
  return s;
}

/// Largest speed until the sphere is half a diameter above the floor.
double largest_speed(Experiment& run, double& at) {
  double largest = 0;
  const double d = run.scenario().grains.diameter;
  while (run.field("grains.position")[1] > d && run.time() < 10) {
    run.step();
    const double v = -run.field("grains.velocity")[1];
    if (v > largest) at = run.time();
    largest = std::max(largest, v);
  }
  return largest;
}

std::vector<ValidationRow> ten_cate_one_way() {
  std::vector<ValidationRow> rows;
  const auto fall = [&](const TenCate& e, core::Drag drag, const char* name, Law law,
                        double unbounded) {
    core::Scenario s = ten_cate_box(e, drag, 0.02);
    s.coupling.mode = core::CouplingMode::one_way;
    s.coupling.length = 0.04;  // the fluid stays at rest: only that there is some counts
    s.time.cfl = 0.1;
    Experiment run(s);
    double at = 0;
    const double speed = largest_speed(run, at);
    const Sphere sphere{s.grains.diameter, s.grains.density, e.density, e.viscosity};
    rows.push_back(relative_row(fmt::format("{}, {}: largest speed", e.name, name), "m/s",
                                falling_speed(sphere, law, at), speed, 0.01));
    rows.push_back(relative_row(fmt::format("{}, {}: the same, settled", e.name, name), "m/s",
                                unbounded, speed, 0.01));
  };
  for (const TenCate& e : ten_cate) {
    fall(e, core::Drag::schiller_naumann, "Schiller-Naumann", schiller_naumann_cd, e.naumann);
    fall(e, core::Drag::dallavalle_di_felice, "DallaValle", dallavalle_cd, e.dallavalle);
  }
  return rows;
}

std::vector<ValidationRow> ten_cate_two_way() {
  std::vector<ValidationRow> rows;
  for (const TenCate& e : ten_cate) {
    core::Scenario s = ten_cate_box(e, core::Drag::dallavalle_di_felice, 0.005);
    Experiment run(s);
    double at = 0;
    const double speed = largest_speed(run, at);
    rows.push_back(relative_row(fmt::format("{}, two-way, hc = d = 3 dx: largest speed", e.name),
                                "m/s", e.measured, speed, no_gate));
  }
  return rows;
}

}  // namespace

void add_sphere_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"three_fluids", "T7", CaseKind::fast,
                   "a sphere of 0.1 mm falls from rest in three fluids, one-way, two laws",
                   "closure by Runge-Kutta; settling speeds of Robinson, Ramaioli and Luding 2014",
                   three_fluids});
  cases.push_back({"ten_cate", "T12", CaseKind::fast,
                   "the four spheres of ten Cate 2002, one-way, two laws",
                   "closure by Runge-Kutta, and unbounded settling speeds", ten_cate_one_way});
  cases.push_back({"ten_cate_two_way", "T12", CaseKind::slow,
                   "the same, two-way, beside the experiment",
                   "ten Cate et al. 2002, PIV; not a gate: the closure has no wall in it",
                   ten_cate_two_way});
}

}  // namespace varve::tools
