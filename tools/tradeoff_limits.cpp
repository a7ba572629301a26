// How far a scene can be driven: the largest stable step, stiffness, density ratio, CFL number and
// the smallest coupling length by bisection, beside what the criteria say, and how each announces
// itself when it is passed.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/criteria.h"
#include "core/kernel.h"
#include "core/simulation.h"
#include "tools/session.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;
using core::Scenario;

constexpr double growth_max = 2;  // of the scene's own largest kinetic energy

struct Theory {
  std::string name, formula;
  double value = 0;
};

/// One thing that is driven until it fails. Values of the scene go through `apply`, past every
/// check that a scenario file would meet.
struct Quantity {
  std::string name, unit, key, note;
  double scene = 0;           ///< as the scene has it
  double factor = 2;          ///< of one stride; below 1: downwards
  double farthest = 0;        ///< where looking ends
  std::vector<Theory> theory;
  std::function<void(Scenario&, double)> apply;
};

struct Trial {
  bool stable = true;
  std::string criterion, text;  ///< what stopped it; criterion "silent": nothing did
  std::uint64_t step = 0;       ///< of the failure
  double peak = 0;              ///< [J] largest kinetic energy
  std::uint64_t contacts = 0;   ///< rows of the table of contacts
  std::uint64_t clamps = 0;     ///< times a porosity was held at its floor
};

struct Found {
  Quantity quantity;
  std::optional<double> stable, failing;  ///< the bracket's ends
  Trial announced;                        ///< how the failing end showed
  std::uint64_t clamps = 0;               ///< of porosity at the stable end
  std::uint64_t trials = 0;
};

/// Kinetic energy of all particles, with the masses of grains from their density.
class Energy {
 public:
  explicit Energy(const core::Simulation& simulation) : simulation_(simulation) {
    const auto& fields = simulation.fields();
    for (std::size_t f = 0; f < fields.size(); ++f) {
      if (fields[f].name == "fluid.velocity") fluid_ = static_cast<int>(f);
      if (fields[f].name == "fluid.mass") mass_ = static_cast<int>(f);
      if (fields[f].name == "grains.velocity") grains_ = static_cast<int>(f);
    }
  }
  double now() const {
    double sum = 0;
    const std::vector<double> masses = values(mass_);
    const std::vector<double> v = values(fluid_);
    const std::size_t dimension = masses.empty() ? 1 : v.size() / masses.size();
    for (std::size_t k = 0; k < v.size(); ++k) sum += 0.5 * masses[k / dimension] * v[k] * v[k];
    const double grain = core::grain_mass(simulation_.scenario());
    for (const double each : values(grains_)) sum += 0.5 * grain * each * each;
    return sum;
  }

 private:
  std::vector<double> values(int field) const {
    if (field < 0) return {};
    const auto f = static_cast<std::size_t>(field);
    const auto bytes = simulation_.field(f).bytes;
    std::vector<double> out;
    if (simulation_.fields()[f].type == core::FieldType::f64) {
      out.resize(bytes.size() / sizeof(double));
      if (!out.empty()) std::memcpy(out.data(), bytes.data(), bytes.size());
      return out;
    }
    for (std::size_t k = 0; k < bytes.size(); k += sizeof(float)) {
      float narrow = 0;
      std::memcpy(&narrow, bytes.data() + k, sizeof narrow);
      out.push_back(static_cast<double>(narrow));
    }
    return out;
  }
  const core::Simulation& simulation_;
  int fluid_ = -1, mass_ = -1, grains_ = -1;
};

/// Most that gravity can have given to grains and fluid, above what they started with [J].
double work_of_gravity(const Scenario& s, double horizon) {
  if (!s.has_grains() || s.grains.motion != core::GrainMotion::free) return 0;
  const core::GrainTotals totals = core::grain_totals(s);
  const double displaced = s.is_coupled() ? s.fluid.density * totals.volume : 0;
  const double force = std::abs(totals.mass - displaced) * s.gravity.magnitude;
  const double fall = 0.5 * force / totals.mass * horizon * horizon;
  return force * std::min(s.domain.height, fall);
}

/// Runs to `horizon` [s]; `energy_max` 0: no bound.
Trial try_out(const Scenario& scenario, double horizon, double energy_max, unsigned threads) {
  Trial trial;
  try {
    const auto simulation = core::Simulation::create(scenario, {threads, 0});
    const Energy energy(*simulation);
    std::size_t contacts = 0;
    while (contacts < simulation->tables().size() &&
           simulation->tables()[contacts].name != "contacts")
      ++contacts;
    trial.peak = energy.now();
    while (simulation->clock().time < horizon * (1 - 1e-9)) {
      simulation->advance();
      if (contacts < simulation->tables().size())
        trial.contacts += simulation->table(contacts).rows;
      trial.clamps = simulation->counters().porosity_clamps;
      const double now = energy.now();
      trial.peak = std::max(trial.peak, now);
      if (energy_max > 0 && !(now <= energy_max)) {
        trial.stable = false;
        trial.criterion = "silent";
        trial.step = simulation->clock().step;
        trial.text = fmt::format("at step {} the kinetic energy is {:.3g} times what the scene "
                                 "can have", trial.step, growth_max * now / energy_max);
        break;
      }
    }
  } catch (const core::NumericalFailure& failure) {
    trial.stable = false;
    trial.criterion = failure.criterion;
    trial.text = failure.what();
    trial.step = failure.step;
  } catch (const core::ModelError& error) {
    trial.stable = false;
    trial.criterion = "model";
    trial.text = error.what();
  }
  return trial;
}

/// The scene with its grains just above the floor, falling: where they would not have touched
/// anything in the time of a trial.
Scenario near_floor(Scenario s) {
  const double speed = std::max(core::impact_speed(s), 1e-3);
  s.grains.lowest_y = 0.5 * core::largest_diameter(s) + 4 * speed * s.time.dt;
  s.grains.velocity_y = -speed;
  return s;
}

// ---- what is driven ----

bool grains_move(const Scenario& s) {
  return s.has_grains() && s.grains.motion != core::GrainMotion::frozen;
}

Quantity time_step(const Scenario& base) {
  Quantity q{"time step", "s", "time.dt", "", base.time.dt, 2, 0, {}, {}};
  for (const core::StepLimit& limit : core::step_limits(base))
    q.theory.push_back({std::string(limit.name), std::string(limit.formula),
                        std::isfinite(limit.largest) ? limit.largest : limit.chosen});
  const bool dry = !base.has_fluid();
  const std::int64_t n = core::substeps(base);
  if (dry && base.contact.law == core::ContactLaw::linear)
    q.theory.push_back({"spring", "substeps 2 sqrt(m / k)",
                        static_cast<double>(n) * 2 / core::pi * core::contact_time(base)});
  q.note = dry ? fmt::format("{} sub-step{} per step throughout", n, n == 1 ? "" : "s")
               : "sub-steps of the grains as many as their contacts need";
  q.farthest = 1024 * base.time.dt;
  q.apply = [dry, n](Scenario& s, double value) {
    s.time.dt = value;
    if (dry) s.time.substeps = n;
  };
  return q;
}

Quantity stiffness(const Scenario& base, bool thrown) {
  const bool hertz = base.contact.law == core::ContactLaw::hertz;
  const double now = hertz ? base.contact.youngs_modulus : base.contact.stiffness;
  Quantity q{hertz ? "Young's modulus" : "stiffness", hertz ? "Pa" : "N/m",
             hertz ? "contact.youngs_modulus" : "contact.stiffness", "", now, 4, 1e8 * now, {}, {}};
  const std::int64_t n = core::substeps(base);
  const double step = base.time.dt / static_cast<double>(n), tc = core::contact_time(base);
  // Contact times fall with k^-1/2, by Hertz with E^-2/5.
  const double power = hertz ? 2.5 : 2;
  q.theory.push_back({"contact",
                      fmt::format("tc0 = {:g} sub-steps", core::substeps_per_contact_min),
                      now * std::pow(tc / (core::substeps_per_contact_min * step), power)});
  if (!hertz)
    q.theory.push_back({"spring", "sub-step = 2 sqrt(m / k)",
                        now * std::pow(2 * tc / (core::pi * step), 2)});
  q.note = fmt::format("time.dt and {} sub-step{} as they are{}", n, n == 1 ? "" : "s",
                       thrown ? "; grains started just above the floor" : "");
  q.apply = [hertz, n, thrown](Scenario& s, double value) {
    if (thrown) s = near_floor(s);
    (hertz ? s.contact.youngs_modulus : s.contact.stiffness) = value;
    s.time.substeps = n;
  };
  return q;
}

/// Densities of all kinds by one factor; contacts keep their duration.
void scale_density(Scenario& s, double factor) {
  s.grains.density *= factor;
  for (core::GrainSpecies& each : s.species) each.density *= factor;
  s.contact.stiffness *= factor;
  if (s.contact.law == core::ContactLaw::hertz) s.contact.youngs_modulus *= factor;
}

Quantity density_ratio(const Scenario& base, bool heavier) {
  const double ratio = base.grains.density / base.fluid.density;
  Quantity q{heavier ? "density ratio, heavy" : "density ratio, light", "", "grains.density",
             "over the fluid's; contacts keep their duration", ratio, heavier ? 4 : 0.25,
             heavier ? 1e6 * ratio : 1e-6 * ratio, {}, {}};
  q.apply = [ratio](Scenario& s, double value) { scale_density(s, value / ratio); };
  if (heavier) {
    const double fastest = base.guards.speed * base.fluid.sound_speed;
    const auto speed = [&](double value) {
      Scenario s = base;
      scale_density(s, value / ratio);
      return core::terminal_speed(s);
    };
    double low = ratio, high = ratio;
    while (speed(high) < fastest && high < q.farthest) high *= 2;
    for (int i = 0; i < 60 && high < q.farthest; ++i) {
      const double middle = std::sqrt(low * high);
      (speed(middle) < fastest ? low : high) = middle;
    }
    if (high < q.farthest)
      q.theory.push_back({"speed", "terminal speed = guards.speed c0", high});
  }
  return q;
}

Quantity courant(const Scenario& base) {
  const double h = core::smoothing_length(base), dt = base.time.dt;
  Quantity q{"CFL number", "", "fluid.sound_speed", "dt c0 / h, by the sound speed at this dt",
             dt * base.fluid.sound_speed / h, 1.5, 100, {}, {}};
  q.theory.push_back({"cfl", "time.cfl of the scene", base.time.cfl});
  q.theory.push_back({"cfl", "largest time.cfl", 1});
  q.apply = [h, dt](Scenario& s, double value) { s.fluid.sound_speed = value * h / dt; };
  return q;
}

Quantity coupling_length(const Scenario& base) {
  const double d = core::largest_diameter(base);
  Quantity q{"coupling length", "d", "coupling.length", "over the largest diameter",
             base.coupling.length / d, 0.8, 0.05, {}, {}};
  const double volume =
      core::grain_volume(base, {"", d, base.grains.density, 1});
  const bool flat = base.domain.dimension == 2;
  const double sigma = flat ? core::kernel_sigma<2, core::Kernel::wendland_c2>()
                            : core::kernel_sigma<3, core::Kernel::wendland_c2>();
  q.theory.push_back({"porosity", flat ? "sqrt(sigma V): 0 in the middle of a lone grain"
                                       : "cbrt(sigma V): 0 in the middle of a lone grain",
                      (flat ? std::sqrt(sigma * volume) : std::cbrt(sigma * volume)) / d});
  q.apply = [d](Scenario& s, double value) { s.coupling.length = value * d; };
  return q;
}

std::vector<Quantity> quantities(const Scenario& base, bool contacts) {
  std::vector<Quantity> all{time_step(base)};
  const bool array = base.grains.arrangement == core::Arrangement::square ||
                     base.grains.arrangement == core::Arrangement::hexagonal;
  if (grains_move(base) && (contacts || array)) all.push_back(stiffness(base, !contacts));
  if (base.has_fluid()) all.push_back(courant(base));
  if (base.is_coupled() && grains_move(base)) {
    all.push_back(density_ratio(base, true));
    all.push_back(density_ratio(base, false));
  }
  if (base.is_coupled()) all.push_back(coupling_length(base));
  return all;
}

// ---- the search ----

class Search {
 public:
  /// `peak`: the scene's own largest kinetic energy.
  Search(const Scenario& base, double horizon, double peak, double precise, unsigned threads)
      : base_(base), horizon_(horizon), peak_(peak), precise_(precise), threads_(threads) {}

  Found run(Quantity quantity) const {
    Found found;
    found.quantity = std::move(quantity);
    const Quantity& q = found.quantity;
    double value = q.scene;
    if (!check(found, value)) {
      // The scene itself fails: look on the safe side of it.
      for (int k = 0; k < 12 && !found.stable; ++k) {
        value /= q.factor;
        check(found, value);
      }
    }
    while (found.stable && !found.failing && (q.factor > 1 ? value < q.farthest
                                                           : value > q.farthest)) {
      value *= q.factor;
      check(found, value);
    }
    while (found.stable && found.failing &&
           std::abs(std::log(*found.failing / *found.stable)) > std::log1p(precise_))
      check(found, std::sqrt(*found.stable * *found.failing));
    if (found.failing && found.announced.criterion == "silent") announce(found);
    return found;
  }

 private:
  Scenario with(const Found& found, double value) const {
    Scenario scenario = base_;
    found.quantity.apply(scenario, value);
    return scenario;
  }

  bool check(Found& found, double value) const {
    const Scenario scenario = with(found, value);
    double energy = peak_ + work_of_gravity(scenario, horizon_);
    for (const double v : {scenario.grains.velocity_x, scenario.grains.velocity_y,
                           scenario.grains.velocity_z})
      if (scenario.has_grains()) energy += 0.5 * core::grain_totals(scenario).mass * v * v;
    const Trial trial = try_out(scenario, horizon_, growth_max * energy, threads_);
    ++found.trials;
    if (trial.stable) {
      found.stable = value;
      found.clamps = trial.clamps;
    } else {
      found.failing = value;
      found.announced = trial;
    }
    return trial.stable;
  }

  /// Energy from nowhere is seen before a guard sees anything: whether one does in four times the
  /// time.
  void announce(Found& found) const {
    const Trial longer = try_out(with(found, *found.failing), 4 * horizon_, 0, threads_);
    ++found.trials;
    const std::string seen = found.announced.text;
    if (longer.stable) return;
    found.announced = longer;
    found.announced.text += " (before that, " + seen + ")";
  }

  const Scenario& base_;
  double horizon_, peak_, precise_;
  unsigned threads_;
};

// ---- what is printed ----

std::string text_of(const std::string& file, std::uint64_t steps, double horizon,
                    const std::vector<Found>& all) {
  std::string out = fmt::format(
      "{}: trials of {:.4g} s, {} steps of the scene's own; stable: no guard stops it, "
      "and the kinetic\nenergy stays below {:g} times what the scene, its start and gravity can "
      "give\n",
      file, horizon, steps, growth_max);
  for (const Found& found : all) {
    const Quantity& q = found.quantity;
    const auto with_unit = [&](double value) {
      return fmt::format("{:.4g}{}{}", value, q.unit.empty() ? "" : " ", q.unit);
    };
    out += fmt::format("\n{} ({}; {})\n  the scene        {}\n", q.name, q.key, q.note,
                       with_unit(q.scene));
    if (found.stable) out += fmt::format("  stable at        {}\n", with_unit(*found.stable));
    if (found.stable && found.clamps > 0)
      out += fmt::format("                   (there the porosity is held at its floor {} times)\n",
                         found.clamps);
    if (found.failing)
      out += fmt::format("  fails at         {}\n", with_unit(*found.failing));
    else
      out += fmt::format("  no failure up to {}\n", with_unit(found.stable.value_or(q.scene)));
    for (const Theory& theory : q.theory)
      out += fmt::format("  theory           {}: {} ({}){}\n", with_unit(theory.value),
                         theory.formula, theory.name,
                         found.stable ? fmt::format("; found / theory {:.3g}",
                                                    *found.stable / theory.value)
                                      : std::string());
    if (found.failing)
      out += fmt::format("  announced by     {}: {}\n",
                         found.announced.criterion == "silent"
                             ? std::string("nothing, in four times the time")
                             : fmt::format("exit 5, {}", found.announced.criterion),
                         found.announced.text);
  }
  return out;
}

std::string json_of(const std::string& file, std::uint64_t steps, double horizon,
                    const std::vector<Found>& all) {
  Json object{{"schema", "varve.tradeoff_limits/1"},
              {"scenario", file},
              {"steps", std::to_string(steps)},
              {"horizon_s", horizon},
              {"energy_growth_max", growth_max}};
  Json& rows = object["limits"] = Json::array();
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  for (const Found& found : all) {
    Json theory = Json::array();
    for (const Theory& each : found.quantity.theory)
      theory.push_back({{"criterion", each.name}, {"formula", each.formula},
                        {"value", each.value}});
    Json announced;
    if (found.failing)
      announced = {{"criterion", found.announced.criterion},
                   {"exit", found.announced.criterion == "silent" ? 0 : exit_numerical},
                   {"step", std::to_string(found.announced.step)},
                   {"text", found.announced.text}};
    rows.push_back({{"name", found.quantity.name},
                    {"key", found.quantity.key},
                    {"unit", found.quantity.unit},
                    {"scene", found.quantity.scene},
                    {"stable", number(found.stable)},
                    {"failing", number(found.failing)},
                    {"porosity_clamps", std::to_string(found.clamps)},
                    {"trials", std::to_string(found.trials)},
                    {"theory", std::move(theory)},
                    {"announced", std::move(announced)}});
  }
  return object.dump(2) + "\n";
}

}  // namespace

int trade_limits(const Invocation& invocation) {
  const std::string& file = invocation.arguments.front();
  const TradeScene scene = load_trade_scene(file, invocation.values("set"), {});
  const std::uint64_t steps = invocation.count("steps").value_or(400);
  if (steps < 1) throw UsageError("--steps: expected at least 1");
  const double precise = fraction(invocation.value("precise"), "--precise");
  const unsigned threads = threads_option(invocation);
  const double horizon = static_cast<double>(steps) * scene.base.time.dt;

  const Cost whole = predict_cost(scene.base, threads);
  const auto run_steps = static_cast<double>(
      std::max<std::uint64_t>(1, core::steps_of_run(scene.base)));
  const double strides = 8 + std::log2(2 / std::log2(1 + precise));
  const std::size_t expected = quantities(scene.base, true).size();
  const double predicted = whole.cpu_s / run_steps * static_cast<double>(steps) * strides *
                           static_cast<double>(expected);
  const std::string plan =
      fmt::format("{} limits of about {:.0f} trials of {} steps: about {:.2g} CPU-seconds",
                  expected, strides, steps, predicted);
  if (invocation.has("budget") && predicted > duration_option(invocation, "budget"))
    throw UsageError(fmt::format("--budget: {}; fewer --steps take less", plan));
  if (invocation.has("dry-run")) {
    print(plan + "\n");
    return exit_ok;
  }
  note(invocation.globals, plan);

  const Trial own = try_out(scene.base, horizon, 0, threads);
  if (!own.stable) warn(fmt::format("the scene itself fails: {}", own.text));
  if (own.peak == 0) warn("nothing moves in this time; --steps makes it longer");
  const std::vector<Quantity> wanted = quantities(scene.base, own.contacts > 0);
  const Search search(scene.base, horizon, own.peak, precise, threads);
  std::vector<Found> all;
  for (const Quantity& quantity : wanted) {
    note(invocation.globals, quantity.name);
    all.push_back(search.run(quantity));
  }
  if (invocation.has("output")) {
    const std::filesystem::path folder(invocation.value("output"));
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    write_whole((folder / "limits.json").string(), json_of(file, steps, horizon, all));
  }
  print(invocation.globals.json ? json_of(file, steps, horizon, all)
                                : text_of(file, steps, horizon, all));
  return exit_ok;
}

}  // namespace varve::tools
