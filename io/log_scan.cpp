#include "io/log_scan.h"

#include <algorithm>

#include "io/errors.h"

namespace varve::io {

LogScan::LogScan(RecordSource& source, std::uint64_t start)
    : source_(source), end_(start), anchors_{{0, start, RecordWalk::any_sequence}} {}

void LogScan::note(const Record& record) {
  if (record.header.kind != RecordKind::keyframe) return;
  if (keyframes_++ % stride_ != 0) return;
  anchors_.push_back({record.header.step, record.offset, record.header.sequence});
  if (anchors_.size() <= anchors_max) return;
  // Every second one goes; the start of the log stays.
  std::size_t kept = 1;
  for (std::size_t i = 1; i < anchors_.size(); i += 2) anchors_[kept++] = anchors_[i];
  anchors_.resize(kept);
  stride_ *= 2;
}

// What a step's record stores; nothing where its message makes no sense: as if it were not there.
std::optional<StoredState> LogScan::stored_in(const Record& record) const {
  if (record.header.kind == RecordKind::keyframe) return StoredState::keyframe;
  if (record.header.body_bytes == 0) return StoredState::none;
  try {
    const bool has_state = !decode_step(record.message, source_.limits()).fields.empty();
    return has_state ? StoredState::delta : StoredState::none;
  } catch (const LogError&) {
    return std::nullopt;
  }
}

LogScan::Reached LogScan::walk_to(std::uint64_t step) {
  auto from = std::upper_bound(
      anchors_.begin() + 1, anchors_.end(), step,
      [](std::uint64_t value, const Anchor& anchor) { return value < anchor.step; });
  --from;
  Reached out;
  DeltaChain chain;
  RecordWalk walk(source_, from->offset, from->sequence, end_, Check::body);
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::bad) continue;
    const Record& record = walk.record();
    if (!is_step(record.header.kind)) continue;
    if (out.last && record.header.step <= out.last->step) continue;  // as if it were not there
    if (record.header.step > step) break;
    const auto state = stored_in(record);
    if (!state) continue;
    out.intact = chain.add(record.header);
    out.last = {record.header.step, record.offset, *state};
    if (*state == StoredState::keyframe) out.keyframe = out.last;
    if (*state != StoredState::none && out.intact) out.stored = record.header.step;
  }
  return out;
}

std::optional<StepEntry> LogScan::find(std::uint64_t step) {
  const Reached reached = walk_to(step);
  if (!reached.last || reached.last->step != step) return std::nullopt;
  return reached.last;
}

std::optional<StepEntry> LogScan::keyframe_at_or_before(std::uint64_t step) {
  const Reached reached = walk_to(step);
  return reached.intact ? reached.keyframe : std::nullopt;
}

std::optional<std::uint64_t> LogScan::stored_at_or_before(std::uint64_t step) {
  return walk_to(step).stored;
}

std::optional<std::uint64_t> LogScan::held_at_or_before(std::uint64_t step) {
  const Reached reached = walk_to(step);
  return reached.last ? std::optional(reached.last->step) : std::nullopt;
}

std::vector<std::uint64_t> LogScan::event_offsets() {
  std::vector<std::uint64_t> out;
  RecordWalk walk(source_, anchors_.front().offset, RecordWalk::any_sequence, end_,
                  Check::message);
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::record && walk.record().header.kind == RecordKind::event) {
      out.push_back(walk.record().offset);
    }
  }
  return out;
}

}  // namespace varve::io
