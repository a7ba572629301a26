// Gradients exact for linear fields, and the sweep that keeps particles even: both for scenes with
// fluid.shifting (core/PHYSICS.md, E17 and E18).
#pragma once

#include "core/lanes_impl.h"
#include "core/pair_lanes_impl.h"
#include "core/pair_sweeps.h"

namespace varve::core::VARVE_ISA {
namespace {

/// Bonet and Lok's (1999) correction L_a = (-sum_b V_b (W'/r) r_ab r_ab^T)^-1 of the gradients of
/// eight particles, gathered along with the velocity gradient that it corrects. Upper triangles,
/// row by row.
template <int D, class T>
struct CorrectedGradients {
  static constexpr int numbers = symmetric_numbers<D>;
  Lane<T> moment[numbers] = {}, shear[numbers] = {};

  /// A neighbour at r_ab = d that moves with dv = v_ab; weight = V_b (W'/r).
  inline __attribute__((always_inline)) void add(Lane<T> weight, const Lane<T>* d,
                                                 const Lane<T>* dv) {
    for (int c = 0, n = 0; c < D; ++c)
      for (int k = c; k < D; ++k, ++n) {
        moment[n] -= weight * (d[c] * d[k]);
        shear[n] += weight * (c == k ? dv[c] * d[c] : dv[c] * d[k] + dv[k] * d[c]);
      }
  }

  /// Stores the correction of lane l; returns sum_b V_b v_ab . L_a (W'/r) r_ab.
  inline __attribute__((always_inline)) T divergence(std::size_t l, T scale, T* correction) const {
    T m[numbers];
    for (int n = 0; n < numbers; ++n) m[n] = scale * moment[n][l];
    invert(m, correction);
    T sum = 0;
    for (int n = 0; n < numbers; ++n) sum += correction[n] * shear[n][l];
    return sum;
  }

 private:
  /// The inverse; 1 where too few neighbours leave none to speak of (the determinant is 1 among
  /// even neighbours all around, 1/4 in the flat and 1/8 in the solid corner of a box without
  /// walls).
  static inline __attribute__((always_inline)) void invert(const T* m, T* inverse) {
    constexpr T least = T(0.1);
    T determinant;
    if constexpr (D == 2) {
      determinant = m[0] * m[2] - m[1] * m[1];
      inverse[0] = m[2], inverse[1] = -m[1], inverse[2] = m[0];
    } else {
      inverse[0] = m[3] * m[5] - m[4] * m[4];
      inverse[1] = m[2] * m[4] - m[1] * m[5];
      inverse[2] = m[1] * m[4] - m[2] * m[3];
      inverse[3] = m[0] * m[5] - m[2] * m[2];
      inverse[4] = m[1] * m[2] - m[0] * m[4];
      inverse[5] = m[0] * m[3] - m[1] * m[1];
      determinant = m[0] * inverse[0] + m[1] * inverse[1] + m[2] * inverse[2];
    }
    const bool good = determinant > least;
    for (int c = 0, n = 0; c < D; ++c)
      for (int k = c; k < D; ++k, ++n) inverse[n] = good ? inverse[n] / determinant : T(c == k);
  }
};

/// L d of a correction held in D (D + 1) / 2 lanes.
template <int D, class T>
inline __attribute__((always_inline)) void correct(const Lane<T>* correction, const Lane<T>* d,
                                                   Lane<T>* corrected) {
  for (int c = 0; c < D; ++c) corrected[c] = Lane<T>{};
  for (int c = 0, n = 0; c < D; ++c)
    for (int k = c; k < D; ++k, ++n) {
      corrected[c] += correction[n] * d[k];
      if (k != c) corrected[k] += correction[n] * d[c];
    }
}

template <int D, class T>
inline __attribute__((always_inline)) void gather_corrections(const T* data,
                                                              const std::int32_t* index,
                                                              Lane<T>* correction) {
  for (int n = 0; n < symmetric_numbers<D>; ++n)
    correction[n] = gather(data, index, symmetric_numbers<D>, n);
}

/// Particle shifting as a velocity (Sun, Colagrossi, Marrone and Zhang 2017, without the term
/// against pairing, which Wendland's kernel does not need):
///   u_a = -2 h U sum_b V_b grad W_ab, at most U/2 along each axis,
/// over fluid and dummies; zero where particles lie evenly.
template <int D, class P, Kernel K, bool periodic>
void shift_loop(const SweepData<D, P>& s, std::size_t group_begin, std::size_t group_end) {
  using Real = typename P::Real;
  using Position = typename P::Position;
  const Real h = s.smoothing_length, inverse_h = Real(1) / h;
  const Real scale = Real(-2) * h * s.shifting_speed * normalisation<K, D, Real>() /
                     power_of_length<D>(h) * inverse_h * inverse_h;
  const Real most = Real(0.5) * s.shifting_speed;
  for (std::size_t g = group_begin; g < group_end; ++g) {
    const OwnPlaces own(g, s.count);
    const Indices id(s.order, own.index);
    Lane<Position> x[D];
    Lane<Real> uneven[D] = {};
    for (int c = 0; c < D; ++c) x[c] = gather(s.position, id.index, D, c);
    Separation<D, P> pair;
    for (std::uint32_t k = s.fluid.start[g]; k < s.fluid.start[g + 1]; ++k) {
      const Indices there(s.order, s.fluid.index + std::size_t(k) * lanes);
      const std::int32_t* j = there.index;
      pair.template set<periodic>(x, s.position, j, s.period, inverse_h);
      const Lane<Real> slope = gather<Real>(s.volume, j, 1, 0) * kernel_slope<K, Real>(pair.q);
      for (int c = 0; c < D; ++c) uneven[c] += slope * pair.d[c];
    }
    for (std::uint32_t k = s.walls.start[g]; k < s.walls.start[g + 1]; ++k) {
      const std::int32_t* j = s.walls.index + std::size_t(k) * lanes;
      pair.template set<periodic>(x, s.wall_position, j, s.period, inverse_h);
      const Lane<Real> slope = gather(s.wall_volume, j, 1, 0) * kernel_slope<K, Real>(pair.q);
      for (int c = 0; c < D; ++c) uneven[c] += slope * pair.d[c];
    }
    for (std::size_t l = 0; l < own.used; ++l)
      for (int c = 0; c < D; ++c) {
        const Real u = scale * uneven[c][l];
        s.shift_velocity[std::size_t(id.index[l]) * D + std::size_t(c)] =
            u > most ? most : u < -most ? -most : u;
      }
  }
}

}  // namespace
}  // namespace varve::core::VARVE_ISA
