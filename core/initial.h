// The first state of a scenario, and the two formulas that every later change of geometry shares
// with it: porosity of the fluid from the grains, and density at rest under gravity.
#pragma once

#include <vector>

#include "core/scenario.h"
#include "core/state.h"

namespace varve::core {

/// State at step 0 of a resolved scenario.
///
/// Fluid: a lattice at ((i + 1/2) dx, (j + 1/2) dx) from the lower left corner up to fluid.level,
/// in 3D from the lower left front corner; ids row by row from the bottom, in 3D each row from the
/// front, line by line from the left; of a pipe the sites within its radius. It moves as
/// fluid.initial says, also inside grains (the method is unresolved). With eps
/// from the grains, m = eps rho dx^D and rhob = eps rho, so that every particle stands for dx^D;
/// rho is rho0 in the excess-pressure form and the density at rest with full pressure. fluid.jitter
/// shifts each coordinate by up to that part of dx, drawn from (fluid.seed, id).
///
/// Grains: rows x columns x layers, pitch d (1 + gap), centred at grains.centre_x and centre_z, the
/// lowest row at grains.lowest_y, ids row by row from the bottom, layer by layer within a row,
/// jittered likewise by parts of d. Spin is 0, and there only with contact.rotation. No contacts;
/// the clock at zero with time.dt.
///
/// Throws ModelError if the domain is not a whole number of spacings wide, and std::logic_error for
/// a scenario that is not resolved.
template <int D, class P>
State<D, P> first_state(const Scenario& resolved);

/// Porosity of each fluid particle by the engine's own formula (core/coupling.h), floored at
/// coupling.porosity_floor; 1 unless the coupling is two-way.
template <int D = 2>
std::vector<double> floored_porosity(const Scenario& scenario,
                                     const State<D, DoublePrecision>& state);

/// [kg/m3] Density above rho0 that carries the fluid at rest under gravity, by the equation of
/// state, 0 at `surface` [m] height. With walls on both sides and a tilt, 0 at the upper of the two
/// corners.
template <int D = 2>
double hydrostatic_excess_density(const Scenario& scenario, const Vec<double, D>& x,
                                  double surface);

/// The same state in another precision: positions and values rounded once, counts and ids kept.
template <int D, class To, class From>
State<D, To> converted(const State<D, From>& from);

}  // namespace varve::core
