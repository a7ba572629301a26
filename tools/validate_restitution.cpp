// The rebound of a disc from the floor against damping, speed and contact time, dry and in fluid.
#include <cmath>

#include <fmt/format.h>

#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

/// The benchmark's disc thrown at the floor from 0.005 d above it, without gravity when dry.
core::Scenario thrown(bool wet, double alpha, double speed, double contact_time) {
  core::Scenario s;
  s.domain.width = s.domain.height = 0.02;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.grains.lowest_y = 0.505 * s.grains.diameter;
  s.grains.velocity_y = -speed;
  s.contact.time = contact_time;
  s.contact.damping = alpha;
  s.fluid.present = wet;
  if (wet) s.fluid.sound_speed = 20 * speed;
  if (!wet) s.gravity.magnitude = 0;
  s.time.steps = 1;
  return s;
}

struct Rebound {
  double impact = 0, ratio = 0;
};

Rebound rebound_of(const core::Scenario& scene) {
  Experiment run(scene);
  Rebound result;
  while (run.time() < 1 && result.ratio == 0) {
    run.step();
    const std::vector<double> ends = run.column("contacts", "end");
    if (ends.empty()) continue;
    if (run.column("contacts", "begin")[0] > 0)
      result.impact = run.column("contacts", "impact_speed")[0];
    if (ends[0] > 0) result.ratio = run.column("contacts", "rebound_speed")[0] / result.impact;
  }
  return result;
}

const char* study_text(double alpha) {
  if (alpha == 0.15) return "the study: 0.78";
  return alpha == 0.2 ? "the study: 0.68 to 0.75" : "the study: 0.62";
}

std::vector<ValidationRow> rebound(bool wet) {
  std::vector<ValidationRow> rows;
  for (const double alpha : {0.15, 0.2, 0.25})
    for (const double speed : {0.1, 0.2, 0.3}) {
      const Rebound ours = rebound_of(thrown(wet, alpha, speed, 5e-4));
      rows.push_back(relative_row(
          fmt::format("alpha {:g}, thrown at {:g} m/s, tc0 0.5 ms", alpha, speed), "",
          restitution_of(alpha), ours.ratio, wet ? no_gate : 0.02,
          wet ? fmt::format("{}; hits the floor at {:.4f} m/s", study_text(alpha), ours.impact)
              : study_text(alpha)));
    }
  for (const double time : {1e-4, 1e-3, 2e-3}) {
    const Rebound ours = rebound_of(thrown(wet, 0.2, 0.2, time));
    const double milliseconds = 1e3 * time;
    rows.push_back(relative_row(fmt::format("alpha 0.2, thrown at 0.2 m/s, tc0 {:g} ms",
                                            milliseconds),
                                "", restitution_of(0.2), ours.ratio, wet ? no_gate : 0.02));
  }
  return rows;
}

std::vector<ValidationRow> dry() { return rebound(false); }
std::vector<ValidationRow> wet() { return rebound(true); }

}  // namespace

void add_restitution_cases(std::vector<ValidationCase>& cases) {
  const char* source =
      "theory of the dry contact (Schwager and Poeschel 2007), the study beside it";
  cases.push_back({"rebound_dry", "-", CaseKind::restitution,
                   "a disc hits the floor dry, 30 sub-steps to a contact", source, dry});
  cases.push_back({"rebound_wet", "-", CaseKind::restitution,
                   "a disc hits the floor in fluid, mu = 0.01 Pa s, two-way", source, wet});
}

}  // namespace varve::tools
