// The first record of every log: what was run, by what, and from where it came.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/digest.h"
#include "io/frame.h"

namespace varve::io {

/// What a step record holds.
enum class Tier : std::uint8_t {
  deltas = 1,   ///< every step decodes without the engine (or every k-th, see `every`)
  digests = 2,  ///< keyframes and a digest per step; states between them by re-execution
};
std::string_view name_of(Tier tier);

/// Where a fork came from.
struct Lineage {
  std::string parent_run_id;   ///< 32 hex digits
  std::string parent_name;     ///< file name of the parent when forked: a hint, outside the digest
  std::uint64_t step = 0;      ///< K
  Digest parent_digest;        ///< digest[K] in the parent, before the change
  Digest parent_chain;         ///< chain[K] in the parent
  /// chain[K-1] in the parent; the parent's own chain base where K is its first step.
  Digest chain_base;
  struct Change {
    std::string key, from, to;
    bool operator==(const Change&) const = default;
  };
  std::vector<Change> changes;  ///< empty: a fork with no change
  std::vector<std::string> ancestors;  ///< run ids, parent first; at most `lineage_depth_max`
};

struct Genesis {
  std::string engine;                 ///< e.g. "varve"
  std::uint32_t engine_revision = 0;  ///< raised whenever a golden digest changes
  Schema schema;
  /// The resolved scenario, in the engine's own canonical text. Opaque to io.
  std::string scenario;
  /// The same, key by key, so that `diff` and `info` can compare without the engine.
  std::vector<std::pair<std::string, std::string>> parameters;
  /// Which models were on and why: name, reason.
  std::vector<std::pair<std::string, std::string>> models;
  std::vector<std::pair<std::string, std::string>> files;  ///< embedded files: name, content
  std::optional<Lineage> lineage;
  Tier tier = Tier::deltas;
  std::uint32_t every = 1;            ///< `deltas every k`: states of every k-th step
  std::uint32_t keyframe_steps = 256;

  // ---- outside every digest ----
  std::string log_id;  ///< random, 32 hex digits; made by the writer when empty
  std::vector<std::pair<std::string, std::string>> build;  ///< compiler, flags, host, threads, date

  /// Digest of everything above the line (for a fork also parent run id, K and changes).
  std::string run_id() const;
};

}  // namespace varve::io
