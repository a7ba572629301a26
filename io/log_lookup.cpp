// Looking steps up: by the index where it holds, else by walking.
#include <algorithm>

#include "io/errors.h"
#include "io/log_reader_impl.h"

namespace varve::io {

template <typename Ask>
auto LogReaderImpl::ask(Ask&& ask) const {
  if (!scan_) {
    try {
      return ask(index_);
    } catch (const LogError& error) {
      if (error.kind() != ErrorKind::damaged) throw;
      found_damage();
    }
  }
  return ask(*scan_);
}

void LogReaderImpl::found_damage() const {
  if (!scan_) {
    scan_all();
    settle();
  } else {
    completeness_ = Completeness::damaged;
  }
}

std::optional<StepEntry> LogReaderImpl::entry(std::uint64_t step) const {
  if (step < first_.step || step > last_.step) return std::nullopt;
  if (!scan_ && !pending_.empty() && step >= pending_.front().step) {
    return find_entry(pending_, step);
  }
  if (!scan_ && !index_.has_root()) return std::nullopt;
  return ask([step](auto& way) { return way.find(step); });
}

std::optional<StepEntry> LogReaderImpl::keyframe_at_or_before(std::uint64_t step) const {
  std::uint64_t wanted = step;
  if (!scan_ && !pending_.empty() && step >= pending_.front().step) {
    auto at = std::upper_bound(
        pending_.begin(), pending_.end(), step,
        [](std::uint64_t value, const StepEntry& entry) { return value < entry.step; });
    while (at != pending_.begin()) {
      --at;
      if (at->state == StoredState::keyframe) return *at;
      if (at->step != wanted) return std::nullopt;
      --wanted;
    }
  }
  if (!scan_ && !index_.has_root()) return std::nullopt;
  return ask([wanted](auto& way) { return way.keyframe_at_or_before(wanted); });
}

std::uint64_t LogReaderImpl::held_at_or_before(std::uint64_t step) const {
  if (!scan_ && !pending_.empty() && step >= pending_.front().step) {
    const auto at = std::upper_bound(
        pending_.begin(), pending_.end(), step,
        [](std::uint64_t value, const StepEntry& entry) { return value < entry.step; });
    return (at - 1)->step;
  }
  if (!scan_ && !index_.has_root()) return first_.step;
  return ask([step](auto& way) { return way.held_at_or_before(step); }).value_or(first_.step);
}

std::optional<std::uint64_t> LogReaderImpl::stored_step_at_or_before(std::uint64_t step) const {
  if (step < first_.step) return std::nullopt;
  if (!scan_) {
    for (auto at = pending_.rbegin(); at != pending_.rend(); ++at) {
      if (at->step <= step && at->state != StoredState::none) return at->step;
    }
    if (!index_.has_root()) return std::nullopt;
  }
  return ask([step](auto& way) { return way.stored_at_or_before(step); });
}

std::vector<std::uint64_t> LogReaderImpl::event_offsets() const {
  std::vector<std::uint64_t> out;
  if (scan_ || index_.has_root()) out = ask([](auto& way) { return way.event_offsets(); });
  out.insert(out.end(), pending_events_.begin(), pending_events_.end());
  return out;
}

bool LogReaderImpl::read_step(const StepEntry& entry, Record& record, StepMessage& message) const {
  if (!source_.read(entry.offset, file_end_, Check::message, record)) return false;
  if (!is_step(record.header.kind) || record.header.step != entry.step) return false;
  message = step_message(record);
  return true;
}

std::optional<StepHeader> LogReaderImpl::header(std::uint64_t step) const {
  if (step == first_.step) return first_;
  if (step == last_.step) return last_;
  Record record;
  StepMessage message;
  for (int attempt = 0; attempt < 2; ++attempt) {
    const auto found = entry(step);
    if (!found) return std::nullopt;
    if (read_step(*found, record, message)) return header_of(record, message);
    found_damage();
  }
  return std::nullopt;
}

std::uint64_t LogReaderImpl::step_at_time(double time) const {
  const auto reached = [time](const StepHeader& header) {
    return header.time <= time + 1e-6 * header.dt;
  };
  std::uint64_t best = first_.step;
  // Steps in (best, low] are known to be missing or reached; those above high are too late.
  std::uint64_t low = best;
  std::uint64_t high = last_.step;
  while (low < high) {
    const std::uint64_t middle = low + (high - low + 1) / 2;
    const std::uint64_t held = held_at_or_before(middle);
    if (held <= best) {
      low = middle;
      continue;
    }
    const auto found = header(held);
    if (found && !reached(*found)) {
      high = held - 1;
      continue;
    }
    if (found) best = held;
    low = std::max(low + 1, middle);
  }
  return best;
}

}  // namespace varve::io
