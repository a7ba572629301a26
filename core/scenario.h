// Everything a run is told, in SI units. A Scenario is const while a run lasts; core/parameters.h
// declares every key once (unit, default, range, meaning, may it change in a fork).
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/kernel_names.h"

namespace varve::core {

enum class Precision { double_, float_, mixed };
/// Names of sets of defaults, which lie under everything that a scenario says itself.
enum class Model { standard, study };
enum class Fidelity { draft, standard, fine, reference };
enum class Boundary { no_slip, free_slip, periodic, free };
enum class PressureForm { automatic, excess, full };
enum class EquationOfState { linear, tait };
/// How the fluid's pressure gets at a grain (core/coupling.h).
enum class PressureForce { conjugate, averaged };
enum class Porosity { kernel, conservative };
enum class CouplingMode { two_way, one_way, off };
enum class Drag { stokes, schiller_naumann, dallavalle_di_felice, gidaspow, cylinder };
enum class GrainMotion { free, frozen, driven };
enum class Arrangement { square, hexagonal, random, list };
enum class ContactLaw { linear, hertz };
enum class Shape { box, pipe };
enum class InitialFlow { rest, uniform, shear, taylor_green };
enum class RecordTier { deltas, digests };
/// What becomes of grains that a narrower width leaves outside.
enum class OutsideMode { error, push, remove };

/// "Not given: derive it" for a real parameter, until resolve() has replaced it.
inline constexpr double automatic = std::numeric_limits<double>::quiet_NaN();

struct Domain {
  std::int64_t dimension = 2;
  Shape shape = Shape::box;  // pipe: round, upright, width across; 3D
  double width = automatic, height = automatic;  // [m] x and y extent at the start
  double depth = automatic;              // [m] z extent, from 0; stays automatic in 2D
  double left = 0;                       // [m] x of the left wall; moves when the width changes
  Boundary sides = Boundary::no_slip;    // no_slip, free_slip, periodic
  Boundary bottom = Boundary::no_slip;   // no_slip, free_slip, periodic (then top too)
  Boundary top = Boundary::no_slip;      // no_slip, free_slip, periodic, free (free surface)
  Boundary faces = Boundary::no_slip;    // front and back, 3D: no_slip, free_slip, periodic
  double lid_speed = 0, floor_speed = 0;  // [m/s] of the top and bottom walls in themselves, +x
};

struct Gravity {
  double magnitude = 9.81;  // [m/s2]
  double tilt = 0;          // [rad] from -y towards +x
};

struct Fluid {
  bool present = true;
  double density = 1000;       // [kg/m3] rho0
  double viscosity = 0.01;     // [Pa s] mu
  double spacing = 1e-3;       // [m] dx of the first lattice
  double resolution = 2.5;     // [-] of an automatic spacing: spacings per grain diameter
  double level = automatic;    // [m] filling height above the bottom; else the domain's height
  double width = automatic;    // [m] filled from the left wall; stays automatic for all of it
  Kernel kernel = Kernel::wendland_c2;
  double smoothing_ratio = 1.25;   // [-] smoothing_length / spacing
  double sound_speed = automatic;  // [m/s] c0
  double sound_speed_factor = 1;   // [-] of the automatic one
  PressureForm pressure = PressureForm::automatic;
  EquationOfState equation_of_state = EquationOfState::linear;
  double artificial_alpha = 0, artificial_beta = 0;  // [-] of Monaghan's viscosity
  double shifting = 0;             // [-] strength of particle shifting
  double density_diffusion = 0.1;  // [-] delta of delta-SPH
  double jitter = 0;               // [-] of the spacing
  std::int64_t seed = 1;
  double body_force_x = 0, body_force_y = 0, body_force_z = 0;  // [m/s2]
  InitialFlow initial = InitialFlow::rest;
  double initial_speed = 0;  // [m/s] amplitude of the initial flow
};

/// A kind of grain beside the one that [grains] describes, which is species 0: [species.NAME].
struct GrainSpecies {
  std::string name;
  double diameter = automatic;  // [m]; as [grains] if not given
  double density = automatic;   // [kg/m3]; as [grains] if not given
  double share = 1;             // [-] relative number of its grains in an array or a packing
};

/// One grain of a list (grains.file).
struct ListedGrain {
  std::uint32_t species = 0;
  double position[3] = {};  // [m]
  double velocity[3] = {};  // [m/s]
  double spin[3] = {};      // [rad/s]; in 2D the third
  bool operator==(const ListedGrain&) const = default;
};

struct Grains {
  Arrangement arrangement = Arrangement::square;
  std::string file;                    // list of grains, read by who reads the scenario
  std::vector<ListedGrain> list;       // what stood in it
  std::int64_t count = 0;              // of a random packing
  double share = 1;                    // [-] relative number of species 0
  double from_y = automatic, to_y = automatic;  // [m] heights between which a packing lies
  std::int64_t rows = 0, columns = 0;  // no grains if either is 0
  std::int64_t layers = 1;             // along z; 1 in 2D
  double diameter = 2.5e-3;            // [m]
  double density = 2500;               // [kg/m3]
  double centre_x = automatic;         // [m] middle of the array; the domain's middle if not given
  double lowest_y = automatic;         // [m] centre of the lowest row
  double centre_z = automatic;         // [m] as centre_x; stays automatic in 2D
  double gap = 0;                      // [-] of the diameter, between neighbours
  double jitter = 0;                   // [-] of the diameter
  std::int64_t seed = 1;
  double velocity_x = 0, velocity_y = 0, velocity_z = 0;  // [m/s] at the start
  double spin_x = 0, spin_y = 0, spin_z = 0;              // [rad/s] at the start
  GrainMotion motion = GrainMotion::free;
};

struct Contact {
  ContactLaw law = ContactLaw::linear;
  double time = 0.5e-3;          // [s] undamped contact time with a wall, if stiffness is not given
  double stiffness = automatic;  // [N/m per m depth in 2D] k_n
  double damping = 0.2;          // [-] alpha: eta = alpha sqrt(m_eff k_n)
  double friction = 0.3;         // [-] Coulomb coefficient
  bool rotation = true;          // spin and tangential springs are part of the state
  double tangential_ratio = automatic;  // [-] k_t / k_n: 1/3 for discs, 2/7 for spheres
  double restitution = automatic;  // [-] sets the damping if given; automatic once resolved
  double youngs_modulus = automatic;  // [Pa] of the grains; Hertz's law
  double poisson_ratio = 0.25;        // [-] likewise
  double rolling_friction = 0;        // [-] largest rolling moment over (effective radius x force)
  bool lubrication = false;           // viscous film between grains that approach
  double lubrication_range = 0.5;     // [-] of the effective radius: gap where the film begins
  double lubrication_gap = 1e-3;      // [-] likewise: roughness, below which it grows no more
};

struct Coupling {
  CouplingMode mode = CouplingMode::two_way;
  double length = automatic;  // [m] hc; a grain diameter if not given
  Drag drag = Drag::dallavalle_di_felice;
  Porosity porosity = Porosity::kernel;
  PressureForce pressure_force = PressureForce::conjugate;
  double porosity_floor = automatic;  // [-] 0.30 in 2D, 0.25 in 3D
  bool exclude_own_volume = true;
  double added_mass = 0;  // [-] of the displaced fluid's mass
  bool self_disturbance = false;  // slip corrected for the flow that a grain itself sets up; 3D
};

struct Time {
  double cfl = 0.25;          // [-]
  double dt = automatic;      // [s] resolved: fixed for the run
  std::int64_t substeps = 0;  // grain sub-steps per step; 0: from the contact time
  double until = automatic;   // [s]
  std::int64_t steps = 0;     // 0: by `until`
};

struct Guards {
  double density_deviation = 0.8;  // [-] largest |rho/rho0 - 1|
  double overlap = 0.2;            // [-] of the diameter
  double speed = 1.0;              // [-] of the sound speed (fluid); grains likewise
};

struct Record {
  RecordTier tier = RecordTier::deltas;
  std::int64_t every = 1;
  std::int64_t keyframe_steps = 256;
  bool stage_digests = false;  // a digest of every stage of every step, as an event table
};

/// A change of fork-changeable keys at the end of a given step of the run. Either `at` or `at_step`
/// is given; resolve() replaces `at` by the last step with time <= at + 1e-6 dt.
struct ScheduledChange {
  std::string name;
  double at = automatic;      // [s]; automatic once resolved
  std::int64_t at_step = -1;  // -1: not given
  std::vector<std::pair<std::string, std::string>> settings;  // key, value as text
  int anchor = 0;  // of a change of width: -1 the left wall stays, +1 the right one, 0 neither
  OutsideMode outside = OutsideMode::error;  // likewise
};

struct Scenario {
  std::string title;
  Precision precision = Precision::double_;
  Model model = Model::standard;
  Fidelity fidelity = Fidelity::standard;
  Domain domain;
  Gravity gravity;
  Fluid fluid;
  Grains grains;
  std::vector<GrainSpecies> species;  // beside species 0
  Contact contact;
  Coupling coupling;
  Time time;
  Guards guards;
  Record record;
  std::vector<ScheduledChange> changes;  // in order of at_step, then of the file

  bool has_fluid() const { return fluid.present; }
  bool has_grains() const { return grain_count() > 0; }
  /// Grains at the start.
  std::int64_t grain_count() const {
    if (grains.arrangement == Arrangement::list)
      return static_cast<std::int64_t>(grains.list.size());
    if (grains.arrangement == Arrangement::random) return grains.count;
    return grains.rows * grains.columns * grains.layers;
  }
  bool is_coupled() const {
    return has_fluid() && has_grains() && coupling.mode != CouplingMode::off;
  }
};

}  // namespace varve::core
