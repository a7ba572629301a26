#include "tools/analysis_json.h"

#include <nlohmann/json.hpp>

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

}  // namespace

nlohmann::ordered_json summary_json(const std::string& run, const AnalysisSummary& s) {
  Json out{{"schema", "varve.analyze/1"},
           {"run", run},
           {"steps", {{"first", std::to_string(s.first_step)},
                      {"last", std::to_string(s.last_step)},
                      {"stride", std::to_string(s.stride)},
                      {"states", std::to_string(s.states)}}},
           {"time_s", {{"first", s.first_time}, {"last", s.last_time}}},
           {"grains", s.grains}};
  Json settling;
  if (s.settling) {
    const core::Window& w = *s.settling;
    settling = {{"terminal_speed_m_s", w.mean},
                {"deviation_m_s", w.deviation},
                {"window_s", {w.from, w.to}},
                {"window_rule", s.window_rule},
                {"drift_m_s", w.drift},
                {"stationary", w.stationary},
                {"acceleration_time_s", json_of(s.acceleration_time)},
                {"peak_speed_m_s", s.peak_speed},
                {"peak_time_s", s.peak_time},
                {"turning_points", s.turns.size()}};
    settling["amplitude_m_s"] = s.oscillation ? Json(s.oscillation->amplitude) : Json();
    settling["period_s"] = s.oscillation ? Json(s.oscillation->period) : Json();
  }
  out["settling"] = std::move(settling);
  out["contacts"] = {{"first_s", json_of(s.first_contact)},
                     {"first_floor_s", json_of(s.first_floor_contact)},
                     {"between_grains", s.collisions},
                     {"with_walls", s.wall_collisions},
                     {"peak_force_N", s.peak_force},
                     {"peak_force_time_s", s.peak_force_time},
                     {"wall_hits", s.wall_hits},
                     {"restitution", s.wall_hits > 0 ? Json(s.restitution.mean) : Json()},
                     {"restitution_deviation", s.restitution.deviation},
                     {"normal_loss_J", s.normal_loss},
                     {"tangential_loss_J", s.tangential_loss},
                     {"friction_loss_J", s.friction_loss}};
  if (!(s.restitution.mean == s.restitution.mean)) out["contacts"]["restitution"] = Json();
  out["rest_time_s"] = json_of(s.rest_time);
  // Every name is there, with null where the run has nothing of the kind.
  Json scalars = Json::object();
  for (const ScalarInfo& info : scalar_infos()) scalars[info.name] = Json();
  for (const Scalar& each : s.scalars) scalars[each.name] = json_of(each.value);
  out["scalars"] = std::move(scalars);
  return out;
}

}  // namespace varve::tools
