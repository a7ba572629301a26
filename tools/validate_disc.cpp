// T11: a disc settles in a box of 2 x 6 cm, against resolved simulations.
#include "tools/validate_disc.h"

#include <cmath>

#include <fmt/format.h>

#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {

core::Scenario disc_scene() {
  core::Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.06;
  s.fluid.sound_speed = 1;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.grains.centre_x = 0.01;
  s.grains.lowest_y = 0.04;
  s.time.steps = 1;
  return s;
}

DiscFall fall_of_disc(const core::Scenario& scenario, double until) {
  Experiment run(scenario);
  DiscFall fall;
  double sum = 0;
  int steps = 0;
  while (run.time() < until) {
    run.step();
    const double v = -run.field("grains.velocity")[1];
    fall.times.push_back(run.time());
    fall.speeds.push_back(v);
    if (run.time() >= 0.3 && run.time() <= 0.5) {
      sum += v;
      ++steps;
    }
    const std::vector<double> begins = run.column("contacts", "begin");
    const std::vector<double> ends = run.column("contacts", "end");
    for (std::size_t k = 0; k < begins.size(); ++k) {
      if (fall.contact_time == 0) fall.contact_time = run.time();
      if (begins[k] > 0) fall.impacts.push_back(run.column("contacts", "impact_speed")[k]);
      if (ends[k] > 0) fall.rebounds.push_back(run.column("contacts", "rebound_speed")[k]);
    }
  }
  if (steps > 0) fall.plateau = sum / steps;
  return fall;
}

namespace {

/// Resolved finite elements (Glowinski 2001), digitised: time [s], speed downwards [m/s].
const std::vector<double> known_times{
    .0115, .0220, .0429, .0639, .0977, .1223, .1574, .1761, .2347, .2570, .3109, .3555, .4212,
    .5232, .5901, .6546, .6863, .7016, .7169, .7275, .7370, .7429, .7477, .7513, .7550};
const std::vector<double> known_speeds{
    .0102, .0168, .0259, .0339, .0424, .0465, .0499, .0514, .0535, .0541, .0549, .0554, .0552,
    .0558, .0557, .0554, .0546, .0533, .0513, .0474, .0434, .0395, .0351, .0289, .0206};
constexpr double known_plateau = 0.0557, known_contact = 0.75;

std::vector<ValidationRow> disc() {
  const DiscFall fall = fall_of_disc(disc_scene(), 1.5);
  const char* closure = "drag DallaValle on a disc's frontal area, porosity without own volume, "
                        "hc = d = 2.5 dx, two-way";
  std::vector<ValidationRow> rows;
  rows.push_back(relative_row("first contact with the floor", "s", known_contact,
                              fall.contact_time, 0.05, closure));
  rows.push_back(
      relative_row("plateau, mean over 0.3 to 0.5 s", "m/s", known_plateau, fall.plateau, 0.05));
  struct Phase {
    const char* name;
    double from, to;
  };
  for (const Phase& phase : {Phase{"acceleration, to 0.25 s", 0, 0.25},
                             Phase{"plateau, to 0.65 s", 0.25, 0.65},
                             Phase{"approach, to contact", 0.65, known_contact}}) {
    double squares = 0;
    int count = 0;
    for (std::size_t k = 0; k < known_times.size(); ++k) {
      // Once ours has touched the floor there is nothing left to compare with.
      const double t = known_times[k];
      if (t < phase.from || t >= std::min(phase.to, fall.contact_time)) continue;
      const double off = interpolated(fall.times, fall.speeds, t) - known_speeds[k];
      squares += off * off;
      ++count;
    }
    rows.push_back(scaled_row(fmt::format("rms off the curve: {}", phase.name), "m/s", 0,
                              std::sqrt(squares / count), known_plateau, "the plateau", 0.15,
                              fmt::format("{} points", count)));
  }
  rows.push_back(absolute_row("contacts that ended, by 1.5 s", "",
                              static_cast<double>(fall.rebounds.size()),
                              static_cast<double>(fall.rebounds.size()), no_gate));
  if (!fall.rebounds.empty())
    rows.push_back(relative_row("first rebound over impact", "", restitution_of(0.2),
                                fall.rebounds[0] / fall.impacts[0], no_gate,
                                "reference: the dry contact; lubrication is not modelled"));
  return rows;
}

}  // namespace

void add_disc_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"disc", "T11", CaseKind::fast,
                   "a disc of 2.5 mm settles in a box of 2 x 6 cm and touches the floor",
                   "resolved finite elements, Glowinski 2001 (digitised), Wan and Turek 2006",
                   disc});
}

}  // namespace varve::tools
