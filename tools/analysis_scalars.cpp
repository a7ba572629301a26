#include "tools/analysis_scalars.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/observe/drag_numbers.h"
#include "core/observe/shape.h"
#include "core/walls.h"

namespace varve::tools {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// Curves of every state, and sums for the fit of speed against wall distance.
enum GrainCurve : std::size_t {
  spread_y, protrusion, edge_speed, centroid_x, centroid_y, shadow, porosity_box, porosity_middle,
  coordination, chain_share, contact_pressure, lowest_row_ahead, apart, settling_speed,
  fit_n, fit_x, fit_y, fit_xx, fit_xy, fit_yy, grain_curves
};
/// Curves of states decoded whole.
enum FluidCurve : std::size_t {
  reynolds, drag_coefficient, shielding, peak_vorticity, core_distance, circulation_left,
  circulation_right, symmetry, through, beneath_speed, beneath_pressure, fluid_speed, fluid_curves
};

}  // namespace

// ---- curves ------------------------------------------------------------------------------------

void CurveSet::take(double time, const std::vector<double>& values) {
  if (time_.size() == samples_max_) halve();
  if (count_++ % every_ != 0) return;
  time_.push_back(time);
  for (std::size_t k = 0; k < curves_.size(); ++k) curves_[k].push_back(values[k]);
}

void CurveSet::halve() {
  const auto thin = [](std::vector<double>& curve) {
    for (std::size_t k = 0; 2 * k < curve.size(); ++k) curve[k] = curve[2 * k];
    curve.resize((curve.size() + 1) / 2);
  };
  thin(time_);
  for (std::vector<double>& curve : curves_) thin(curve);
  every_ *= 2;
}

std::vector<double> CurveSet::between(std::size_t index, double from, double to) const {
  std::vector<double> values;
  for (std::size_t k = 0; k < time_.size(); ++k)
    if (time_[k] >= from && time_[k] <= to && std::isfinite(curves_[index][k]))
      values.push_back(curves_[index][k]);
  return values;
}

std::optional<double> CurveSet::mean(std::size_t index, double from, double to) const {
  const std::vector<double> values = between(index, from, to);
  if (values.empty()) return std::nullopt;
  return core::spread_of(values).mean;
}

std::optional<double> CurveSet::greatest(std::size_t index, double from, double to) const {
  const std::vector<double> values = between(index, from, to);
  if (values.empty()) return std::nullopt;
  return *std::max_element(values.begin(), values.end());
}

std::optional<double> CurveSet::first(std::size_t index) const {
  if (time_.empty() || !std::isfinite(curves_[index].front())) return std::nullopt;
  return curves_[index].front();
}

std::optional<double> CurveSet::last(std::size_t index, double to) const {
  std::optional<double> value;
  for (std::size_t k = 0; k < time_.size() && time_[k] <= to; ++k)
    if (std::isfinite(curves_[index][k])) value = curves_[index][k];
  return value;
}

// ---- collecting --------------------------------------------------------------------------------

ScalarCollector::ScalarCollector(const core::Scenario& scenario)
    : scenario_(scenario),
      grains_(grain_curves, std::size_t{1} << 14),
      fluid_(fluid_curves, std::size_t{1} << 14) {}

void ScalarCollector::take_step(const ObservedStep& now) {
  if (!first_time_) first_time_ = now.time;
  last_time_ = now.time;
  for (const core::ContactRow& row : now.contacts) {
    forces_.add(row.peak_force);
    force_sum_ += row.peak_force;
    ++force_count_;
    if (row.kind == 1 && row.partner == core::wall_bottom && !landed_) {
      landed_ = true;
      landing_time_ = now.time;
    }
    if (!row.begin) continue;
    ++(row.kind == 0 ? collisions_ : wall_collisions_);
    if (row.kind == 0 && !landed_) ++falling_collisions_;
  }
  for (const core::WallHit& hit : now.hits) floor_hits_ += hit.wall == core::wall_bottom ? 1 : 0;
}

void ScalarCollector::take_grains(const ObservedStep& now) {
  const core::GrainView& g = now.grains;
  grain_count_ = std::max(grain_count_, g.size());
  speed_max_ = std::max(speed_max_, now.group.max_speed);
  chain_max_ = std::max(chain_max_, now.chains.longest);
  for (const core::GrainStress& each : now.stresses)
    contact_pressure_max_ = std::max(contact_pressure_max_, each.pressure);
  for (const core::Departure& each : now.departures)
    if (each.left && !first_detachment_) first_detachment_ = now.time;
  if (g.size() == 0) return;
  if (!grains_.due()) return grains_.skip();
  grains_.take(now.time, speeds_against(now));
}

/// One sample of the curves of grains.
std::vector<double> ScalarCollector::speeds_against(const ObservedStep& now) const {
  const core::GrainView& g = now.grains;
  std::vector<double> row(grain_curves, nothing);
  const double count = static_cast<double>(g.size());
  const core::RowShape shape = core::cluster_shape(scenario_, g, now.down);
  const std::vector<core::RowShape> rows = core::row_shapes(scenario_, g, now.down);
  double spread = 0;
  for (const core::RowShape& each : rows) spread += each.spread_y;
  if (!rows.empty()) row[spread_y] = spread / static_cast<double>(rows.size());
  row[protrusion] = shape.protrusion;
  row[edge_speed] = shape.centre_minus_edge_speed;
  if (rows.size() > 1)
    row[lowest_row_ahead] = rows.front().settling_speed - rows.back().settling_speed;
  row[centroid_x] = now.group.centroid[0];
  row[centroid_y] = now.group.centroid[1];
  row[settling_speed] = now.group.settling_speed;
  row[shadow] = core::compactness(g, now.walls);
  const core::ClusterPorosity porosity = core::cluster_porosity(g);
  row[porosity_box] = porosity.box;
  row[porosity_middle] = porosity.middle;
  double contacts = 0, pressure = 0;
  for (const core::GrainStress& each : now.stresses) {
    contacts += each.contacts;
    pressure += each.pressure;
  }
  row[coordination] = contacts / count;
  row[contact_pressure] = pressure / count;
  row[chain_share] = static_cast<double>(now.chains.grains) / count;
  row[apart] = static_cast<double>(now.apart);
  core::FitSums sums;
  const std::vector<double> distances = core::wall_distances(g, now.walls);
  for (std::size_t i = 0; i < g.size(); ++i) {
    double speed = 0;
    for (std::size_t k = 0; k < g.dimension; ++k)
      speed += g.velocity[i * g.dimension + k] * now.down[k];
    if (std::isfinite(distances[i])) sums.add(distances[i], speed);
  }
  row[fit_n] = sums.n;
  row[fit_x] = sums.x;
  row[fit_y] = sums.y;
  row[fit_xx] = sums.xx;
  row[fit_xy] = sums.xy;
  row[fit_yy] = sums.yy;
  return row;
}

/// Means over the grains of what drag comes to, and the largest Reynolds number.
void ScalarCollector::take_drag(const ObservedStep& now, std::vector<double>& row) {
  const std::size_t d = now.grains.dimension;
  double re = 0, cd = 0, shield = 0, moving = 0;
  for (std::size_t i = 0; i < now.forces.size(); ++i) {
    const core::GrainReport& f = now.forces[i];
    double slip2 = 0, drag2 = 0;
    for (std::size_t k = 0; k < d; ++k) {
      const double slip = f.fluid_velocity[k] - now.grains.velocity[i * d + k];
      slip2 += slip * slip;
      drag2 += f.drag[k] * f.drag[k];
    }
    const core::DragNumbers n = core::drag_numbers(
        scenario_, 2 * now.grains.radius[i], std::sqrt(slip2), f.porosity, std::sqrt(drag2));
    re_max_ = std::max(re_max_, n.reynolds);
    if (!(n.reynolds > 0)) continue;
    ++moving;
    re += n.reynolds;
    cd += n.coefficient;
    shield += n.shielding;
  }
  if (!(moving > 0)) return;
  row[reynolds] = re / moving;
  row[drag_coefficient] = cd / moving;
  row[shielding] = shield / moving;
}

void ScalarCollector::take_fluid(const ObservedStep& now, bool forces,
                                 const core::Counters& clamps) {
  std::vector<double> row(fluid_curves, nothing);
  if (forces) {
    take_drag(now, row);
    momentum_max_ = std::max(momentum_max_, now.budget.momentum_residual);
    budget_ = now.budget;
    ++evaluated_;
    clamps_.porosity_clamps += clamps.porosity_clamps;
    clamps_.drag_porosity_clamps += clamps.drag_porosity_clamps;
    clamps_.weak_coupling += clamps.weak_coupling;
  }
  if (now.lattice.columns > 0) {
    const core::FlowFeatures& f = now.features;
    row[peak_vorticity] = std::abs(f.peak_vorticity);
    row[circulation_left] = f.circulation_left;
    row[circulation_right] = f.circulation_right;
    row[symmetry] = f.symmetry;
    row[fluid_speed] = f.max_speed;
    double nearest = std::numeric_limits<double>::infinity();
    for (const core::VortexCore* core : {&f.positive, &f.negative})
      if (core->found && now.grains.size() > 0)
        nearest = std::min(nearest, std::hypot(core->x - now.group.centroid[0],
                                               core->y - now.group.centroid[1]));
    if (std::isfinite(nearest)) row[core_distance] = nearest;
  }
  if (now.beneath) {
    row[beneath_speed] = now.beneath->velocity[1];
    if (!now.fluid.pressure.empty()) row[beneath_pressure] = now.beneath->pressure;
    row[through] = now.through.share;
  }
  fluid_.take(now.time, row);
}

// ---- results -----------------------------------------------------------------------------------

class ScalarCollector::Results {
 public:
  Results() {
    for (const ScalarInfo& info : scalar_infos()) scalars_.push_back({info.name, std::nullopt});
  }
  void set(const char* name, std::optional<double> value) {
    for (Scalar& each : scalars_)
      if (each.name == name) {
        if (value && std::isfinite(*value)) each.value = value;
        return;
      }
    throw std::logic_error(std::string("scalar '") + name + "' is not declared");
  }
  std::vector<Scalar> take() { return std::move(scalars_); }

 private:
  std::vector<Scalar> scalars_;
};

namespace {

std::optional<double> whole(std::uint64_t value) { return static_cast<double>(value); }

}  // namespace

void ScalarCollector::finish_contacts(Results& results, const AnalysisSummary& s) const {
  const double span = first_time_ ? last_time_ - *first_time_ : 0;
  const double falling = landed_ ? landing_time_ - *first_time_ : span;
  results.set("collisions", whole(collisions_));
  results.set("wall_collisions", whole(wall_collisions_));
  results.set("floor_rebounds", whole(floor_hits_));
  if (span > 0) results.set("collision_rate_1_s", static_cast<double>(collisions_) / span);
  if (falling > 0)
    results.set("falling_collision_rate_1_s",
                static_cast<double>(falling_collisions_) / falling);
  if (force_count_ > 0) {
    results.set("contact_force_mean_N", force_sum_ / static_cast<double>(force_count_));
    results.set("contact_force_lower_N", forces_.at(0.25));
    results.set("contact_force_median_N", forces_.at(0.5));
    results.set("contact_force_upper_N", forces_.at(0.75));
    results.set("contact_force_peak_N", s.peak_force);
  }
  results.set("contact_pressure_max_Pa", contact_pressure_max_);
  results.set("longest_chain_grains", whole(chain_max_));
  results.set("first_detachment_s", first_detachment_);
}

void ScalarCollector::finish_grains(Results& results, const AnalysisSummary& s, double from,
                                    double to) const {
  if (s.settling) {
    results.set("terminal_speed_m_s", s.settling->mean);
    results.set("terminal_deviation_m_s", s.settling->deviation);
    results.set("terminal_drift_m_s", s.settling->drift);
    results.set("terminal_stationary", s.settling->stationary ? 1 : 0);
    results.set("peak_speed_m_s", s.peak_speed);
    results.set("peak_time_s", s.peak_time);
    results.set("turning_points", whole(s.turns.size()));
  }
  results.set("acceleration_time_s", s.acceleration_time);
  if (s.oscillation) {
    results.set("oscillation_amplitude_m_s", s.oscillation->amplitude);
    results.set("oscillation_period_s", s.oscillation->period);
  }
  results.set("rest_time_s", s.rest_time);
  results.set("first_contact_s", s.first_contact);
  results.set("first_floor_contact_s", s.first_floor_contact);
  if (s.wall_hits > 0) results.set("restitution", s.restitution.mean);
  results.set("compactness_first", grains_.first(shadow));
  results.set("compactness", grains_.mean(shadow, from, to));
  results.set("porosity_box_first", grains_.first(porosity_box));
  results.set("porosity_box", grains_.mean(porosity_box, from, to));
  results.set("porosity_middle_first", grains_.first(porosity_middle));
  results.set("porosity_middle", grains_.mean(porosity_middle, from, to));
  results.set("row_spread_y_m", grains_.mean(spread_y, from, to));
  results.set("protrusion_m", grains_.mean(protrusion, from, to));
  results.set("centre_minus_edge_speed_m_s", grains_.mean(edge_speed, from, to));
  results.set("bottom_minus_top_row_speed_m_s", grains_.mean(lowest_row_ahead, from, to));
  results.set("coordination", grains_.mean(coordination, from, to));
  results.set("chain_share", grains_.mean(chain_share, from, to));
  results.set("contact_pressure_Pa", grains_.mean(contact_pressure, from, to));
  results.set("detached_grains", grains_.last(apart, to));
  const auto first_x = grains_.first(centroid_x), first_y = grains_.first(centroid_y);
  if (const auto last = grains_.last(centroid_x, to); last && first_x)
    results.set("centroid_drift_x_m", *last - *first_x);
  if (const auto last = grains_.last(centroid_y, to); last && first_y)
    results.set("settled_distance_m", *first_y - *last);
}

void ScalarCollector::finish_fits(Results& results, double from, double to) const {
  core::FitSums sums, against_shadow;
  if (const auto origin = grains_.first(shadow)) against_shadow.origin_x = *origin;
  for (std::size_t k = 0; k < grains_.time().size(); ++k) {
    if (grains_.time()[k] < from || grains_.time()[k] > to) continue;
    const auto at = [&](std::size_t curve) { return grains_.curve(curve)[k]; };
    core::FitSums one;
    one.n = at(fit_n);
    one.x = at(fit_x);
    one.y = at(fit_y);
    one.xx = at(fit_xx);
    one.xy = at(fit_xy);
    one.yy = at(fit_yy);
    sums.add(one);
    against_shadow.add(at(shadow), at(settling_speed));
  }
  // States that follow on each other say the same again: grains are what is independent.
  if (const auto fit = sums.fit(static_cast<double>(grain_count_))) {
    results.set("wall_distance_slope_1_s", fit->slope);
    results.set("wall_distance_intercept_m_s", fit->intercept);
    results.set("wall_distance_correlation", fit->correlation);
    if (grain_count_ > 2) {
      results.set("wall_distance_slope_half_width_1_s", fit->slope_half_width);
      results.set("wall_distance_intercept_half_width_m_s", fit->intercept_half_width);
    }
  }
  if (const auto fit = against_shadow.fit(against_shadow.n)) {
    results.set("compactness_slope_m_s", fit->slope);
    results.set("compactness_slope_half_width_m_s", fit->slope_half_width);
    results.set("compactness_correlation", fit->correlation);
  }
}

void ScalarCollector::finish_fluid(Results& results, double from, double to) const {
  const double all = std::numeric_limits<double>::infinity();
  results.set("reynolds", fluid_.mean(reynolds, from, to));
  results.set("drag_coefficient", fluid_.mean(drag_coefficient, from, to));
  results.set("shielding", fluid_.mean(shielding, from, to));
  results.set("peak_vorticity_1_s", fluid_.mean(peak_vorticity, from, to));
  results.set("vortex_core_distance_m", fluid_.mean(core_distance, from, to));
  results.set("circulation_left_m2_s", fluid_.mean(circulation_left, from, to));
  results.set("circulation_right_m2_s", fluid_.mean(circulation_right, from, to));
  results.set("symmetry", fluid_.mean(symmetry, from, to));
  results.set("flux_through_share", fluid_.mean(through, from, to));
  results.set("beneath_vy_m_s", fluid_.mean(beneath_speed, from, to));
  results.set("beneath_pressure_Pa", fluid_.mean(beneath_pressure, from, to));
  const auto fluid_max = fluid_.greatest(fluid_speed, -all, all);
  results.set("fluid_speed_max_m_s", fluid_max);
  results.set("grain_speed_max_m_s", speed_max_);
  const double fastest = std::max(speed_max_, fluid_max.value_or(0));
  if (scenario_.has_fluid() && fastest > 0)
    results.set("sound_speed_over_max_speed", scenario_.fluid.sound_speed / fastest);
  results.set("states_evaluated", whole(evaluated_));
  if (evaluated_ == 0) return;
  const double states = static_cast<double>(evaluated_);
  if (scenario_.is_coupled()) {
    results.set("reynolds_max", re_max_);
    results.set("porosity_clamps_per_state", static_cast<double>(clamps_.porosity_clamps) / states);
    results.set("drag_porosity_clamps_per_state",
                static_cast<double>(clamps_.drag_porosity_clamps) / states);
    results.set("weak_coupling_per_state", static_cast<double>(clamps_.weak_coupling) / states);
  }
  results.set("momentum_residual_max", momentum_max_);
  if (evaluated_ < 2) return;
  const double lost = budget_.losses();
  results.set("energy_released_J", budget_.released);
  results.set("energy_residual_share", budget_.residual_share());
  results.set("wall_loss_share", budget_.wall_share());
  if (!(lost > 0)) return;
  results.set("viscous_loss_share", (budget_.viscous + budget_.shear) / lost);
  results.set("drag_loss_share", budget_.drag / lost);
  results.set("diffusion_loss_share", budget_.diffusion / lost);
  results.set("contact_loss_share",
              (budget_.normal + budget_.tangential + budget_.friction) / lost);
}

std::vector<Scalar> ScalarCollector::finish(const AnalysisSummary& summary, double from,
                                            double to) const {
  Results results;
  finish_contacts(results, summary);
  if (grain_count_ > 0) {
    finish_grains(results, summary, from, to);
    finish_fits(results, from, to);
  }
  finish_fluid(results, from, to);
  return results.take();
}

}  // namespace varve::tools
