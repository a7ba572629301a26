// Drag of a fluid on a grain: laws as small value types. Each returns K [N s/m, per metre of depth
// in 2D], the force per slip speed: F = K (u - v), with u the fluid's interstitial velocity at the
// grain and v the grain's. K is finite at zero slip; a new law adds no loop.
//
// One form holds for all. With u_s = eps |u - v| the superficial slip, Re = rho0 u_s d / mu, A the
// frontal area (pi d^2 / 4 of a sphere, d of a disc per metre of depth) and a swarm exponent chi,
//
//   F = 1/2 rho0 A Cd(Re) |u_s| u_s eps^-chi
//   K = (A / d) mu eps / 2 * [Cd Re](Re) * eps^-chi
//
// (Di Felice 1994, and in the same form Wen & Yu 1966). Cd Re stays finite where Cd alone does not.
// A disc uses a sphere's Cd on its own frontal area unless the law says otherwise.
//
// Symbols: rho0 [kg/m3] fluid density, mu [Pa s] viscosity, d [m] diameter, eps [-] porosity.
#pragma once

#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <variant>

#include "core/math.h"
#include "core/scenario.h"

namespace varve::core {

struct Slip {
  double speed;      ///< [m/s] |u - v|, interstitial
  double porosity;   ///< [-] eps felt by the grain, in (0, 1]
  double diameter;   ///< [m] d
  double density;    ///< [kg/m3] rho0
  double viscosity;  ///< [Pa s] mu, > 0
};

/// Re = rho0 eps |u - v| d / mu.
inline double reynolds(const Slip& s) {
  return s.density * (s.porosity * s.speed) * s.diameter / s.viscosity;
}

namespace drag_detail {

/// (A / d) mu eps / 2: what multiplies Cd Re eps^-chi.
template <int D>
double scale(const Slip& s) {
  static_assert(D == 2 || D == 3);
  const double area_per_diameter = D == 2 ? 1.0 : 0.25 * pi * s.diameter;
  return 0.5 * area_per_diameter * s.viscosity * s.porosity;
}

/// eps^-chi; 1 without a call where there is no swarm, so that a lone grain feels the bare law.
inline double swarm(double porosity, double chi) {
  return porosity == 1.0 ? 1.0 : pow(porosity, -chi);
}

/// Schiller & Naumann 1935: Cd = 24/Re (1 + 0.15 Re^0.687), not below Newton's 0.44. Returns Cd Re.
inline double schiller_naumann(double re) {
  const double viscous = 24.0 * (1.0 + 0.15 * pow(re, 0.687));
  const double newton = 0.44 * re;
  return viscous > newton ? viscous : newton;
}

/// Di Felice 1994: chi = 3.7 - 0.65 exp(-(1.5 - log10 Re)^2 / 2). Below Re = 1e-12 the bell is
/// below 1e-39, so the floor changes no bit of chi; it only keeps log10 away from 0.
inline double di_felice_exponent(double re) {
  const double distance = 1.5 - log10(re > 1e-12 ? re : 1e-12);
  return 3.7 - 0.65 * exp(-0.5 * distance * distance);
}

}  // namespace drag_detail

/// Stokes 1851: Cd = 24/Re, F = 3 pi mu d u_s for a sphere; no swarm correction.
template <int D>
struct StokesDrag {
  double operator()(const Slip& s) const {
    return drag_detail::scale<D>(s) * 24.0;
  }
};

/// Schiller-Naumann with Wen & Yu's swarm exponent 3.65: Gidaspow's dilute branch at every
/// porosity.
template <int D>
struct SchillerNaumannDrag {
  double operator()(const Slip& s) const {
    return drag_detail::scale<D>(s) * drag_detail::schiller_naumann(reynolds(s)) *
           drag_detail::swarm(s.porosity, 3.65);
  }
};

/// DallaValle 1948, Cd = (0.63 + 4.8 / sqrt Re)^2, with Di Felice's swarm exponent.
template <int D>
struct DallaValleDiFeliceDrag {
  double operator()(const Slip& s) const {
    const double re = reynolds(s);
    const double root = 0.63 * std::sqrt(re) + 4.8;
    return drag_detail::scale<D>(s) * (root * root) *
           (s.porosity == 1.0
                ? 1.0
                : drag_detail::swarm(s.porosity, drag_detail::di_felice_exponent(re)));
  }
};

/// Gidaspow 1994: Ergun below porosity 0.8, Wen & Yu above; blended linearly over 0.78 to 0.82,
/// since the plain switch jumps by 6 to 200 % and makes grains near it chatter. In the common form
/// Ergun's F = V_sphere [150 (1-eps) mu / (eps d^2) + 1.75 rho0 |u_r| / d] u_r reads
/// Cd Re eps^-chi = [200 (1-eps) + 7/3 Re] / eps^2.
template <int D>
struct GidaspowDrag {
  double operator()(const Slip& s) const {
    constexpr double low = 0.78, high = 0.82;
    const double eps = s.porosity, re = reynolds(s);
    const double dense = (200.0 * (1.0 - eps) + 7.0 / 3.0 * re) / (eps * eps);
    const double share = eps <= low ? 0.0 : eps >= high ? 1.0 : (eps - low) / (high - low);
    double factor = share < 1.0 ? (1.0 - share) * dense : 0.0;
    if (share > 0.0) {
      factor += share * drag_detail::schiller_naumann(re) * drag_detail::swarm(eps, 3.65);
    }
    return drag_detail::scale<D>(s) * factor;
  }
};

/// Sucker & Brauer 1976, circular cylinder across the flow, 1e-4 < Re < 2e5:
/// Cd = 1.18 + 6.8/Re^0.89 + 1.96/sqrt Re - 4e-4 Re / (1 + 3.64e-7 Re^2), with Di Felice's
/// exponent. A cylinder has no linear regime: Cd Re, and K with it, goes to 0 at zero slip.
template <int D>
struct CylinderDrag {
  static_assert(D == 2, "a cylinder across the flow is a disc");
  double operator()(const Slip& s) const {
    const double re = reynolds(s);
    const double drag = 1.18 * re + 6.8 * pow(re, 0.11) + 1.96 * std::sqrt(re) -
                        4e-4 * re * re / (1.0 + 3.64e-7 * re * re);
    return drag_detail::scale<D>(s) * drag *
           (s.porosity == 1.0
                ? 1.0
                : drag_detail::swarm(s.porosity, drag_detail::di_felice_exponent(re)));
  }
};

/// A law chosen at run time: std::visit once per pass, then call the law in the loop.
template <int D>
using DragLaw = std::conditional_t<
    D == 2,
    std::variant<StokesDrag<2>, SchillerNaumannDrag<2>, DallaValleDiFeliceDrag<2>, GidaspowDrag<2>,
                 CylinderDrag<2>>,
    std::variant<StokesDrag<3>, SchillerNaumannDrag<3>, DallaValleDiFeliceDrag<3>,
                 GidaspowDrag<3>>>;

/// Throws std::invalid_argument for the cylinder in 3D.
template <int D>
DragLaw<D> make_drag_law(Drag drag) {
  switch (drag) {
    case Drag::stokes: return StokesDrag<D>{};
    case Drag::schiller_naumann: return SchillerNaumannDrag<D>{};
    case Drag::dallavalle_di_felice: return DallaValleDiFeliceDrag<D>{};
    case Drag::gidaspow: return GidaspowDrag<D>{};
    case Drag::cylinder:
      if constexpr (D == 2) return CylinderDrag<D>{};
      break;
  }
  throw std::invalid_argument("coupling.drag: the cylinder law is for discs (dimension 2)");
}

/// K of a law held in the variant; for single calls, loops visit once outside.
template <int D>
double drag_coefficient(const DragLaw<D>& law, const Slip& slip) {
  return std::visit([&](const auto& chosen) { return chosen(slip); }, law);
}

}  // namespace varve::core
