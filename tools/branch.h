// A new run from a step of a recorded one: the state there with named keys changed, and the genesis
// that says so.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/simulation.h"
#include "io/genesis.h"
#include "io/log_reader.h"
#include "tools/recording.h"
#include "tools/simulation_engine.h"

namespace varve::tools {

struct BranchRequest {
  std::uint64_t step = 0;             ///< K
  std::vector<io::Setting> settings;  ///< keys to change, values as text with or without units
  core::ChangeOptions options;        ///< of a changed width
  std::optional<double> ramp_time;    ///< [s] over which a changed width is reached
  /// Grains are shifted by a draw from `seed` of at most this much [m]; 0: not at all.
  double perturb = 0;
  std::uint64_t seed = 1;
  std::optional<Target> target;  ///< end of the child's run; not given: the parent's last step
};

struct Branch {
  io::Genesis genesis;
  io::Frame first;                ///< state K after the change, tables as recorded in the parent
  std::vector<io::Event> events;  ///< what the change did
  std::unique_ptr<SimulationEngine> engine;  ///< made from `genesis`, holding `first`
  std::vector<std::string> notes;            ///< for people
};

/// Why a fork or an event can't change these keys of the scenario as it stands: every bad value
/// (`<command line>:N:` form, N counts settings from 1) ends in Exit{3} after printing, everything
/// else is a UsageError with all reasons.
void check_settings(const core::Scenario& now, const std::vector<io::Setting>& settings,
                    const core::ChangeOptions& options);

/// Makes the branch. Throws UsageError (keys that may not change, limits), LogError, Divergence.
Branch make_branch(const io::LogReader& parent, const BranchRequest& request,
                   const core::RunOptions& run_options);

}  // namespace varve::tools
