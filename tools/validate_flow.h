// Flows that both the gates and the studies of convergence run.
#pragma once

#include "core/scenario.h"
#include "tools/validate_support.h"

namespace varve::tools {

/// A body force between two plates, `cells` particles across; from rest.
core::Scenario poiseuille_scene(int cells);
/// [m/s] u_max = g H^2 / 8 nu of that scene.
double poiseuille_speed(const core::Scenario& scenario);
/// u / u_max at y / H and nu t / H^2, by the series.
double poiseuille_profile(double y, double time);

/// Vortices in a periodic square of 5 cm with U = 5 cm/s at Re = U L / nu = 100: L / U is 1 s.
core::Scenario taylor_green_scene(int cells, bool shifted);

/// [J/m] kinetic energy of the fluid (2D).
double flow_energy(const Experiment& experiment);
/// Adds one velocity component (2D) of every particle.
void add_velocity(const Experiment& experiment, std::size_t component, Samples& samples);

}  // namespace varve::tools
