// Finds steps without an index, by walking the log from the nearest of a bounded number of
// keyframes. Used where the index is missing or does not hold. Private to io.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "io/log_index.h"
#include "io/record_io.h"

namespace varve::io {

class LogScan {
 public:
  LogScan(RecordSource& source, std::uint64_t start);

  /// Notes a record of the walk over the whole log.
  void note(const Record& record);
  /// Bytes of the log that lookups may use.
  void set_end(std::uint64_t end) { end_ = end; }

  std::optional<StepEntry> find(std::uint64_t step);
  std::optional<StepEntry> keyframe_at_or_before(std::uint64_t step);
  std::optional<std::uint64_t> stored_at_or_before(std::uint64_t step);
  std::optional<std::uint64_t> held_at_or_before(std::uint64_t step);
  std::vector<std::uint64_t> event_offsets();

 private:
  struct Anchor {
    std::uint64_t step = 0, offset = 0, sequence = 0;
  };
  static constexpr std::size_t anchors_max = 4096;

  /// What a walk from an anchor up to `step` found.
  struct Reached {
    std::optional<StepEntry> last, keyframe;
    std::optional<std::uint64_t> stored;
    bool intact = false;
  };
  std::optional<StoredState> stored_in(const Record& record) const;
  Reached walk_to(std::uint64_t step);

  RecordSource& source_;
  std::uint64_t end_;
  std::vector<Anchor> anchors_;  // the log's first record, then every stride-th keyframe
  std::size_t stride_ = 1;
  std::size_t keyframes_ = 0;
};

}  // namespace varve::io
