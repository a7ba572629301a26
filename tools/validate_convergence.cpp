// How errors fall with spacing and step, and what a narrower number format costs.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/math.h"
#include "tools/validate.h"
#include "tools/validate_disc.h"
#include "tools/validate_flow.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

using core::pi;

/// One number per rung of a ladder; each rung halves what the one before it had.
struct Ladder {
  std::string name, unit;
  std::vector<std::string> rungs;
  std::vector<double> values;
};

/// Errors against a known value, and the order from rung to rung: log2 of their ratio.
void add_errors(const Ladder& ladder, double known, std::vector<ValidationRow>& rows) {
  for (std::size_t k = 0; k < ladder.values.size(); ++k) {
    std::string order;
    if (k > 0)
      order = fmt::format("observed order {:.2f}",
                          std::log2(std::abs((ladder.values[k - 1] - known) /
                                             (ladder.values[k] - known))));
    rows.push_back(relative_row(fmt::format("{}, {}", ladder.name, ladder.rungs[k]), ladder.unit,
                                known, ladder.values[k], no_gate, order));
  }
}

/// No known value: each rung beside the last, the order from successive differences.
void add_differences(const Ladder& ladder, std::vector<ValidationRow>& rows) {
  const std::vector<double>& v = ladder.values;
  for (std::size_t k = 0; k < v.size(); ++k)
    rows.push_back(relative_row(
        fmt::format("{}, {}", ladder.name, ladder.rungs[k]), ladder.unit, v.back(), v[k], no_gate,
        k < 2 ? ""
              : fmt::format("observed order {:.2f} (successive differences)",
                            std::log2(std::abs((v[k - 2] - v[k - 1]) / (v[k - 1] - v[k]))))));
}

// ---- plane Poiseuille flow ----

/// rms error of the profile over u_max at nu t / H^2 = 0.2, over particles.
double poiseuille_error(const core::Scenario& scene) {
  Experiment run(scene);
  const core::Scenario& s = run.scenario();
  const double height = s.domain.height;
  const double unit = height * height * s.fluid.density / s.fluid.viscosity;
  run.run_until(0.2 * unit - 0.5 * run.dt());
  const std::vector<double> x = run.field("fluid.position"), v = run.field("fluid.velocity");
  double sum = 0;
  for (std::size_t k = 0; k < x.size(); k += 2) {
    const double off = v[k] / poiseuille_speed(s) -
                       poiseuille_profile(x[k + 1] / height, run.time() / unit);
    sum += off * off;
  }
  return std::sqrt(2 * sum / static_cast<double>(x.size()));
}

std::vector<ValidationRow> poiseuille() {
  std::vector<ValidationRow> rows;
  Ladder spacing{"rms error / u_max", "", {}, {}};
  for (const int cells : {10, 20, 40}) {
    spacing.rungs.push_back(fmt::format("{} particles across", cells));
    spacing.values.push_back(poiseuille_error(poiseuille_scene(cells)));
  }
  for (std::size_t k = 0; k < spacing.values.size(); ++k)
    rows.push_back(absolute_row(
        fmt::format("{}, {}", spacing.name, spacing.rungs[k]), "", 0, spacing.values[k], no_gate,
        k == 0 ? ""
               : fmt::format("observed order {:.2f}",
                             std::log2(spacing.values[k - 1] / spacing.values[k]))));
  Ladder step{"rms error / u_max, 20 across", "", {}, {}};
  core::Scenario s = poiseuille_scene(20);
  const double largest = Experiment(s).dt();
  for (const double part : {1.0, 0.5, 0.25}) {
    s.time.dt = part * largest;
    step.rungs.push_back(fmt::format("dt = {:.3g} s", s.time.dt));
    step.values.push_back(poiseuille_error(s));
  }
  add_differences(step, rows);
  s.time.dt = core::automatic;
  s.precision = core::Precision::float_;
  rows.push_back(absolute_row("the same, 20 across, float", "", step.values[0],
                              poiseuille_error(s), no_gate, "reference: double"));
  return rows;
}

// ---- Taylor-Green ----

/// Effective viscosity over nu from the energy lost to t = L / U.
double taylor_green_viscosity(const core::Scenario& scene) {
  Experiment run(scene);
  const double first = flow_energy(run);
  run.run_until(1.0);
  return -std::log(flow_energy(run) / first) / (16 * pi * pi * run.time() / 100);
}

std::vector<ValidationRow> taylor_green() {
  std::vector<ValidationRow> rows;
  Ladder spacing{"effective viscosity / nu", "", {}, {}};
  for (const int cells : {16, 32, 64}) {
    spacing.rungs.push_back(fmt::format("{} x {}", cells, cells));
    spacing.values.push_back(taylor_green_viscosity(taylor_green_scene(cells, false)));
  }
  add_errors(spacing, 1, rows);
  Ladder step{"effective viscosity / nu, 32 x 32", "", {}, {}};
  core::Scenario s = taylor_green_scene(32, false);
  const double largest = Experiment(s).dt();
  for (const double part : {1.0, 0.5, 0.25}) {
    s.time.dt = part * largest;
    step.rungs.push_back(fmt::format("dt = {:.3g} s", s.time.dt));
    step.values.push_back(part == 1 ? spacing.values[1] : taylor_green_viscosity(s));
  }
  add_differences(step, rows);
  s.time.dt = core::automatic;
  s.precision = core::Precision::float_;
  rows.push_back(relative_row("the same, 32 x 32, float", "", spacing.values[1],
                              taylor_green_viscosity(s), no_gate, "reference: double"));
  return rows;
}

// ---- the disc ----

void add_falls(const char* what, const std::vector<core::Scenario>& scenes,
               const std::vector<std::string>& rungs, std::vector<ValidationRow>& rows) {
  Ladder plateau{fmt::format("plateau, {}", what), "m/s", rungs, {}};
  Ladder contact{fmt::format("contact, {}", what), "s", rungs, {}};
  for (const core::Scenario& scene : scenes) {
    const DiscFall fall = fall_of_disc(scene, 0.8);
    plateau.values.push_back(fall.plateau);
    contact.values.push_back(fall.contact_time);
  }
  add_differences(plateau, rows);
  add_differences(contact, rows);
}

std::vector<ValidationRow> disc() {
  std::vector<ValidationRow> rows;
  std::vector<core::Scenario> scenes;
  for (const double spacing : {1.25e-3, 0.625e-3, 0.3125e-3}) {
    scenes.push_back(disc_scene());
    scenes.back().fluid.spacing = spacing;
  }
  add_falls("hc = d", scenes, {"dx = 1.25 mm", "dx = 0.625 mm", "dx = 0.3125 mm"}, rows);
  scenes.clear();
  for (const double cfl : {0.25, 0.125, 0.0625}) {
    scenes.push_back(disc_scene());
    scenes.back().time.cfl = cfl;
  }
  add_falls("dx = 1 mm", scenes, {"cfl 0.25", "cfl 0.125", "cfl 0.0625"}, rows);
  scenes.assign(3, disc_scene());
  scenes[0].precision = core::Precision::float_;
  scenes[1].precision = core::Precision::mixed;
  for (std::size_t k = 0; k < 2; ++k) {
    const DiscFall narrow = fall_of_disc(scenes[k], 0.8), full = fall_of_disc(scenes[2], 0.8);
    const char* name = k == 0 ? "float" : "mixed";
    rows.push_back(relative_row(fmt::format("plateau, {}", name), "m/s", full.plateau,
                                narrow.plateau, no_gate, "reference: double"));
    rows.push_back(relative_row(fmt::format("contact, {}", name), "s", full.contact_time,
                                narrow.contact_time, no_gate, "reference: double"));
  }
  return rows;
}

}  // namespace

void add_convergence_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"poiseuille_convergence", "-", CaseKind::convergence,
                   "plane Poiseuille flow at nu t / H^2 = 0.2 against spacing, step, precision",
                   "the series solution of the start-up", poiseuille});
  cases.push_back({"taylor_green_convergence", "-", CaseKind::convergence,
                   "decay to t = L / U at Re = 100 against spacing, step, precision",
                   "|u| = U exp(-8 pi^2 t U / (Re L)); the finest rung", taylor_green});
  cases.push_back({"disc_convergence", "-", CaseKind::convergence,
                   "the disc's plateau and contact against spacing, step, precision",
                   "the finest rung", disc});
}

}  // namespace varve::tools
