#include "io/log_index.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/errors.h"

namespace varve::io {

std::optional<StepEntry> find_entry(const std::vector<StepEntry>& entries, std::uint64_t step) {
  const auto at = std::lower_bound(
      entries.begin(), entries.end(), step,
      [](const StepEntry& entry, std::uint64_t value) { return entry.step < value; });
  if (at == entries.end() || at->step != step) return std::nullopt;
  return *at;
}

StepEntry IndexLookup::Node::entry(std::uint64_t step) const {
  const std::uint64_t index = step - message.first_step;
  StepEntry out{step, message.first_offset, message.states[index]};
  for (std::uint64_t i = 0; i < index; ++i) {
    out.offset += std::uint64_t{message.gaps[i]} * alignment_bytes;
  }
  return out;
}

IndexLookup::NodePointer IndexLookup::load(std::uint64_t offset, std::uint64_t before) {
  for (auto at = cache_.begin(); at != cache_.end(); ++at) {
    if ((*at)->offset != offset) continue;
    std::rotate(at, at + 1, cache_.end());
    return cache_.back();
  }
  const std::string& path = source_.file().path();
  const auto fail = [&](const std::string& text) {
    throw LogError(ErrorKind::damaged, path, text, static_cast<std::int64_t>(offset));
  };
  if (!source_.read(offset, before, Check::message, record_)) fail(source_.problem());
  if (record_.header.kind != RecordKind::index) {
    fail(fmt::format("a {} record where the index points to an index record",
                     name_of(record_.header.kind)));
  }
  auto node = std::make_shared<Node>();
  try {
    node->message = decode_index(record_.message, source_.limits());
  } catch (const LogError& error) {
    rethrow_at(error, path, offset);
  }
  node->offset = offset;
  node->end = record_.end();
  node->sequence = record_.header.sequence;
  if (cache_.size() >= cached_max) cache_.erase(cache_.begin());
  cache_.push_back(node);
  return node;
}

IndexLookup::NodePointer IndexLookup::previous(const Node& node) {
  if (node.message.skips.empty()) return nullptr;
  return load(node.message.skips.front().offset, node.offset);
}

void IndexLookup::set_root(std::uint64_t offset) { root_ = load(offset, source_.file().size()); }

IndexLookup::NodePointer IndexLookup::nearest_cached(std::uint64_t step) const {
  NodePointer best = root_;
  for (const NodePointer& node : cache_) {
    if (node->message.last_step() >= step && node->offset < best->offset) best = node;
  }
  return best;
}

IndexLookup::NodePointer IndexLookup::at_or_after(std::uint64_t step) {
  if (!root_ || step > root_->message.last_step()) return nullptr;
  NodePointer node = nearest_cached(step);
  while (node->message.first_step > step) {
    const auto& skips = node->message.skips;
    const auto farthest =
        std::find_if(skips.rbegin(), skips.rend(),
                     [step](const SkipPointer& skip) { return skip.last_step >= step; });
    if (farthest == skips.rend()) break;  // no index record covers it: the step is not there
    const NodePointer next = load(farthest->offset, node->offset);
    if (next->message.last_step() != farthest->last_step ||
        next->message.ordinal >= node->message.ordinal) {
      throw LogError(ErrorKind::damaged, source_.file().path(),
                     fmt::format("index record {}: its pointer to step {} leads elsewhere",
                                 node->message.ordinal, farthest->last_step),
                     static_cast<std::int64_t>(node->offset));
    }
    node = next;
  }
  return node;
}

std::optional<StepEntry> IndexLookup::find(std::uint64_t step) {
  const NodePointer node = at_or_after(step);
  if (!node || node->message.first_step > step) return std::nullopt;
  return node->entry(step);
}

std::optional<StepEntry> IndexLookup::keyframe_at_or_before(std::uint64_t step) {
  NodePointer node = at_or_after(step);
  if (!node || node->message.first_step > step) return std::nullopt;
  for (;;) {
    const IndexMessage& message = node->message;
    const std::uint64_t from = std::min(step, message.last_step()) + 1;
    for (std::uint64_t at = from; at > message.first_step; --at) {
      if (message.states[at - 1 - message.first_step] == StoredState::keyframe) {
        return node->entry(at - 1);
      }
    }
    const std::uint64_t first = message.first_step;
    node = previous(*node);
    if (!node || node->message.last_step() + 1 != first) return std::nullopt;
  }
}

std::optional<std::uint64_t> IndexLookup::stored_at_or_before(std::uint64_t step) {
  NodePointer node = at_or_after(step);
  if (!node) node = root_;
  for (; node; node = previous(*node)) {
    const IndexMessage& message = node->message;
    if (message.first_step > step) continue;
    const std::uint64_t from = std::min(step, message.last_step()) + 1;
    for (std::uint64_t at = from; at > message.first_step; --at) {
      if (message.states[at - 1 - message.first_step] != StoredState::none) return at - 1;
    }
  }
  return std::nullopt;
}

std::optional<std::uint64_t> IndexLookup::held_at_or_before(std::uint64_t step) {
  NodePointer node = at_or_after(step);
  if (!node) return root_ ? std::optional(root_->message.last_step()) : std::nullopt;
  if (node->message.first_step <= step) return step;
  node = previous(*node);
  return node ? std::optional(node->message.last_step()) : std::nullopt;
}

std::vector<std::uint64_t> IndexLookup::event_offsets() {
  std::vector<std::uint64_t> out;  // gathered from the end, turned round at last
  for (NodePointer node = root_; node;) {
    const auto& events = node->message.events;
    out.insert(out.end(), events.rbegin(), events.rend());
    const std::uint64_t before = node->message.events_before;
    node = before == 0 ? nullptr : load(before, node->offset);
  }
  std::reverse(out.begin(), out.end());
  return out;
}

}  // namespace varve::io
