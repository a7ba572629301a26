#include "tools/analysis.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <tuple>

#include <fmt/format.h>

#include "core/constants.h"
#include "core/criteria.h"
#include "core/walls.h"
#include "io/errors.h"
#include "tools/analysis_scalars.h"
#include "tools/analysis_state.h"
#include "tools/cli.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

/// Curves that the summary is made of. When they are full, every second sample goes and from then
/// on every second one is taken: memory does not grow with the log.
class Curves {
 public:
  void take(double time, double settling, double fastest) {
    curves_.take(time, {settling, fastest});
  }
  const std::vector<double>& time() const { return curves_.time(); }
  const std::vector<double>& settling() const { return curves_.curve(0); }
  const std::vector<double>& fastest() const { return curves_.curve(1); }

 private:
  CurveSet curves_{2, std::size_t{1} << 18};
};

constexpr double rest_speed = 1e-3;  // [m/s]
/// Grains whose surfaces are at most this many diameters apart belong to one cluster.
constexpr double cluster_link = 0.5;
constexpr std::uint64_t never = ~std::uint64_t{0};

/// Where a change of the width put the walls.
struct MovedWalls {
  std::uint64_t step;
  double left, width;
};
std::vector<MovedWalls> moved_walls(const io::LogReader& log) {
  std::vector<MovedWalls> moves;
  for (const io::Event& event : log.events()) {
    if (event.kind != "walls") continue;
    MovedWalls move{event.step, 0, 0};
    for (const auto& [key, value] : event.items) {
      double number = 0;
      std::from_chars(value.data(), value.data() + value.size(), number);
      if (key == "left") move.left = number;
      if (key == "width") move.width = number;
    }
    if (move.width > 0) moves.push_back(move);
  }
  return moves;
}

/// What the walk needs of the constants of a run, whatever its dimension.
struct Species {
  std::vector<double> radius, mass, inertia;
  std::vector<std::vector<double>> weight;  // [N] components
  std::vector<double> down, period;
};
template <int D>
Species species_of(const core::Scenario& scenario) {
  const core::Constants<D> c = core::constants_of<D>(scenario);
  Species all;
  for (const core::SpeciesConstants<D>& one : c.species) {
    all.radius.push_back(one.radius);
    all.mass.push_back(one.mass);
    all.inertia.push_back(one.inertia);
    all.weight.emplace_back(one.weight.data(), one.weight.data() + D);
  }
  all.down.assign(3, 0.0);
  all.period.assign(3, 0.0);
  double g2 = 0;
  for (int k = 0; k < D; ++k) {
    all.period[static_cast<std::size_t>(k)] = c.period.length[k];
    g2 += c.gravity[k] * c.gravity[k];
  }
  for (int k = 0; k < D; ++k)
    all.down[static_cast<std::size_t>(k)] =
        g2 > 0 ? c.gravity[k] / std::sqrt(g2) : (k == 1 ? -1.0 : 0.0);
  return all;
}

class Walk {
 public:
  Walk(const io::LogReader& log, const core::Scenario& scenario, const AnalysisRequest& request,
       const RowSink& sink)
      : log_(log), scenario_(scenario), request_(request), sink_(sink),
        schema_(log.genesis().schema), contacts_(schema_, "contacts"), work_(schema_, "work"),
        species_(scenario.domain.dimension == 2 ? species_of<2>(scenario)
                                                : species_of<3>(scenario)),
        moves_(moved_walls(log)), scalars_(scenario) {
    const auto dimension = static_cast<std::size_t>(scenario.domain.dimension);
    now_.grains.dimension = dimension;
    now_.down = species_.down;
    now_.period = species_.period;
    now_.walls = scenario.domain;
    now_.points = request.points;
    now_.fluid.dimension = dimension;
    now_.fluid.smoothing_length = scenario.has_fluid() ? core::smoothing_length(scenario) : 0;
    now_.fluid.kernel = scenario.fluid.kernel;
    for (std::size_t k = 0; k < 3; ++k) now_.fluid.period[k] = now_.period[k];
    needs_fluid_ = needs_lattice_ = request.pictures;
    for (const Observable* table : request.tables) {
      needs_fluid_ = needs_fluid_ || table->needs != Needs::grains;
      needs_forces_ = needs_forces_ || table->needs == Needs::forces;
      needs_lattice_ = needs_lattice_ || table->lattice;
    }
    rule_ = request.fluid.value_or(FluidSteps{
        needs_fluid_ ? FluidSteps::Rule::as_range : FluidSteps::Rule::keyframes, 1});
    evaluates_scalars_ = log.genesis().engine_revision == core::engine_revision;
  }

  AnalysisSummary run() {
    AnalysisSummary& s = summary_;
    s.stride = request_.range.stride;
    for (const Observable* table : request_.tables) sink_(*table, table->columns(scenario_));
    io::StatePart part;
    part.populations = {"grains", "contacts"};
    part.keyframes = rule_.rule == FluidSteps::Rule::keyframes;
    part.next_whole = [this](std::uint64_t step) { return next_whole(step); };
    log_.for_each_part(request_.range.first, request_.range.last, part,
                       [&](const io::StepHeader& header, const io::Frame* frame, bool whole) {
                         take(header, frame, whole);
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
  std::uint64_t whole_stride() const {
    switch (rule_.rule) {
      case FluidSteps::Rule::as_range: return request_.range.stride;
      case FluidSteps::Rule::every: return rule_.every;
      case FluidSteps::Rule::keyframes: break;
    }
    return never;
  }
  std::optional<std::uint64_t> next_whole(std::uint64_t step) const {
    const StepRange& r = request_.range;
    const std::uint64_t stride = whole_stride();
    // Between keyframes only the last state is wanted.
    if (stride == never)
      return step <= r.last ? std::optional(r.last) : std::nullopt;
    const std::uint64_t past = (step - r.first) % stride;
    return past == 0 ? step : step + (stride - past);
  }

  void take(const io::StepHeader& header, const io::Frame* frame, bool whole) {
    now_.step = header.step;
    now_.time = header.time;
    now_.dt = header.dt;
    for (; moves_taken_ < moves_.size() && moves_[moves_taken_].step <= header.step;
         ++moves_taken_) {
      now_.walls.left = moves_[moves_taken_].left;
      now_.walls.width = moves_[moves_taken_].width;
    }
    const bool due = (header.step - request_.range.first) % request_.range.stride == 0;
    if (summary_.states == 0 && frame) summary_.first_step = header.step;
    if (frame)
      take_contacts(*frame);
    else if (const auto tables = log_.tables(header.step))
      take_contacts(*tables);
    const bool taken = frame && (due || whole);
    if (taken) take_state(*frame, due, whole);
    for (const Observable* table : request_.tables) {
      const bool ready = table->needs == Needs::grains ? frame && due
                         : table->needs == Needs::fluid ? taken && whole
                                                        : taken && whole && evaluated_;
      if (!ready && !table->every_step) continue;
      table->rows(scenario_, now_,
                  [&](std::vector<std::string> row) { sink_(*table, row); });
    }
    if (taken && request_.on_state) request_.on_state(scenario_, now_, whole);
  }

  void take_contacts(const io::Frame& frame) {
    now_.contacts = contact_rows(contacts_, frame, now_.grains.dimension);
    double at_walls = 0, normal = 0, tangential = 0, friction = 0;
    for (const core::ContactRow& row : now_.contacts) {
      normal += row.normal_loss;
      tangential += row.tangential_loss;
      friction += row.friction_loss;
      if (row.kind == 1) at_walls += row.normal_loss + row.tangential_loss + row.friction_loss;
    }
    now_.normal_loss += normal;
    now_.tangential_loss += tangential;
    now_.friction_loss += friction;
    budget_.take_contacts(normal, tangential, friction, at_walls);
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
    scalars_.take_step(now_);
  }

  void take_grains(const io::Frame& frame) {
    id_ = wholes(schema_, frame, "grains.id");
    position_ = reals(schema_, frame, "grains.position");
    velocity_ = reals(schema_, frame, "grains.velocity");
    spin_ = reals(schema_, frame, "grains.spin");
    const std::vector<std::uint64_t> kinds = wholes(schema_, frame, "grains.species");
    radius_.clear();
    mass_.clear();
    now_.weights.clear();
    for (const std::uint64_t each : kinds) {
      const auto kind = static_cast<std::size_t>(each);
      radius_.push_back(species_.radius.at(kind));
      mass_.push_back(species_.mass.at(kind));
      const std::vector<double>& weight = species_.weight[kind];
      now_.weights.insert(now_.weights.end(), weight.begin(), weight.end());
    }
    core::GrainView& g = now_.grains;
    g.id = id_;
    g.position = position_;
    g.velocity = velocity_;
    g.spin = spin_;
    g.radius = radius_;
    g.mass = mass_;
  }

  void take_network() {
    const core::GrainView& g = now_.grains;
    now_.group = core::group_motion(g, now_.down);
    now_.links = core::contact_links(g, now_.contacts, now_.dt, now_.walls, now_.period);
    now_.stresses = core::grain_stresses(g, now_.links);
    now_.chains = core::force_chains(g.size(), now_.links);
    now_.clusters = core::clusters_of(g, cluster_link * scenario_.grains.diameter, now_.period);
    now_.departures = departures_.take(g, now_.clusters);
    now_.apart = departures_.apart();
  }

  void take_state(const io::Frame& frame, bool due, bool whole) {
    take_grains(frame);
    if (due) take_network();
    else now_.group = core::group_motion(now_.grains, now_.down);
    if (whole) take_fluid(frame);
    AnalysisSummary& s = summary_;
    if (!due) return;
    if (s.states == 0) s.first_time = now_.time;
    ++s.states;
    s.last_step = now_.step;
    s.last_time = now_.time;
    s.grains = std::max(s.grains, id_.size());
    scalars_.take_grains(now_);
    if (id_.empty()) return;
    curves_.take(now_.time, now_.group.settling_speed, now_.group.max_speed);
    if (s.states == 1 || now_.group.settling_speed > s.peak_speed) {
      s.peak_speed = now_.group.settling_speed;
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
    superficial_volume_ = fluid_volume_;
    for (std::size_t a = 0; a < rhob.size(); ++a) {
      superficial_volume_[a] /= scenario_.fluid.density;
      fluid_volume_[a] /= rhob[a];
    }
    // Numbers of the run rest on states that far apart where only tables ask for more.
    const bool sampled = request_.fluid || now_.step >= next_sample_ ||
                         now_.step == request_.range.last;
    if (sampled) next_sample_ = now_.step + log_.genesis().keyframe_steps;
    pressure_.clear();
    evaluated_ = (needs_forces_ || (sampled && evaluates_scalars_)) && evaluate(frame);
    now_.fluid.position = fluid_position_;
    now_.fluid.velocity = fluid_velocity_;
    now_.fluid.volume = fluid_volume_;
    now_.fluid.pressure = pressure_;
    now_.superficial = now_.fluid;
    now_.superficial.volume = superficial_volume_;
    const bool looks = scenario_.has_fluid() && (sampled || needs_lattice_);
    now_.lattice = {};
    now_.beneath.reset();
    now_.above.reset();
    if (looks) look_at_flow();
    if (sampled || evaluated_) scalars_.take_fluid(now_, evaluated_, clamps_);
  }

  void look_at_flow() {
    const double spacing = scenario_.fluid.spacing;
    now_.lattice = core::flow_lattice(now_.fluid, now_.walls, spacing);
    now_.features = core::flow_features(
        now_.lattice, std::min(2 * scenario_.grains.diameter, now_.walls.width / 8));
    const core::GrainView& g = now_.grains;
    if (g.size() == 0) return;
    const std::size_t d = g.dimension;
    double from = g.position[0], to = from;
    for (std::size_t i = 0; i < g.size(); ++i) {
      from = std::min(from, g.position[i * d] - g.radius[i]);
      to = std::max(to, g.position[i * d] + g.radius[i]);
    }
    now_.through = core::flow_through(now_.superficial, now_.walls, spacing,
                                      now_.group.centroid[1], from, to,
                                      now_.group.mean_velocity[1]);
    std::vector<double> places;
    for (const double y : {now_.group.lowest - scenario_.grains.diameter,
                           now_.group.highest + scenario_.grains.diameter}) {
      places.push_back(now_.group.centroid[0]);
      places.push_back(y);
      if (d == 3) places.push_back(now_.group.centroid[2]);
    }
    const std::vector<core::FluidAtPoint> at = core::sample_fluid(now_.fluid, places);
    now_.beneath = at[0];
    now_.above = at[1];
  }

  /// Forces at the state; false where a guard of the engine stops them (the last state of a run
  /// that failed).
  bool evaluate(const io::Frame& frame) {
    if (!engine_) engine_ = SimulationEngine::of_genesis(log_.genesis(), log_.path(), {});
    try {
      engine_->revisit(frame.view());
      clamps_ = engine_->simulation().counters();
      engine_->evaluate();
    } catch (const EngineFailure&) {
      now_.forces.clear();
      return false;
    }
    const core::Simulation& simulation = engine_->simulation();
    const core::Counters& after = simulation.counters();
    clamps_.porosity_clamps = after.porosity_clamps - clamps_.porosity_clamps;
    clamps_.drag_porosity_clamps = after.drag_porosity_clamps - clamps_.drag_porosity_clamps;
    clamps_.weak_coupling = after.weak_coupling - clamps_.weak_coupling;
    now_.forces = simulation.grain_reports();
    pressure_ = simulation.fluid_report().pressure;
    now_.balance = simulation.balance();
    now_.budget = budget_.take(now_.step, now_.time, simulation.clock().dt, now_.balance,
                               now_.grains, energy(), now_.weights);
    return true;
  }

  core::GrainEnergy energy() const {
    return core::grain_energy(now_.grains, now_.grains.dimension == 2 ? 0.5 : 0.4,
                              std::vector<double>(now_.grains.dimension, 0.0));
  }

  void summarize() {
    AnalysisSummary& s = summary_;
    s.normal_loss = now_.normal_loss;
    s.tangential_loss = now_.tangential_loss;
    s.friction_loss = now_.friction_loss;
    s.restitution = core::spread_of(restitutions_);
    double from = s.first_time, to = s.last_time;
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
    if (!curves_.time().empty()) {
      s.settling = core::window_of(curves_.time(), curves_.settling(), from, to);
      if (s.settling) {
        s.acceleration_time =
            core::rise_time(curves_.time(), curves_.settling(), s.settling->mean, 0.95);
        take_turns(from, to);
      }
      s.rest_time = core::rest_time(curves_.time(), curves_.fastest(), rest_speed);
    }
    s.scalars = scalars_.finish(s, from, to);
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
  Species species_;
  std::vector<MovedWalls> moves_;
  std::size_t moves_taken_ = 0;
  ScalarCollector scalars_;
  ObservedStep now_;
  AnalysisSummary summary_;
  Curves curves_;
  EnergyBudget budget_;
  core::WallHits hits_;
  core::Departures departures_;
  std::vector<double> restitutions_;
  std::vector<std::uint64_t> id_;
  std::vector<double> position_, velocity_, spin_, radius_, mass_;
  std::vector<double> fluid_position_, fluid_velocity_, fluid_volume_, superficial_volume_,
      pressure_;
  std::unique_ptr<SimulationEngine> engine_;
  core::Counters clamps_;
  FluidSteps rule_;
  std::uint64_t next_sample_ = 0;
  bool needs_fluid_ = false, needs_forces_ = false, needs_lattice_ = false;
  bool evaluates_scalars_ = false, evaluated_ = false;
};

}  // namespace

AnalysisSummary analyze(const io::LogReader& log, const core::Scenario& scenario,
                        const AnalysisRequest& request, const RowSink& sink) {
  return Walk(log, scenario, request, sink).run();
}

}  // namespace varve::tools
