// Tables of contacts: counts and forces, hits of walls, stress, chains.
#include <map>

#include <fmt/format.h>

#include "tools/analysis_tables.h"

namespace varve::tools {
namespace {

Observable contacts() {
  Observable o;
  o.name = "contacts";
  o.summary = "contacts of a step: how many, how strong, what they lost";
  o.formula =
      "counts and quartiles over the engine's contact records; force: largest normal force within "
      "the step";
  o.source = "contact records";
  o.every_step = true;
  o.columns = [](const core::Scenario& s) {
    TableRow row{"step",           "time_s",         "contacts",        "with_grains",
                 "with_walls",     "begun",          "ended",           "mean_force_N",
                 "lower_force_N",  "median_force_N", "upper_force_N",   "peak_force_N",
                 "normal_loss_J",  "tangential_loss_J", "friction_loss_J"};
    add_axes(row, s, "wall_impulse_", "_N_s");
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    const core::ContactTotals totals = core::contact_totals(now.contacts);
    TableRow row = row_beginning(now);
    for (const std::size_t each : {totals.contacts, totals.with_grains, totals.with_walls,
                                   totals.begun, totals.ended})
      row.push_back(cell(static_cast<std::uint64_t>(each)));
    add_values(row, {totals.mean_force, totals.force.lower, totals.force.median,
                     totals.force.upper, totals.force.greatest, totals.normal_loss,
                     totals.tangential_loss, totals.friction_loss});
    add_values(row, totals.wall_impulse.data(), dimension_of(s));
    emit(std::move(row));
  };
  return o;
}

Observable wall_hits() {
  Observable o;
  o.name = "wall_hits";
  o.summary = "every grain that hit a wall and left it: restitution";
  o.formula = "normal separation speed over normal approach speed, within the sub-steps";
  o.source = "contact records";
  o.every_step = true;
  o.columns = [](const core::Scenario&) {
    return TableRow{"step",        "time_s",           "grain",        "wall",
                    "begin_s",     "impact_speed_m_s", "rebound_speed_m_s",
                    "restitution", "peak_force_N",     "peak_overlap_m"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    static constexpr const char* names[] = {"left",  "right", "bottom", "top",
                                            "front", "back",  "pipe"};
    for (const core::WallHit& hit : now.hits) {
      TableRow row = row_beginning(now);
      row.push_back(cell(hit.grain));
      row.push_back(hit.wall < 7 ? names[hit.wall] : cell(hit.wall));
      add_values(row, {hit.begin, hit.impact_speed, hit.rebound_speed, hit.restitution,
                       hit.peak_force, hit.peak_overlap});
      emit(std::move(row));
    }
  };
  return o;
}

constexpr const char* stress_formula =
    "pressure: (1 / (D V)) sum over contacts of R F.n; vertical: (1 / V) sum R F_y n_y, "
    "compression positive; F: mean over the step that led here, n: towards the grain, V: the "
    "grain's volume (area in 2D); contacts: that hold at the end of the step, walls included";

Observable stress() {
  Observable o;
  o.name = "stress";
  o.summary = "contact stress and coordination number of every grain";
  o.formula = stress_formula;
  o.source = "contact records; Love-Weber average over the grain (Weber 1966)";
  o.columns = [](const core::Scenario&) {
    TableRow row = grain_columns();
    row.insert(row.end(), {"contacts", "pressure_Pa", "vertical_Pa", "chain"});
    return row;
  };
  o.rows = [](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    for (std::size_t i = 0; i < now.stresses.size(); ++i) {
      const core::GrainStress& each = now.stresses[i];
      TableRow row = row_beginning(now);
      add_grain(row, s, now.grains.id[i]);
      row.push_back(cell(std::uint64_t{each.contacts}));
      add_values(row, {each.pressure, each.vertical});
      row.push_back(cell(std::int64_t{now.chains.chain_of[i]}));
      emit(std::move(row));
    }
  };
  return o;
}

/// Means over the grains of one row or column.
Observable stress_by(const char* name, const char* what, bool rows) {
  Observable o;
  o.name = name;
  o.summary = fmt::format("contact stress and coordination number by {} of the first array", what);
  o.formula = fmt::format("means over the grains that started in one {}; {}", what, stress_formula);
  o.source = "contact records";
  o.columns = [what](const core::Scenario&) {
    return TableRow{"step",     "time_s",      what,         "grains",
                    "contacts", "pressure_Pa", "vertical_Pa"};
  };
  o.rows = [rows](const core::Scenario& s, const ObservedStep& now, const EmitRow& emit) {
    struct Sum {
      double grains = 0, contacts = 0, pressure = 0, vertical = 0;
    };
    std::map<std::int64_t, Sum> sums;
    for (std::size_t i = 0; i < now.stresses.size(); ++i) {
      const core::GrainLabel label = core::label_of(s, now.grains.id[i]);
      Sum& sum = sums[rows ? label.row : label.column];
      ++sum.grains;
      sum.contacts += now.stresses[i].contacts;
      sum.pressure += now.stresses[i].pressure;
      sum.vertical += now.stresses[i].vertical;
    }
    for (const auto& [label, sum] : sums) {
      TableRow row = row_beginning(now);
      row.push_back(cell(label));
      row.push_back(cell(static_cast<std::uint64_t>(sum.grains)));
      add_values(row, {sum.contacts / sum.grains, sum.pressure / sum.grains,
                       sum.vertical / sum.grains});
      emit(std::move(row));
    }
  };
  return o;
}

Observable chains() {
  Observable o;
  o.name = "chains";
  o.summary = "force chains of a state";
  o.formula =
      "strong: contacts between grains that push with more than the mean over all contacts between "
      "grains of the step; a chain: three or more grains linked by strong contacts";
  o.source = "contact records; Radjai et al. 1998";
  o.columns = [](const core::Scenario&) {
    return TableRow{"step",   "time_s",        "contacts",     "mean_push_N", "strong",
                    "chains", "chain_grains", "longest_grains", "coordination"};
  };
  o.rows = [](const core::Scenario&, const ObservedStep& now, const EmitRow& emit) {
    if (now.grains.size() == 0) return;
    double contacts = 0;
    for (const core::GrainStress& each : now.stresses) contacts += each.contacts;
    TableRow row = row_beginning(now);
    row.push_back(cell(static_cast<std::uint64_t>(now.links.size())));
    row.push_back(cell(now.chains.mean_push));
    for (const std::size_t each :
         {now.chains.strong, now.chains.chains, now.chains.grains, now.chains.longest})
      row.push_back(cell(static_cast<std::uint64_t>(each)));
    row.push_back(cell(contacts / static_cast<double>(now.grains.size())));
    emit(std::move(row));
  };
  return o;
}

}  // namespace

std::vector<Observable> contact_tables() {
  return {contacts(),
          wall_hits(),
          stress(),
          stress_by("row_stress", "row", true),
          stress_by("column_stress", "column", false),
          chains()};
}

}  // namespace varve::tools
