// T13 head-on contact, linear and Hertz's, T14 oblique impact and rolling: grains alone, against
// closed forms.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/criteria.h"
#include "core/math.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

/// A sphere (3D) or disc of 2.5 mm and 1250 kg/m3, k = 1e4 N/m, alone above a floor, no gravity.
core::Scenario dry_grain(int dimension) {
  core::Scenario s;
  s.domain.dimension = dimension;
  s.domain.width = s.domain.height = 0.05;
  if (dimension == 3) s.domain.depth = 0.05;
  s.fluid.present = false;
  s.gravity.magnitude = 0;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.grains.lowest_y = 0.5 * s.grains.diameter + 1e-5;
  s.contact.stiffness = 1e4;
  s.time.steps = 1;
  return s;
}

/// One contact from its first touch to its end.
struct Hit {
  double impact = 0, rebound = 0;     // [m/s]
  double pushing = 0, overlap = 0;    // [s] with a force, [m]
  double force = 0;                   // [N] largest
};

Hit run_hit(Experiment& run, double longest) {
  Hit hit;
  while (run.time() < longest) {
    run.step();
    const std::vector<double> ends = run.column("contacts", "end");
    if (ends.empty()) continue;
    const std::vector<double> force = run.column("contacts", "peak_force");
    if (run.column("contacts", "begin")[0] > 0)
      hit.impact = run.column("contacts", "impact_speed")[0];
    if (force[0] > 0) hit.pushing += run.dt();
    hit.overlap = std::max(hit.overlap, run.column("contacts", "peak_overlap")[0]);
    hit.force = std::max(hit.force, force[0]);
    if (ends[0] > 0) {
      hit.rebound = run.column("contacts", "rebound_speed")[0];
      break;
    }
  }
  return hit;
}

/// A hit at `speed` on the floor, `fine` steps to an undamped contact.
Hit on_the_floor(double alpha, double speed, double fine) {
  core::Scenario s = dry_grain(3);
  s.contact.damping = alpha;
  s.grains.velocity_y = -speed;
  const double contact = core::pi * std::sqrt(core::grain_mass(s) / s.contact.stiffness);
  s.time.dt = contact / fine;
  Experiment run(s);
  return run_hit(run, 1e-5 / speed + 4 * contact);
}

Hit of_a_pair(double alpha, double speed) {
  core::Scenario s = dry_grain(3);
  s.contact.damping = alpha;
  s.grains.rows = 2;
  s.grains.lowest_y = 0.02;
  s.grains.gap = 0.004;
  const double contact = core::pi * std::sqrt(0.5 * core::grain_mass(s) / s.contact.stiffness);
  s.time.dt = contact / 1000;
  Experiment run(s);
  run.set_field("grains.velocity", {0, 0.5 * speed, 0, 0, -0.5 * speed, 0});
  return run_hit(run, 1e-5 / speed + 4 * contact);
}

// ---- T13 ----

/// Time to the largest overlap and the overlap there, per v / w0: of the damped oscillator.
double largest_overlap(double alpha) {
  const double zeta = 0.5 * alpha, w = std::sqrt(1 - zeta * zeta);
  return std::exp(-zeta / w * std::atan2(w, zeta));
}

std::vector<ValidationRow> linear_contact() {
  constexpr double alpha = 0.2, speed = 0.1;
  const double mass = core::grain_mass(dry_grain(3)), k = 1e4;
  std::vector<ValidationRow> rows;
  const Hit floor = on_the_floor(alpha, speed, 1000), pair = of_a_pair(alpha, speed);
  const double unit = std::sqrt(mass / k), pair_unit = std::sqrt(0.5 * mass / k);
  rows.push_back(relative_row("floor: restitution", "", restitution_of(alpha),
                              floor.rebound / floor.impact, 0.005));
  rows.push_back(relative_row("floor: time with a force", "s", push_time_of(alpha) * unit,
                              floor.pushing, 0.005));
  rows.push_back(relative_row("floor: largest overlap", "m", 2.7586e-6, floor.overlap, 0.005));
  rows.push_back(relative_row("pair: restitution", "", restitution_of(alpha),
                              pair.rebound / pair.impact, 0.005));
  rows.push_back(relative_row("pair: time with a force", "s", push_time_of(alpha) * pair_unit,
                              pair.pushing, 0.005));
  rows.push_back(relative_row("pair: largest overlap", "m",
                              speed * pair_unit * largest_overlap(alpha), pair.overlap, 0.005));
  for (const double each : {0.0, 0.05, 0.15, 0.25, 0.5, 1.0, 1.5}) {
    const Hit hit = on_the_floor(each, speed, 1000);
    rows.push_back(relative_row(fmt::format("floor: restitution at alpha = {:g}", each), "",
                                restitution_of(each), hit.rebound / hit.impact, 0.005));
  }
  core::Scenario lying = dry_grain(3);
  lying.gravity.magnitude = standard_gravity;
  lying.grains.lowest_y = 0.5 * lying.grains.diameter;
  Experiment rest(lying);
  rest.run_until(0.02);
  rows.push_back(relative_row("at rest: overlap", "m", mass * standard_gravity / k,
                              0.5 * lying.grains.diameter - rest.field("grains.position")[1],
                              0.005));
  return rows;
}

/// An elastic sphere: Hertz's largest force and overlap and the duration are printed.
struct Material {
  const char* name;
  double modulus, ratio, density;     // [Pa], [kg/m3]
  double force, overlap, duration;    // [N], [m], [s]
};

/// Two of 10 mm radius meet at 10 m/s each, or one of 0.1 m radius a rigid wall at 0.2 m/s.
void add_hertz(const Material& material, bool pair, std::vector<ValidationRow>& rows) {
  const double radius = pair ? 0.01 : 0.1, gap = 1e-3 * material.overlap;
  core::Scenario s = dry_grain(3);
  s.domain.width = s.domain.height = s.domain.depth = 10 * radius;
  s.grains.diameter = 2 * radius;
  s.grains.density = material.density;
  s.grains.rows = pair ? 2 : 1;
  s.grains.gap = 0.5 * gap / radius;  // of diameters
  s.grains.lowest_y = pair ? 3 * radius : radius + gap;
  s.contact.law = core::ContactLaw::hertz;
  s.contact.stiffness = core::automatic;
  s.contact.youngs_modulus = material.modulus;
  s.contact.poisson_ratio = material.ratio;
  s.contact.damping = s.contact.friction = 0;
  s.time.dt = material.duration / 2000;
  Experiment run(s);
  if (pair) run.set_field("grains.velocity", {0, 10, 0, 0, -10, 0});
  else run.set_field("grains.velocity", {0, -0.2, 0});
  const Hit hit = run_hit(run, 2 * material.duration);
  const auto add = [&](const char* what, const char* unit, double reference, double ours) {
    rows.push_back(relative_row(fmt::format("{}, {}: {}", pair ? "pair" : "wall", material.name,
                                            what), unit, reference, ours, 0.005));
  };
  add("largest force", "N", material.force, hit.force);
  add("largest overlap", "m", material.overlap, hit.overlap);
  add("duration", "s", material.duration, hit.pushing);
  add("restitution", "", 1, hit.rebound / hit.impact);
}

std::vector<ValidationRow> hertz_contact() {
  std::vector<ValidationRow> rows;
  for (const Material& material :
       {Material{"glass", 4.8e10, 0.2, 2800, 10.70e3, 274.1e-6, 40.3e-6},
        Material{"limestone", 2e10, 0.25, 2500, 7.108e3, 368.3e-6, 54.2e-6}})
    add_hertz(material, true, rows);
  for (const Material& material :
       {Material{"aluminium alloy", 7e10, 0.3, 2699, 11.37e3, 49.72e-6, 731.7e-6},
        Material{"magnesium alloy", 4e10, 0.35, 1800, 7.233e3, 52.12e-6, 767.1e-6}})
    add_hertz(material, false, rows);
  return rows;
}

// ---- T14 ----

/// A grain of 5 mm hits the floor at 3.9 m/s, `angle` degrees from the normal, and slides all the
/// time: e_t = 1 - mu (1 + e) / tan, R spin = s mu (1 + e) v_n with s = 5/2 (sphere), 2 (disc).
void add_oblique(int dimension, double angle, std::vector<ValidationRow>& rows) {
  constexpr double speed = 3.9, friction = 0.092, restitution = 0.98;
  const double normal = speed * std::cos(angle * core::pi / 180);
  const double sliding = speed * std::sin(angle * core::pi / 180);
  core::Scenario s = dry_grain(dimension);
  s.grains.diameter = 5e-3;
  s.grains.lowest_y = 0.5 * s.grains.diameter + 1e-5;
  s.grains.velocity_x = sliding;
  s.grains.velocity_y = -normal;
  s.contact.stiffness = core::automatic;
  s.contact.time = 2e-5;
  s.contact.damping = damping_for(restitution);
  s.contact.friction = friction;
  s.time.dt = s.contact.time / 500;
  Experiment run(s);
  run_hit(run, 1e-4);
  const double e_t = run.field("grains.velocity")[0] / sliding;
  const double spin = std::abs(run.field("grains.spin")[dimension == 2 ? 0 : 2]);
  const double share = dimension == 2 ? 2 : 2.5;
  const auto name = [&](const char* what) {
    return fmt::format("{}, {:g} degrees: {}", dimension == 2 ? "disc" : "sphere", angle, what);
  };
  rows.push_back(relative_row(
      name("tangential restitution"), "",
      1 - friction * (1 + restitution) / std::tan(angle * core::pi / 180), e_t, 0.02));
  rows.push_back(relative_row(name("spin after"), "rad/s",
                              share * friction * (1 + restitution) * normal /
                                  (0.5 * s.grains.diameter),
                              spin, 0.02));
}

/// Thrown flat over a floor a grain slides until it rolls: at 5/7 of its speed (sphere), 2/3
/// (disc).
void add_rolling(int dimension, std::vector<ValidationRow>& rows) {
  constexpr double speed = 0.2, friction = 0.3;
  core::Scenario s = dry_grain(dimension);
  s.domain.width = 0.1;
  s.gravity.magnitude = standard_gravity;
  s.grains.centre_x = 0.01;
  s.contact.stiffness = core::automatic;
  s.contact.time = 5e-4;
  s.contact.friction = friction;
  s.grains.velocity_x = speed;
  s.grains.lowest_y = 0.5 * s.grains.diameter;
  s.time.dt = s.contact.time / 100;
  Experiment run(s);
  const double share = dimension == 2 ? 1.0 / 3 : 2.0 / 7;
  const double slid = share * speed / (friction * standard_gravity);  // [s] until it rolls
  double rolls_at = 0, sum = 0;
  int steps = 0;
  while (run.time() < 3 * slid) {
    run.step();
    const double v = run.field("grains.velocity")[0];
    const double spin = std::abs(run.field("grains.spin")[dimension == 2 ? 0 : 2]);
    if (rolls_at == 0 && spin * 0.5 * s.grains.diameter >= v) rolls_at = run.time();
    if (run.time() < 2 * slid) continue;
    sum += v;
    ++steps;
  }
  const char* body = dimension == 2 ? "disc" : "sphere";
  rows.push_back(relative_row(fmt::format("{}: speed when it rolls, over the first", body), "",
                              1 - share, sum / steps / speed, 0.02));
  rows.push_back(relative_row(fmt::format("{}: time until it rolls", body), "s", slid, rolls_at,
                              0.02));
}

std::vector<ValidationRow> oblique_impact() {
  std::vector<ValidationRow> rows;
  for (const int dimension : {3, 2})
    for (const double angle : {40.0, 50.0, 60.0, 75.0}) add_oblique(dimension, angle, rows);
  return rows;
}

std::vector<ValidationRow> rolling() {
  std::vector<ValidationRow> rows;
  for (const int dimension : {3, 2}) add_rolling(dimension, rows);
  return rows;
}

}  // namespace

void add_contact_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"linear_contact", "T13", CaseKind::fast,
                   "a sphere of 2.5 mm hits floor and twin, k = 1e4 N/m",
                   "the damped oscillator whose dashpot never pulls, Schwager and Poeschel 2007",
                   linear_contact});
  cases.push_back({"hertz_contact", "T13", CaseKind::fast,
                   "two elastic spheres of 20 mm meet at 20 m/s, one of 0.2 m a rigid wall at "
                   "0.2 m/s",
                   "Chung and Ooi 2011, tests 1 and 2: Hertz 1882", hertz_contact});
  cases.push_back({"oblique_impact", "T14", CaseKind::fast,
                   "a grain of 5 mm hits the floor at 3.9 m/s aslant and slides throughout",
                   "Chung and Ooi 2011, test 4: mu = 0.092, e = 0.98", oblique_impact});
  cases.push_back({"rolling", "T14", CaseKind::fast,
                   "a grain thrown flat over a floor slides, then rolls",
                   "rigid body: 5/7 and 2/3 of the first speed", rolling});
}

}  // namespace varve::tools
