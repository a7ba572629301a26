// States that a log does not store, made again by the engine: varve-replay beside this program.
#pragma once

#include <memory>
#include <string>

#include "io/log_reader.h"
#include "tools/scratch_folder.h"

namespace varve::tools {

struct Reexecution {
  std::unique_ptr<io::LogReader> log;  ///< holds the states of the steps asked for; or nullptr
  std::string problem;  ///< why there is none
};

/// Executes steps from..to of `log` again, every digest checked, into a log named `name` in the
/// scratch folder.
Reexecution reexecute(const io::LogReader& log, std::uint64_t from, std::uint64_t to,
                      const ScratchFolder& scratch, const std::string& name);

}  // namespace varve::tools
