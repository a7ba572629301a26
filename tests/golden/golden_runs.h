// The runs behind the golden logs: a made-up engine that must never change, since the committed
// logs hold what it computed. Only + - * / on IEEE numbers, so any machine gives the same bits.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "io/genesis.h"
#include "io/log_writer.h"

namespace varve::golden {

struct GoldenRun {
  std::string name;  ///< of the log, without its ending
  io::Genesis genesis;
  std::vector<io::Frame> frames;  ///< of consecutive steps
  std::map<std::uint64_t, std::vector<io::Event>> events;  ///< by step
  /// Steps left out, with a gap record and an unknown skippable record in their place; none where
  /// empty. Such a log is put together as recovery does, the others are written by LogWriter.
  std::pair<std::uint64_t, std::uint64_t> lost{1, 0};

  bool is_lost(std::uint64_t step) const { return step >= lost.first && step <= lost.second; }
};

/// Every tier, doubles and floats, particles that come and go, a fork, a gap.
const std::vector<GoldenRun>& golden_runs();

/// The log of a run as bytes, written now.
std::vector<std::byte> written(const GoldenRun& run);

/// Digest of what a step holds beside its state: table rows and events.
io::Digest outputs_digest(const io::Frame& frame, const std::vector<io::Event>& events);

}  // namespace varve::golden
