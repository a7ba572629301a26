// Looks steps up through a log's index records without holding more than a few of them. Private to
// io. Every method throws LogError(damaged) where the index does not hold; it is disposable, so the
// caller then scans.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "io/record_io.h"

namespace varve::io {

/// Where a step's record stands and what it holds.
struct StepEntry {
  std::uint64_t step = 0;
  std::uint64_t offset = 0;
  StoredState state = StoredState::none;
};

/// The entry of `step` in entries of ascending steps.
std::optional<StepEntry> find_entry(const std::vector<StepEntry>& entries, std::uint64_t step);

class IndexLookup {
 public:
  explicit IndexLookup(RecordSource& source) : source_(source) {}

  /// Starts from the index record at `offset`: the last one.
  void set_root(std::uint64_t offset);
  void clear() { root_ = nullptr; }
  bool has_root() const { return root_ != nullptr; }
  std::uint64_t last_step() const { return root_->message.last_step(); }
  /// Where the records behind the last index record begin.
  std::uint64_t end() const { return root_->end; }
  std::uint64_t end_sequence() const { return root_->sequence + 1; }

  std::optional<StepEntry> find(std::uint64_t step);
  /// Nearest keyframe at or before `step` with no step missing in between.
  std::optional<StepEntry> keyframe_at_or_before(std::uint64_t step);
  std::optional<std::uint64_t> stored_at_or_before(std::uint64_t step);
  std::optional<std::uint64_t> held_at_or_before(std::uint64_t step);
  /// Offsets of all event records, in order.
  std::vector<std::uint64_t> event_offsets();

 private:
  static constexpr std::size_t cached_max = 64;
  struct Node {
    std::uint64_t offset = 0, end = 0, sequence = 0;
    IndexMessage message;
    StepEntry entry(std::uint64_t step) const;
  };
  using NodePointer = std::shared_ptr<const Node>;

  NodePointer load(std::uint64_t offset, std::uint64_t before);
  NodePointer previous(const Node& node);
  /// Earliest index record whose last step is >= `step`; null where `step` lies behind all.
  NodePointer at_or_after(std::uint64_t step);
  NodePointer nearest_cached(std::uint64_t step) const;

  RecordSource& source_;
  NodePointer root_;
  std::vector<NodePointer> cache_;  // most recently used last
  Record record_;
};

}  // namespace varve::io
