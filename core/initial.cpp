#include "core/initial.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/constants.h"
#include "core/coupling.h"
#include "core/grain_placement.h"
#include "core/initial_flow.h"
#include "core/math.h"
#include "core/random.h"
#include "core/walls.h"
#include "core/workers.h"

namespace varve::core {
namespace {

template <int D>
using DoubleState = State<D, DoublePrecision>;

// Draws of one id are told apart by number; grains use others than the fluid, since both may have
// the same seed.
constexpr std::uint64_t first_fluid_draw = 0;

void require_resolved(const Scenario& s, int dimension) {
  const auto need = [](bool given, const char* key) {
    if (!given) throw std::logic_error(std::string("scenario not resolved: ") + key);
  };
  const auto number = [](double value) { return std::isfinite(value); };
  need(s.domain.dimension == dimension, "domain.dimension");
  need(number(s.domain.width), "domain.width");
  need(number(s.domain.height), "domain.height");
  if (dimension == 3) need(number(s.domain.depth), "domain.depth");
  need(number(s.time.dt), "time.dt");
  if (s.has_fluid()) {
    need(number(s.fluid.level), "fluid.level");
    need(number(s.fluid.sound_speed), "fluid.sound_speed");
    need(s.fluid.pressure != PressureForm::automatic, "fluid.pressure");
  }
  const Arrangement arrangement = s.grains.arrangement;
  if (s.has_grains() &&
      (arrangement == Arrangement::square || arrangement == Arrangement::hexagonal)) {
    need(number(s.grains.centre_x), "grains.centre_x");
    need(number(s.grains.lowest_y), "grains.lowest_y");
    if (dimension == 3) need(number(s.grains.centre_z), "grains.centre_z");
  }
  if (s.is_coupled()) {
    need(number(s.coupling.length), "coupling.length");
    need(number(s.coupling.porosity_floor), "coupling.porosity_floor");
  }
}

/// A point of D coordinates from three.
template <int D>
Vec<double, D> point(double x, double y, double z) {
  if constexpr (D == 2) return {x, y};
  if constexpr (D == 3) return {x, y, z};
}

template <int D>
Vec<double, D> jittered(Vec<double, D> x, double amplitude, std::uint64_t seed, std::uint64_t id,
                        std::uint64_t first_draw) {
  if (amplitude == 0) return x;
  for (int k = 0; k < D; ++k)
    x[k] += amplitude * symmetric(seed, id, first_draw + static_cast<std::uint64_t>(k));
  return x;
}

/// Positions rounded as they will be stored, so that porosity belongs to what the engine will see.
template <int D, class P>
Vec<double, D> as_stored(const Vec<double, D>& x) {
  return x.template cast<typename P::Position>().template cast<double>();
}

template <int D, class P>
void place_grains(const Scenario& s, DoubleState<D>& state) {
  const Box<D> box = domain_box<D>(s);
  for (const ListedGrain& grain : placed_grains(s)) {
    const auto& x = grain.position;
    const auto& v = grain.velocity;
    state.grains.id.push_back(state.grains.size());
    state.grains.species.push_back(grain.species);
    state.grains.position.push_back(as_stored<D, P>(box.wrapped(point<D>(x[0], x[1], x[2]))));
    state.grains.velocity.push_back(point<D>(v[0], v[1], v[2]));
    if (s.contact.rotation) {
      Vec<double, spin_components<D>> spin;
      for (int k = 0; k < spin_components<D>; ++k) spin[k] = grain.spin[D == 2 ? 2 : k];
      state.grains.spin.push_back(spin);
    }
    if (s.grains.motion == GrainMotion::driven) state.grains.driven.push_back(1);
  }
}

template <int D, class P>
void place_fluid(const Scenario& s, DoubleState<D>& state) {
  const double dx = s.fluid.spacing;
  const Box<D> box = domain_box<D>(s);
  const bool pipe = D == 3 && s.domain.shape == Shape::pipe;
  const std::int64_t across = whole_spacings("domain.width", s.domain.width, dx);
  const std::int64_t columns =
      std::isnan(s.fluid.width) ? across : whole_spacings("fluid.width", s.fluid.width, dx);
  const std::int64_t rows = nearest_integer(s.fluid.level / dx);
  const std::int64_t layers = D == 2 ? 1 : whole_spacings("domain.depth", s.domain.depth, dx);
  const auto at = [dx](std::int64_t k) { return (static_cast<double>(k) + 0.5) * dx; };
  for (std::int64_t j = 0; j < rows; ++j)
    for (std::int64_t k = 0; k < layers; ++k)
      for (std::int64_t i = 0; i < columns; ++i) {
        if (pipe && !in_pipe(i, k, across)) continue;
        const std::uint64_t id = state.fluid.size();
        const Vec<double, D> site = box.lower + point<D>(at(i), at(j), at(k));
        const Vec<double, D> x =
            jittered<D>(site, s.fluid.jitter * dx, static_cast<std::uint64_t>(s.fluid.seed), id,
                        first_fluid_draw);
        state.fluid.id.push_back(id);
        state.fluid.position.push_back(as_stored<D, P>(box.wrapped(x)));
        state.fluid.velocity.push_back(initial_velocity<D>(s, state.fluid.position.back()));
      }
  // A volume of dx^D each, until porosity is known: only m / rhob enters it.
  state.fluid.mass.assign(state.fluid.size(), integer_power<D>(dx));
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

template <int D>
std::vector<double> floored_porosity(const Scenario& scenario, const DoubleState<D>& state) {
  const Constants<D> c = constants_of<D>(scenario);
  std::vector<double> porosity(state.fluid.size(), 1.0);
  if (!c.two_way || state.grains.size() == 0 || state.fluid.size() == 0) return porosity;
  std::vector<double> volume(state.fluid.size());
  for (std::size_t a = 0; a < volume.size(); ++a)
    volume[a] = state.fluid.mass[a] / state.fluid.superficial_density[a];
  Workers alone(1);
  CouplingStage<D, DoublePrecision> coupling;
  coupling.rebuild(c, state, domain_walls(scenario), 0.0, alone);
  std::vector<double> unfloored(state.fluid.size());
  coupling.porosity(c, state, volume, unfloored, porosity, alone);
  return porosity;
}

template <int D>
double hydrostatic_excess_density(const Scenario& scenario, const Vec<double, D>& x,
                                  double surface) {
  const Domain& d = scenario.domain;
  const double down = scenario.gravity.magnitude * cos(scenario.gravity.tilt);
  const double right = scenario.gravity.magnitude * sin(scenario.gravity.tilt);
  double work = 0;  // [m2/s2] of gravity from the surface to x
  if (d.bottom != Boundary::periodic) work += down * (surface - x[1]);
  if (is_wall(d.sides))
    work += right * (x[0] - (right >= 0 ? d.left : d.left + d.width));
  const double compression =
      work / (scenario.fluid.sound_speed * scenario.fluid.sound_speed);
  if (scenario.fluid.equation_of_state == EquationOfState::linear)
    return scenario.fluid.density * compression;
  // Tait's equation solved for the density. Above a surface nothing carries any tension.
  const double ratio = std::max(0.0, 1 + 7 * compression);
  return scenario.fluid.density * (pow(ratio, 1.0 / 7) - 1);
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
  to.grains.driven = from.grains.driven;
  to.contacts.key = from.contacts.key;
  to.contacts.spring = converted_vectors<Real>(from.contacts.spring);
  to.contacts.rolling = converted_vectors<Real>(from.contacts.rolling);
  return to;
}

template <int D, class P>
State<D, P> first_state(const Scenario& resolved) {
  require_resolved(resolved, D);
  DoubleState<D> state;
  state.clock.dt = resolved.time.dt;
  if (resolved.has_grains()) place_grains<D, P>(resolved, state);
  if (resolved.has_fluid()) {
    place_fluid<D, P>(resolved, state);
    const std::vector<double> eps = floored_porosity<D>(resolved, state);
    const bool full = resolved.fluid.pressure == PressureForm::full;
    const double volume = integer_power<D>(resolved.fluid.spacing);
    for (std::size_t a = 0; a < state.fluid.size(); ++a) {
      double rho = resolved.fluid.density;
      if (full)
        rho += hydrostatic_excess_density<D>(resolved, state.fluid.position[a],
                                             resolved.fluid.level);
      rho += initial_excess_density<D>(resolved, state.fluid.position[a]);
      state.fluid.superficial_density[a] = eps[a] * rho;
      state.fluid.mass[a] = eps[a] * rho * volume;
    }
  }
  return converted<D, P>(state);
}

#define VARVE_INSTANTIATE(D)                                                                     \
  template State<D, DoublePrecision> first_state<D, DoublePrecision>(const Scenario&);           \
  template State<D, FloatPrecision> first_state<D, FloatPrecision>(const Scenario&);             \
  template State<D, MixedPrecision> first_state<D, MixedPrecision>(const Scenario&);             \
  template std::vector<double> floored_porosity<D>(const Scenario&, const DoubleState<D>&);      \
  template double hydrostatic_excess_density<D>(const Scenario&, const Vec<double, D>&, double); \
  template State<D, DoublePrecision> converted<D, DoublePrecision>(                              \
      const State<D, DoublePrecision>&);                                                         \
  template State<D, DoublePrecision> converted<D, DoublePrecision>(                              \
      const State<D, FloatPrecision>&);                                                          \
  template State<D, DoublePrecision> converted<D, DoublePrecision>(                              \
      const State<D, MixedPrecision>&);                                                          \
  template State<D, FloatPrecision> converted<D, FloatPrecision>(                                \
      const State<D, DoublePrecision>&);                                                         \
  template State<D, MixedPrecision> converted<D, MixedPrecision>(                                \
      const State<D, DoublePrecision>&);
VARVE_INSTANTIATE(2)
VARVE_INSTANTIATE(3)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
