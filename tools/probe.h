// How large a log will be, from its first steps: they are computed and encoded as a run would, and
// nothing is written.
#pragma once

#include <cstdint>
#include <optional>

#include "core/simulation.h"

namespace varve::tools {

struct Probe {
  std::uint64_t steps = 0;         ///< computed
  double bytes_per_step = 0;       ///< of the later ones, their share of keyframes included
  double bytes_per_particle_step = 0;
  double predicted_bytes = 0;      ///< of the whole run; 0 if its length is not known
  double wall_s = 0;               ///< what the probe took
};

/// Steps that probe_log() computes unless told: two intervals between keyframes, at most 1024.
std::uint64_t default_probe_steps(const core::Scenario& resolved);

/// Computes `steps` steps, fewer if `run_steps` (the length of the run, 0: unknown) is less.
/// Throws EngineFailure where the engine can't.
Probe probe_log(const core::Scenario& resolved, std::uint64_t run_steps, std::uint64_t steps,
                const core::RunOptions& options);

}  // namespace varve::tools
