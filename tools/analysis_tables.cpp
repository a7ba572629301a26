// The tables that `varve analyze` writes: columns with units, formula, source, and how a row is
// made.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "core/observe/drag_numbers.h"
#include "tools/analysis.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

using Row = std::vector<std::string>;
using Emit = std::function<void(Row)>;

std::string number(double value) { return fmt::format("{}", value); }
std::string number(std::uint64_t value) { return fmt::format("{}", value); }
template <class T>
  requires(std::is_integral_v<T> && !std::is_same_v<T, std::uint64_t>)
std::string number(T value) {
  return fmt::format("{}", value);
}

Row beginning(const ObservedStep& now) { return {number(now.step), number(now.time)}; }

std::size_t dimension_of(const core::Scenario& s) {
  return static_cast<std::size_t>(s.domain.dimension);
}

/// "x_m", "y_m" ...
void add_axes(Row& row, const core::Scenario& s, const std::string& before,
              const std::string& unit) {
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < dimension_of(s); ++k) row.push_back(before + axes[k] + unit);
}
void add_values(Row& row, const double* values, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) row.push_back(number(values[k]));
}

Observable settling() {
  return {"settling",
          "motion of all grains together",
          "mean over grains of v, |v|, x; settling speed: mean v along gravity; spread: standard "
          "deviation of x",
          "definition",
          false,
          false,
          false,
          [](const core::Scenario& s) {
            Row row{"step", "time_s", "settling_speed_m_s", "mean_speed_m_s", "max_speed_m_s"};
            add_axes(row, s, "mean_v", "_m_s");
            add_axes(row, s, "centroid_", "_m");
            add_axes(row, s, "spread_", "_m");
            row.insert(row.end(), {"lowest_y_m", "highest_y_m"});
            return row;
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const core::GroupMotion group = core::group_motion(now.grains, now.down);
            Row row = beginning(now);
            for (const double each : {group.settling_speed, group.mean_speed, group.max_speed})
              row.push_back(number(each));
            add_values(row, group.mean_velocity.data(), dimension_of(s));
            add_values(row, group.centroid.data(), dimension_of(s));
            add_values(row, group.spread.data(), dimension_of(s));
            row.push_back(number(group.lowest));
            row.push_back(number(group.highest));
            emit(std::move(row));
          }};
}

Observable trajectories() {
  return {"trajectories",
          "every grain at every step",
          "positions, velocities and spin as recorded; row and column of the first array",
          "the log's state",
          false,
          false,
          false,
          [](const core::Scenario& s) {
            Row row{"step", "time_s", "grain", "row", "column"};
            if (dimension_of(s) == 3) row.push_back("layer");
            add_axes(row, s, "", "_m");
            add_axes(row, s, "v", "_m_s");
            if (s.contact.rotation) {
              if (dimension_of(s) == 2)
                row.push_back("spin_rad_s");
              else
                add_axes(row, s, "spin_", "_rad_s");
            }
            return row;
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const std::size_t d = dimension_of(s), spins = d == 2 ? 1 : 3;
            for (std::size_t i = 0; i < now.grains.size(); ++i) {
              Row row = beginning(now);
              const core::GrainLabel label = core::label_of(s, now.grains.id[i]);
              row.push_back(number(now.grains.id[i]));
              row.push_back(number(label.row));
              row.push_back(number(label.column));
              if (d == 3) row.push_back(number(label.layer));
              add_values(row, now.grains.position.data() + i * d, d);
              add_values(row, now.grains.velocity.data() + i * d, d);
              if (!now.grains.spin.empty())
                add_values(row, now.grains.spin.data() + i * spins, spins);
              emit(std::move(row));
            }
          }};
}

/// Mean settling speed of the grains that share a label.
Observable by_label(const char* name, const char* what, bool rows) {
  return {name,
          fmt::format("settling speed by {} of the first array", what),
          fmt::format("mean of v along gravity over the grains that started in one {}", what),
          "definition",
          false,
          false,
          false,
          [what](const core::Scenario&) {
            return Row{"step", "time_s", what, "grains", "settling_speed_m_s", "mean_y_m"};
          },
          [rows](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            struct Sum {
              std::uint64_t count = 0;
              double speed = 0, y = 0;
            };
            std::map<std::int64_t, Sum> sums;
            const std::size_t d = dimension_of(s);
            for (std::size_t i = 0; i < now.grains.size(); ++i) {
              const core::GrainLabel label = core::label_of(s, now.grains.id[i]);
              Sum& sum = sums[rows ? label.row : label.column];
              ++sum.count;
              for (std::size_t k = 0; k < d; ++k)
                sum.speed += now.grains.velocity[i * d + k] * now.down[k];
              sum.y += now.grains.position[i * d + 1];
            }
            for (const auto& [label, sum] : sums) {
              const double count = static_cast<double>(sum.count);
              Row row = beginning(now);
              row.insert(row.end(), {number(label), number(sum.count), number(sum.speed / count),
                                     number(sum.y / count)});
              emit(std::move(row));
            }
          }};
}

Observable gaps() {
  return {"gaps",
          "free space to the nearest neighbour",
          "|x_i - x_j| - R_i - R_j, least over j; its mean, least and quartiles over i",
          "definition",
          false,
          false,
          false,
          [](const core::Scenario&) {
            return Row{"step",          "time_s",       "mean_gap_m",  "least_gap_m",
                       "lower_gap_m", "median_gap_m", "upper_gap_m"};
          },
          [](const core::Scenario&, const ObservedStep& now, const Emit& emit) {
            const std::vector<double> all = core::nearest_gaps(now.grains, now.period);
            if (all.size() < 2) return;
            const core::Quartiles q = core::quartiles_of(all);
            Row row = beginning(now);
            for (const double each :
                 {core::spread_of(all).mean, q.least, q.lower, q.median, q.upper})
              row.push_back(number(each));
            emit(std::move(row));
          }};
}

Observable porosity() {
  return {"porosity",
          "porosity of the cluster",
          "1 - (volume of grains) / (volume of the region); box: the least one around all grains; "
          "middle: its middle half along each axis, grains counted by their centre",
          "definition",
          false,
          false,
          false,
          [](const core::Scenario&) {
            return Row{"step", "time_s", "porosity_box", "porosity_middle"};
          },
          [](const core::Scenario&, const ObservedStep& now, const Emit& emit) {
            if (now.grains.size() == 0) return;
            const core::ClusterPorosity p = core::cluster_porosity(now.grains);
            Row row = beginning(now);
            row.push_back(number(p.box));
            row.push_back(number(p.middle));
            emit(std::move(row));
          }};
}

Observable contacts() {
  return {"contacts",
          "contacts of a step: how many, how strong, what they lost",
          "counts and quartiles over the engine's contact records; force: largest normal force "
          "within the step",
          "contact records",
          true,
          false,
          false,
          [](const core::Scenario& s) {
            Row row{"step",           "time_s",         "contacts",        "with_grains",
                    "with_walls",     "begun",          "ended",           "mean_force_N",
                    "lower_force_N",  "median_force_N", "upper_force_N",   "peak_force_N",
                    "normal_loss_J",  "tangential_loss_J", "friction_loss_J"};
            add_axes(row, s, "wall_impulse_", "_N_s");
            return row;
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const core::ContactTotals totals = core::contact_totals(now.contacts);
            Row row = beginning(now);
            for (const std::size_t each : {totals.contacts, totals.with_grains, totals.with_walls,
                                           totals.begun, totals.ended})
              row.push_back(number(each));
            for (const double each :
                 {totals.mean_force, totals.force.lower, totals.force.median, totals.force.upper,
                  totals.force.greatest, totals.normal_loss, totals.tangential_loss,
                  totals.friction_loss})
              row.push_back(number(each));
            add_values(row, totals.wall_impulse.data(), dimension_of(s));
            emit(std::move(row));
          }};
}

Observable wall_hits() {
  return {"wall_hits",
          "every grain that hit a wall and left it: restitution",
          "normal separation speed over normal approach speed, within the sub-steps",
          "contact records",
          true,
          false,
          false,
          [](const core::Scenario&) {
            return Row{"step",          "time_s",          "grain",       "wall",
                       "begin_s",       "impact_speed_m_s", "rebound_speed_m_s",
                       "restitution",   "peak_force_N",    "peak_overlap_m"};
          },
          [](const core::Scenario&, const ObservedStep& now, const Emit& emit) {
            static constexpr const char* names[] = {"left",  "right", "bottom", "top",
                                                    "front", "back",  "pipe"};
            for (const core::WallHit& hit : now.hits) {
              Row row = beginning(now);
              row.push_back(number(hit.grain));
              row.push_back(hit.wall < 7 ? names[hit.wall] : number(hit.wall));
              for (const double each : {hit.begin, hit.impact_speed, hit.rebound_speed,
                                        hit.restitution, hit.peak_force, hit.peak_overlap})
                row.push_back(number(each));
              emit(std::move(row));
            }
          }};
}

Observable energy() {
  return {"energy",
          "energies of grains and fluid, and what contacts and the fluid took",
          "1/2 m v^2, 1/2 I w^2, -m g.x of grains (submerged in the excess form); 1/2 m v^2 of the "
          "fluid; losses and work summed since the first step analyzed",
          "definition; contact and work records",
          false,
          false,
          false,
          [](const core::Scenario&) {
            return Row{"step", "time_s", "grains_kinetic_J", "grains_rotation_J",
                       "grains_potential_J", "fluid_kinetic_J", "normal_loss_J",
                       "tangential_loss_J", "friction_loss_J", "drag_work_on_grains_J",
                       "hydrodynamic_work_on_grains_J"};
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const core::GrainEnergy e =
                core::grain_energy(now.grains, dimension_of(s) == 2 ? 0.5 : 0.4, now.gravity);
            Row row = beginning(now);
            for (const double each :
                 {e.translation, e.rotation, e.potential, now.fluid_kinetic, now.normal_loss,
                  now.tangential_loss, now.friction_loss, now.total_drag_work,
                  now.total_hydrodynamic_work})
              row.push_back(number(each));
            emit(std::move(row));
          }};
}

/// Of the contacts of this step on each grain [N], means over the step that led to this state.
std::map<std::uint64_t, std::array<double, 3>> contact_forces(const ObservedStep& now,
                                                              double dt) {
  std::map<std::uint64_t, std::array<double, 3>> forces;
  if (!(dt > 0)) return forces;
  for (const core::ContactRow& row : now.contacts)
    for (std::size_t k = 0; k < 3; ++k) {
      forces[row.grain][k] += row.impulse[k] / dt;
      if (row.kind == 0) forces[row.partner][k] -= row.impulse[k] / dt;
    }
  return forces;
}

Observable forces() {
  return {"forces",
          "forces on every grain, slip, drag coefficient, shielding",
          "hydrodynamic: V (-grad p + div tau), drag: mean of K (u - v) over the sub-steps, at "
          "this state; contact: impulse over dt of the step that led here; Re = rho0 eps |u - v| d "
          "/ mu; Cd = |drag| / (1/2 rho0 (eps |u - v|)^2 A); shielding: |drag| over that of a lone "
          "grain at the same slip",
          "the engine's force pass on the recorded state; contact records",
          false,
          true,
          false,
          [](const core::Scenario& s) {
            Row row{"step", "time_s", "grain", "row", "column"};
            add_axes(row, s, "hydrodynamic_", "_N");
            add_axes(row, s, "drag_", "_N");
            add_axes(row, s, "contact_", "_N");
            add_axes(row, s, "weight_", "_N");
            add_axes(row, s, "fluid_v", "_m_s");
            row.insert(row.end(), {"slip_m_s", "reynolds", "drag_coefficient", "porosity",
                                   "shielding"});
            return row;
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const std::size_t d = dimension_of(s);
            const auto contact = contact_forces(now, now.dt);
            for (std::size_t i = 0; i < now.forces.size(); ++i) {
              const core::GrainReport& f = now.forces[i];
              Row row = beginning(now);
              const core::GrainLabel label = core::label_of(s, now.grains.id[i]);
              row.push_back(number(now.grains.id[i]));
              row.push_back(number(label.row));
              row.push_back(number(label.column));
              add_values(row, f.hydrodynamic.data(), d);
              add_values(row, f.drag.data(), d);
              const auto touching = contact.find(now.grains.id[i]);
              const std::array<double, 3> none{};
              add_values(row, touching == contact.end() ? none.data() : touching->second.data(),
                         d);
              double slip2 = 0, drag2 = 0;
              for (std::size_t k = 0; k < d; ++k) {
                row.push_back(number(now.grains.mass[i] * now.gravity[k]));
                const double slip = f.fluid_velocity[k] - now.grains.velocity[i * d + k];
                slip2 += slip * slip;
                drag2 += f.drag[k] * f.drag[k];
              }
              add_values(row, f.fluid_velocity.data(), d);
              const core::DragNumbers n =
                  core::drag_numbers(s, 2 * now.grains.radius[i], std::sqrt(slip2), f.porosity,
                                     std::sqrt(drag2));
              for (const double each : {std::sqrt(slip2), n.reynolds, n.coefficient, f.porosity,
                                        n.shielding})
                row.push_back(number(each));
              emit(std::move(row));
            }
          }};
}

Observable flow() {
  return {"flow",
          "velocity, vorticity and pressure of the fluid at points (--grid, --at-point)",
          "sum_b V_b f_b W / S; curl of sum_b V_b (v_b - v) grad W / S; S = sum_b V_b W",
          "kernel interpolation with the run's kernel; pressure by the engine's force pass",
          false,
          true,
          true,
          [](const core::Scenario& s) {
            Row row{"step", "time_s"};
            add_axes(row, s, "", "_m");
            add_axes(row, s, "v", "_m_s");
            if (dimension_of(s) == 2)
              row.push_back("vorticity_1_s");
            else
              add_axes(row, s, "vorticity_", "_1_s");
            row.insert(row.end(), {"pressure_Pa", "weight"});
            return row;
          },
          [](const core::Scenario& s, const ObservedStep& now, const Emit& emit) {
            const std::size_t d = dimension_of(s);
            const std::vector<core::FluidAtPoint> values =
                core::sample_fluid(now.fluid, now.points);
            for (std::size_t p = 0; p < values.size(); ++p) {
              Row row = beginning(now);
              add_values(row, now.points.data() + p * d, d);
              add_values(row, values[p].velocity.data(), d);
              if (d == 2)
                row.push_back(number(values[p].vorticity[2]));
              else
                add_values(row, values[p].vorticity.data(), 3);
              row.push_back(number(values[p].pressure));
              row.push_back(number(values[p].weight));
              emit(std::move(row));
            }
          }};
}

}  // namespace

const std::vector<Observable>& observables() {
  static const std::vector<Observable> all = {
      settling(),  trajectories(),  by_label("rows", "row", true),
      by_label("columns", "column", false), gaps(), porosity(), contacts(), wall_hits(), energy(),
      forces(),    flow()};
  return all;
}

const Observable& find_observable(const std::string& name) {
  std::vector<std::string_view> names;
  for (const Observable& each : observables()) {
    if (each.name == name) return each;
    names.push_back(each.name);
  }
  const std::string_view nearest = nearest_name(name, names);
  throw UsageError(nearest.empty()
                       ? fmt::format("--observable: '{}' is not known; expected {}", name,
                                     fmt::join(names, ", "))
                       : fmt::format("--observable: '{}' is not known; did you mean '{}'?", name,
                                     nearest));
}

}  // namespace varve::tools
