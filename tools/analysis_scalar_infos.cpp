// What the numbers of a run are. The window is that of the terminal speed.
#include "tools/analysis.h"

namespace varve::tools {

namespace {

constexpr struct {
  const char *name, *formula, *unit;
} infos[] = {
    {"terminal_speed_m_s", "mean settling speed in the window", "m/s"},
    {"terminal_deviation_m_s", "standard deviation of the settling speed in the window", "m/s"},
    {"terminal_drift_m_s", "change of a straight line through the window", "m/s"},
    {"terminal_stationary", "1 if the drift is at most 5 % of the mean, else 0", ""},
    {"acceleration_time_s", "first time at 95 % of the terminal speed", "s"},
    {"peak_speed_m_s", "largest settling speed", "m/s"},
    {"peak_time_s", "when", "s"},
    {"turning_points", "of the settling speed in the window, by more than 1 % of it", ""},
    {"oscillation_amplitude_m_s", "half the mean difference of successive turns", "m/s"},
    {"oscillation_period_s", "twice their mean distance in time", "s"},
    {"rest_time_s", "from when on no grain is faster than 1 mm/s", "s"},
    {"settled_distance_m", "way down of the centroid from the first state to the window's end",
     "m"},
    {"centroid_drift_x_m", "way along x of the centroid, likewise", "m"},
    {"first_contact_s", "first contact of any kind", "s"},
    {"first_floor_contact_s", "first contact with the floor", "s"},
    {"floor_rebounds", "grains that hit the floor and left it again", ""},
    {"restitution", "mean rebound over impact speed of all hits of walls above 1 mm/s", ""},
    {"collisions", "contacts between grains that began", ""},
    {"wall_collisions", "contacts with walls that began", ""},
    {"collision_rate_1_s", "collisions over the time analyzed", "1/s"},
    {"falling_collision_rate_1_s", "the same before the first contact with the floor", "1/s"},
    {"contact_force_mean_N", "mean over contacts and steps of the largest normal force", "N"},
    {"contact_force_lower_N", "lower quartile of the same, within 0.6 %", "N"},
    {"contact_force_median_N", "median, likewise", "N"},
    {"contact_force_upper_N", "upper quartile, likewise", "N"},
    {"contact_force_peak_N", "largest", "N"},
    {"contact_pressure_Pa", "mean over grains and window of (1 / (D V)) sum R F_n", "Pa"},
    {"contact_pressure_max_Pa", "largest of any grain", "Pa"},
    {"coordination", "mean number of contacts per grain in the window, walls included", ""},
    {"chain_share", "part of the grains in force chains, mean over the window", ""},
    {"longest_chain_grains", "grains of the largest force chain", ""},
    {"first_detachment_s", "first time a grain left the main cluster (table detachment)", "s"},
    {"detached_grains", "grains apart from it at the window's end", ""},
    {"compactness_first", "grains' shadow along y over the cross-section, first state", ""},
    {"compactness", "the same, mean over the window", ""},
    {"porosity_box_first", "porosity of the least box around the grains, first state", ""},
    {"porosity_box", "the same, mean over the window", ""},
    {"porosity_middle_first", "porosity of the middle half of that box, first state", ""},
    {"porosity_middle", "the same, mean over the window", ""},
    {"row_spread_y_m", "standard deviation of y within a row, mean over rows and window", "m"},
    {"protrusion_m", "middle columns ahead of the outer ones along gravity, window", "m"},
    {"centre_minus_edge_speed_m_s", "settling speed of middle less outer columns, window", "m/s"},
    {"bottom_minus_top_row_speed_m_s", "settling speed of the lowest less the highest row", "m/s"},
    {"wall_distance_slope_1_s", "settling speed against distance to the nearest side wall: "
     "straight line through all grains at all states of the window", "1/s"},
    {"wall_distance_slope_half_width_1_s", "of its 95 % interval, grains taken as independent",
     "1/s"},
    {"wall_distance_intercept_m_s", "of the same line", "m/s"},
    {"wall_distance_intercept_half_width_m_s", "of its 95 % interval", "m/s"},
    {"wall_distance_correlation", "Pearson's, of the same", ""},
    {"compactness_slope_m_s", "settling speed against compactness over the window", "m/s"},
    {"compactness_slope_half_width_m_s", "of its 95 % interval, states taken as independent",
     "m/s"},
    {"compactness_correlation", "Pearson's, of the same", ""},
    {"reynolds", "rho0 eps |u - v| d / mu, mean over grains and window *", ""},
    {"reynolds_max", "largest of any grain *", ""},
    {"drag_coefficient", "|drag| / (1/2 rho0 (eps |u - v|)^2 A), likewise *", ""},
    {"shielding", "|drag| over a lone grain's at the same slip, likewise *", ""},
    {"peak_vorticity_1_s", "largest |vorticity| of the lattice, mean over the window *", "1/s"},
    {"vortex_core_distance_m", "from the centroid to the nearer vortex core, likewise *", "m"},
    {"circulation_left_m2_s", "of the left half of the width, likewise *", "m2/s"},
    {"circulation_right_m2_s", "of the right half, likewise *", "m2/s"},
    {"symmetry", "sum u . mirrored u / sum u^2, likewise *", ""},
    {"flux_through_share", "of the fluid that passes the cluster, through it, likewise *", ""},
    {"beneath_vy_m_s", "of the fluid a diameter below the lowest grain, likewise *", "m/s"},
    {"beneath_pressure_Pa", "there, likewise *", "Pa"},
    {"fluid_speed_max_m_s", "largest kernel mean on the lattice *", "m/s"},
    {"grain_speed_max_m_s", "largest of any grain", "m/s"},
    {"sound_speed_over_max_speed", "c0 over the largest speed of grains and fluid *", ""},
    {"states_evaluated", "states decoded whole, which * rests on", ""},
    {"porosity_clamps_per_state", "fluid particles whose porosity is floored, mean *", ""},
    {"drag_porosity_clamps_per_state", "grains that feel a floored porosity, mean *", ""},
    {"weak_coupling_per_state", "grains with a Shepard sum below 0.5, mean *", ""},
    {"momentum_residual_max", "momentum a step makes from nothing, over the sum of forces *", ""},
    {"energy_released_J", "potential energy released up to the last state evaluated *", "J"},
    {"energy_residual_share", "residual of the energy budget over it *; table energy_budget", ""},
    {"wall_loss_share", "shear at walls and contacts with them, of all losses *", ""},
    {"viscous_loss_share", "shear in the fluid, of all losses *", ""},
    {"drag_loss_share", "drag, likewise *", ""},
    {"diffusion_loss_share", "density diffusion, likewise *", ""},
    {"contact_loss_share", "contacts, likewise *", ""},
};

}  // namespace

const std::vector<ScalarInfo>& scalar_infos() {
  static const std::vector<ScalarInfo> all = [] {
    std::vector<ScalarInfo> list;
    for (const auto& info : infos) list.push_back({info.name, info.formula, info.unit});
    return list;
  }();
  return all;
}

}  // namespace varve::tools
