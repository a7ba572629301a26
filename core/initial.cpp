#include "core/initial.h"

#include <cmath>
#include <stdexcept>

#include "core/constants.h"
#include "core/coupling.h"
#include "core/math.h"
#include "core/random.h"
#include "core/walls.h"
#include "core/workers.h"

namespace varve::core {
namespace {

using DoubleState = State<2, DoublePrecision>;

// Draws of one id are told apart by number; grains use others than the fluid, since both may have
// the same seed.
constexpr std::uint64_t first_fluid_draw = 0, first_grain_draw = 16;

void require_resolved(const Scenario& s) {
  const auto need = [](bool given, const char* key) {
    if (!given) throw std::logic_error(std::string("scenario not resolved: ") + key);
  };
  const auto number = [](double value) { return std::isfinite(value); };
  need(s.domain.dimension == 2, "domain.dimension");
  need(number(s.domain.width), "domain.width");
  need(number(s.domain.height), "domain.height");
  need(number(s.time.dt), "time.dt");
  if (s.has_fluid()) {
    need(number(s.fluid.level), "fluid.level");
    need(number(s.fluid.sound_speed), "fluid.sound_speed");
    need(s.fluid.pressure != PressureForm::automatic, "fluid.pressure");
  }
  if (s.has_grains()) {
    need(number(s.grains.centre_x), "grains.centre_x");
    need(number(s.grains.lowest_y), "grains.lowest_y");
  }
  if (s.is_coupled()) {
    need(number(s.coupling.length), "coupling.length");
    need(number(s.coupling.porosity_floor), "coupling.porosity_floor");
  }
}

Vec<double, 2> jittered(Vec<double, 2> x, double amplitude, std::uint64_t seed, std::uint64_t id,
                        std::uint64_t first_draw) {
  if (amplitude == 0) return x;
  for (int k = 0; k < 2; ++k)
    x[k] += amplitude * symmetric(seed, id, first_draw + static_cast<std::uint64_t>(k));
  return x;
}

/// Positions rounded as they will be stored, so that porosity belongs to what the engine will see.
template <class P>
Vec<double, 2> as_stored(const Vec<double, 2>& x) {
  return x.cast<typename P::Position>().template cast<double>();
}

template <class P>
void place_grains(const Scenario& s, DoubleState& state) {
  const Grains& g = s.grains;
  const double pitch = g.diameter * (1.0 + g.gap);
  const Box<2> box = domain_box(s);
  const double first_x = g.centre_x - 0.5 * pitch * static_cast<double>(g.columns - 1);
  for (std::int64_t row = 0; row < g.rows; ++row)
    for (std::int64_t column = 0; column < g.columns; ++column) {
      const std::uint64_t id = state.grains.size();
      const Vec<double, 2> site(first_x + pitch * static_cast<double>(column),
                                g.lowest_y + pitch * static_cast<double>(row));
      const Vec<double, 2> x = jittered(site, g.jitter * g.diameter,
                                        static_cast<std::uint64_t>(g.seed), id, first_grain_draw);
      state.grains.id.push_back(id);
      state.grains.species.push_back(0);
      state.grains.position.push_back(as_stored<P>(box.wrapped(x)));
      state.grains.velocity.emplace_back(g.velocity_x, g.velocity_y);
      if (s.contact.rotation) state.grains.spin.push_back(Vec<double, 1>::Zero());
    }
}

template <class P>
void place_fluid(const Scenario& s, DoubleState& state) {
  const double dx = s.fluid.spacing;
  const Box<2> box = domain_box(s);
  const std::int64_t columns = whole_spacings("domain.width", s.domain.width, dx);
  const std::int64_t rows = nearest_integer(s.fluid.level / dx);
  for (std::int64_t j = 0; j < rows; ++j)
    for (std::int64_t i = 0; i < columns; ++i) {
      const std::uint64_t id = state.fluid.size();
      const Vec<double, 2> site(box.lower[0] + (static_cast<double>(i) + 0.5) * dx,
                                box.lower[1] + (static_cast<double>(j) + 0.5) * dx);
      const Vec<double, 2> x = jittered(site, s.fluid.jitter * dx,
                                        static_cast<std::uint64_t>(s.fluid.seed), id,
                                        first_fluid_draw);
      state.fluid.id.push_back(id);
      state.fluid.position.push_back(as_stored<P>(box.wrapped(x)));
      state.fluid.velocity.push_back(Vec<double, 2>::Zero());
    }
  // A volume of dx^D each, until porosity is known: only m / rhob enters it.
  state.fluid.mass.assign(state.fluid.size(), dx * dx);
  state.fluid.superficial_density.assign(state.fluid.size(), 1.0);
}

template <class To, class From, int N>
std::vector<Vec<To, N>> converted_vectors(const std::vector<Vec<From, N>>& from) {
  std::vector<Vec<To, N>> to;
  to.reserve(from.size());
  for (const auto& v : from) to.push_back(v.template cast<To>());
  return to;
}

template <class To, class From>
std::vector<To> converted_numbers(const std::vector<From>& from) {
  std::vector<To> to;
  to.reserve(from.size());
  for (const From v : from) to.push_back(static_cast<To>(v));
  return to;
}

}  // namespace

std::vector<double> floored_porosity(const Scenario& scenario, const DoubleState& state) {
  const Constants<2> c = constants_of<2>(scenario);
  std::vector<double> porosity(state.fluid.size(), 1.0);
  if (!c.two_way || state.grains.size() == 0 || state.fluid.size() == 0) return porosity;
  std::vector<double> volume(state.fluid.size());
  for (std::size_t a = 0; a < volume.size(); ++a)
    volume[a] = state.fluid.mass[a] / state.fluid.superficial_density[a];
  Workers alone(1);
  CouplingStage<2, DoublePrecision> coupling;
  coupling.rebuild(c, state, wall_planes(scenario), 0.0, alone);
  std::vector<double> unfloored(state.fluid.size());
  coupling.porosity(c, state, volume, unfloored, porosity, alone);
  return porosity;
}

double hydrostatic_excess_density(const Scenario& scenario, const Vec<double, 2>& x,
                                  double surface) {
  const Domain& d = scenario.domain;
  const double down = scenario.gravity.magnitude * cos(scenario.gravity.tilt);
  const double right = scenario.gravity.magnitude * sin(scenario.gravity.tilt);
  double work = 0;  // [m2/s2] of gravity from the surface to x
  if (d.bottom != Boundary::periodic) work += down * (surface - x[1]);
  if (is_wall(d.sides))
    work += right * (x[0] - (right >= 0 ? d.left : d.left + d.width));
  return scenario.fluid.density * work /
         (scenario.fluid.sound_speed * scenario.fluid.sound_speed);
}

template <int D, class To, class From>
State<D, To> converted(const State<D, From>& from) {
  using Real = typename To::Real;
  using Position = typename To::Position;
  State<D, To> to;
  to.clock = from.clock;
  to.fluid.id = from.fluid.id;
  to.fluid.mass = converted_numbers<Real>(from.fluid.mass);
  to.fluid.position = converted_vectors<Position>(from.fluid.position);
  to.fluid.velocity = converted_vectors<Real>(from.fluid.velocity);
  to.fluid.superficial_density = converted_numbers<Real>(from.fluid.superficial_density);
  to.grains.id = from.grains.id;
  to.grains.species = from.grains.species;
  to.grains.position = converted_vectors<Position>(from.grains.position);
  to.grains.velocity = converted_vectors<Real>(from.grains.velocity);
  to.grains.spin = converted_vectors<Real>(from.grains.spin);
  to.contacts.key = from.contacts.key;
  to.contacts.spring = converted_vectors<Real>(from.contacts.spring);
  return to;
}

template <int D, class P>
State<D, P> first_state(const Scenario& resolved) {
  static_assert(D == 2, "a scenario describes a width and a height");
  require_resolved(resolved);
  DoubleState state;
  state.clock.dt = resolved.time.dt;
  if (resolved.has_grains()) place_grains<P>(resolved, state);
  if (resolved.has_fluid()) {
    place_fluid<P>(resolved, state);
    const std::vector<double> eps = floored_porosity(resolved, state);
    const bool full = resolved.fluid.pressure == PressureForm::full;
    const double volume = resolved.fluid.spacing * resolved.fluid.spacing;
    for (std::size_t a = 0; a < state.fluid.size(); ++a) {
      double rho = resolved.fluid.density;
      if (full)
        rho += hydrostatic_excess_density(resolved, state.fluid.position[a], resolved.fluid.level);
      state.fluid.superficial_density[a] = eps[a] * rho;
      state.fluid.mass[a] = eps[a] * rho * volume;
    }
  }
  return converted<D, P>(state);
}

template State<2, DoublePrecision> first_state<2, DoublePrecision>(const Scenario&);
template State<2, FloatPrecision> first_state<2, FloatPrecision>(const Scenario&);
template State<2, MixedPrecision> first_state<2, MixedPrecision>(const Scenario&);
template State<2, DoublePrecision> converted<2, DoublePrecision>(const State<2, DoublePrecision>&);
template State<2, DoublePrecision> converted<2, DoublePrecision>(const State<2, FloatPrecision>&);
template State<2, DoublePrecision> converted<2, DoublePrecision>(const State<2, MixedPrecision>&);
template State<2, FloatPrecision> converted<2, FloatPrecision>(const State<2, DoublePrecision>&);
template State<2, MixedPrecision> converted<2, MixedPrecision>(const State<2, DoublePrecision>&);

}  // namespace varve::core
