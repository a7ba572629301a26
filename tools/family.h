// Runs and where they came from: finding a parent's log by its run id. Log headers only, no engine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/log_reader.h"

namespace varve::tools {

/// Every varve log in a folder (not below it), by name; other files are passed over.
std::vector<std::string> logs_in(const std::string& folder);

/// The parent of a fork: first `parent_option` (a file, or a folder to search) if given, then the
/// file named in the lineage beside the child, then every log beside it whose run id is the
/// parent's and which holds the step of the fork with the recorded chain. nullptr where `child` is
/// no fork or no such log is found. Throws UsageError where `parent_option` is another run,
/// LogError where it can't be read.
std::unique_ptr<io::LogReader> open_parent(const io::LogReader& child,
                                           const std::optional<std::string>& parent_option = {});

/// The log of the family of `run` in which step `step` is recorded: itself, or the ancestor that it
/// shares the step with. Throws LogError(not_found) naming what is missing.
std::unique_ptr<io::LogReader> open_holder(std::unique_ptr<io::LogReader> run, std::uint64_t step,
                                           const std::optional<std::string>& parent_option = {});

/// The log and the step that --at TEXT names, seen from `run`: a step number or a time before its
/// first state is looked up in its ancestors.
struct Place {
  std::unique_ptr<io::LogReader> log;
  std::uint64_t step = 0;
};
Place open_at(std::unique_ptr<io::LogReader> run, const std::string& text,
              const std::optional<std::string>& parent_option = {});

/// Says on stderr what is missing from a torn or damaged log that is read all the same.
void warn_if_incomplete(const io::LogReader& log);

}  // namespace varve::tools
