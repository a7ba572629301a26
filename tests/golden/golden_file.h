// The committed digests of the golden logs: tests/golden/logs.digests, a text file.
#pragma once

#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "golden_runs.h"
#include "io/digest.h"

namespace varve::golden {

/// What is committed of one log.
struct Committed {
  std::uint64_t bytes = 0;
  std::string file;  ///< digest of the whole file
  struct Step {
    std::string digest, outputs;
    bool operator==(const Step&) const = default;
  };
  std::map<std::uint64_t, Step> steps;
};

struct CommittedFile {
  std::string zstd;  ///< version of the library that packed the logs
  std::map<std::string, Committed> logs;
};

inline CommittedFile read_committed(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  CommittedFile out;
  Committed* log = nullptr;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string first;
    words >> first;
    if (first.empty() || first.starts_with('#')) continue;
    if (first == "zstd") {
      words >> out.zstd;
    } else if (first == "log") {
      std::string name;
      words >> name;
      log = &out.logs[name];
      words >> log->bytes >> log->file;
    } else {
      if (log == nullptr) throw std::runtime_error(path + ": a step before the first log");
      Committed::Step& step = log->steps[std::stoull(first)];
      words >> step.digest >> step.outputs;
    }
    if (!words) throw std::runtime_error(path + ": '" + line + "' is not understood");
  }
  return out;
}

/// What would be committed of a run whose log has these bytes.
inline Committed committed(const GoldenRun& run, const std::vector<std::byte>& bytes) {
  Committed out;
  out.bytes = bytes.size();
  out.file = io::digest_bytes(bytes).hex();
  for (const io::Frame& frame : run.frames) {
    if (run.is_lost(frame.step)) continue;
    const auto events = run.events.find(frame.step);
    const bool tables = run.genesis.tier == io::Tier::deltas;
    const io::Digest outputs =
        outputs_digest(tables ? frame : io::Frame{},
                       events == run.events.end() ? std::vector<io::Event>{} : events->second);
    out.steps[frame.step] = {io::digest_frame(run.genesis.schema, frame.view()).hex(),
                             outputs.hex()};
  }
  return out;
}

}  // namespace varve::golden
