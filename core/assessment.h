// What a resolved scenario amounts to: which models are on and why, what sets the step, how the
// flow will be, what to be wary of. For check, info and genesis; nothing here reaches a state.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/criteria.h"
#include "core/scenario.h"

namespace varve::core {

struct ModelUse {
  std::string name;    ///< "fluid", "contact friction"
  bool active = false;
  std::string reason;  ///< "fluid.present = on"
};
/// Every model of the engine, on or off.
std::vector<ModelUse> models_of(const Scenario& resolved);

struct Warning {
  std::string key;   ///< key that would change it
  std::string text;
};

struct Assessment {
  std::vector<ModelUse> models;
  std::vector<Warning> warnings;

  std::uint64_t fluid_particles = 0, grains = 0;
  double fluid_mass = 0, grain_mass = 0;  ///< [kg, kg/m in 2D] of all

  double dt = 0;                       ///< [s]
  std::vector<StepLimit> limits;
  std::string step_set_by;             ///< name of the binding limit, or "time.dt"
  std::uint64_t steps = 0;             ///< of the run; 0 if its length is not given
  std::int64_t substeps = 1;
  double contact_time = 0;             ///< [s] tc0 of the shortest contact; 0 without moving grains

  SpeedEstimate speeds;
  double terminal_speed = 0;           ///< [m/s] of one grain in fluid at rest
  double reynolds = 0;                 ///< rho0 U d / mu of a grain at the grains' expected speed
  double stokes = 0;                   ///< (rho_s / rho0) Re / 9
  double mach = 0;                     ///< largest expected speed / c0
  double overlap = 0;                  ///< of d, predicted for an impact at the grains' speed
  double restitution = 1;              ///< dry, of a grain on a wall, from the damping

  std::uint64_t state_bytes = 0;       ///< of one state, uncompressed
  /// [bytes] range in which the log should end; 0 if the length of the run is not given.
  double log_bytes_low = 0, log_bytes_high = 0;
};

Assessment assess(const Scenario& resolved);

}  // namespace varve::core
