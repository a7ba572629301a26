// Tables of the grains: where they are, how they move, what shape they take.
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "core/observe/shape.h"
#include "tools/analysis_tables.h"

namespace varve::tools {
namespace {

double along_gravity(const ObservedStep& now, std::size_t i) {
  double speed = 0;
  for (std::size_t k = 0; k < now.grains.dimension; ++k)
    speed += now.grains.velocity[i * now.grains.dimension + k] * now.down[k];
  return speed;
}

Observable settling() {
  Observable o;
  o.name = "settling";
  o.summary = "motion of all grains together";
  o.formula =
      "mean over grains of v, |v|, x; settling speed: mean v along gravity; spread: standard "
      "deviation of x";
  o.source = "definition";
  o.columns = [](const core::Scenario& s) {
    TableRow row{"step", "time_s", "settling_speed_m_s", "mean_speed_m_s", "max_speed_m_s"};
    add_axes(row, s, "mean_v", "_m_s");
    add_axes(row, s, "centroid_", "_m");
    add_axes(row, s, "spread_", "_m");
    row.insert(row.end(), {"lowest_y_m", "highest_y_m"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const core::GroupMotion& group = now.group;
    TableRow row = row_beginning(now);
    add_values(row, {group.settling_speed, group.mean_speed, group.max_speed});
    add_values(row, group.mean_velocity.data(), dimension_of(s));
    add_values(row, group.centroid.data(), dimension_of(s));
    add_values(row, group.spread.data(), dimension_of(s));
    add_values(row, {group.lowest, group.highest});
    emit(std::move(row));
  };
  return o;
}

Observable trajectories() {
  Observable o;
  o.name = "trajectories";
  o.summary = "every grain at every step";
  o.formula = "positions, velocities and spin as recorded; row and column of the first array";
  o.source = "the log's state";
  o.columns = [](const core::Scenario& s) {
    TableRow row = grain_columns();
    if (dimension_of(s) == 3) row.push_back("layer");
    add_axes(row, s, "", "_m");
    add_axes(row, s, "v", "_m_s");
    if (!s.contact.rotation) return row;
    if (dimension_of(s) == 2)
      row.push_back("spin_rad_s");
    else
      add_axes(row, s, "spin_", "_rad_s");
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const std::size_t d = dimension_of(s), spins = d == 2 ? 1 : 3;
    for (std::size_t i = 0; i < now.grains.size(); ++i) {
      TableRow row = row_beginning(now);
      add_grain(row, s, now.grains.id[i]);
      if (d == 3) row.push_back(cell(core::label_of(s, now.grains.id[i]).layer));
      add_values(row, now.grains.position.data() + i * d, d);
      add_values(row, now.grains.velocity.data() + i * d, d);
      if (!now.grains.spin.empty()) add_values(row, now.grains.spin.data() + i * spins, spins);
      emit(std::move(row));
    }
  };
  return o;
}

/// Mean settling speed of the grains that share a label.
Observable by_label(const char* name, const char* what, bool rows) {
  Observable o;
  o.name = name;
  o.summary = fmt::format("settling speed by {} of the first array", what);
  o.formula = fmt::format("mean of v along gravity over the grains that started in one {}", what);
  o.source = "definition";
  o.columns = [what](const core::Scenario&) {
    return TableRow{"step", "time_s", what, "grains", "settling_speed_m_s", "mean_y_m"};
  };
  o.rows = [rows](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    struct Sum {
      std::uint64_t count = 0;
      double speed = 0, y = 0;
    };
    std::map<std::int64_t, Sum> sums;
    for (std::size_t i = 0; i < now.grains.size(); ++i) {
      const core::GrainLabel label = core::label_of(s, now.grains.id[i]);
      Sum& sum = sums[rows ? label.row : label.column];
      ++sum.count;
      sum.speed += along_gravity(now, i);
      sum.y += now.grains.position[i * dimension_of(s) + 1];
    }
    for (const auto& [label, sum] : sums) {
      const double count = static_cast<double>(sum.count);
      TableRow row = row_beginning(now);
      row.push_back(cell(label));
      row.push_back(cell(sum.count));
      add_values(row, {sum.speed / count, sum.y / count});
      emit(std::move(row));
    }
  };
  return o;
}

Observable gaps() {
  Observable o;
  o.name = "gaps";
  o.summary = "free space to the nearest neighbour";
  o.formula = "|x_i - x_j| - R_i - R_j, least over j; its mean, least and quartiles over i";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    return TableRow{"step",        "time_s",       "mean_gap_m", "least_gap_m",
                    "lower_gap_m", "median_gap_m", "upper_gap_m"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    const std::vector<double> all = core::nearest_gaps(now.grains, now.period);
    if (all.size() < 2) return;
    const core::Quartiles q = core::quartiles_of(all);
    TableRow row = row_beginning(now);
    add_values(row, {core::spread_of(all).mean, q.least, q.lower, q.median, q.upper});
    emit(std::move(row));
  };
  return o;
}

Observable porosity() {
  Observable o;
  o.name = "porosity";
  o.summary = "porosity of the cluster, and its compactness";
  o.formula =
      "1 - (volume of grains) / (volume of the region); box: the least one around all grains; "
      "middle: its middle half along each axis, grains counted by their centre; compactness: the "
      "grains' shadow along y over the cross-section";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    return TableRow{"step", "time_s", "porosity_box", "porosity_middle", "compactness"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    if (now.grains.size() == 0) return;
    const core::ClusterPorosity p = core::cluster_porosity(now.grains);
    TableRow row = row_beginning(now);
    add_values(row, {p.box, p.middle, core::compactness(now.grains, now.walls)});
    emit(std::move(row));
  };
  return o;
}

Observable shape() {
  Observable o;
  o.name = "shape";
  o.summary = "shape of the cluster: drift, and the middle of the array against its edges";
  o.formula =
      "centroid less that of the grains' start is in table settling; spread: standard deviation of "
      "y within a row, mean over rows; protrusion: mean way along gravity of the one or two middle "
      "columns less that of the first and last (nan below three columns); likewise their speeds; "
      "apart: grains that left the main cluster";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    return TableRow{"step",         "time_s",
                    "row_spread_m", "protrusion_m",
                    "centre_minus_edge_speed_m_s", "apart_grains"};
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    if (now.grains.size() == 0) return;
    const core::RowShape all = core::cluster_shape(s, now.grains, now.down);
    double spread = 0;
    const std::vector<core::RowShape> rows = core::row_shapes(s, now.grains, now.down);
    for (const core::RowShape& each : rows) spread += each.spread_y;
    TableRow row = row_beginning(now);
    add_values(row, {rows.empty() ? std::numeric_limits<double>::quiet_NaN()
                                  : spread / static_cast<double>(rows.size()),
                     all.protrusion, all.centre_minus_edge_speed});
    row.push_back(cell(static_cast<std::uint64_t>(now.apart)));
    emit(std::move(row));
  };
  return o;
}

Observable row_shape() {
  Observable o;
  o.name = "row_shape";
  o.summary = "shape of every row of the first array";
  o.formula = "as in table shape, over the grains that started in one row; row 0 is the lowest";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    return TableRow{"step",     "time_s",     "row",          "grains",
                    "mean_y_m", "spread_y_m", "protrusion_m", "centre_minus_edge_speed_m_s"};
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    for (const core::RowShape& each : core::row_shapes(s, now.grains, now.down)) {
      TableRow row = row_beginning(now);
      row.push_back(cell(each.row));
      row.push_back(cell(static_cast<std::uint64_t>(each.grains)));
      add_values(row, {each.mean_y, each.spread_y, each.protrusion,
                       each.centre_minus_edge_speed});
      emit(std::move(row));
    }
  };
  return o;
}

Observable detachment() {
  Observable o;
  o.name = "detachment";
  o.summary = "every grain that left the main cluster, or came back";
  o.formula =
      "main cluster: the largest set of grains joined by gaps between surfaces of at most half a "
      "diameter; a grain of the first state's main cluster leaves it with the first state analyzed "
      "in which it is not among the main cluster's";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    TableRow row = grain_columns();
    row.insert(row.end(), {"event", "cluster_grains"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    for (const core::Departure& each : now.departures) {
      TableRow row = row_beginning(now);
      add_grain(row, s, each.grain);
      row.push_back(each.left ? "left" : "back");
      row.push_back(cell(static_cast<std::uint64_t>(each.cluster_size)));
      emit(std::move(row));
    }
  };
  return o;
}

Observable wall_distance() {
  Observable o;
  o.name = "wall_distance";
  o.summary = "speed of every grain and its distance to the nearest side wall";
  o.formula =
      "distance of the centre from the wall's plane (from a pipe's curved wall); v along gravity. "
      "The straight line through them is among the numbers of the run: wall_distance_slope_1_s";
  o.source = "definition";
  o.columns = [](const core::Scenario&) {
    TableRow row = grain_columns();
    row.insert(row.end(), {"wall_distance_m", "settling_speed_m_s"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const std::vector<double> distances = core::wall_distances(now.grains, now.walls);
    for (std::size_t i = 0; i < now.grains.size(); ++i) {
      if (!std::isfinite(distances[i])) continue;
      TableRow row = row_beginning(now);
      add_grain(row, s, now.grains.id[i]);
      add_values(row, {distances[i], along_gravity(now, i)});
      emit(std::move(row));
    }
  };
  return o;
}

}  // namespace

std::vector<Observable> grain_tables() {
  return {settling(),  trajectories(), by_label("rows", "row", true),
          by_label("columns", "column", false),
          gaps(),      porosity(),     shape(),
          row_shape(), detachment(),   wall_distance()};
}

}  // namespace varve::tools
