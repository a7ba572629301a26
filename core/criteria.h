// Derived numbers of a scenario: masses, contact times, expected speeds, and the limits of the time
// step with the reason for each. Everything here is a pure function of a Scenario; core/PHYSICS.md
// has the sources. In 2D masses and stiffnesses are per metre of depth.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/scenario.h"

namespace varve::core {

/// [m] h = smoothing_ratio x spacing.
double smoothing_length(const Scenario& scenario);
/// [m] radius beyond which two fluid particles do not see each other.
double kernel_support(const Scenario& scenario);
/// [m] Rc = 2 hc: radius within which a grain and a fluid particle see each other. Needs
/// coupling.length.
double coupling_radius(const Scenario& scenario);
/// E11b: what the slip without a grain's own disturbance is over the slip that it samples, in slow
/// flow far from walls: 1 / (1 - 1.0737 R / hc). Infinite or negative where hc is too short.
double undisturbed_slip(double radius, double coupling_length);
/// The most that a neighbour list may add to a radius, over h where there is fluid, else over the
/// diameter of the grains.
inline constexpr double list_skin_ratio = 0.25;
/// [m] least extent along a periodic direction: twice the largest support with a list's skin, so
/// that no pair meets through two images.
double periodic_minimum(const Scenario& scenario);

/// All kinds of grains, by their number in the state: first the one of [grains], called "grains",
/// then those of [species.NAME]; what a species leaves open is filled in.
std::vector<GrainSpecies> species_of(const Scenario& scenario);
/// Number of the species of grain `id` at the start: of the list, else drawn by (grains.seed, id)
/// with the species' shares.
std::uint32_t species_at_start(const Scenario& scenario, std::uint64_t id);
/// [m] over all species.
double largest_diameter(const Scenario& scenario);
double least_diameter(const Scenario& scenario);

/// [m3, m2 in 2D] of one grain of a species, or of species 0.
double grain_volume(const Scenario& scenario, const GrainSpecies& species);
double grain_volume(const Scenario& scenario);
/// [kg, kg/m in 2D] of one grain of a species, or of species 0.
double grain_mass(const Scenario& scenario, const GrainSpecies& species);
double grain_mass(const Scenario& scenario);
/// Volume [m3] and mass [kg] of all grains at the start, per metre of depth in 2D.
struct GrainTotals {
  double volume = 0, mass = 0;
};
GrainTotals grain_totals(const Scenario& scenario);
/// [kg, kg/m in 2D] least effective mass of any contact: half the lightest grain's, all of it where
/// there is one grain.
double least_effective_mass(const Scenario& scenario);
/// [m/s] at which a grain may hit something: without coupling that of a fall through the domain.
double impact_speed(const Scenario& scenario);
/// [s] tc0 of the shortest contact, undamped: pi sqrt(m_eff,min / k), by Hertz's law at
/// impact_speed(). Needs contact.stiffness or contact.youngs_modulus.
double contact_time(const Scenario& scenario);
/// [s] m_eff / lambda of the shortest: in which the thinnest film stops a grain. Infinite without
/// lubrication.
double lubrication_time(const Scenario& scenario);
/// Grain sub-steps per step: time.substeps, or as many as the shortest contact and the thinnest
/// film need where that is 0; 1 without grains that move. Needs contact.stiffness and time.dt.
std::int64_t substeps(const Scenario& scenario);
/// Sub-steps to a shortest contact where they are chosen, and the fewest that are let through.
inline constexpr double substeps_per_contact = 30;
inline constexpr double substeps_per_contact_min = 10;
/// The same for the time in which a film stops a grain.
inline constexpr double substeps_per_film = 10;
inline constexpr double substeps_per_film_min = 1;

/// A free surface: an open top, or a box that is not full at the start.
bool has_free_surface(const Scenario& scenario);

/// [m/s] speed at which drag holds the submerged weight of one grain in fluid at rest; 0 where the
/// two densities are equal or there is no gravity. Infinite if the drag law cannot hold it below
/// 1e6 m/s.
double terminal_speed(const Scenario& scenario);

/// Speeds from which the sound speed is chosen, each with its reason.
struct SpeedEstimate {
  double fluid = 0;          ///< [m/s]
  std::string fluid_reason;  ///< "a free surface: sqrt(2 g H)"
  double grains = 0;         ///< [m/s]
  std::string grains_reason;
  /// [m/s] max(10 fluid, 20 grains); 1 m/s where nothing can move.
  double sound_speed() const;
};
SpeedEstimate expected_speeds(const Scenario& scenario);

/// One criterion of the time step.
struct StepLimit {
  std::string_view name;     ///< "cfl", "acceleration", "viscosity", "contact"
  std::string_view formula;  ///< "cfl h / c0"
  double chosen = 0;         ///< [s] largest step that resolve() takes under it
  double largest = 0;        ///< [s] largest step that may be set under it
};
/// The criteria that apply. Needs fluid.sound_speed and contact.stiffness; never empty for a
/// scenario with fluid or moving grains.
std::vector<StepLimit> step_limits(const Scenario& scenario);
/// The limit with the least `chosen` (or `largest`) value.
const StepLimit& binding_limit(const std::vector<StepLimit>& limits, bool of_largest = false);
/// True if `dt` is within `limit`, but for rounding.
bool within(double dt, double limit);

/// [m/s2] largest acceleration that acts from outside on fluid or grains.
double outer_acceleration(const Scenario& scenario);

/// Steps to the end of a run from its start, changes of time.dt on the way included; 0 if the
/// length is not given.
std::uint64_t steps_of_run(const Scenario& resolved);

/// The first step whose time is not before `seconds`, counted from time 0 with a fixed dt.
std::uint64_t first_step_at(double seconds, double dt);
/// The last step whose time is <= seconds + 1e-6 dt, counted from time 0 with a fixed dt.
std::uint64_t last_step_at(double seconds, double dt);

/// Lattice of the fluid at the start: sites along x, y and z (1 in 2D), and how many of them hold a
/// particle (all, but for a pipe). Zero without fluid.
struct Lattice {
  std::int64_t columns = 0, rows = 0, layers = 1;
  std::int64_t particles = 0;
};
Lattice fluid_lattice(const Scenario& scenario);

/// [m] distance between the centres of neighbouring grains in the array.
double grain_pitch(const Scenario& scenario);

}  // namespace varve::core
