#include "core/assessment.h"

#include <algorithm>
#include <cmath>

#include "core/contact_law.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

std::string setting(std::string_view key, const Scenario& s) {
  return std::string(key) + " = " + get_parameter(s, *find_parameter(key));
}

bool is_pipe(const Scenario& s) {
  return s.domain.dimension == 3 && s.domain.shape == Shape::pipe;
}

bool any_side(const Scenario& s, Boundary kind) {
  const bool face = s.domain.dimension == 3 && !is_pipe(s) && s.domain.faces == kind;
  return s.domain.sides == kind || s.domain.bottom == kind || s.domain.top == kind || face;
}

bool grains_move(const Scenario& s) {
  return s.has_grains() && s.grains.motion != GrainMotion::frozen;
}

class Assessor {
 public:
  explicit Assessor(const Scenario& scenario) : s_(scenario) {}

  Assessment run() {
    a_.models = models_of(s_);
    count();
    step();
    flow();
    contact();
    log();
    warn_about_fluid();
    warn_about_grains();
    return std::move(a_);
  }

 private:
  void warn(std::string key, std::string text) {
    a_.warnings.push_back({std::move(key), std::move(text)});
  }

  void count() {
    const Lattice lattice = fluid_lattice(s_);
    a_.fluid_particles = static_cast<std::uint64_t>(lattice.particles);
    const double dx = s_.fluid.spacing;
    const double volume = s_.domain.dimension == 2 ? dx * dx : dx * dx * dx;
    if (s_.has_fluid())
      a_.fluid_mass = s_.fluid.density * volume * static_cast<double>(lattice.particles);
    if (!s_.has_grains()) return;
    a_.grains = static_cast<std::uint64_t>(s_.grain_count());
    const GrainTotals totals = grain_totals(s_);
    a_.grain_mass = totals.mass;
    // The grains' volume is taken out of the fluid only where it feels them.
    if (s_.is_coupled() && s_.coupling.mode == CouplingMode::two_way)
      a_.fluid_mass -= s_.fluid.density * totals.volume;
  }

  void step() {
    a_.dt = s_.time.dt;
    a_.limits = step_limits(s_);
    const StepLimit& binding = binding_limit(a_.limits);
    a_.step_set_by = binding.chosen == a_.dt ? std::string(binding.name) : "time.dt";
    a_.substeps = substeps(s_);
    if (grains_move(s_)) a_.contact_time = core::contact_time(s_);
    a_.steps = steps_of_run(s_);
  }

  void flow() {
    a_.speeds = expected_speeds(s_);
    if (!s_.has_fluid()) return;
    if (s_.has_grains()) {
      a_.terminal_speed = core::terminal_speed(s_);
      a_.reynolds = s_.fluid.density * a_.speeds.grains * largest_diameter(s_) / s_.fluid.viscosity;
      a_.stokes = s_.grains.density / s_.fluid.density * a_.reynolds / 9;
    }
    a_.mach = std::max(a_.speeds.fluid, a_.speeds.grains) / s_.fluid.sound_speed;
  }

  void contact() {
    if (!grains_move(s_)) return;
    const double speed = impact_speed(s_);
    for (const GrainSpecies& each : species_of(s_)) {
      const double m = grain_mass(s_, each), radius = 0.5 * each.diameter;
      const ContactPair wall = contact_pair(s_.contact, static_cast<int>(s_.domain.dimension),
                                            {radius, m, m * radius * radius}, nullptr);
      // Undamped: the largest compression of the spring, v sqrt(m / k) or Hertz's.
      const double most = s_.contact.law == ContactLaw::linear
                              ? speed * std::sqrt(m / s_.contact.stiffness)
                              : pow(1.875 * m * speed * speed / wall.stiffness, 0.4);
      a_.overlap = std::max(a_.overlap, most / each.diameter);
    }
    a_.restitution = restitution_of(0.5 * s_.contact.damping);
  }

  void log() {
    const double real = s_.precision == Precision::double_ ? 8 : 4;
    const double place = s_.precision == Precision::float_ ? 4 : 8;
    const double d = static_cast<double>(s_.domain.dimension);
    // Fluid: id, mass, position, velocity, density. Grains: id, species, position, velocity, spin.
    const double fluid = 8 + real + d * place + d * real + real;
    const double spin = s_.contact.rotation ? (s_.domain.dimension == 2 ? 1 : 3) * real : 0;
    const double grain = 8 + 4 + d * place + d * real + spin;
    const double bytes = static_cast<double>(a_.fluid_particles) * fluid +
                         static_cast<double>(a_.grains) * grain + 40;
    a_.state_bytes = static_cast<std::uint64_t>(bytes);
    if (a_.steps == 0) return;
    const double steps = static_cast<double>(a_.steps);
    const double particles = static_cast<double>(a_.fluid_particles + a_.grains);
    const double keyframes = 1 + std::floor(steps / static_cast<double>(s_.record.keyframe_steps));
    // Settling grains with doubles in 2D take 7 to 10 bytes per particle and step at a quarter of
    // the acoustic limit and 3 to 4 far below it, half of it with floats; a fluid at rest takes
    // next to nothing. A keyframe compresses to between 0.6 and 1 of its size.
    const bool at_rest = a_.speeds.fluid == 0 && a_.speeds.grains == 0;
    const double courant =
        s_.has_fluid() ? a_.dt * s_.fluid.sound_speed / smoothing_length(s_) : 1.0;
    const double least = at_rest ? 0.01 : courant > 0.15 ? 6.0 : 2.5;
    const double most = at_rest ? 0.5 : 11.0;
    const double per_particle = real / 8 * d / 2;
    const bool digests = s_.record.tier == RecordTier::digests;
    const double deltas = digests ? 0 : steps / static_cast<double>(s_.record.every) * particles;
    a_.log_bytes_low =
        4096 + keyframes * 0.1 * bytes + steps * 120 + deltas * least * per_particle;
    a_.log_bytes_high = 8192 + keyframes * bytes + steps * 600 + deltas * most * per_particle;
  }

  void warn_about_fluid() {
    if (!s_.has_fluid()) return;
    const double needed = std::max(10 * a_.speeds.fluid, 20 * a_.speeds.grains);
    if (s_.fluid.sound_speed < 0.9 * needed)
      warn("fluid.sound_speed",
           number_text(s_.fluid.sound_speed) + " m/s is below " + rough_number(needed) +
               " m/s (10 x the fluid's, 20 x the grains' expected speed): the fluid will be "
               "compressed noticeably");
    if (s_.fluid.artificial_alpha > 0) {
      const double added = s_.fluid.artificial_alpha * s_.fluid.sound_speed *
                           smoothing_length(s_) /
                           (2 * (static_cast<double>(s_.domain.dimension) + 2));
      const double real = s_.fluid.viscosity / s_.fluid.density;
      if (added > 0.05 * real)
        warn("fluid.artificial_alpha",
             setting("fluid.artificial_alpha", s_) + ": acts like " + rough_number(added / real) +
                 " times the fluid's viscosity; Reynolds numbers are not those of the scenario");
    }
    if (s_.fluid.density_diffusion == 0)
      warn("fluid.density_diffusion",
           "0: pressure noise is about ten times larger without density diffusion");
    if (s_.fluid.kernel == Kernel::cubic)
      warn("fluid.kernel", "cubic: particles tend to pair up; wendland_c2 does not");
    if (s_.fluid.pressure == PressureForm::full && grains_move(s_) && s_.is_coupled())
      warn("fluid.pressure",
           "full: under hydrostatic pressure the particles lock into a lattice, and slow settling "
           "comes out up to 45 % too slow; use excess where the domain is closed and full");
    const Lattice lattice = fluid_lattice(s_);
    std::int64_t fewest = std::min(lattice.columns, lattice.rows);
    if (s_.domain.dimension == 3) fewest = std::min(fewest, lattice.layers);
    if (fewest < 10)
      warn("fluid.spacing",
           "only " + std::to_string(fewest) +
               " particles across the domain; flow between walls needs 10 or more");
    if (s_.time.cfl > 0.5)
      warn("time.cfl", number_text(s_.time.cfl) +
                           ": above 0.5 speeds are off by some per cent and dense arrays can fail");
    else if (s_.time.cfl > 0.25 && s_.has_grains() && a_.grains >= 16)
      warn("time.cfl", number_text(s_.time.cfl) + ": dense arrays can fail above 0.25");
  }

  void warn_about_grains() {
    if (!grains_move(s_)) return;
    if (a_.overlap > 0.05)
      warn(s_.contact.law == ContactLaw::linear ? "contact.stiffness" : "contact.youngs_modulus",
           "an impact at " + rough_number(impact_speed(s_)) +
                                    " m/s will overlap by " + rough_number(100 * a_.overlap) +
                                    " % of a diameter; below 5 % is sound");
    if (!s_.is_coupled()) return;
    const double ratio = s_.coupling.length / largest_diameter(s_);
    if (ratio < 1)
      warn("coupling.length",
           rough_number(ratio) +
               " d: porosity between touching grains becomes uneven below one diameter");
    else if (ratio < 3 && s_.coupling.mode == CouplingMode::two_way)
      warn("coupling.length",
           rough_number(ratio) +
               " d: a grain disturbs the fluid that it samples; drag laws hold to a few per cent "
               "from 3 d on, one_way at any length");
    if (coupling_radius(s_) < 1.5 * s_.fluid.spacing)
      warn("fluid.spacing",
           number_text(s_.fluid.spacing) +
               " m leaves a grain with hardly any fluid within its coupling radius " +
               rough_number(coupling_radius(s_)) + " m");
    if (s_.domain.width < 2 * coupling_radius(s_))
      warn("domain.width",
           number_text(s_.domain.width) +
               " m is narrower than two coupling radii: walls cut every grain's view");
    if (s_.domain.dimension == 3 && s_.domain.shape == Shape::box &&
        s_.domain.depth < 2 * coupling_radius(s_))
      warn("domain.depth",
           number_text(s_.domain.depth) +
               " m is less than two coupling radii: walls cut every grain's view");
    warn_about_drag();
  }

  void warn_about_drag() {
    const double re = a_.reynolds;
    const auto outside = [&](const std::string& law, const std::string& range) {
      warn("coupling.drag", law + " is for Re " + range + "; Re " + rough_number(re) +
                                " is expected");
    };
    if (s_.coupling.self_disturbance && re > 1)
      warn("coupling.self_disturbance",
           "is for slow flow, Re below 1, where disturbances do not drift away; Re " +
               rough_number(re) + " is expected");
    if (s_.coupling.drag == Drag::stokes && re > 1) outside("stokes", "below 1");
    if (s_.coupling.drag == Drag::schiller_naumann && re > 1000)
      outside("schiller_naumann", "below 1000");
    if (s_.coupling.drag == Drag::dallavalle_di_felice && re > 1e4)
      outside("dallavalle_di_felice", "below 10^4");
    if (s_.coupling.drag == Drag::gidaspow && re > 1e4) outside("gidaspow", "below 10^4");
    if (s_.coupling.drag == Drag::cylinder && (re > 2e5 || (re > 0 && re < 1e-4)))
      outside("cylinder", "10^-4 to 2 10^5");
  }

  const Scenario& s_;
  Assessment a_;
};

}  // namespace

std::vector<ModelUse> models_of(const Scenario& s) {
  std::vector<ModelUse> models;
  const auto add = [&models](std::string name, bool active, std::string reason) {
    models.push_back({std::move(name), active, std::move(reason)});
  };
  const bool fluid = s.has_fluid(), grains = s.has_grains(), coupled = s.is_coupled();
  add("fluid", fluid, setting("fluid.present", s));
  add("viscosity", fluid, fluid ? setting("fluid.viscosity", s) : "no fluid");
  add("density diffusion", fluid && s.fluid.density_diffusion > 0,
      fluid ? setting("fluid.density_diffusion", s) : "no fluid");
  const bool artificial = s.fluid.artificial_alpha > 0 || s.fluid.artificial_beta > 0;
  add("artificial viscosity", fluid && artificial,
      fluid ? setting("fluid.artificial_alpha", s) + ", " + setting("fluid.artificial_beta", s)
            : "no fluid");
  add("particle shifting", fluid && s.fluid.shifting > 0,
      fluid ? setting("fluid.shifting", s) : "no fluid");
  const bool tait = s.fluid.equation_of_state == EquationOfState::tait;
  add("Tait's equation", fluid && tait,
      fluid ? setting("fluid.equation_of_state", s) : "no fluid");
  const bool excess = fluid && s.fluid.pressure == PressureForm::excess;
  add("excess pressure", excess,
      !fluid  ? "no fluid"
      : excess ? "the domain is closed, full or periodic: hydrostatics are taken out"
               : setting("fluid.pressure", s));
  add("free surface", has_free_surface(s),
      !fluid                            ? "no fluid"
      : s.domain.top == Boundary::free  ? setting("domain.top", s)
      : s.fluid.level < s.domain.height ? "fluid.level is below the top"
      : !std::isnan(s.fluid.width)      ? setting("fluid.width", s)
                                        : "the domain is full");
  const bool walls = any_side(s, Boundary::no_slip) || any_side(s, Boundary::free_slip);
  add("walls", walls, walls ? "sides, bottom or top are walls" : "every side is periodic");
  const bool periodic = any_side(s, Boundary::periodic);
  add("periodic sides", periodic, periodic ? "sides or bottom and top" : "no side is periodic");
  add("pipe", is_pipe(s), setting("domain.shape", s));
  const bool lid = s.domain.lid_speed != 0 || s.domain.floor_speed != 0;
  add("moving walls", lid,
      setting("domain.lid_speed", s) + ", " + setting("domain.floor_speed", s));
  add("flow at the start", fluid && s.fluid.initial != InitialFlow::rest,
      fluid ? setting("fluid.initial", s) : "no fluid");
  const bool body = fluid && (s.fluid.body_force_x != 0 || s.fluid.body_force_y != 0 ||
                              s.fluid.body_force_z != 0);
  add("body force", body, body ? "fluid.body_force_x, _y, _z" : "zero");
  add("grains", grains,
      grains ? std::to_string(s.grain_count()) + ", " + setting("grains.arrangement", s)
             : setting("grains.rows", s) + ", " + setting("grains.columns", s));
  add("grain species", grains && s.species.size() > 0,
      s.species.empty() ? "one" : std::to_string(s.species.size() + 1));
  const bool moving = grains_move(s);
  const std::string still = grains ? setting("grains.motion", s) : "no grains";
  add("contacts", moving, moving ? "grains that move" : still);
  add("Hertz-Mindlin contacts", moving && s.contact.law == ContactLaw::hertz,
      moving ? setting("contact.law", s) : still);
  add("rolling friction", moving && s.contact.rotation && s.contact.rolling_friction > 0,
      moving ? setting("contact.rolling_friction", s) : still);
  add("lubrication", moving && coupled && s.contact.lubrication,
      moving ? setting("contact.lubrication", s) : still);
  add("added mass", moving && coupled && s.coupling.added_mass > 0,
      moving ? setting("coupling.added_mass", s) : still);
  add("driven grains", s.has_grains() && s.grains.motion == GrainMotion::driven,
      setting("grains.motion", s));
  add("friction and rotation", moving && s.contact.rotation,
      moving ? setting("contact.rotation", s) : still);
  const std::string alone = !fluid ? "no fluid" : !grains ? "no grains" : "";
  add("coupling", coupled, alone.empty() ? setting("coupling.mode", s) : alone);
  add("reaction on the fluid", coupled && s.coupling.mode == CouplingMode::two_way,
      alone.empty() ? setting("coupling.mode", s) : alone);
  const bool both = coupled && s.coupling.mode == CouplingMode::two_way;
  add("conjugate pressure", both && s.coupling.pressure_force == PressureForce::conjugate,
      both ? setting("coupling.pressure_force", s) : alone.empty() ? setting("coupling.mode", s)
                                                                   : alone);
  add("self-disturbance corrected", both && s.coupling.self_disturbance,
      both ? setting("coupling.self_disturbance", s) : alone.empty() ? setting("coupling.mode", s)
                                                                     : alone);
  add("drag", coupled,
      !alone.empty() ? alone : setting(coupled ? "coupling.drag" : "coupling.mode", s));
  const bool stepped = moving && substeps(s) > 1;
  const std::string often = std::to_string(substeps(s)) + " per step of ";
  add("grain sub-steps", stepped, moving ? often + number_text(s.time.dt) + " s" : still);
  add("scheduled changes", !s.changes.empty(), std::to_string(s.changes.size()) + " events");
  return models;
}

Assessment assess(const Scenario& resolved) { return Assessor(resolved).run(); }

}  // namespace varve::core
