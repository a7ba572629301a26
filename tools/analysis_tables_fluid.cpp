// Tables of the fluid: at points, on lines, around the grains.
#include <cmath>
#include <limits>

#include "tools/analysis_tables.h"

namespace varve::tools {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

void add_vorticity_columns(TableRow& row, const core::Scenario& s) {
  if (dimension_of(s) == 2)
    row.push_back("vorticity_1_s");
  else
    add_axes(row, s, "vorticity_", "_1_s");
}
void add_vorticity(TableRow& row, const core::Scenario& s, const core::FluidAtPoint& at) {
  if (dimension_of(s) == 2)
    row.push_back(cell(at.vorticity[2]));
  else
    add_values(row, at.vorticity.data(), 3);
}

Observable flow() {
  Observable o;
  o.name = "flow";
  o.summary = "velocity, vorticity and pressure of the fluid at points (--grid, --at-point)";
  o.formula = "sum_b V_b f_b W / S; curl of sum_b V_b (v_b - v) grad W / S; S = sum_b V_b W";
  o.source = "kernel interpolation with the run's kernel; pressure by the engine's force pass";
  o.needs = Needs::forces;
  o.points = true;
  o.columns = [](const core::Scenario& s) {
    TableRow row{"step", "time_s"};
    add_axes(row, s, "", "_m");
    add_axes(row, s, "v", "_m_s");
    add_vorticity_columns(row, s);
    row.insert(row.end(), {"pressure_Pa", "weight"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const std::size_t d = dimension_of(s);
    const std::vector<core::FluidAtPoint> values = core::sample_fluid(now.fluid, now.points);
    for (std::size_t p = 0; p < values.size(); ++p) {
      TableRow row = row_beginning(now);
      add_values(row, now.points.data() + p * d, d);
      add_values(row, values[p].velocity.data(), d);
      add_vorticity(row, s, values[p]);
      add_values(row, {values[p].pressure, values[p].weight});
      emit(std::move(row));
    }
  };
  return o;
}

void add_core(TableRow& row, const core::VortexCore& core) {
  if (!core.found) return add_values(row, {nothing, nothing, nothing, nothing});
  add_values(row, {core.x, core.y, core.swirl, core.circulation});
}

Observable vortices() {
  Observable o;
  o.name = "vortices";
  o.summary = "vortex cores, circulation, left-right symmetry, peak vorticity";
  o.formula =
      "on a lattice of the fluid's spacing over the x-y plane (3D: through the middle): peak: "
      "vorticity of largest size; circulation: integral of the vorticity over the left and right "
      "half of the width; symmetry: sum u . mirrored u / sum u^2 (1: mirror images); core: where "
      "|Gamma_1| is largest among cells turning one way, at least 0.6 (nan below), Gamma_1: mean "
      "of sin(angle from r to u) within two grain diameters, at most an eighth of the width; its "
      "circulation: integral of the vorticity there. ccw: counter-clockwise";
  o.source = "kernel interpolation; Graftieaux, Michard and Grosjean 2001";
  o.needs = Needs::fluid;
  o.lattice = true;
  o.columns = [](const core::Scenario&) {
    TableRow row{"step", "time_s", "peak_vorticity_1_s", "peak_x_m", "peak_y_m",
                 "circulation_left_m2_s", "circulation_right_m2_s", "symmetry", "max_speed_m_s"};
    for (const char* turn : {"ccw", "cw"})
      for (const char* what : {"_x_m", "_y_m", "_swirl", "_circulation_m2_s"})
        row.push_back(std::string(turn) + what);
    return row;
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    const core::FlowFeatures& f = now.features;
    TableRow row = row_beginning(now);
    add_values(row, {f.peak_vorticity, f.peak_x, f.peak_y, f.circulation_left,
                     f.circulation_right, f.symmetry, f.max_speed});
    add_core(row, f.positive);
    add_core(row, f.negative);
    emit(std::move(row));
  };
  return o;
}

Observable profile() {
  Observable o;
  o.name = "profile";
  o.summary = "velocity and vorticity of the fluid along lines through the cluster's centroid";
  o.formula =
      "as in table flow, at the lattice cells of table vortices; line across: all x at the "
      "centroid's height; line along: all y at the centroid's x (without grains: the middle)";
  o.source = "kernel interpolation with the run's kernel";
  o.needs = Needs::fluid;
  o.lattice = true;
  o.columns = [](const core::Scenario& s) {
    TableRow row{"step", "time_s", "line", "x_m", "y_m"};
    add_axes(row, s, "v", "_m_s");
    add_vorticity_columns(row, s);
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const core::FlowLattice& f = now.lattice;
    if (f.columns == 0) return;
    const bool grains = now.grains.size() > 0;
    const double x = grains ? now.group.centroid[0] : f.left + 0.5 * now.walls.width;
    const double y = grains ? now.group.centroid[1] : 0.5 * now.walls.height;
    const auto place = [&](double at, std::size_t count) {
      const double cell_at = std::floor(at / f.spacing);
      return cell_at <= 0 ? 0
                          : std::min(static_cast<std::size_t>(cell_at), count - 1);
    };
    const std::size_t column = place(x - f.left, f.columns), level = place(y, f.rows);
    const auto put = [&](const char* line, std::size_t i, std::size_t j) {
      TableRow row = row_beginning(now);
      row.push_back(line);
      add_values(row, {f.x(i), f.y(j)});
      add_values(row, f.cell(i, j).velocity.data(), dimension_of(s));
      add_vorticity(row, s, f.cell(i, j));
      emit(std::move(row));
    };
    for (std::size_t i = 0; i < f.columns; ++i) put("across", i, level);
    for (std::size_t j = 0; j < f.rows; ++j) put("along", column, j);
  };
  return o;
}

Observable flux() {
  Observable o;
  o.name = "flux";
  o.summary = "fluid that passes the cluster, through it and beside it";
  o.formula =
      "integral of eps (u_y - mean v_y of the grains) over x at the centroid's height: through, "
      "between the outermost surfaces of the grains; beside, over the rest of the width; share: "
      "through / (through + beside). Per metre of depth";
  o.source = "kernel interpolation with m / rho0 as volumes";
  o.needs = Needs::fluid;
  o.lattice = true;
  o.columns = [](const core::Scenario&) {
    return TableRow{"step", "time_s", "through_m2_s", "beside_m2_s", "through_share"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    if (now.grains.size() == 0) return;
    TableRow row = row_beginning(now);
    add_values(row, {now.through.through, now.through.beside, now.through.share});
    emit(std::move(row));
  };
  return o;
}

Observable beneath() {
  Observable o;
  o.name = "beneath";
  o.summary = "pressure and upflow under the grains, and above them";
  o.formula =
      "kernel means one grain diameter below the lowest centre and above the highest one, at the "
      "centroid's x; pressure as in the momentum equation (excess or full); weight: S, 0 outside "
      "the fluid";
  o.source = "kernel interpolation; pressure by the engine's force pass";
  o.needs = Needs::forces;
  o.lattice = true;
  o.columns = [](const core::Scenario&) {
    TableRow row{"step", "time_s"};
    for (const char* place : {"beneath", "above"})
      for (const char* what : {"_pressure_Pa", "_vy_m_s", "_weight"})
        row.push_back(std::string(place) + what);
    row.push_back("pressure_difference_Pa");
    return row;
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    if (!now.beneath || !now.above) return;
    TableRow row = row_beginning(now);
    for (const auto* at : {&*now.beneath, &*now.above})
      add_values(row, {at->pressure, at->velocity[1], at->weight});
    row.push_back(cell(now.beneath->pressure - now.above->pressure));
    emit(std::move(row));
  };
  return o;
}

}  // namespace

std::vector<Observable> fluid_tables() {
  return {flow(), vortices(), profile(), flux(), beneath()};
}

}  // namespace varve::tools
