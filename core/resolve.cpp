// A scenario as written becomes one without anything left open, or a list of what makes no sense.
#include <algorithm>
#include <cmath>

#include "core/criteria.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/parameters.h"
#include "core/resolve_grains.h"

namespace varve::core {
namespace {

// Far above what one machine holds; a slip of the unit is caught before memory is asked for.
constexpr double particles_max = 1e8;
constexpr std::int64_t substeps_max = 1'000'000;
constexpr double rounding = 1e-9;

class Resolver {
 public:
  explicit Resolver(Scenario& scenario) : s_(scenario) {}

  std::vector<Problem> run() {
    if (!check_table() || !check_extent()) return std::move(problems_);
    resolve_fluid();
    resolve_grains(s_, problems_);
    resolve_coupling();
    check_periodic();
    if (problems_.empty()) resolve_sound_speed();
    if (problems_.empty()) resolve_step();
    if (problems_.empty()) resolve_changes();
    return std::move(problems_);
  }

 private:
  void problem(std::string key, std::string text) {
    problems_.push_back({std::move(key), std::move(text)});
  }

  /// Values set by a program rather than by text obey the same ranges.
  bool check_table() {
    for (const Parameter& parameter : parameters()) {
      if (const auto* real = std::get_if<Parameter::Real>(&parameter.access)) {
        const double value = (*real)(s_);
        if (std::isnan(value)) continue;
        const bool above = parameter.lowest_open ? value > parameter.lowest
                                                 : value >= parameter.lowest;
        if (above && value <= parameter.highest) continue;
      } else if (const auto* whole = std::get_if<Parameter::Integer>(&parameter.access)) {
        const double value = static_cast<double>((*whole)(s_));
        if (value >= parameter.lowest && value <= parameter.highest) continue;
      } else {
        continue;
      }
      problem(std::string(parameter.key), get_parameter(s_, parameter) +
                                              " is out of range; expected " +
                                              expected_text(parameter));
    }
    return problems_.empty();
  }

  bool check_extent() {
    if (std::isnan(s_.domain.width))
      problem("domain.width", "missing; expected a length > 0, such as '6 cm'");
    if (std::isnan(s_.domain.height))
      problem("domain.height", "missing; expected a length > 0, such as '12 cm'");
    if (s_.domain.dimension == 3)
      check_solid();
    else
      check_flat();
    if (!s_.has_fluid() && !s_.has_grains())
      problem("fluid.present", "neither fluid nor grains: there is nothing to simulate");
    const bool bottom = s_.domain.bottom == Boundary::periodic;
    const bool top = s_.domain.top == Boundary::periodic;
    if (bottom != top)
      problem(bottom ? "domain.bottom" : "domain.top",
              "periodic on one side only; bottom and top must both be periodic");
    const auto check_speed = [&](const char* key, double speed, Boundary wall, const char* side) {
      if (speed != 0 && wall != Boundary::no_slip)
        problem(key, number_text(speed) + " m/s moves nothing: " + side +
                         " is not no_slip; expected 0, or " + side + " = no_slip");
    };
    check_speed("domain.lid_speed", s_.domain.lid_speed, s_.domain.top, "domain.top");
    check_speed("domain.floor_speed", s_.domain.floor_speed, s_.domain.bottom, "domain.bottom");
    return problems_.empty();
  }

  /// What only three dimensions have.
  void check_flat() {
    const auto absent = [&](bool given, const char* key, const char* expected) {
      if (given)
        problem(key, "has no meaning in 2D, where all is per metre of depth; expected " +
                         std::string(expected) + ", or domain.dimension = 3");
    };
    absent(s_.domain.shape == Shape::pipe, "domain.shape", "box");
    absent(!std::isnan(s_.domain.depth), "domain.depth", "auto");
    absent(s_.domain.faces != Boundary::no_slip, "domain.faces", "no_slip");
    absent(s_.fluid.body_force_z != 0, "fluid.body_force_z", "0");
    absent(s_.grains.layers != 1, "grains.layers", "1");
    absent(!std::isnan(s_.grains.centre_z), "grains.centre_z", "auto");
    absent(s_.grains.velocity_z != 0, "grains.velocity_z", "0");
  }

  void check_solid() {
    Domain& d = s_.domain;
    if (d.shape == Shape::box) {
      if (std::isnan(d.depth))
        problem("domain.depth", "missing; expected a length > 0, such as '2 cm'");
      return;
    }
    if (std::isnan(d.depth)) d.depth = d.width;
    if (d.depth != d.width)
      problem("domain.depth", number_text(d.depth) +
                                  " m: a pipe is as deep as it is wide; expected auto or " +
                                  number_text(d.width) + " m (domain.width)");
    if (d.sides == Boundary::periodic)
      problem("domain.sides", "the side of a pipe is a wall; expected no_slip or free_slip");
    if (d.faces != Boundary::no_slip)
      problem("domain.faces", "a pipe has none: domain.sides is its wall; expected no_slip");
  }

  /// An extent filled by the lattice must hold a whole number of spacings.
  void check_lattice(const std::string& key, double extent) {
    const double exact = extent / s_.fluid.spacing;
    if (exact > particles_max) {
      problem("fluid.spacing", number_text(s_.fluid.spacing) + " m needs " + rough_number(exact) +
                                   " particles along " + key + "; at most " +
                                   rough_number(particles_max) + " in all are possible");
      return;
    }
    const double whole = std::floor(exact + 0.5);
    if (whole >= 1 && std::abs(exact - whole) <= 1e-6) return;
    const double below = std::max(1.0, std::floor(exact)), above = std::floor(exact) + 1;
    std::string nearest = rough_number(above * s_.fluid.spacing) + " m";
    if (below != above) nearest = rough_number(below * s_.fluid.spacing) + " m or " + nearest;
    problem(key, number_text(extent) + " m is not a whole number of spacings of " +
                     number_text(s_.fluid.spacing) + " m; nearest: " + nearest +
                     " (or change fluid.spacing)");
  }

  /// The largest spacing by fluid.resolution that divides the extents which the lattice fills.
  void resolve_spacing() {
    if (!std::isnan(s_.fluid.spacing)) return;
    const bool solid = s_.domain.dimension == 3;
    double extents[] = {s_.fluid.level, solid ? s_.domain.depth : s_.domain.width,
                        std::isnan(s_.fluid.width) ? s_.domain.width : s_.fluid.width};
    double size = s_.grains.diameter;
    if (!s_.has_grains()) {
      size = std::min(s_.domain.width, s_.domain.height) / 16;
      if (solid) size = std::min(size, s_.domain.depth / 16);
    }
    const double fewest = std::ceil(s_.domain.width * s_.fluid.resolution / size - rounding);
    for (double n = std::max(1.0, fewest); n <= 4 * fewest && n < particles_max; ++n) {
      const double spacing = s_.domain.width / n;
      bool fits = true;
      for (const double extent : extents) {
        const double exact = extent / spacing;
        fits = fits && std::abs(exact - std::floor(exact + 0.5)) <= 1e-6;
      }
      if (!fits) continue;
      s_.fluid.spacing = spacing;
      return;
    }
    problem("fluid.spacing", "auto finds none near " + rough_number(size / s_.fluid.resolution) +
                                 " m (fluid.resolution) that divides the domain; give a value");
    s_.fluid.spacing = size / s_.fluid.resolution;
  }

  void resolve_fluid() {
    if (!s_.has_fluid()) {
      if (std::isnan(s_.fluid.spacing)) s_.fluid.spacing = Fluid{}.spacing;
      return;
    }
    if (std::isnan(s_.fluid.level)) s_.fluid.level = s_.domain.height;
    resolve_spacing();
    if (!problems_.empty()) return;
    if (s_.fluid.level > s_.domain.height * (1 + rounding))
      problem("fluid.level", number_text(s_.fluid.level) +
                                 " m is above the domain; largest value " +
                                 number_text(s_.domain.height) + " m (domain.height)");
    if (s_.domain.top == Boundary::periodic && s_.fluid.level < s_.domain.height)
      problem("fluid.level", "bottom and top are periodic: the domain must be full; expected " +
                                 number_text(s_.domain.height) + " m or auto");
    resolve_column();
    check_lattice("domain.width", s_.domain.width);
    check_lattice(s_.fluid.level == s_.domain.height ? "domain.height" : "fluid.level",
                  s_.fluid.level);
    double particles =
        (s_.domain.width / s_.fluid.spacing) * (s_.fluid.level / s_.fluid.spacing);
    if (s_.domain.dimension == 3) {
      check_lattice("domain.depth", s_.domain.depth);
      particles *= s_.domain.depth / s_.fluid.spacing;
    }
    check_initial_flow();
    if (problems_.empty() && particles > particles_max)
      problem("fluid.spacing", number_text(s_.fluid.spacing) + " m makes " +
                                   rough_number(particles) + " fluid particles; at most " +
                                   rough_number(particles_max) + " are possible");
    resolve_pressure();
    check_shifting();
  }

  /// Shifting sees a free surface as a hole to fill, and corrected gradients have no counterpart in
  /// the grains' part of the pressure work (core/coupling.h).
  void check_shifting() {
    if (!(s_.fluid.shifting > 0)) return;
    if (has_free_surface(s_))
      problem("fluid.shifting", number_text(s_.fluid.shifting) +
                                    ": this fluid has a free surface, off which it would be "
                                    "shifted; expected 0, or a closed, full or periodic domain");
    if (s_.is_coupled() && s_.coupling.mode == CouplingMode::two_way)
      problem("fluid.shifting", number_text(s_.fluid.shifting) +
                                    ": its gradients leave out the pressure that grains take in "
                                    "two-way coupling; expected 0, or coupling.mode = one_way");
  }

  /// A column of fluid that does not reach the right wall.
  void resolve_column() {
    double& width = s_.fluid.width;
    if (std::isnan(width)) return;
    if (width > s_.domain.width * (1 + rounding))
      problem("fluid.width", number_text(width) + " m is wider than the domain; largest value " +
                                 number_text(s_.domain.width) + " m (domain.width)");
    // The whole width is no width of its own: the domain's may change later.
    if (width >= s_.domain.width * (1 - rounding)) {
      width = automatic;
      return;
    }
    check_lattice("fluid.width", width);
    if (s_.domain.sides == Boundary::periodic || s_.domain.shape == Shape::pipe)
      problem("fluid.width", "a column stands against the left wall of a box; expected auto");
  }

  void check_initial_flow() {
    const Domain& d = s_.domain;
    if (s_.fluid.initial == InitialFlow::shear && d.bottom == Boundary::periodic)
      problem("fluid.initial", "'shear' jumps where bottom meets top, which are periodic; expected "
                               "walls there, or another flow");
    if (s_.fluid.initial != InitialFlow::taylor_green) return;
    const auto check = [&](const char* key, Boundary side) {
      if (side == Boundary::no_slip || side == Boundary::free)
        problem(key, "fluid.initial = taylor_green slides along this side; expected periodic or "
                     "free_slip");
    };
    if (d.dimension == 3 && d.shape == Shape::pipe)
      problem("domain.shape", "fluid.initial = taylor_green needs a box");
    check("domain.sides", d.sides);
    check("domain.bottom", d.bottom);
    check("domain.top", d.top);
    if (d.dimension == 3) check("domain.faces", d.faces);
    if (has_free_surface(s_))
      problem("fluid.level", "fluid.initial = taylor_green fills the domain; expected auto");
  }

  void resolve_pressure() {
    const bool open = has_free_surface(s_);
    PressureForm& form = s_.fluid.pressure;
    if (form == PressureForm::automatic) form = open ? PressureForm::full : PressureForm::excess;
    if (form == PressureForm::excess && open)
      problem("fluid.pressure",
              "'excess' needs a closed, full or periodic domain, and this one has a free surface, "
              "where the full pressure must vanish; expected full or auto");
    if (form == PressureForm::full && s_.domain.bottom == Boundary::periodic &&
        s_.gravity.magnitude > 0)
      problem("fluid.pressure",
              "'full' with periodic bottom and top: nothing would hold the fluid against gravity; "
              "expected excess or auto");
  }

  void resolve_coupling() {
    const bool flat = s_.domain.dimension == 2;
    if (std::isnan(s_.coupling.porosity_floor)) s_.coupling.porosity_floor = flat ? 0.30 : 0.25;
    if (std::isnan(s_.coupling.length)) s_.coupling.length = largest_diameter(s_);
    if (!s_.is_coupled()) return;
    if (!flat && s_.coupling.drag == Drag::cylinder)
      problem("coupling.drag", "'cylinder' is a law for discs; expected another one in 3D");
    check_self_disturbance();
    // Porosity at the centre of a lone grain is 1 - V W(0): it must stay positive.
    constexpr Kernel widest = Kernel::wendland_c2;
    const double d = largest_diameter(s_);
    const double own = grain_volume(s_, {"", d, 0, 0});
    double least = std::sqrt(kernel_sigma<2, widest>() * own);
    if (!flat) {
      const double volume = kernel_sigma<3, widest>() * own;
      least = d;  // cube root by Newton's iteration, from above
      for (int i = 0; i < 60; ++i) least -= (least - volume / (least * least)) / 3;
    }
    if (s_.coupling.length <= least)
      problem("coupling.length",
              number_text(s_.coupling.length) + " m is " + rough_number(s_.coupling.length / d) +
                  " d: the porosity inside a grain would not be positive; smallest safe value " +
                  number_above(least * 1.001) + " m");
  }

  /// E11b is for the flow around a sphere, which falls off with distance, and for slips that the
  /// sphere leaves more than a third of.
  void check_self_disturbance() {
    if (!s_.coupling.self_disturbance) return;
    constexpr double factor_max = 3;
    if (s_.domain.dimension == 2)
      problem("coupling.self_disturbance", "'on' needs domain.dimension = 3; expected off");
    else if (s_.coupling.mode != CouplingMode::two_way)
      problem("coupling.self_disturbance",
              "'on' in one-way coupling, where grains disturb nothing; expected off");
    const double factor = undisturbed_slip(0.5 * largest_diameter(s_), s_.coupling.length);
    if (!(factor > 0 && factor <= factor_max))
      problem("coupling.length",
              number_text(s_.coupling.length) + " m is too short for coupling.self_disturbance: a "
              "grain would see less than a third of its slip; smallest safe value " +
                  number_above(0.5 * 1.0737 * 1.5 * largest_diameter(s_)) + " m");
  }

  void check_periodic() {
    const double least = periodic_minimum(s_);
    const auto check = [&](Boundary side, const char* key, double extent) {
      if (side != Boundary::periodic || extent >= least) return;
      problem(key, number_text(extent) +
                       " m is too small for periodic sides: particles would meet their own images; "
                       "smallest safe value " + number_above(least) + " m");
    };
    check(s_.domain.sides, "domain.width", s_.domain.width);
    check(s_.domain.bottom, "domain.height", s_.domain.height);
    if (s_.domain.dimension == 3) check(s_.domain.faces, "domain.depth", s_.domain.depth);
  }

  void resolve_sound_speed() {
    if (!s_.has_fluid() || !std::isnan(s_.fluid.sound_speed)) return;
    const double speed = s_.fluid.sound_speed_factor * expected_speeds(s_).sound_speed();
    const Parameter& parameter = *find_parameter("fluid.sound_speed");
    if (!(speed <= parameter.highest)) {
      problem("fluid.sound_speed", "auto gives " + rough_number(speed) +
                                       " m/s, far beyond any flow; check sizes, densities and "
                                       "viscosity, or give a value");
      return;
    }
    s_.fluid.sound_speed = speed;
  }

  void resolve_step() {
    const std::vector<StepLimit> limits = step_limits(s_);
    if (std::isnan(s_.time.dt)) {
      s_.time.dt = binding_limit(limits).chosen;
    } else if (const StepLimit& limit = binding_limit(limits, true);
               !within(s_.time.dt, limit.largest)) {
      problem("time.dt", number_text(s_.time.dt) + " s is above the " + std::string(limit.name) +
                             " limit " + std::string(limit.formula) + "; largest safe value " +
                             number_below(limit.largest) + " s");
      return;
    }
    if (s_.has_grains() && substeps(s_) > substeps_max)
      problem("contact.stiffness", number_text(s_.contact.stiffness) + " N/m needs " +
                                       std::to_string(substeps(s_)) +
                                       " grain sub-steps per step; at most " +
                                       std::to_string(substeps_max) + " are possible");
    if (s_.time.until > 0 && s_.time.until / s_.time.dt > 1e15)
      problem("time.until", number_text(s_.time.until) + " s is more than 1e15 steps");
  }

  /// Walks through the scheduled changes as the run will: each is checked against the scenario as
  /// it then stands, and a changed dt shifts the clock for those behind it.
  void resolve_changes() {
    for (std::size_t i = 0; i < s_.changes.size(); ++i) check_schedule(s_.changes[i], i);
    if (!problems_.empty()) return;
    Scenario now = s_;
    std::vector<ScheduledChange> waiting = std::move(s_.changes);
    s_.changes.clear();
    now.changes.clear();
    std::uint64_t since_step = 0;
    double since_time = 0;
    while (!waiting.empty()) {
      const auto step_of = [&](const ScheduledChange& change) {
        if (change.at_step >= 0) return static_cast<std::uint64_t>(change.at_step);
        return since_step + last_step_at(change.at - since_time, now.time.dt);
      };
      auto next = waiting.begin();
      for (auto it = waiting.begin(); it != waiting.end(); ++it)
        if (step_of(*it) < step_of(*next)) next = it;
      ScheduledChange change = std::move(*next);
      const std::uint64_t step = step_of(change);
      waiting.erase(next);
      change.at_step = static_cast<std::int64_t>(step);
      change.at = automatic;
      const double dt = now.time.dt;
      apply_change(now, change);
      if (now.time.dt != dt) {
        since_time += static_cast<double>(step - since_step) * dt;
        since_step = step;
      }
      s_.changes.push_back(std::move(change));
    }
  }

  void check_schedule(const ScheduledChange& change, std::size_t index) {
    const std::string section = "event." + change.name;
    if (change.name.empty()) problem("event", "an event needs a name, as in [event.softer]");
    for (char c : change.name)
      if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
            c == '_' || c == '-')) {
        problem(section, "the name of an event may hold letters, digits, '_' and '-'");
        break;
      }
    for (std::size_t i = 0; i < index; ++i)
      if (s_.changes[i].name == change.name) problem(section, "there are two events of this name");
    if (change.at_step < 0 && std::isnan(change.at))
      problem(section + ".at", "missing; expected a time, such as '0.3 s' (or at_step, a step)");
    if (change.at < 0)
      problem(section + ".at", number_text(change.at) + " s lies before the start; expected >= 0");
    if (change.settings.empty()) problem(section, "the event changes nothing; expected a key");
  }

  void apply_change(Scenario& now, ScheduledChange& change) {
    for (const Problem& found : apply_settings(now, change.settings, change.anchor))
      problem("event." + change.name + "." + found.key, found.text);
    // Values in their canonical form, so that equal scenarios have equal texts.
    for (auto& [key, value] : change.settings) {
      const Parameter* parameter = find_parameter(key);
      Scenario scratch;
      if (parameter && !set_parameter(scratch, *parameter, value))
        value = get_parameter(scratch, *parameter);
    }
  }

  Scenario& s_;
  std::vector<Problem> problems_;
};

}  // namespace

std::vector<Problem> resolve(Scenario& scenario) { return Resolver(scenario).run(); }

}  // namespace varve::core
