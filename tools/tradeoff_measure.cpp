// The built-in measures: what a run gave, in a number or a curve.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "core/constants.h"
#include "core/criteria.h"
#include "core/math.h"
#include "tools/measure.h"
#include "tools/simulation_engine.h"
#include "tools/tradeoff.h"
#include "tools/validate_flow.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

using core::Boundary;

std::vector<double> doubles_of(const io::Schema& schema, const io::Frame& frame,
                               std::string_view name) {
  std::vector<double> values;
  const int index = schema.find(name);
  if (index < 0) return values;
  const auto f = static_cast<std::size_t>(index);
  const io::FieldDescriptor& field = schema.fields[f];
  values.resize(frame.counts[f] * field.components);
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::byte* at = frame.fields[f].data() + k * io::size_of(field.type);
    if (field.type == io::ScalarType::f64) {
      std::memcpy(&values[k], at, sizeof(double));
    } else {
      float narrow = 0;
      std::memcpy(&narrow, at, sizeof narrow);
      values[k] = static_cast<double>(narrow);
    }
  }
  return values;
}

// ---- what scenes are ----

bool fluid_alone(const core::Scenario& s) { return s.has_fluid() && !s.has_grains(); }

/// A body force between two plates at rest, from rest: the start-up has a series.
bool is_poiseuille(const core::Scenario& s) {
  return fluid_alone(s) && s.domain.dimension == 2 && s.domain.sides == Boundary::periodic &&
         s.domain.bottom == Boundary::no_slip && s.domain.top == Boundary::no_slip &&
         s.domain.lid_speed == 0 && s.domain.floor_speed == 0 && s.fluid.body_force_x != 0 &&
         s.fluid.body_force_y == 0 && s.fluid.initial == core::InitialFlow::rest &&
         !core::has_free_surface(s);
}

bool is_taylor_green(const core::Scenario& s) {
  return fluid_alone(s) && s.domain.dimension == 2 && s.domain.width == s.domain.height &&
         s.domain.sides == Boundary::periodic && s.domain.bottom == Boundary::periodic &&
         s.fluid.initial == core::InitialFlow::taylor_green && s.fluid.body_force_x == 0 &&
         s.fluid.body_force_y == 0;
}

bool has_moving_grains(const core::Scenario& s) {
  return s.has_grains() && s.grains.motion != core::GrainMotion::frozen;
}

// ---- numbers of a state ----

double kinetic_energy(const RunView::State& state) {
  const std::size_t count = state.fluid_mass.size();
  if (count == 0) return 0;
  const std::size_t dimension = state.fluid_velocity.size() / count;
  double sum = 0;
  for (std::size_t k = 0; k < state.fluid_velocity.size(); ++k)
    sum += 0.5 * state.fluid_mass[k / dimension] * state.fluid_velocity[k] *
           state.fluid_velocity[k];
  return sum;
}

double largest_speed(const RunView::State& state, std::size_t dimension) {
  double largest = 0;
  for (std::size_t k = 0; k + dimension <= state.fluid_velocity.size(); k += dimension) {
    double square = 0;
    for (std::size_t c = 0; c < dimension; ++c)
      square += state.fluid_velocity[k + c] * state.fluid_velocity[k + c];
    largest = std::max(largest, std::sqrt(square));
  }
  return largest;
}

double front(const RunView::State& state, const core::Scenario& s) {
  double most = 0;
  const auto dimension = static_cast<std::size_t>(s.domain.dimension);
  for (std::size_t k = 0; k < state.fluid_position.size(); k += dimension)
    most = std::max(most, state.fluid_position[k]);
  // A particle stands for half a spacing on each side of it.
  return most - s.domain.left + 0.5 * s.fluid.spacing;
}

double mean_height(const RunView::State& state, std::size_t dimension) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t k = 1; k < state.grain_position.size(); k += dimension, ++count)
    sum += state.grain_position[k];
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

/// u_x on the upright middle line, by a local linear fit.
std::vector<double> profile(const RunView::State& state, const core::Scenario& s) {
  constexpr int points = 16;
  Samples samples;
  for (std::size_t k = 0; k + 1 < state.fluid_position.size(); k += 2)
    samples.add(state.fluid_position[k], state.fluid_position[k + 1], state.fluid_velocity[k]);
  std::vector<double> values;
  for (int n = 0; n < points; ++n)
    values.push_back(samples.at(s.domain.left + 0.5 * s.domain.width,
                                s.domain.height * (n + 0.5) / points, 2.5 * s.fluid.spacing));
  for (const double each : values)
    if (std::isnan(each)) return {};
  return values;
}

std::vector<double> poiseuille_error(const RunView& run) {
  const core::Scenario& s = run.scenario();
  const RunView::State state = run.last();
  const double height = s.domain.height, fastest = std::abs(poiseuille_speed(s));
  const double unit = height * height * s.fluid.density / s.fluid.viscosity;
  const double sign = s.fluid.body_force_x > 0 ? 1 : -1;
  double sum = 0;
  for (std::size_t k = 0; k < state.fluid_position.size(); k += 2) {
    const double known = poiseuille_profile(state.fluid_position[k + 1] / height,
                                            state.time / unit);
    const double off = sign * state.fluid_velocity[k] / fastest - known;
    sum += off * off;
  }
  return {std::sqrt(2 * sum / static_cast<double>(state.fluid_position.size()))};
}

std::vector<double> taylor_green_viscosity(const RunView& run) {
  const core::Scenario& s = run.scenario();
  const RunView::State from = run.first(), to = run.last();
  const double k = 2 * core::pi / s.domain.width;
  const double exponent = 4 * k * k * (to.time - from.time) * s.fluid.viscosity / s.fluid.density;
  if (!(exponent > 0)) return {};
  return {-std::log(kinetic_energy(to) / kinetic_energy(from)) / exponent};
}

/// (energy of the grains + what contacts took - what the fluid gave) - what there was, over the
/// largest kinetic energy. What is stored in contacts that last is not counted.
std::vector<double> energy_drift(const RunView& run) {
  const auto& rows = run.energies();
  const auto column = [&](const char* name) -> const std::vector<double>& {
    return rows.at(name);
  };
  if (rows.empty() || column("time_s").size() < 2) return {};
  const auto balance = [&](std::size_t k) {
    return column("grains_kinetic_J")[k] + column("grains_rotation_J")[k] +
           column("grains_potential_J")[k] + column("normal_loss_J")[k] +
           column("tangential_loss_J")[k] + column("friction_loss_J")[k] -
           column("drag_work_on_grains_J")[k] - column("hydrodynamic_work_on_grains_J")[k];
  };
  double largest = 0;
  for (std::size_t k = 0; k < column("time_s").size(); ++k)
    largest = std::max(largest, column("grains_kinetic_J")[k] + column("grains_rotation_J")[k]);
  if (largest == 0) return {};
  return {(balance(column("time_s").size() - 1) - balance(0)) / largest};
}

std::vector<double> optional_number(const std::optional<double>& value) {
  return value ? std::vector<double>{*value} : std::vector<double>{};
}

TradeMeasure of_summary(std::string name, std::string unit, std::string meaning,
                   std::function<std::vector<double>(const RunView&)> evaluate) {
  return {std::move(name), std::move(unit), std::move(meaning), {}, 1, true, false, "",
          std::move(evaluate)};
}
TradeMeasure of_state(std::string name, std::string unit, std::string meaning,
                 std::function<std::vector<double>(const RunView&)> evaluate) {
  return {std::move(name), std::move(unit), std::move(meaning), {}, 1, false, false, "",
          std::move(evaluate)};
}

void add_grain_measures(const core::Scenario& s, std::vector<TradeMeasure>& all) {
  const auto dimension = static_cast<std::size_t>(s.domain.dimension);
  all.push_back(of_summary("settling_speed", "m/s",
                           "mean settling speed, second half of the time to the floor",
                           [](const RunView& run) -> std::vector<double> {
                             if (!run.summary().settling) return {};
                             return {run.summary().settling->mean};
                           }));
  all.push_back(of_summary("peak_speed", "m/s", "largest settling speed", [](const RunView& run) {
    return std::vector<double>{run.summary().peak_speed};
  }));
  all.push_back(of_summary("first_contact", "s", "time of the first contact of any kind",
                           [](const RunView& run) {
                             return optional_number(run.summary().first_contact);
                           }));
  all.push_back(of_summary("floor_contact", "s", "time of the first contact with the floor",
                           [](const RunView& run) {
                             return optional_number(run.summary().first_floor_contact);
                           }));
  all.push_back(of_summary("restitution", "", "mean restitution of hits on walls",
                           [](const RunView& run) -> std::vector<double> {
                             const double mean = run.summary().restitution.mean;
                             if (std::isnan(mean)) return {};
                             return {mean};
                           }));
  all.push_back(of_summary("peak_force", "N", "largest contact force", [](const RunView& run) {
    return run.summary().peak_force > 0 ? std::vector<double>{run.summary().peak_force}
                                        : std::vector<double>{};
  }));
  all.push_back(of_state("fall", "m", "by how much the grains' mean height fell",
                         [dimension](const RunView& run) {
                           const double last = run.at_end([&](const RunView::State& state) {
                             return mean_height(state, dimension);
                           });
                           return std::vector<double>{mean_height(run.first(), dimension) - last};
                         }));
  TradeMeasure drift = of_summary("energy_drift", "",
                             "energy of the grains that appears from nowhere, over the largest "
                             "kinetic energy",
                             energy_drift);
  drift.needs_energies = true;
  drift.known = 0;
  all.push_back(std::move(drift));
}

void add_fluid_measures(const core::Scenario& s, std::vector<TradeMeasure>& all) {
  const auto dimension = static_cast<std::size_t>(s.domain.dimension);
  all.push_back(of_state("kinetic_energy", "J", "of the fluid at the end", [](const RunView& run) {
    return std::vector<double>{run.at_end(kinetic_energy)};
  }));
  all.push_back(of_state("max_speed", "m/s", "largest speed of the fluid at the end",
                         [dimension](const RunView& run) {
                           return std::vector<double>{run.at_end([&](const RunView::State& state) {
                             return largest_speed(state, dimension);
                           })};
                         }));
  if (dimension == 2)
    all.push_back(of_state("profile", "m/s",
                           "u_x on the upright middle line at the end: rms over 16 points, over "
                           "the largest",
                           [](const RunView& run) { return profile(run.last(), run.scenario()); }));
  if (core::has_free_surface(s))
    all.push_back(of_state("front", "m", "farthest x of the fluid at the end",
                           [](const RunView& run) {
                             return std::vector<double>{run.at_end([&](const RunView::State& at) {
                               return front(at, run.scenario());
                             })};
                           }));
  if (is_poiseuille(s)) {
    TradeMeasure known = of_state("poiseuille", "",
                             "rms error of the profile over u_max, against the series of the "
                             "start-up",
                             poiseuille_error);
    known.known = 0;
    all.push_back(std::move(known));
  }
  if (is_taylor_green(s)) {
    TradeMeasure known = of_state("viscosity", "",
                                  "effective viscosity over nu, from the energy lost",
                                  taylor_green_viscosity);
    known.known = 1;
    all.push_back(std::move(known));
  }
}

TradeMeasure of_expression(const std::string& name, const std::string& text) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  if (name.empty() || !std::all_of(name.begin(), name.end(), plain))
    throw UsageError(fmt::format(
        "--measure: '{}' is no name; it may hold letters, digits and '_'", name));
  try {
    make_measure(name, text);
  } catch (const ExpressionError& error) {
    throw UsageError(
        fmt::format("--measure {}: column {}: {}", name, error.column(), error.what()));
  }
  TradeMeasure measure;
  measure.name = name;
  measure.meaning = measure.expression = text;
  return measure;
}

/// "NAME=VALUE": errors of that measure are relative to VALUE, or as they are where it is 0.
void set_known(const std::string& text, std::vector<TradeMeasure>& measures) {
  const std::size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  const auto found = std::find_if(measures.begin(), measures.end(),
                                  [&](const TradeMeasure& each) { return each.name == name; });
  char* end = nullptr;
  const std::string digits = equals == std::string::npos ? "" : text.substr(equals + 1);
  const double value = std::strtod(digits.c_str(), &end);
  if (digits.empty() || *end != '\0' || !std::isfinite(value))
    throw UsageError(fmt::format("--known: expected NAME=VALUE with a number in SI, got '{}'",
                                 text));
  if (found == measures.end())
    throw UsageError(fmt::format("--known: '{}' is not among the measures", name));
  found->known = value;
  found->scale = value == 0 ? 1 : std::abs(value);
}

}  // namespace

RunView::RunView(const io::LogReader& log, const core::Scenario& scenario, double until)
    : log_(log), scenario_(scenario), until_(until) {}

RunView::State RunView::state(std::uint64_t step) const {
  const io::Frame frame = state_at(log_, step, [&]() -> std::unique_ptr<io::Engine> {
    return SimulationEngine::of_genesis(log_.genesis(), log_.path(), {});
  });
  const io::Schema& schema = log_.genesis().schema;
  State state;
  state.time = frame.time;
  state.fluid_position = doubles_of(schema, frame, "fluid.position");
  state.fluid_velocity = doubles_of(schema, frame, "fluid.velocity");
  state.fluid_mass = doubles_of(schema, frame, "fluid.mass");
  state.grain_position = doubles_of(schema, frame, "grains.position");
  state.grain_velocity = doubles_of(schema, frame, "grains.velocity");
  return state;
}

RunView::State RunView::first() const { return state(log_.first_step()); }
RunView::State RunView::last() const { return state(log_.last_step()); }

double RunView::at_end(const std::function<double(const State&)>& number) const {
  const std::uint64_t last_step = log_.last_step();
  const State after = state(last_step);
  if (last_step == log_.first_step() || !(after.time > until_)) return number(after);
  const State before = state(last_step - 1);
  const double weight = (until_ - before.time) / (after.time - before.time);
  return (1 - weight) * number(before) + weight * number(after);
}

void RunView::read(bool summary, bool energies) {
  if (!summary && !energies) return;
  AnalysisRequest request;
  request.range = {log_.first_step(), log_.last_step(), 1};
  if (energies) request.tables.push_back(&find_observable("energy"));
  std::vector<std::string> columns;
  summary_ = analyze(log_, scenario_, request,
                     [&](const Observable&, const std::vector<std::string>& row) {
                       if (columns.empty()) {
                         columns = row;
                         return;
                       }
                       for (std::size_t k = 0; k < row.size() && k < columns.size(); ++k)
                         energies_[columns[k]].push_back(std::strtod(row[k].c_str(), nullptr));
                     });
}

std::vector<TradeMeasure> measures_of(const core::Scenario& scene) {
  std::vector<TradeMeasure> all;
  if (has_moving_grains(scene)) add_grain_measures(scene, all);
  if (scene.has_fluid()) add_fluid_measures(scene, all);
  return all;
}

std::vector<std::string> default_measures(const core::Scenario& s) {
  if (has_moving_grains(s) && !s.has_fluid())
    return {"first_contact", "restitution", "fall", "energy_drift"};
  if (has_moving_grains(s))
    return s.grain_count() == 1
               ? std::vector<std::string>{"settling_speed", "floor_contact"}
               : std::vector<std::string>{"settling_speed", "fall", "floor_contact"};
  if (is_poiseuille(s)) return {"poiseuille"};
  if (is_taylor_green(s)) return {"viscosity"};
  if (core::has_free_surface(s) && !std::isnan(s.fluid.width)) return {"front", "kinetic_energy"};
  if (s.domain.dimension == 2) return {"kinetic_energy", "profile"};
  return {"kinetic_energy", "max_speed"};
}

std::vector<TradeMeasure> choose_measures(const core::Scenario& scene,
                                          const std::vector<std::string>& asked,
                                          const std::vector<std::string>& known) {
  const std::vector<TradeMeasure> all = measures_of(scene);
  std::vector<std::string_view> names;
  for (const TradeMeasure& each : all) names.push_back(each.name);
  std::vector<TradeMeasure> chosen;
  for (const std::string& name : asked.empty() ? default_measures(scene) : asked) {
    if (const std::size_t equals = name.find('='); equals != std::string::npos) {
      chosen.push_back(of_expression(name.substr(0, equals), name.substr(equals + 1)));
      continue;
    }
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](const TradeMeasure& each) { return each.name == name; });
    if (found == all.end())
      throw UsageError(fmt::format("--measure: this scene has no '{}'; expected NAME=EXPRESSION or "
                                   "one of {}", name, fmt::join(names, ", ")));
    chosen.push_back(*found);
  }
  for (std::size_t i = 0; i < chosen.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (chosen[i].name == chosen[j].name)
        throw UsageError(fmt::format("--measure: '{}' is named twice", chosen[i].name));
  for (const std::string& text : known) set_known(text, chosen);
  return chosen;
}

}  // namespace varve::tools
