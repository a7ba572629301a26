// The hot loops, included once per instruction set with VARVE_ISA naming the inner namespace. No
// inline function of the standard library is called here: the linker might otherwise keep the copy
// made for a wider instruction set and run it on a processor that lacks it.
// (No include guard beyond the pragma is needed: each source file includes it once.)
#pragma once

#include "core/lanes_impl.h"
#include "core/pair_lanes_impl.h"
#include "core/pair_sweeps.h"
#include "core/shift_sweep_impl.h"

namespace varve::core::VARVE_ISA {
namespace {

/// Continuity for the superficial density (Robinson, Ramaioli and Luding 2014, in the volume form
/// that is energy-consistent with the pressure force below) with density diffusion on the intrinsic
/// density (Molteni and Colagrossi 2009):
///   d rhob_a/dt = rhob_a sum_b V_b v_ab . grad W_ab
///               + eps_a delta h c0 sum_fluid 2 (rho_a - rho_b) (W'/r) V_b
/// (`corrected`: the first gradient is L_a grad W_ab, exact for linear fields)
/// then the pressure of the intrinsic density rho = rhob/eps: linear, P = c0^2 (rho - rho0), or
/// Tait's, P = B ((rho/rho0)^7 - 1) with B = rho0 c0^2 / 7.
template <int D, class P, Kernel K, bool periodic, bool corrected>
void density_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  const Real inverse_h = Real(1) / s.smoothing_length;
  const Real slope_scale =
      normalisation<K, D, Real>() / power_of_length<D>(s.smoothing_length) * inverse_h * inverse_h;
  const Real diffusion = Real(2) * s.diffusion * s.smoothing_length * s.sound_speed;
  const Real stiffness = s.sound_speed * s.sound_speed;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnPlaces own(g, s.count);
    const Indices id(s.order, own.index);
    const Particles<D, P> here(s, own.index);
    Lane<Real> divergence{}, spread{};
    Separation<D, P> pair;
    CorrectedGradients<D, Real> gradients;
    const auto add = [&](Lane<Real> weight, const Lane<Real>* dv) {
      if constexpr (corrected) {
        gradients.add(weight, pair.d, dv);
      } else {
        Lane<Real> approach{};
        for (int c = 0; c < D; ++c) approach += dv[c] * pair.d[c];
        divergence += weight * approach;
      }
    };
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const std::int32_t* j = s.fluid.index + std::size_t(k) * lanes;
      const Particles<D, P> there(s, j);
      pair.template set<periodic>(here.x, there.x, s.period, inverse_h);
      Lane<Real> dv[D], drop = here.first - there.first;
      for (int c = 0; c < D; ++c) {
        dv[c] = here.v[c] - there.v[c];
        drop += s.hydrostatic_gradient[c] * -pair.d[c];
      }
      const Lane<Real> weight = there.second * kernel_slope<K, Real>(pair.q);
      add(weight, dv);
      spread += weight * drop;
    }
    for (std::uint32_t k = s.walls.start[g]; k < s.walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.walls.index + std::size_t(k) * lanes;
      pair.template set<periodic>(here.x, s.wall_position, j, s.period, inverse_h);
      Lane<Real> dv[D];
      for (int c = 0; c < D; ++c) dv[c] = here.v[c] - gather(s.wall_own_velocity, j, D, c);
      add(gather(s.wall_volume, j, 1, 0) * kernel_slope<K, Real>(pair.q), dv);
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t place = g * lanes + l;
      const auto i = std::size_t(id.index[l]);
      const Real eps = s.porosity ? s.porosity[i] : Real(1);
      const Real rhob = s.superficial_density[i];
      if constexpr (corrected)
        divergence[l] = gradients.divergence(
            l, slope_scale, s.gradient_correction + place * std::size_t(symmetric_numbers<D>));
      const Real rate =
          slope_scale * (rhob * divergence[l] + eps * diffusion * spread[l]);
      const Real next = rhob + s.dt * rate;
      s.density_out[place] = next;
      s.volume_out[place] = s.mass[i] / next;
      Real pressure;
      if (s.tait_pressure > Real(0)) {
        const Real ratio = next / eps / s.reference_density, cube = ratio * ratio * ratio;
        pressure = s.tait_pressure * (cube * cube * ratio - Real(1));
      } else {
        pressure = stiffness * (next / eps - s.reference_density);
      }
      s.pressure_out[place] = pressure;
      s.push_out[place] = pressure;
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
    const OwnPlaces own(g, s.wall_count);
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
/// (`conjugate`, core/coupling.h); the viscous part is then also stored by itself. `corrected`:
///   -(P_a L_a + P_b L_b) (W'/r) r_ab
/// in place of the first term, whose work is that of the corrected continuity; dummies have L_a.
template <int D, class P, Kernel K, bool periodic, PressureSum sum>
void stress_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  const Real inverse_h = Real(1) / s.smoothing_length;
  const Real slope_scale =
      normalisation<K, D, Real>() / power_of_length<D>(s.smoothing_length) * inverse_h * inverse_h;
  const Real soft = Real(0.01) * s.smoothing_length * s.smoothing_length;
  const Real viscous = Real(2) * s.viscosity;
  constexpr bool conjugate = sum == PressureSum::conjugate;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnPlaces own(g, s.count);
    const Particles<D, P> here(s, own.index);
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
    constexpr int numbers = symmetric_numbers<D>;
    Lane<Real> own_correction[numbers], tensor[numbers], along[D];
    if constexpr (sum == PressureSum::corrected)
      gather_corrections<D, Real>(s.gradient_correction, own.index, own_correction);
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const std::int32_t* j = s.fluid.index + std::size_t(k) * lanes;
      const Particles<D, P> there(s, j);
      pair.template set<periodic>(here.x, there.x, s.period, inverse_h);
      const Lane<Real> weight = there.second * kernel_slope<K, Real>(pair.q);
      const Lane<Real> push = -(here.first + there.first) * weight;
      const Lane<Real> drag = viscous * weight * (pair.r2 / (pair.r2 + soft));
      if constexpr (sum == PressureSum::corrected) {
        gather_corrections<D, Real>(s.gradient_correction, j, tensor);
        for (int n = 0; n < numbers; ++n)
          tensor[n] = here.first * own_correction[n] + there.first * tensor[n];
        correct<D, Real>(tensor, pair.d, along);
        for (int c = 0; c < D; ++c) add(-weight * along[c], drag, c, there.v[c]);
      } else {
        for (int c = 0; c < D; ++c) add(push * pair.d[c], drag, c, there.v[c]);
      }
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
      if constexpr (sum == PressureSum::corrected) {
        correct<D, Real>(own_correction, pair.d, along);
        for (int c = 0; c < D; ++c)
          add(push * along[c], drag, c, gather<Real>(s.wall_velocity, j, D, c));
      } else {
        for (int c = 0; c < D; ++c)
          add(push * pair.d[c], drag, c, gather<Real>(s.wall_velocity, j, D, c));
      }
    }
    for (std::size_t l = 0; l < own.used; ++l) {
      const std::size_t i = g * lanes + l;
      for (int c = 0; c < D; ++c)
        if constexpr (conjugate) {
          const Real viscous_part = slope_scale * here.second[l] * shear[c][l];
          s.viscous_force[i * D + std::size_t(c)] = viscous_part;
          s.stress_force[i * D + std::size_t(c)] =
              slope_scale * here.second[l] * force[c][l] + viscous_part;
        } else {
          s.stress_force[i * D + std::size_t(c)] = slope_scale * here.second[l] * force[c][l];
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
    const OwnPlaces own(g, s.count);
    const Indices id(s.order, own.index);
    Lane<Position> x[D];
    Lane<Real> v[D], force[D] = {}, other_v[D];
    for (int c = 0; c < D; ++c) {
      x[c] = gather(s.position, id.index, D, c);
      v[c] = gather(s.velocity, id.index, D, c);
    }
    const Lane<Real> rhob = gather<Real>(s.superficial_density_next, id.index, 1, 0);
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
      const Indices there(s.order, s.fluid.index + std::size_t(k) * lanes);
      const std::int32_t* j = there.index;
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
        const Real each = slope_scale * s.volume[id.index[l]] * force[c][l];
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

template <int D, class P, Kernel K, bool periodic, PressureSum sum>
PairSweeps<D, P> sweeps_of() {
  constexpr bool corrected = sum == PressureSum::corrected;
  return {density_loop<D, P, K, periodic, corrected>,
          extrapolate_loop<D, P, K, periodic>,
          stress_loop<D, P, K, periodic, sum>,
          artificial_loop<D, P, K, periodic>,
          corrected ? shift_loop<D, P, K, periodic> : nullptr,
          reads_records};
}

template <int D, class P, Kernel K, PressureSum sum>
PairSweeps<D, P> sweeps_with(bool periodic) {
  return periodic ? sweeps_of<D, P, K, true, sum>() : sweeps_of<D, P, K, false, sum>();
}

template <int D, class P, Kernel K>
PairSweeps<D, P> sweeps_for(bool periodic, PressureSum sum) {
  switch (sum) {
    case PressureSum::conjugate: return sweeps_with<D, P, K, PressureSum::conjugate>(periodic);
    case PressureSum::corrected: return sweeps_with<D, P, K, PressureSum::corrected>(periodic);
    case PressureSum::plain: break;
  }
  return sweeps_with<D, P, K, PressureSum::plain>(periodic);
}

}  // namespace

template <int D, class P>
PairSweeps<D, P> sweeps(Kernel kernel, bool periodic, PressureSum sum) {
  switch (kernel) {
    case Kernel::cubic: return sweeps_for<D, P, Kernel::cubic>(periodic, sum);
    case Kernel::quintic: return sweeps_for<D, P, Kernel::quintic>(periodic, sum);
    case Kernel::wendland_c2: break;
  }
  return sweeps_for<D, P, Kernel::wendland_c2>(periodic, sum);
}

template PairSweeps<2, DoublePrecision> sweeps<2, DoublePrecision>(Kernel, bool, PressureSum);
template PairSweeps<2, FloatPrecision> sweeps<2, FloatPrecision>(Kernel, bool, PressureSum);
template PairSweeps<2, MixedPrecision> sweeps<2, MixedPrecision>(Kernel, bool, PressureSum);
template PairSweeps<3, DoublePrecision> sweeps<3, DoublePrecision>(Kernel, bool, PressureSum);
template PairSweeps<3, FloatPrecision> sweeps<3, FloatPrecision>(Kernel, bool, PressureSum);
template PairSweeps<3, MixedPrecision> sweeps<3, MixedPrecision>(Kernel, bool, PressureSum);

}  // namespace varve::core::VARVE_ISA
