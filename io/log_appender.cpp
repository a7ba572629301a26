#include "io/log_appender.h"

#include <fmt/format.h>

#include <utility>

#include "io/errors.h"

namespace varve::io {

namespace {

// Each index record points to the (m * 16^k)-th before it, m = 1..15: among them every 2^k-th. Any
// earlier one is then at most one hop per hexadecimal digit of its distance away.
constexpr std::uint64_t skip_base = 16;

}  // namespace

std::vector<std::uint64_t> skip_distances(std::uint64_t ordinal) {
  std::vector<std::uint64_t> out;
  for (std::uint64_t stride = 1; stride <= ordinal; stride *= skip_base) {
    for (std::uint64_t m = 1; m < skip_base && m <= ordinal / stride; ++m) {
      out.push_back(m * stride);
    }
    if (stride > UINT64_MAX / skip_base) break;
  }
  return out;
}

bool IndexBuilder::continues(std::uint64_t step, std::uint64_t offset) const {
  if (empty()) return true;
  return step == pending_.last_step() + 1 &&
         (offset - last_offset_) / alignment_bytes <= UINT32_MAX;
}

void IndexBuilder::add_step(std::uint64_t step, std::uint64_t offset, StoredState state) {
  if (empty()) {
    pending_.first_step = step;
    pending_.first_offset = offset;
  } else {
    pending_.gaps.push_back(static_cast<std::uint32_t>((offset - last_offset_) / alignment_bytes));
  }
  pending_.states.push_back(state);
  last_offset_ = offset;
}

bool IndexBuilder::due() const {
  return pending_.states.size() >= steps_due || pending_.events.size() >= events_due ||
         (!empty() && last_offset_ - pending_.first_offset >= bytes_due);
}

IndexMessage IndexBuilder::message() const {
  IndexMessage out = pending_;
  out.ordinal = past_.size();
  for (const std::uint64_t distance : skip_distances(out.ordinal)) {
    out.skips.push_back(past_[past_.size() - distance]);
  }
  out.events_before = events_before_;
  return out;
}

void IndexBuilder::written(const IndexMessage& message, std::uint64_t offset) {
  past_.push_back({offset, message.last_step()});
  if (!message.events.empty()) events_before_ = offset;
  pending_ = {};
}

LogAppender::LogAppender(File& file, const LogId& id, const Limits& limits)
    : limits_(limits), records_(file, id, {}, limits) {}

// Takes over what an existing record says. Events count once their step is there.
void LogAppender::absorb(const Record& record, std::vector<std::uint64_t>& loose_events,
                         const std::string& path) {
  switch (record.header.kind) {
    case RecordKind::event: loose_events.push_back(record.offset); return;
    case RecordKind::step:
    case RecordKind::keyframe:
      for (const std::uint64_t at : std::exchange(loose_events, {})) index_.add_event(at);
      note(record.header.step, record.header.kind == RecordKind::keyframe,
           decode_step(record.message, limits_), record.offset);
      return;
    case RecordKind::index: {
      const IndexMessage message = decode_index(record.message, limits_);
      if (message.ordinal != index_.written_so_far()) {
        throw LogError(ErrorKind::damaged, path,
                       fmt::format("index record: number {} where {} is expected",
                                   message.ordinal, index_.written_so_far()),
                       static_cast<std::int64_t>(record.offset));
      }
      index_.written(message, record.offset);
      loose_events.clear();  // an index names every event record before it
      return;
    }
    default: return;
  }
}

LogAppender LogAppender::continuing(File& file, const LogId& id, const Limits& limits) {
  RecordSource source(file, limits);
  source.bind(id);
  const std::uint64_t file_end = file.size();
  RecordWalk walk(source, 0, 0, file_end, Check::body);
  LogAppender out(file, id, limits);
  RecordAppender::Start start;
  std::vector<std::uint64_t> loose_events;
  std::optional<BadStretch> bad;
  // Behind the first bad stretch nothing is taken over, but the walk must see all headers there:
  // one of them may say that what is bad was durable.
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (bad) continue;
    if (item == RecordWalk::Item::bad) {
      bad = walk.bad();
      continue;
    }
    const Record& record = walk.record();
    try {
      out.absorb(record, loose_events, file.path());
    } catch (const LogError& error) {
      rethrow_at(error, file.path(), record.offset);
    }
    if (record.header.kind == RecordKind::index) start.index_offset = record.offset;
    // An event or a gap is nothing without the step behind it.
    if (record.header.kind == RecordKind::event || record.header.kind == RecordKind::gap) continue;
    start.offset = record.end();
    start.sequence = record.header.sequence + 1;
  }
  if (bad && bad->sequence <= walk.durable_seq()) {
    throw LogError(ErrorKind::damaged, file.path(),
                   bad->what + "; this part was durable, so it is no torn tail and nothing is "
                               "cut: 'recover' saves what is whole",
                   static_cast<std::int64_t>(bad->from));
  }
  if (out.summary_.steps == 0) throw LogError(ErrorKind::damaged, file.path(), "no whole step", 0);
  start.durable_seq = start.sequence - 1;
  out.records_ = RecordAppender(file, id, start, limits);
  out.durable_step_ = out.summary_.last_step;
  out.cut_bytes_ = file_end - start.offset;
  return out;
}

void LogAppender::genesis(const Genesis& genesis, std::uint64_t particles_max) {
  records_.add(RecordKind::genesis, 0, encode_genesis(genesis, particles_max));
}

void LogAppender::event(const Event& event) {
  index_.add_event(records_.add(RecordKind::event, event.step, encode(event)));
}

void LogAppender::step(std::uint64_t step, bool keyframe, const StepMessage& message,
                       std::span<const std::span<const std::byte>> blobs) {
  if (!index_.continues(step, records_.offset())) write_index();
  const std::uint64_t offset = records_.add(keyframe ? RecordKind::keyframe : RecordKind::step,
                                            step, encode(message), blobs);
  note(step, keyframe, message, offset);
  if (index_.due()) write_index();
}

void LogAppender::note(std::uint64_t step, bool keyframe, const StepMessage& message,
                       std::uint64_t offset) {
  const bool has_state = !message.fields.empty();
  index_.add_step(step, offset,
                  keyframe    ? StoredState::keyframe
                  : has_state ? StoredState::delta
                              : StoredState::none);
  if (summary_.steps++ == 0) summary_.first_step = step;
  summary_.last_step = step;
  summary_.time = message.time;
  summary_.dt = message.dt;
  summary_.digest = message.digest;
  summary_.chain = message.chain;
  summary_.has_state = has_state;
}

void LogAppender::gap(const GapMessage& message) {
  if (!index_.empty()) write_index();
  records_.add(RecordKind::gap, message.from, encode(message));
}

void LogAppender::foreign(const Record& record, std::span<const std::byte> body) {
  const std::span<const std::byte> blobs[] = {body};
  records_.add(record.header.kind, record.header.step, record.message,
               body.empty() ? std::span<const std::span<const std::byte>>{} : blobs);
}

void LogAppender::end() {
  if (!index_.empty()) write_index();
  // Synced first, so that the end record's header says of all before it that it was durable.
  write();
  sync();
  records_.add(RecordKind::end, summary_.last_step, encode(summary_));
}

void LogAppender::sync() {
  records_.sync();
  durable_step_ = summary_.last_step;
}

void LogAppender::write_index() {
  const IndexMessage message = index_.message();
  index_.written(message, records_.add(RecordKind::index, message.last_step(), encode(message)));
}

}  // namespace varve::io
