// What the loops over pairs share, eight particles side by side: kernels, separations, loads. For
// loops that are compiled once per instruction set with VARVE_ISA naming the inner namespace; no
// inline function of the standard library is called (core/lanes_impl.h says why).
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

/// Of the particles at eight places: position, velocity and the sweep's two numbers.
template <int D, class P>
struct Particles {
  using Real = typename P::Real;
  using Position = typename P::Position;
  Lane<Position> x[D];
  Lane<Real> v[D], first, second;

  inline __attribute__((always_inline)) Particles(const SweepData<D, P>& s,
                                                  const std::int32_t* index) {
#ifdef __AVX512F__
    Lane<Real> number[record_length];
    gather_records(s.records[0].number, index, number);
    for (int c = 0; c < D; ++c) {
      if constexpr (record_velocity<D, P> == 0)
        x[c] = gather(s.place_position, index, D, c);
      else
        x[c] = number[c];
      v[c] = number[record_velocity<D, P> + std::size_t(c)];
    }
    first = number[record_first<D, P>];
    second = number[record_first<D, P> + 1];
#else
    for (int c = 0; c < D; ++c) {
      x[c] = gather(s.place_position, index, D, c);
      v[c] = gather(s.place_velocity, index, D, c);
    }
    first = gather(s.first, index, 1, 0);
    second = gather(s.second, index, 1, 0);
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

/// The indices of the particles at eight places.
struct Indices {
  std::int32_t index[lanes];
  inline __attribute__((always_inline)) Indices(const std::int32_t* order,
                                                const std::int32_t* place) {
    if (order)
      for (std::size_t l = 0; l < lanes; ++l) index[l] = order[place[l]];
    else
      __builtin_memcpy(index, place, sizeof index);
  }
};

/// Eight consecutive places; lanes past the end repeat the last one and are not stored.
struct OwnPlaces {
  std::int32_t index[lanes];
  std::size_t used;
  OwnPlaces(std::size_t group, std::size_t count) {
    const std::size_t first = group * lanes;
    used = count - first < lanes ? count - first : lanes;
    for (std::size_t l = 0; l < lanes; ++l)
      index[l] = static_cast<std::int32_t>(first + (l < used ? l : used - 1));
  }
};

}  // namespace
}  // namespace varve::core::VARVE_ISA
