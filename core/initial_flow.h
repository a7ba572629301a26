// How the fluid moves at the start (fluid.initial), and the pressure that belongs to it.
//
//   rest          u = 0
//   uniform       u = (U, 0, 0)
//   shear         u = (U y / H, 0, 0): at rest at the bottom, U at the top
//   taylor_green  u = U (sin X cos Y cos Z, -(kx/ky) cos X sin Y cos Z, 0)
//
// with X = kx (x - left), kx = 2 pi / width and so on; in 2D cos Z = 1. The vortices of Taylor and
// Green (1937), whose pressure solves laplace p = -rho0 d_i u_j d_j u_i:
//
//   p = rho0 U^2 kx^2 / 8 [ cos 2X / kx^2 + cos 2Y / ky^2
//                           + cos 2X cos 2Z / (kx^2 + kz^2) + cos 2Y cos 2Z / (ky^2 + kz^2) ]
//
// which in 2D is rho0 U^2/4 (cos 2X + (kx/ky)^2 cos 2Y). U is fluid.initial_speed [m/s].
#pragma once

#include "core/scenario.h"
#include "core/state.h"

namespace varve::core {

/// [m/s] at `x` [m].
template <int D>
Vec<double, D> initial_velocity(const Scenario& resolved, const Vec<double, D>& x);

/// [kg/m3] Density above the fluid's at rest that carries the initial flow's pressure.
template <int D>
double initial_excess_density(const Scenario& resolved, const Vec<double, D>& x);

/// [m/s] Largest speed of the initial flow.
double largest_initial_speed(const Scenario& scenario);

}  // namespace varve::core
