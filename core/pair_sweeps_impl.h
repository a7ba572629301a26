// The hot loops, included once per instruction set with VARVE_ISA naming the inner namespace. No
// inline function of the standard library is called here: the linker might otherwise keep the copy
// made for a wider instruction set and run it on a processor that lacks it.
// (No include guard beyond the pragma is needed: each source file includes it once.)
#pragma once

#include "core/lanes_impl.h"
#include "core/pair_sweeps.h"

namespace varve::core::VARVE_ISA {
namespace {

// Kernels without their normalisation: value f(q) and slope f'(q)/q, q = r/h, both zero beyond the
// support (physics: W = sigma/h^D f, grad W = sigma/h^(D+2) (f'/q) r_ab). Wendland 1995 C2: f =
// (1-q/2)^4 (2q+1), f'/q = -5 (1-q/2)^3. B-splines (Schoenberg): truncated powers, slope guarded at
// q = 0, where the true slope times r_ab is 0.
template <Kernel K, class T>
inline __attribute__((always_inline)) Lane<T> kernel_value(Lane<T> q) {
  if constexpr (K == Kernel::wendland_c2) {
    const Lane<T> u = positive<T>(T(1) - T(0.5) * q);
    const Lane<T> u2 = u * u;
    return u2 * u2 * (T(2) * q + T(1));
  } else if constexpr (K == Kernel::cubic) {
    const Lane<T> a = positive<T>(T(2) - q), b = positive<T>(T(1) - q);
    return T(0.25) * (a * a * a) - b * b * b;
  } else {
    const Lane<T> a = positive<T>(T(3) - q), b = positive<T>(T(2) - q), c = positive<T>(T(1) - q);
    return (a * a) * (a * a) * a - T(6) * ((b * b) * (b * b) * b) + T(15) * ((c * c) * (c * c) * c);
  }
}
template <Kernel K, class T>
inline __attribute__((always_inline)) Lane<T> kernel_slope(Lane<T> q) {
  if constexpr (K == Kernel::wendland_c2) {
    const Lane<T> u = positive<T>(T(1) - T(0.5) * q);
    return T(-5) * (u * u * u);
  } else {
    Lane<T> numerator;
    if constexpr (K == Kernel::cubic) {
      const Lane<T> a = positive<T>(T(2) - q), b = positive<T>(T(1) - q);
      numerator = T(3) * (b * b) - T(0.75) * (a * a);
    } else {
      const Lane<T> a = positive<T>(T(3) - q), b = positive<T>(T(2) - q),
                    c = positive<T>(T(1) - q);
      numerator = T(30) * ((b * b) * (b * b)) - T(5) * ((a * a) * (a * a)) -
                  T(75) * ((c * c) * (c * c));
    }
    const Lane<T> divisor = q > T(1e-12) ? q : T(1e-12) - Lane<T>{};
    const Lane<T> slope = numerator / divisor;
    return q > T(1e-12) ? slope : Lane<T>{};
  }
}

/// sigma in W = sigma/h^D f(q).
template <Kernel K, int D, class T>
inline T normalisation() {
  constexpr double pi = 3.14159265358979323846;
  if constexpr (K == Kernel::wendland_c2) return T(D == 2 ? 7 / (4 * pi) : 21 / (16 * pi));
  if constexpr (K == Kernel::cubic) return T(D == 2 ? 10 / (7 * pi) : 1 / pi);
  return T(D == 2 ? 7 / (478 * pi) : 1 / (120 * pi));
}
template <int D, class T>
inline T power_of_length(T h) {
  return D == 2 ? h * h : h * h * h;
}

/// Of eight particles: position, velocity and two numbers, which the records hold too.
template <int D, class P>
struct Particles {
  using Real = typename P::Real;
  using Position = typename P::Position;
  Lane<Position> x[D];
  Lane<Real> v[D], first, second;

  inline __attribute__((always_inline)) Particles(const SweepData<D, P>& s, const Real* firsts,
                                                  const Real* seconds,
                                                  const std::int32_t* index) {
#ifdef __AVX512F__
    static_cast<void>(firsts), static_cast<void>(seconds);
    Lane<Real> number[record_length];
    gather_records(s.records[0].number, index, number);
    for (int c = 0; c < D; ++c) {
      if constexpr (record_velocity<D, P> == 0)
        x[c] = gather(s.position, index, D, c);
      else
        x[c] = number[c];
      v[c] = number[record_velocity<D, P> + std::size_t(c)];
    }
    first = number[record_first<D, P>];
    second = number[record_first<D, P> + 1];
#else
    for (int c = 0; c < D; ++c) {
      x[c] = gather(s.position, index, D, c);
      v[c] = gather(s.velocity, index, D, c);
    }
    first = gather(firsts, index, 1, 0);
    second = gather(seconds, index, 1, 0);
#endif
  }
};

/// What one slot of a list holds for eight lanes: separation, its square, kernel argument.
template <int D, class P>
struct Separation {
  using Real = typename P::Real;
  using Position = typename P::Position;
  Lane<Real> d[D], r2, q;

  template <bool periodic>
  inline __attribute__((always_inline)) void set(const Lane<Position>* own,
                                                 const Lane<Position>* other,
                                                 const Position* period, Real inverse_h) {
    r2 = Lane<Real>{};
    for (int c = 0; c < D; ++c) {
      Lane<Position> wide = own[c] - other[c];
      if constexpr (periodic) {
        const Position length = period[c], half = length * Position(0.5);
        const Lane<Position> lengths = length - Lane<Position>{};
        wide = wide > half ? wide - lengths : wide;
        wide = wide < -half ? wide + lengths : wide;
        // A side that is not periodic has period 0: both lines then add or take away 0.
      }
      d[c] = narrow<Real, Position>(wide);
      r2 += d[c] * d[c];
    }
    q = r2;
    square_root<Real>(q);
    q *= inverse_h;
  }
  template <bool periodic>
  inline __attribute__((always_inline)) void set(const Lane<Position>* own, const Position* other,
                                                 const std::int32_t* index,
                                                 const Position* period, Real inverse_h) {
    Lane<Position> x[D];
    for (int c = 0; c < D; ++c) x[c] = gather(other, index, D, c);
    set<periodic>(own, x, period, inverse_h);
  }
};

/// Loads eight consecutive particles; lanes past the end repeat the last one and are not stored.
struct OwnIndex {
  std::int32_t index[lanes];
  std::size_t used;
  OwnIndex(std::size_t group, std::size_t count) {
    const std::size_t first = group * lanes;
    used = count - first < lanes ? count - first : lanes;
    for (std::size_t l = 0; l < lanes; ++l)
      index[l] = static_cast<std::int32_t>(first + (l < used ? l : used - 1));
  }
};

/// Continuity for the superficial density (Robinson, Ramaioli and Luding 2014, in the volume form
/// that is energy-consistent with the pressure force below) with density diffusion on the intrinsic
/// density (Molteni and Colagrossi 2009):
///   d rhob_a/dt = rhob_a sum_b V_b v_ab . grad W_ab
///               + eps_a delta h c0 sum_fluid 2 (rho_a - rho_b) (W'/r) V_b
/// then the pressure of the intrinsic density rho = rhob/eps: linear, P = c0^2 (rho - rho0), or
/// Tait's, P = B ((rho/rho0)^7 - 1) with B = rho0 c0^2 / 7.
template <int D, class P, Kernel K, bool periodic>
void density_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  const Real inverse_h = Real(1) / s.smoothing_length;
  const Real slope_scale =
      normalisation<K, D, Real>() / power_of_length<D>(s.smoothing_length) * inverse_h * inverse_h;
  const Real diffusion = Real(2) * s.diffusion * s.smoothing_length * s.sound_speed;
  const Real stiffness = s.sound_speed * s.sound_speed;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnIndex own(g, s.count);
    const Particles<D, P> here(s, s.density_before, s.volume_before, own.index);
    Lane<Real> divergence{}, spread{};
    Separation<D, P> pair;
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const std::int32_t* j = s.fluid.index + std::size_t(k) * lanes;
      const Particles<D, P> there(s, s.density_before, s.volume_before, j);
      pair.template set<periodic>(here.x, there.x, s.period, inverse_h);
      Lane<Real> approach{}, drop = here.first - there.first;
      for (int c = 0; c < D; ++c) {
        approach += (here.v[c] - there.v[c]) * pair.d[c];
        drop += s.hydrostatic_gradient[c] * -pair.d[c];
      }
      const Lane<Real> weight = there.second * kernel_slope<K, Real>(pair.q);
      divergence += weight * approach;
      spread += weight * drop;
    }
    for (std::uint32_t k = s.walls.start[g]; k < s.walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.walls.index + std::size_t(k) * lanes;
      pair.template set<periodic>(here.x, s.wall_position, j, s.period, inverse_h);
      Lane<Real> approach{};
      for (int c = 0; c < D; ++c)
        approach += (here.v[c] - gather(s.wall_own_velocity, j, D, c)) * pair.d[c];
      divergence += gather(s.wall_volume, j, 1, 0) * kernel_slope<K, Real>(pair.q) * approach;
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t i = g * lanes + l;
      const Real eps = s.porosity ? s.porosity[i] : Real(1);
      const Real rhob = s.superficial_density[i];
      const Real rate =
          slope_scale * (rhob * divergence[l] + eps * diffusion * spread[l]);
      const Real next = rhob + s.dt * rate;
      s.superficial_density_next[i] = next;
      s.volume[i] = s.mass[i] / next;
      Real pressure;
      if (s.tait_pressure > Real(0)) {
        const Real ratio = next / eps / s.reference_density, cube = ratio * ratio * ratio;
        pressure = s.tait_pressure * (cube * cube * ratio - Real(1));
      } else {
        pressure = stiffness * (next / eps - s.reference_density);
      }
      s.pressure[i] = pressure;
      s.push[i] = pressure;
    }
  }
}

/// Adami, Hu and Adams 2012: pressure and velocity of dummy particles from the fluid around them,
///   P_w = (sum_f P_f W + g . sum_f rho_f (r_w - r_f) W) / sum_f W
///   v_w = 2 v_wall - sum_f v_f W / sum_f W
/// with rho = rho0 + P / c0^2, which is exact for the linear equation of state and good to the
/// square of the compression for Tait's. Where pairs push with something else than P, so do
/// dummies.
template <int D, class P, Kernel K, bool periodic>
void extrapolate_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  using Position = typename P::Position;
  const Real inverse_h = Real(1) / s.smoothing_length;
  const Real stiffness = s.sound_speed * s.sound_speed;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnIndex own(g, s.wall_count);
    Lane<Position> x[D];
    for (int c = 0; c < D; ++c) x[c] = gather(s.wall_position, own.index, D, c);
    Lane<Real> weights{}, pressures{}, velocities[D] = {};
    Separation<D, P> pair;
    for (std::uint32_t k = s.of_walls.start[g]; k < s.of_walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.of_walls.index + std::size_t(k) * lanes;
      // Index -1 fills short lanes: its weight is taken to be 0.
      std::int32_t safe[lanes];
      Lane<Real> real{};
      for (std::size_t l = 0; l < lanes; ++l) {
        safe[l] = j[l] < 0 ? 0 : j[l];
        real[l] = j[l] < 0 ? Real(0) : Real(1);
      }
      pair.template set<periodic>(x, s.position, safe, s.period, inverse_h);
      const Lane<Real> w = real * kernel_value<K, Real>(pair.q);
      const Lane<Real> p = gather<Real>(s.pressure, safe, 1, 0);
      const Lane<Real> rho = p / stiffness + s.reference_density;
      Lane<Real> head{};
      for (int c = 0; c < D; ++c) {
        head += s.gravity[c] * pair.d[c];
        velocities[c] += w * gather(s.velocity, safe, D, c);
      }
      weights += w;
      pressures += w * (gather<Real>(s.push, safe, 1, 0) + rho * head);
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t i = g * lanes + l;
      const bool near = weights[l] > Real(0);
      s.wall_push[i] = near ? pressures[l] / weights[l] : Real(0);
      for (int c = 0; c < D; ++c) {
        const Real wall = s.wall_own_velocity[i * D + std::size_t(c)];
        s.wall_velocity[i * D + std::size_t(c)] =
            near ? Real(2) * wall - velocities[c][l] / weights[l] : wall;
      }
    }
  }
}

/// Pressure and viscous force (Morris, Fox and Zhu 1997), antisymmetric pair by pair:
///   F_a = V_a sum_b V_b [ -(P_a + P_b) (W'/r) r_ab + 2 mu (W'/r) r^2/(r^2 + 0.01 h^2) v_ab ]
/// with something else in place of P where grains take their part of the pressure work pair by pair
/// (`conjugate`, core/coupling.h); the viscous part is then also stored by itself.
template <int D, class P, Kernel K, bool periodic, bool conjugate>
void stress_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  const Real inverse_h = Real(1) / s.smoothing_length;
  const Real slope_scale =
      normalisation<K, D, Real>() / power_of_length<D>(s.smoothing_length) * inverse_h * inverse_h;
  const Real soft = Real(0.01) * s.smoothing_length * s.smoothing_length;
  const Real viscous = Real(2) * s.viscosity;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnIndex own(g, s.count);
    const Particles<D, P> here(s, s.push, s.volume, own.index);
    Lane<Real> force[D] = {}, shear[D] = {};
    const auto add = [&](Lane<Real> push, Lane<Real> drag, int c, Lane<Real> other) {
      if constexpr (conjugate) {
        force[c] += push;
        shear[c] += drag * (here.v[c] - other);
      } else {
        force[c] += push + drag * (here.v[c] - other);
      }
    };
    Separation<D, P> pair;
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const std::int32_t* j = s.fluid.index + std::size_t(k) * lanes;
      const Particles<D, P> there(s, s.push, s.volume, j);
      pair.template set<periodic>(here.x, there.x, s.period, inverse_h);
      const Lane<Real> weight = there.second * kernel_slope<K, Real>(pair.q);
      const Lane<Real> push = -(here.first + there.first) * weight;
      const Lane<Real> drag = viscous * weight * (pair.r2 / (pair.r2 + soft));
      for (int c = 0; c < D; ++c)
        add(push * pair.d[c], drag, c, there.v[c]);
    }
    for (std::uint32_t k = s.walls.start[g]; k < s.walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.walls.index + std::size_t(k) * lanes;
      pair.template set<periodic>(here.x, s.wall_position, j, s.period, inverse_h);
      const Lane<Real> slope = kernel_slope<K, Real>(pair.q);
      const Lane<Real> push =
          -(here.first + gather<Real>(s.wall_push, j, 1, 0)) *
          (gather(s.wall_volume, j, 1, 0) * slope);
      const Lane<Real> drag = viscous * (gather(s.wall_viscous_volume, j, 1, 0) * slope) *
                              (pair.r2 / (pair.r2 + soft));
      for (int c = 0; c < D; ++c)
        add(push * pair.d[c], drag, c, gather<Real>(s.wall_velocity, j, D, c));
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t i = g * lanes + l;
      for (int c = 0; c < D; ++c)
        if constexpr (conjugate) {
          const Real viscous_part = slope_scale * s.volume[i] * shear[c][l];
          s.viscous_force[i * D + std::size_t(c)] = viscous_part;
          s.stress_force[i * D + std::size_t(c)] =
              slope_scale * s.volume[i] * force[c][l] + viscous_part;
        } else {
          s.stress_force[i * D + std::size_t(c)] = slope_scale * s.volume[i] * force[c][l];
        }
    }
  }
}

/// Artificial viscosity (Monaghan 1992), for pairs that approach:
///   F_a -= sum_b m_a m_b Pi_ab (W'/r) r_ab,  Pi_ab = (-alpha c0 phi + beta phi^2) / rhobar_ab,
///   phi = h v_ab . r_ab / (r^2 + 0.01 h^2),
/// with masses and densities per volume of mixture. A dummy counts with the density of the fluid
/// beside it and the velocity of its wall.
template <int D, class P, Kernel K, bool periodic>
void artificial_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  using Position = typename P::Position;
  const Real h = s.smoothing_length, inverse_h = Real(1) / h;
  const Real slope_scale =
      normalisation<K, D, Real>() / power_of_length<D>(h) * inverse_h * inverse_h;
  const Real soft = Real(0.01) * h * h, linear = s.artificial_alpha * s.sound_speed;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnIndex own(g, s.count);
    Lane<Position> x[D];
    Lane<Real> v[D], force[D] = {}, other_v[D];
    for (int c = 0; c < D; ++c) {
      x[c] = gather(s.position, own.index, D, c);
      v[c] = gather(s.velocity, own.index, D, c);
    }
    const Lane<Real> rhob = gather<Real>(s.superficial_density_next, own.index, 1, 0);
    Separation<D, P> pair;
    const auto add = [&](Lane<Real> volume, Lane<Real> other_rhob) {
      Lane<Real> approach{};
      for (int c = 0; c < D; ++c) approach += (v[c] - other_v[c]) * pair.d[c];
      // Negative where they approach, else an exact zero.
      const Lane<Real> phi = -positive<Real>(-approach) * h / (pair.r2 + soft);
      const Lane<Real> mean = Real(0.5) * (rhob + other_rhob);
      const Lane<Real> push = -(volume * rhob * other_rhob / mean) *
                              (s.artificial_beta * phi - linear) * phi *
                              kernel_slope<K, Real>(pair.q);
      for (int c = 0; c < D; ++c) force[c] += push * pair.d[c];
    };
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const std::int32_t* j = s.fluid.index + std::size_t(k) * lanes;
      pair.template set<periodic>(x, s.position, j, s.period, inverse_h);
      for (int c = 0; c < D; ++c) other_v[c] = gather(s.velocity, j, D, c);
      add(gather<Real>(s.volume, j, 1, 0), gather<Real>(s.superficial_density_next, j, 1, 0));
    }
    for (std::uint32_t k = s.walls.start[g]; k < s.walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.walls.index + std::size_t(k) * lanes;
      pair.template set<periodic>(x, s.wall_position, j, s.period, inverse_h);
      for (int c = 0; c < D; ++c) other_v[c] = gather(s.wall_own_velocity, j, D, c);
      add(gather(s.wall_volume, j, 1, 0), rhob);
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t i = g * lanes + l;
      for (int c = 0; c < D; ++c) {
        const Real each = slope_scale * s.volume[i] * force[c][l];
        s.stress_force[i * D + std::size_t(c)] += each;
        if (s.conjugate) s.viscous_force[i * D + std::size_t(c)] += each;
      }
    }
  }
}

#ifdef __AVX512F__
constexpr bool reads_records = true;
#else
constexpr bool reads_records = false;
#endif

template <int D, class P, Kernel K, bool periodic>
PairSweeps<D, P> sweeps_of(bool conjugate) {
  return {density_loop<D, P, K, periodic>, extrapolate_loop<D, P, K, periodic>,
          conjugate ? stress_loop<D, P, K, periodic, true> : stress_loop<D, P, K, periodic, false>,
          artificial_loop<D, P, K, periodic>, reads_records};
}

template <int D, class P, Kernel K>
PairSweeps<D, P> sweeps_for(bool periodic, bool conjugate) {
  return periodic ? sweeps_of<D, P, K, true>(conjugate) : sweeps_of<D, P, K, false>(conjugate);
}

}  // namespace

template <int D, class P>
PairSweeps<D, P> sweeps(Kernel kernel, bool periodic, bool conjugate) {
  switch (kernel) {
    case Kernel::cubic: return sweeps_for<D, P, Kernel::cubic>(periodic, conjugate);
    case Kernel::quintic: return sweeps_for<D, P, Kernel::quintic>(periodic, conjugate);
    case Kernel::wendland_c2: break;
  }
  return sweeps_for<D, P, Kernel::wendland_c2>(periodic, conjugate);
}

template PairSweeps<2, DoublePrecision> sweeps<2, DoublePrecision>(Kernel, bool, bool);
template PairSweeps<2, FloatPrecision> sweeps<2, FloatPrecision>(Kernel, bool, bool);
template PairSweeps<2, MixedPrecision> sweeps<2, MixedPrecision>(Kernel, bool, bool);
template PairSweeps<3, DoublePrecision> sweeps<3, DoublePrecision>(Kernel, bool, bool);
template PairSweeps<3, FloatPrecision> sweeps<3, FloatPrecision>(Kernel, bool, bool);
template PairSweeps<3, MixedPrecision> sweeps<3, MixedPrecision>(Kernel, bool, bool);

}  // namespace varve::core::VARVE_ISA
