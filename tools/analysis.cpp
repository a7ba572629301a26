#include "tools/analysis.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <tuple>

#include <fmt/format.h>

#include "core/constants.h"
#include "core/walls.h"
#include "io/errors.h"
#include "core/criteria.h"
#include "tools/cli.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

/// A field's scalars as doubles; empty where the log has no such field.
std::vector<double> reals(const io::Schema& schema, const io::Frame& frame,
                          std::string_view name) {
  std::vector<double> values;
  const int index = schema.find(name);
  if (index < 0) return values;
  const auto f = static_cast<std::size_t>(index);
  const io::FieldDescriptor& field = schema.fields[f];
  const std::vector<std::byte>& bytes = frame.fields[f];
  values.resize(frame.counts[f] * field.components);
  if (field.type == io::ScalarType::f64) {
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }
  for (std::size_t k = 0; k < values.size(); ++k) {
    float value;
    std::memcpy(&value, bytes.data() + k * sizeof value, sizeof value);
    values[k] = static_cast<double>(value);
  }
  return values;
}

std::vector<std::uint64_t> ids(const io::Schema& schema, const io::Frame& frame,
                               std::string_view name) {
  const int index = schema.find(name);
  std::vector<std::uint64_t> values;
  if (index < 0) return values;
  const auto f = static_cast<std::size_t>(index);
  values.resize(frame.counts[f]);
  if (!values.empty())
    std::memcpy(values.data(), frame.fields[f].data(), frame.fields[f].size());
  return values;
}

/// One column of a table, by name, as doubles (whole numbers up to 2^53 exactly).
class TableReader {
 public:
  TableReader(const io::Schema& schema, std::string_view table) : schema_(schema) {
    for (std::size_t t = 0; t < schema.tables.size(); ++t)
      if (schema.tables[t].name == table) table_ = static_cast<int>(t);
  }
  std::uint64_t rows(const io::Frame& frame) const {
    return table_ < 0 ? 0 : frame.rows[static_cast<std::size_t>(table_)];
  }
  template <class T>
  T at(const io::Frame& frame, std::string_view column, std::uint64_t row) const {
    const io::TableDescriptor& table = schema_.tables[static_cast<std::size_t>(table_)];
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      if (table.columns[c].name != column) continue;
      const auto& bytes = frame.tables[static_cast<std::size_t>(table_)][c];
      T value{};
      std::memcpy(&value, bytes.data() + row * sizeof value, sizeof value);
      return value;
    }
    return T{};
  }

 private:
  const io::Schema& schema_;
  int table_ = -1;
};

std::vector<core::ContactRow> contact_rows(const TableReader& table, const io::Frame& frame,
                                           std::size_t dimension) {
  static constexpr const char* impulses[] = {"impulse_x", "impulse_y", "impulse_z"};
  std::vector<core::ContactRow> rows(table.rows(frame));
  for (std::uint64_t r = 0; r < rows.size(); ++r) {
    core::ContactRow& row = rows[r];
    row.grain = table.at<std::uint64_t>(frame, "grain", r);
    row.partner = table.at<std::uint64_t>(frame, "partner", r);
    row.kind = table.at<std::uint8_t>(frame, "kind", r);
    row.begin = table.at<std::uint8_t>(frame, "begin", r) != 0;
    row.end = table.at<std::uint8_t>(frame, "end", r) != 0;
    row.peak_force = table.at<double>(frame, "peak_force", r);
    row.peak_overlap = table.at<double>(frame, "peak_overlap", r);
    for (std::size_t k = 0; k < dimension; ++k)
      row.impulse[k] = table.at<double>(frame, impulses[k], r);
    row.impact_speed = table.at<double>(frame, "impact_speed", r);
    row.rebound_speed = table.at<double>(frame, "rebound_speed", r);
    row.normal_loss = table.at<double>(frame, "normal_loss", r);
    row.tangential_loss = table.at<double>(frame, "tangential_loss", r);
    row.friction_loss = table.at<double>(frame, "friction_loss", r);
  }
  return rows;
}

/// Curves that the summary is made of. When they are full, every second sample goes and from then
/// on every second one is taken: memory does not grow with the log.
class Curves {
 public:
  void take(double time, double settling, double fastest) {
    if (count_++ % every_ != 0) return;
    if (time_.size() == samples_max) halve();
    time_.push_back(time);
    settling_.push_back(settling);
    fastest_.push_back(fastest);
  }
  const std::vector<double>& time() const { return time_; }
  const std::vector<double>& settling() const { return settling_; }
  const std::vector<double>& fastest() const { return fastest_; }

 private:
  static constexpr std::size_t samples_max = std::size_t{1} << 18;
  void halve() {
    for (auto* curve : {&time_, &settling_, &fastest_}) {
      for (std::size_t k = 0; 2 * k < curve->size(); ++k) (*curve)[k] = (*curve)[2 * k];
      curve->resize((curve->size() + 1) / 2);
    }
    every_ *= 2;
  }
  std::uint64_t count_ = 0, every_ = 1;
  std::vector<double> time_, settling_, fastest_;
};

constexpr double rest_speed = 1e-3;  // [m/s]

class Walk {
 public:
  Walk(const io::LogReader& log, const core::Scenario& scenario, const AnalysisRequest& request,
       const RowSink& sink)
      : log_(log), scenario_(scenario), request_(request), sink_(sink),
        schema_(log.genesis().schema), contacts_(schema_, "contacts"), work_(schema_, "work") {
    const auto dimension = static_cast<std::size_t>(scenario.domain.dimension);
    now_.grains.dimension = dimension;
    now_.gravity.assign(3, 0.0);
    now_.down.assign(3, 0.0);
    now_.period.assign(3, 0.0);
    now_.points = request.points;
    now_.fluid.dimension = dimension;
    now_.fluid.smoothing_length = core::smoothing_length(scenario);
    now_.fluid.kernel = scenario.fluid.kernel;
    for (const Observable* table : request.tables) needs_forces_ |= table->forces;
    if (dimension == 2)
      set_directions(core::constants_of<2>(scenario));
    else
      set_directions(core::constants_of<3>(scenario));
  }

  AnalysisSummary run() {
    AnalysisSummary& s = summary_;
    s.stride = request_.range.stride;
    for (const Observable* table : request_.tables) sink_(*table, table->columns(scenario_));
    log_.for_each(request_.range.first, request_.range.last,
                  [&](const io::StepHeader& header, const io::Frame* frame) {
                    take(header, frame);
                    return true;
                  });
    if (s.states == 0)
      throw UsageError(fmt::format(
          "{}: no state of steps {} to {} is stored; observables need recorded states (tier "
          "deltas), or a range with keyframes",
          log_.path(), request_.range.first, request_.range.last));
    summarize();
    return s;
  }

 private:
  template <class Constants>
  void set_directions(const Constants& c) {
    double g2 = 0;
    for (int k = 0; k < static_cast<int>(now_.grains.dimension); ++k) {
      now_.gravity[static_cast<std::size_t>(k)] = c.gravity[k];
      now_.period[static_cast<std::size_t>(k)] = c.period.length[k];
      g2 += c.gravity[k] * c.gravity[k];
    }
    for (std::size_t k = 0; k < 3; ++k)
      now_.down[k] = g2 > 0 ? now_.gravity[k] / std::sqrt(g2) : (k == 1 ? -1.0 : 0.0);
    for (std::size_t k = 0; k < 3; ++k) now_.fluid.period[k] = now_.period[k];
    // In the excess form the fluid carries its share of a grain's weight before any motion.
    if (c.coupled && !c.full_pressure)
      for (double& each : now_.gravity)
        each *= 1 - scenario_.fluid.density / scenario_.grains.density;
  }

  void take(const io::StepHeader& header, const io::Frame* frame) {
    now_.step = header.step;
    now_.time = header.time;
    now_.dt = header.dt;
    const bool due = (header.step - request_.range.first) % request_.range.stride == 0;
    if (summary_.states == 0 && frame) summary_.first_step = header.step;
    if (frame)
      take_contacts(*frame);
    else if (const auto tables = log_.tables(header.step))
      take_contacts(*tables);
    if (frame && due) take_state(*frame);
    for (const Observable* table : request_.tables) {
      if (!table->every_step && !(frame && due)) continue;
      table->rows(scenario_, now_,
                  [&](std::vector<std::string> row) { sink_(*table, row); });
    }
  }

  void take_contacts(const io::Frame& frame) {
    now_.contacts = contact_rows(contacts_, frame, now_.grains.dimension);
    const core::ContactTotals totals = core::contact_totals(now_.contacts);
    now_.normal_loss += totals.normal_loss;
    now_.tangential_loss += totals.tangential_loss;
    now_.friction_loss += totals.friction_loss;
    now_.drag_work = now_.hydrodynamic_work = 0;
    if (work_.rows(frame) > 0) {
      now_.drag_work = work_.at<double>(frame, "drag_on_grains", 0);
      now_.hydrodynamic_work = work_.at<double>(frame, "hydrodynamic_on_grains", 0);
    }
    now_.total_drag_work += now_.drag_work;
    now_.total_hydrodynamic_work += now_.hydrodynamic_work;
    now_.hits = hits_.take(now_.time, now_.contacts);
    AnalysisSummary& s = summary_;
    for (const core::ContactRow& row : now_.contacts) {
      if (!s.first_contact) s.first_contact = now_.time;
      if (row.kind == 1 && row.partner == core::wall_bottom && !s.first_floor_contact)
        s.first_floor_contact = now_.time;
      if (row.begin) ++(row.kind == 0 ? s.collisions : s.wall_collisions);
      if (row.peak_force > s.peak_force) {
        s.peak_force = row.peak_force;
        s.peak_force_time = now_.time;
      }
    }
    for (const core::WallHit& hit : now_.hits)
      if (hit.impact_speed > rest_speed) restitutions_.push_back(hit.restitution);
    s.wall_hits += now_.hits.size();
  }

  void take_state(const io::Frame& frame) {
    id_ = ids(schema_, frame, "grains.id");
    position_ = reals(schema_, frame, "grains.position");
    velocity_ = reals(schema_, frame, "grains.velocity");
    spin_ = reals(schema_, frame, "grains.spin");
    const double d = scenario_.grains.diameter;
    constexpr double pi = 3.14159265358979323846;
    const double volume =
        now_.grains.dimension == 2 ? 0.25 * pi * d * d : pi * d * d * d / 6;
    radius_.assign(id_.size(), 0.5 * d);
    mass_.assign(id_.size(), scenario_.grains.density * volume);
    core::GrainView& g = now_.grains;
    g.id = id_;
    g.position = position_;
    g.velocity = velocity_;
    g.spin = spin_;
    g.radius = radius_;
    g.mass = mass_;
    take_fluid(frame);
    AnalysisSummary& s = summary_;
    if (s.states == 0) s.first_time = now_.time;
    ++s.states;
    s.last_step = now_.step;
    s.last_time = now_.time;
    s.grains = std::max(s.grains, id_.size());
    if (id_.empty()) return;
    const core::GroupMotion group = core::group_motion(g, now_.down);
    curves_.take(now_.time, group.settling_speed, group.max_speed);
    if (s.states == 1 || group.settling_speed > s.peak_speed) {
      s.peak_speed = group.settling_speed;
      s.peak_time = now_.time;
    }
  }

  void take_fluid(const io::Frame& frame) {
    fluid_position_ = reals(schema_, frame, "fluid.position");
    fluid_velocity_ = reals(schema_, frame, "fluid.velocity");
    fluid_volume_ = reals(schema_, frame, "fluid.mass");
    const std::vector<double> rhob = reals(schema_, frame, "fluid.superficial_density");
    now_.fluid_kinetic = 0;
    for (std::size_t k = 0; k < fluid_velocity_.size(); ++k)
      now_.fluid_kinetic += 0.5 * fluid_volume_[k / now_.fluid.dimension] * fluid_velocity_[k] *
                            fluid_velocity_[k];
    for (std::size_t a = 0; a < rhob.size(); ++a) fluid_volume_[a] /= rhob[a];
    pressure_.clear();
    if (needs_forces_) {
      if (!engine_) engine_ = SimulationEngine::of_genesis(log_.genesis(), log_.path(), {});
      engine_->restore(frame.view());
      engine_->evaluate();
      now_.forces = engine_->simulation().grain_reports();
      pressure_ = engine_->simulation().fluid_report().pressure;
    }
    now_.fluid.position = fluid_position_;
    now_.fluid.velocity = fluid_velocity_;
    now_.fluid.volume = fluid_volume_;
    now_.fluid.pressure = pressure_;
  }

  void summarize() {
    AnalysisSummary& s = summary_;
    s.normal_loss = now_.normal_loss;
    s.tangential_loss = now_.tangential_loss;
    s.friction_loss = now_.friction_loss;
    s.restitution = core::spread_of(restitutions_);
    if (curves_.time().empty()) return;
    double from, to;
    if (request_.window) {
      std::tie(from, to) = *request_.window;
      s.window_rule = "as asked";
    } else {
      to = s.first_floor_contact.value_or(s.last_time);
      from = 0.5 * (s.first_time + to);
      s.window_rule = s.first_floor_contact
                          ? "second half of the time to the first contact with the floor"
                          : "second half of the run";
    }
    s.settling = core::window_of(curves_.time(), curves_.settling(), from, to);
    if (s.settling) {
      s.acceleration_time =
          core::rise_time(curves_.time(), curves_.settling(), s.settling->mean, 0.95);
      take_turns(from, to);
    }
    s.rest_time = core::rest_time(curves_.time(), curves_.fastest(), rest_speed);
  }

  void take_turns(double from, double to) {
    std::vector<double> t, v;
    for (std::size_t k = 0; k < curves_.time().size(); ++k)
      if (curves_.time()[k] >= from && curves_.time()[k] <= to) {
        t.push_back(curves_.time()[k]);
        v.push_back(curves_.settling()[k]);
      }
    // Turns smaller than a hundredth of the speed are the fluid's noise.
    summary_.turns = core::turning_points(t, v, 0.01 * std::abs(summary_.settling->mean));
    summary_.oscillation = core::oscillation_of(summary_.turns);
  }

  const io::LogReader& log_;
  const core::Scenario& scenario_;
  const AnalysisRequest& request_;
  const RowSink& sink_;
  const io::Schema& schema_;
  TableReader contacts_, work_;
  ObservedStep now_;
  AnalysisSummary summary_;
  Curves curves_;
  core::WallHits hits_;
  std::vector<double> restitutions_;
  std::vector<std::uint64_t> id_;
  std::vector<double> position_, velocity_, spin_, radius_, mass_;
  std::vector<double> fluid_position_, fluid_velocity_, fluid_volume_, pressure_;
  std::unique_ptr<SimulationEngine> engine_;
  bool needs_forces_ = false;
};

}  // namespace

AnalysisSummary analyze(const io::LogReader& log, const core::Scenario& scenario,
                        const AnalysisRequest& request, const RowSink& sink) {
  return Walk(log, scenario, request, sink).run();
}

}  // namespace varve::tools
