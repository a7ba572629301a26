#include "core/coupling.h"

#include <algorithm>
#include <cmath>

#include "core/kernel.h"

namespace varve::core {

namespace {
// Fluid particles, most of which no grain is near, below which a second thread is not worth waking.
constexpr std::size_t few_items = 2048;

template <int D>
using CouplingKernel = SmoothingKernel<D, Kernel::wendland_c2, double>;

/// a - b over the nearest periodic image.
template <int D, class T>
Vec<double, D> difference(const Constants<D>& c, const Vec<T, D>& a, const Vec<T, D>& b) {
  Vec<double, D> difference;
  for (int k = 0; k < D; ++k) {
    double d = static_cast<double>(a[k]) - static_cast<double>(b[k]);
    const double length = c.period.length[k];
    if (d > 0.5 * length) d -= length;
    if (d < -0.5 * length) d += length;
    difference[k] = d;
  }
  return difference;
}

template <int D>
double length_of(const Vec<double, D>& v) {
  double r2 = 0;
  for (int k = 0; k < D; ++k) r2 += v[k] * v[k];
  return std::sqrt(r2);
}

/// Distance over the nearest periodic image.
template <int D, class T>
double separation(const Constants<D>& c, const Vec<T, D>& a, const Vec<T, D>& b) {
  return length_of<D>(difference<D>(c, a, b));
}

}  // namespace

template <int D, class P>
bool CouplingStage<D, P>::stale(const Constants<D>& c, const State<D, P>& state,
                                double skin) const {
  // The fluid's own lists watch the fluid with the same skin and are rebuilt together with these.
  if (listed_at_.size() != state.grains.size() || listed_fluid_ != state.fluid.size()) return true;
  for (std::size_t i = 0; i < listed_at_.size(); ++i)
    if (!(separation<D>(c, state.grains.position[i], listed_at_[i]) < 0.5 * skin)) return true;
  return false;
}

template <int D, class P>
void CouplingStage<D, P>::rebuild(const Constants<D>& c, const State<D, P>& state,
                             std::span<const Wall> walls, double skin,
                             Workers& workers) {
  const double radius = 2 * c.coupling_length + skin;
  const std::span<const Vec<Position, D>> grains(state.grains.position);
  const std::span<const Vec<Position, D>> fluid(state.fluid.position);
  // The coupling's support is wider than the fluid's: cells of its own, or Rc would be cut short.
  cells_.build(fluid, radius, c.period, workers);
  find_candidates<D, Position>(grains, cells_, radius, c.period, false, workers, set_, parts_,
                               fluid_of_);
  cells_.build(grains, radius, c.period, workers);
  find_candidates<D, Position>(grains, cells_, radius, c.period, true, workers, set_, parts_,
                               grains_of_);
  weights_.assign(fluid_of_.index.size(), 0);
  pushes_.clear();
  pressure_force_.clear();
  image_force_.clear();
  if (c.conjugate_pressure) {
    pushes_.assign(fluid_of_.index.size(), Vec<double, D>::Zero());
    pressure_force_.assign(grains.size(), Vec<double, D>::Zero());
    image_force_ = pressure_force_;
    mean_pressure_.assign(grains.size(), 0);
  }
  near_start_.assign(fluid.size() + 1, 0);
  for (const std::int32_t a : fluid_of_.index) ++near_start_[static_cast<std::size_t>(a) + 1];
  for (std::size_t a = 0; a < fluid.size(); ++a) near_start_[a + 1] += near_start_[a];
  near_.resize(fluid_of_.index.size());
  std::vector<std::uint32_t> next(near_start_.begin(), near_start_.end() - 1);
  for (std::size_t i = 0; i < grains.size(); ++i)
    for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot)
      near_[next[static_cast<std::size_t>(fluid_of_.index[slot])]++] = {
          static_cast<std::uint32_t>(i), slot};
  walls_.assign(walls.begin(), walls.end());
  listed_at_.assign(grains.begin(), grains.end());
  listed_fluid_ = fluid.size();
  forces_.assign(grains.size(), {});
  spread_volume_.assign(grains.size(), 0);
  reaction_per_weight_.assign(grains.size(), Vec<double, D>::Zero());
}

template <int D, class P>
typename CouplingStage<D, P>::Images CouplingStage<D, P>::images(const Constants<D>& c,
                                                                 const Vec<double, D>& x) const {
  // Along each axis: the place itself and its mirror image in either wall.
  double places[D][3];
  int counts[D];
  for (int k = 0; k < D; ++k) {
    places[k][0] = x[k];
    counts[k] = 1;
  }
  const Wall* pipe = nullptr;
  for (const Wall& wall : walls_) {
    if (!(distance_inside<D>(wall, x) < 2 * c.coupling_length)) continue;
    if (wall.is_pipe())
      pipe = &wall;
    else
      places[wall.axis][counts[wall.axis]++] = 2 * wall.at - x[wall.axis];
  }
  Images result;
  int total = 1;
  for (int k = 0; k < D; ++k) total *= counts[k];
  for (int n = 1; n < total; ++n) {  // 0 is the point itself
    int rest = n;
    Vec<double, D>& sign = result.sign[static_cast<std::size_t>(result.count)];
    Vec<double, D>& image = result.at[static_cast<std::size_t>(result.count++)];
    for (int k = 0; k < D; ++k) {
      image[k] = places[k][rest % counts[k]];
      sign[k] = rest % counts[k] == 0 ? 1 : -1;
      rest /= counts[k];
    }
  }
  if (!pipe) return result;
  // As in a plane that touches the curved wall where it is nearest, the images found so far too.
  result.normal = inward_normal<D>(*pipe, x);
  const Vec<double, D> across = -2 * distance_inside<D>(*pipe, x) * result.normal;
  const int flat = result.count;
  for (int n = -1; n < flat; ++n) {
    const auto into = static_cast<std::size_t>(result.count++), from = static_cast<std::size_t>(n);
    result.at[into] = (n < 0 ? x : result.at[from]) + across;
    result.sign[into] = n < 0 ? Vec<double, D>(Vec<double, D>::Ones()) : result.sign[from];
    result.curved[into] = true;
  }
  return result;
}

template <int D, class P>
void CouplingStage<D, P>::compute_weights(const Constants<D>& c, const State<D, P>& state,
                                     std::span<const Vec<Position, D>> fluid, Workers& workers) {
  const CouplingKernel<D> kernel(c.coupling_length);
  workers.run(state.grains.size(), 1, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t i = begin; i < end; ++i) {
      const Images mirrored = images(c, state.grains.position[i].template cast<double>());
      for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot) {
        const auto a = static_cast<std::size_t>(fluid_of_.index[slot]);
        const Vec<double, D> x = fluid[a].template cast<double>();
        double weight = kernel.value(separation<D>(c, fluid[a], state.grains.position[i]));
        // An image is never nearer than its grain, except to fluid that strayed into the wall: the
        // grain's own reach holds for both, since lists know of no other.
        if (weight > 0)
          for (int n = 0; n < mirrored.count; ++n)
            weight +=
                kernel.value(separation<D>(c, x, mirrored.at[static_cast<std::size_t>(n)]));
        weights_[slot] = weight;
      }
    }
  });
}

template <int D, class P>
void CouplingStage<D, P>::porosity(const Constants<D>& c, const State<D, P>& state,
                              std::span<const Real> volume_before, std::span<Real> porosity,
                              std::span<Real> floored, Workers& workers) {
  compute_weights(c, state, state.fluid.position, workers);
  workers.run(state.grains.size(), 1, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t i = begin; i < end; ++i) {
      const double own = c.species[state.grains.species[i]].volume;
      spread_volume_[i] = own;
      if (!c.conservative_porosity) continue;
      double of_fluid = 0;
      for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot)
        of_fluid += static_cast<double>(
                        volume_before[static_cast<std::size_t>(fluid_of_.index[slot])]) *
                    weights_[slot];
      if (of_fluid > 0) spread_volume_[i] = own / of_fluid;
    }
  });
  // Clamps are counted per part and added up; integers have no order.
  std::vector<std::uint64_t> clamps(workers.parts(), 0);
  workers.run(state.fluid.size(), few_items, [&](std::size_t begin, std::size_t end,
                                                  unsigned part) {
    for (std::size_t a = begin; a < end; ++a) {
      double solid = 0;
      for (std::uint32_t k = near_start_[a]; k < near_start_[a + 1]; ++k)
        solid += spread_volume_[near_[k].grain] * weights_[near_[k].slot];
      const double eps = 1 - solid;
      porosity[a] = static_cast<Real>(eps);
      floored[a] = static_cast<Real>(std::max(eps, c.porosity_floor));
      if (eps < c.porosity_floor) ++clamps[part];
    }
  });
  fluid_clamps_ = 0;
  for (const std::uint64_t each : clamps) fluid_clamps_ += each;
}

/// Porosity at grain i from the other grains, normalised so that a packed array still sees its
/// neighbours: eps_i = 1 - sum_{j != i} V_j W_ij / (1 - V_i W(0)).
template <int D, class P>
double CouplingStage<D, P>::others_porosity(const Constants<D>& c, const State<D, P>& state,
                                       std::size_t i) const {
  const CouplingKernel<D> kernel(c.coupling_length);
  double solid = 0;
  for (const std::int32_t j : grains_of_.of(i))
    solid += c.species[state.grains.species[static_cast<std::size_t>(j)]].volume *
             kernel.value(separation<D>(c, state.grains.position[i],
                                        state.grains.position[static_cast<std::size_t>(j)]));
  const double own = c.species[state.grains.species[i]].volume * kernel.value(0);
  return c.exclude_own_volume ? 1 - solid / (1 - own) : 1 - (solid + own);
}

template <int D, class P>
void CouplingStage<D, P>::share_pressure(const Constants<D>& c, std::span<const Real> volume,
                                         std::span<const Real> pressure,
                                         std::span<const Real> porosity,
                                         std::span<const Real> floored, std::span<Real> push,
                                         Workers& workers) {
  workers.run(forces_.size(), 1, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t i = begin; i < end; ++i) {
      mean_pressure_[i] = 0;
      double sum = 0, weights = 0;
      for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot) {
        const auto a = static_cast<std::size_t>(fluid_of_.index[slot]);
        const double weight = static_cast<double>(volume[a]) * weights_[slot];
        weights += weight;
        if (static_cast<double>(porosity[a]) >= c.porosity_floor)
          sum += weight * static_cast<double>(pressure[a]);
      }
      if (weights > 0) mean_pressure_[i] = sum / weights;
    }
  });
  workers.run(push.size(), few_items, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t a = begin; a < end; ++a) {
      double q = static_cast<double>(floored[a]) * static_cast<double>(pressure[a]);
      for (std::uint32_t k = near_start_[a]; k < near_start_[a + 1]; ++k)
        q += spread_volume_[near_[k].grain] * weights_[near_[k].slot] *
             mean_pressure_[near_[k].grain];
      push[a] = static_cast<Real>(q);
    }
  });
}

/// The conjugate pressure forces between grain i and the fluid around it.
template <int D, class P>
void CouplingStage<D, P>::push_apart(const Constants<D>& c, const State<D, P>& state,
                                     const FluidView<D, P>& fluid, std::size_t i) {
  const CouplingKernel<D> kernel(c.coupling_length);
  const Vec<double, D> x = state.grains.position[i].template cast<double>();
  const Images mirrored = images(c, x);
  Vec<double, D> on_grain = Vec<double, D>::Zero(), by_walls = Vec<double, D>::Zero();
  for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot) {
    const auto a = static_cast<std::size_t>(fluid_of_.index[slot]);
    pushes_[slot].setZero();
    if (weights_[slot] <= 0) continue;
    const bool floored = static_cast<double>(fluid.porosity[a]) < c.porosity_floor;
    const double pressure = floored ? 0.0 : static_cast<double>(fluid.pressure[a]);
    const double push = (pressure - mean_pressure_[i]) * spread_volume_[i];
    const double volume = static_cast<double>(fluid.volume[a]);
    const Vec<double, D> xa = fluid.position[a].template cast<double>();
    const Vec<double, D> d = difference<D>(c, xa, x);
    Vec<double, D> on_fluid = -push * kernel.slope(length_of<D>(d)) * d;
    on_grain -= volume * on_fluid;
    for (int n = 0; n < mirrored.count; ++n) {
      const auto k = static_cast<std::size_t>(n);
      const Vec<double, D> e = difference<D>(c, xa, mirrored.at[k]);
      const Vec<double, D> force = -push * kernel.slope(length_of<D>(e)) * e;
      const Vec<double, D> back = mirrored.turned_back(k, force);
      on_fluid += force;
      on_grain -= volume * back;
      by_walls += volume * (force - back);
    }
    pushes_[slot] = on_fluid;
  }
  pressure_force_[i] = on_grain;
  image_force_[i] = by_walls;
}

template <int D, class P>
Vec<double, D> CouplingStage<D, P>::walls_on_fluid() const {
  Vec<double, D> sum = Vec<double, D>::Zero();
  for (const Vec<double, D>& each : image_force_) sum += each;
  return sum;
}

template <int D, class P>
GrainForce<D> CouplingStage<D, P>::force_on(const Constants<D>& c, const State<D, P>& state,
                                       const FluidView<D, P>& fluid, const DragLaw<D>& law,
                                       std::size_t i) const {
  GrainForce<D> f;
  Vec<double, D> stress = Vec<double, D>::Zero(), velocity = Vec<double, D>::Zero();
  for (std::uint32_t slot = fluid_of_.start[i]; slot < fluid_of_.start[i + 1]; ++slot) {
    const auto a = static_cast<std::size_t>(fluid_of_.index[slot]);
    const double volume_weight = static_cast<double>(fluid.volume[a]) * weights_[slot];
    f.weight += volume_weight;
    velocity += volume_weight * fluid.velocity[a].template cast<double>();
    stress += weights_[slot] * fluid.stress_force[a].template cast<double>();
  }
  const double eps = others_porosity(c, state, i);
  f.porosity = std::max(eps, c.porosity_floor);
  const SpeciesConstants<D>& one = c.species[state.grains.species[i]];
  // A grain that has left the fluid feels none of it.
  if (f.weight <= 0) return f;
  f.fluid_velocity = velocity / f.weight;
  f.hydrodynamic = one.volume * stress / f.weight;
  if (c.conjugate_pressure) {
    f.pressure = pressure_force_[i];
    f.hydrodynamic += f.pressure;
  }
  const Vec<double, D> v = state.grains.velocity[i].template cast<double>();
  const Vec<double, D> slip = f.fluid_velocity - v;
  double speed2 = 0;
  for (int k = 0; k < D; ++k) speed2 += slip[k] * slip[k];
  const Slip argument{one.slip_factor * std::sqrt(speed2), f.porosity, one.diameter,
                      c.reference_density, c.viscosity};
  f.coefficient = one.slip_factor * drag_coefficient<D>(law, argument);
  return f;
}

template <int D, class P>
void CouplingStage<D, P>::forces(const Constants<D>& c, const State<D, P>& state,
                            const FluidView<D, P>& fluid, const DragLaw<D>& law,
                            Workers& workers) {
  if (!c.two_way) compute_weights(c, state, fluid.position, workers);
  workers.run(state.grains.size(), 1, [&](std::size_t begin, std::size_t end, unsigned) {
    for (std::size_t i = begin; i < end; ++i) {
      if (c.conjugate_pressure) push_apart(c, state, fluid, i);
      forces_[i] = force_on(c, state, fluid, law, i);
    }
  });
  grain_clamps_ = weak_ = 0;
  for (const GrainForce<D>& f : forces_) {
    if (f.porosity <= c.porosity_floor) ++grain_clamps_;
    if (f.weight < 0.5) ++weak_;
  }
}

template <int D, class P>
void CouplingStage<D, P>::set_drag(std::span<const Vec<double, D>> mean_drag) {
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    GrainForce<D>& f = forces_[i];
    f.drag = mean_drag[i];
    reaction_per_weight_[i] = f.weight > 0
                                  ? Vec<double, D>(-(f.hydrodynamic - f.pressure + f.drag) /
                                                   f.weight)
                                  : Vec<double, D>(Vec<double, D>::Zero());
  }
}

template class CouplingStage<2, DoublePrecision>;
template class CouplingStage<2, FloatPrecision>;
template class CouplingStage<2, MixedPrecision>;
template class CouplingStage<3, DoublePrecision>;
template class CouplingStage<3, FloatPrecision>;
template class CouplingStage<3, MixedPrecision>;

}  // namespace varve::core
