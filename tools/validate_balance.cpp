// T2 what must be conserved, T17 what the walls must carry.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/criteria.h"
#include "core/math.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

double length_of(const std::vector<double>& v) {
  double sum = 0;
  for (const double each : v) sum += each * each;
  return std::sqrt(sum);
}

// ---- T2 ----

/// Grains that collide in a periodic box of fluid, no gravity.
core::Scenario periodic_box(int dimension) {
  core::Scenario s;
  s.domain.dimension = dimension;
  s.domain.width = s.domain.height = dimension == 2 ? 0.02 : 0.012;
  s.domain.sides = s.domain.bottom = s.domain.top = core::Boundary::periodic;
  if (dimension == 3) {
    s.domain.depth = s.domain.width;
    s.domain.faces = core::Boundary::periodic;
    s.grains.layers = 2;
    s.grains.velocity_z = 0.02;
  }
  s.gravity.magnitude = 0;
  s.fluid.sound_speed = 2.5;
  s.fluid.initial = core::InitialFlow::taylor_green;
  s.fluid.initial_speed = 0.1;
  s.grains.rows = s.grains.columns = dimension == 2 ? 5 : 2;
  s.grains.density = 2000;
  s.grains.gap = 0.02;
  s.grains.jitter = 0.005;
  s.grains.velocity_x = 0.05;
  s.grains.velocity_y = -0.03;
  s.coupling.porosity = core::Porosity::conservative;
  s.time.steps = 1;
  return s;
}

std::vector<ValidationRow> conservation_in(int dimension) {
  Experiment run(periodic_box(dimension));
  const core::Scenario& s = run.scenario();
  const auto D = static_cast<std::size_t>(dimension);
  const double count = static_cast<double>(s.grains.rows * s.grains.columns * s.grains.layers);
  const double solid = count * core::grain_volume(s), grain_mass = core::grain_mass(s);
  const auto momentum = [&](double& size) {
    std::vector<double> sum(D, 0.0);
    size = 0;
    const std::vector<double> u = run.field("fluid.velocity"), m = run.field("fluid.mass");
    for (std::size_t k = 0; k < u.size(); ++k) {
      sum[k % D] += m[k / D] * u[k];
      size += std::abs(m[k / D] * u[k]);
    }
    const std::vector<double> v = run.field("grains.velocity");
    for (std::size_t k = 0; k < v.size(); ++k) {
      sum[k % D] += grain_mass * v[k];
      size += std::abs(grain_mass * v[k]);
    }
    return sum;
  };
  double size = 0, contacts = 0, reaction = 0, drift = 0, volume = 0;
  const std::vector<double> first = momentum(size);
  for (int n = 0; n < (dimension == 2 ? 400 : 100); ++n) {
    const std::vector<double> mass = run.field("fluid.mass");
    const std::vector<double> rhob = run.field("fluid.superficial_density");
    run.step();
    const std::vector<double> eps = run.simulation().fluid_report().porosity;
    double filled = 0;
    for (std::size_t a = 0; a < mass.size(); ++a) filled += mass[a] / rhob[a] * (1 - eps[a]);
    volume = std::max(volume, std::abs(filled - solid) / solid);
    const core::StepLedger ledger = run.simulation().ledger();
    std::vector<double> sum = ledger.grains_from_fluid;
    for (std::size_t k = 0; k < D; ++k) sum[k] += ledger.fluid_from_grains[k];
    reaction = std::max(reaction, length_of(sum) / ledger.force_scale);
    contacts += static_cast<double>(run.column("contacts", "grain").size());
  }
  double now = 0;
  const std::vector<double> last = momentum(now);
  for (std::size_t k = 0; k < D; ++k) drift = std::max(drift, std::abs(last[k] - first[k]) / size);
  const auto name = [&](const char* what) { return fmt::format("{}D: {}", dimension, what); };
  return {absolute_row(name("total momentum, drift over its parts"), "", 0, drift, 1e-12),
          absolute_row(name("force on grains + reaction, worst step"), "", 0, reaction, 1e-12),
          absolute_row(name("sum V (1 - eps) over grains' volume - 1"), "", 0, volume, 1e-12),
          absolute_row(name("contacts on the way"), "", contacts, contacts, no_gate)};
}

std::vector<ValidationRow> conservation() {
  std::vector<ValidationRow> rows = conservation_in(2);
  const std::vector<ValidationRow> more = conservation_in(3);
  rows.insert(rows.end(), more.begin(), more.end());
  return rows;
}

// ---- T17 ----

/// Twelve grains in a closed tank, hc = 4 d.
core::Scenario closed_tank(core::PressureForm form) {
  core::Scenario s;
  s.domain.width = 0.06;
  s.domain.height = 0.12;
  s.fluid.spacing = 2.5e-3;
  s.fluid.smoothing_ratio = 1.5;
  s.fluid.pressure = form;
  s.grains.rows = 2;
  s.grains.columns = 6;
  s.grains.density = 2000;
  s.grains.gap = 1;
  s.grains.lowest_y = 0.09;
  use_closure_set(s);
  s.time.steps = 1;
  return s;
}
/// The same grains lying on its floor.
core::Scenario lying(core::PressureForm form) {
  core::Scenario s = closed_tank(form);
  s.grains.rows = 1;
  s.grains.columns = 12;
  s.grains.gap = 0.05;
  s.grains.lowest_y = 0.5 * s.grains.diameter;
  return s;
}

struct Carried {
  double walls_on_fluid = 0;   // [N/m] upwards, mean over time, less the momentum gained
  double walls_on_grains = 0;  // [N/m] upwards, mean over time
  double gain = 0;             // [N/m] momentum gained over the time
  double fluid_weight = 0, submerged = 0;  // [N/m] displaced fluid included; of the grains
};

/// Means over [from, to] of the forces that walls exert.
Carried carried(const core::Scenario& scene, double from, double to) {
  Experiment run(scene);
  const core::Scenario& s = run.scenario();
  Carried mean;
  const double solid =
      static_cast<double>(s.grains.rows * s.grains.columns) * core::grain_volume(s);
  for (const double m : run.field("fluid.mass")) mean.fluid_weight += m * standard_gravity;
  mean.fluid_weight += s.fluid.density * solid * standard_gravity;
  mean.submerged = solid * (s.grains.density - s.fluid.density) * standard_gravity;
  run.run_until(from);
  int steps = 0;
  for (; run.time() < to; ++steps) {
    run.step();
    const core::StepLedger ledger = run.simulation().ledger();
    mean.walls_on_fluid += ledger.walls_on_fluid[1];
    mean.walls_on_grains += ledger.walls_on_grains[1];
    mean.gain += (ledger.fluid_momentum_change[1] + ledger.grain_momentum_change[1]) / run.dt();
  }
  for (double* each : {&mean.walls_on_fluid, &mean.walls_on_grains, &mean.gain}) *each /= steps;
  // A swarm never settles quite steadily: what it gains in momentum the walls carry besides.
  mean.walls_on_fluid -= mean.gain;
  return mean;
}

std::vector<ValidationRow> wall_forces() {
  using enum core::PressureForm;
  std::vector<ValidationRow> rows;
  const auto gained = [](const Carried& c) {
    return fmt::format("after {:+.2g} N/m of momentum gained meanwhile", c.gain);
  };
  const Carried a = carried(closed_tank(excess), 0.15, 0.4);
  rows.push_back(relative_row("excess form, settling: walls on the fluid", "N/m", a.submerged,
                              a.walls_on_fluid, 0.02, gained(a)));
  const Carried b = carried(closed_tank(full), 0.15, 0.4);
  rows.push_back(relative_row("full pressure, settling: walls on the fluid", "N/m",
                              b.fluid_weight + b.submerged, b.walls_on_fluid, 0.02, gained(b)));
  const Carried c = carried(lying(excess), 0.4, 0.6);
  rows.push_back(scaled_row("excess form, resting: walls on the fluid", "N/m", 0,
                            c.walls_on_fluid, c.submerged, "the submerged weight", 0.02));
  rows.push_back(relative_row("excess form, resting: floor on the grains", "N/m", c.submerged,
                              c.walls_on_grains, 0.02));
  const Carried d = carried(lying(full), 0.4, 0.6);
  rows.push_back(relative_row("full pressure, resting: walls on both", "N/m",
                              d.fluid_weight + d.submerged,
                              d.walls_on_fluid + d.walls_on_grains, 0.02, gained(d)));
  rows.push_back(relative_row("full pressure, resting: walls on the fluid", "N/m", d.fluid_weight,
                              d.walls_on_fluid, 0.02));
  core::Scenario averaging = lying(full);
  averaging.coupling.pressure_force = core::PressureForce::averaged;
  const Carried e = carried(averaging, 0.4, 0.6);
  rows.push_back(relative_row("full pressure, averaged form: floor on the grains", "N/m",
                              e.submerged, e.walls_on_grains, 0.02));
  ValidationRow floor = relative_row("full pressure, resting: floor on the grains", "N/m",
                                     d.submerged, d.walls_on_grains, 0.02);
  floor.excuse =
      "in the conjugate form a grain nearer to a wall than hc loses buoyancy: its volume is "
      "mirrored, and what is smeared over hc rises less than it does; the sum is right";
  rows.push_back(floor);
  return rows;
}

}  // namespace

void add_balance_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"conservation", "T2", CaseKind::fast,
                   "momentum, reactions and the grains' volume in a periodic box, 2D and 3D",
                   "Newton's third law; porosity E3'", conservation});
  cases.push_back({"wall_forces", "T17", CaseKind::fast,
                   "what walls carry while all grains settle, and when all rest, hc = 4 d",
                   "weight of the fluid and of what grains displace; the grains' submerged weight",
                   wall_forces});
}

}  // namespace varve::tools
