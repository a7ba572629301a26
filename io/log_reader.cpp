#include "io/log_reader.h"

#include <algorithm>
#include <utility>

#include "io/errors.h"
#include "io/log_reader_impl.h"

namespace varve::io {

std::string_view name_of(Completeness completeness) {
  switch (completeness) {
    case Completeness::complete: return "complete";
    case Completeness::torn: return "torn";
    case Completeness::damaged: return "damaged";
  }
  return "unknown";
}

std::unique_ptr<LogReader> LogReader::open(const std::string& path, FileSystem* files,
                                           const Limits& limits) {
  return std::make_unique<LogReaderImpl>(path, files_or_system(files), limits);
}

LogReaderImpl::LogReaderImpl(std::string path, FileSystem& files, const Limits& limits)
    : path_(std::move(path)),
      files_(files),
      file_(files.open_read(path_)),
      source_(*file_, limits),
      genesis_(read_genesis(source_, &genesis_end_)),
      index_(source_),
      decoder_(source_, genesis_.genesis.schema, genesis_.particles_max) {
  file_end_ = file_->size();
  end_ = genesis_end_;
  next_sequence_ = 1;
  find_first();
  find_end();
  settle();
  if (steps_seen_ == 0) refuse_without_step();
}

// The first place that does not hold says why, and where.
void LogReaderImpl::refuse_without_step() {
  RecordWalk walk(source_, genesis_end_, 1, file_end_, Check::body);
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item != RecordWalk::Item::bad) continue;
    throw LogError(walk.bad().kind, path_, "no step of it is whole: " + walk.bad().what,
                   static_cast<std::int64_t>(walk.bad().from));
  }
  throw LogError(ErrorKind::damaged, path_, "no step of it is whole", 0);
}

StepMessage LogReaderImpl::step_message(const Record& record) const {
  try {
    return decode_step(record.message, source_.limits());
  } catch (const LogError& error) {
    rethrow_at(error, path_, record.offset);
  }
}

StepHeader LogReaderImpl::header_of(const Record& record, const StepMessage& message) const {
  return {record.header.step, message.time,  message.dt, message.digest,
          message.chain,      !message.fields.empty()};
}

void LogReaderImpl::find_first() {
  RecordWalk walk(source_, genesis_end_, 1, file_end_, Check::message);
  while (walk.next() == RecordWalk::Item::record) {
    const Record& record = walk.record();
    if (!is_step(record.header.kind)) continue;
    first_ = header_of(record, step_message(record));
    first_known_ = true;
    return;
  }
}

// Takes the end from an end record that is the last thing in the file and whose index covers all.
bool LogReaderImpl::close_by_end_record(const RecordHeader& header, std::uint64_t offset) {
  Record record;
  if (header.kind != RecordKind::end || offset + header.record_bytes() != file_end_ ||
      !source_.read(offset, file_end_, Check::body, record)) {
    return false;
  }
  const EndMessage message = decode_end(record.message);
  index_.set_root(header.index_offset);
  if (message.steps == 0 || index_.last_step() != message.last_step ||
      index_.end() != offset || message.first_step != first_.step) {
    return false;
  }
  last_ = {message.last_step, message.time,  message.dt, message.digest,
           message.chain,     message.has_state};
  steps_seen_ = message.steps;
  end_ = record.end();
  next_sequence_ = record.header.sequence + 1;
  closed_ = true;
  return true;
}

// Stands behind an index record; what follows is walked.
bool LogReaderImpl::start_from_index(std::uint64_t index_offset) {
  try {
    index_.set_root(index_offset);
    const auto found = index_.find(index_.last_step());
    Record record;
    StepMessage message;
    if (!found || !read_step(*found, record, message)) return false;
    last_ = header_of(record, message);
    steps_seen_ = 1;
    end_ = index_.end();
    next_sequence_ = index_.end_sequence();
    return true;
  } catch (const LogError& error) {
    if (error.kind() != ErrorKind::damaged) throw;
    return false;
  }
}

// The last index, from the one at `index_offset` back, that is known to have been synced, and with
// it all that it covers. What stands behind may be torn anywhere, however whole its own end is, so
// all of that is walked; from the first step on where no index is known to be durable.
bool LogReaderImpl::start_from_durable_index(std::uint64_t index_offset) {
  index_.clear();
  Record record;
  while (index_offset != 0) {
    if (!source_.read(index_offset, file_end_, Check::message, record) ||
        record.header.kind != RecordKind::index || record.header.index_offset >= index_offset) {
      return false;
    }
    if (record.header.sequence <= durable_seq_) return start_from_index(index_offset);
    index_offset = record.header.index_offset;
  }
  return true;
}

void LogReaderImpl::find_end() {
  std::uint64_t offset = 0;
  const auto header = source_.find_last_header(file_end_, offset);
  durable_seq_ = header ? header->durable_seq : 0;
  bool started = header && offset != 0 && header->index_offset == 0 &&
                 header->kind != RecordKind::index;  // too short to have an index yet
  if (header && !started && first_known_) {
    try {
      if (close_by_end_record(*header, offset)) return;
    } catch (const LogError& error) {
      if (error.kind() != ErrorKind::damaged && error.kind() != ErrorKind::limit) throw;
    }
    // An index record at the very end cannot be known to be synced: its header leads to others.
    started = start_from_durable_index(header->index_offset);
  }
  if (!started || !walk_on()) scan_all();
}

void LogReaderImpl::absorb_index(const Record& record) const {
  if (scan_) return;
  index_.set_root(record.offset);
  if (steps_seen_ == 0 || index_.last_step() != last_.step) {
    throw LogError(ErrorKind::damaged, path_, "index record: does not name the step before it",
                   static_cast<std::int64_t>(record.offset));
  }
  pending_.clear();
  pending_events_.clear();
  loose_events_.clear();
}

// Steps follow each other, unless a gap says which are missing. While damage is scanned for, steps
// may be lost with it, and what goes back is as if it were not there.
void LogReaderImpl::check_order(const Record& record) const {
  const bool after_gap = std::exchange(after_gap_, false);
  const std::uint64_t step = record.header.step;
  if (steps_seen_ == 0 || step == last_.step + 1 || (after_gap && step > last_.step)) return;
  if (!scan_ || step <= last_.step) {
    throw LogError(ErrorKind::damaged, path_,
                   "step " + std::to_string(step) + " follows step " + std::to_string(last_.step),
                   static_cast<std::int64_t>(record.offset));
  }
  completeness_ = Completeness::damaged;
}

void LogReaderImpl::absorb(const Record& record) const {
  const RecordKind kind = record.header.kind;
  // An event counts once the step that it belongs to is there.
  if (kind == RecordKind::event) {
    loose_events_.push_back(record.offset);
    return;
  }
  if (kind == RecordKind::gap) {  // so does a gap
    after_gap_ = true;
    return;
  }
  if (is_step(kind)) {
    check_order(record);
    const StepMessage message = step_message(record);
    last_ = header_of(record, message);
    if (steps_seen_++ == 0) first_ = last_;
    const StoredState state = kind == RecordKind::keyframe ? StoredState::keyframe
                              : last_.has_state           ? StoredState::delta
                                                          : StoredState::none;
    if (!scan_) pending_.push_back({last_.step, record.offset, state});
  }
  if (is_step(kind)) {
    pending_events_.insert(pending_events_.end(), loose_events_.begin(), loose_events_.end());
    loose_events_.clear();
  }
  if (kind == RecordKind::index) absorb_index(record);
  closed_ = kind == RecordKind::end;
  end_ = record.end();
  next_sequence_ = record.header.sequence + 1;
  if (scan_) {
    pending_events_.clear();
    scan_->note(record);
    scan_->set_end(end_);
  }
}

// Takes over what follows `end_`. False where that shows damage and the log must be scanned
// instead.
bool LogReaderImpl::walk_on() const {
  loose_events_.clear();
  after_gap_ = false;
  RecordWalk walk(source_, end_, next_sequence_, file_end_, Check::body);
  std::optional<std::uint64_t> torn_from;
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    durable_seq_ = std::max(durable_seq_, walk.durable_seq());
    if (torn_from) continue;  // only the durable marks behind are of interest
    if (item == RecordWalk::Item::bad) {
      if (walk.bad().sequence > durable_seq_) {
        torn_from = walk.bad().sequence;
      } else if (!scan_) {
        return false;
      } else {
        completeness_ = Completeness::damaged;
      }
      continue;
    }
    try {
      absorb(walk.record());
    } catch (const LogError& error) {
      if (error.kind() != ErrorKind::damaged && error.kind() != ErrorKind::limit) throw;
      if (!scan_) return false;
      completeness_ = Completeness::damaged;  // its bytes hold and make no sense: as if not there
    }
    if (!scan_ && pending_.size() > source_.limits().index_steps_max) return false;
  }
  return !torn_from || *torn_from > durable_seq_;
}

void LogReaderImpl::scan_all() const {
  // A second round where the first has met a later durable mark than was known when it began.
  do {
    scan_.emplace(source_, genesis_end_);
    pending_.clear();
    pending_events_.clear();
    decoded_step_.reset();
    steps_seen_ = 0;
    closed_ = false;
    completeness_ = Completeness::complete;
    end_ = genesis_end_;
    next_sequence_ = 1;
  } while (!walk_on());
}

void LogReaderImpl::settle() const {
  torn_bytes_ = file_end_ - end_;
  if (completeness_ == Completeness::damaged) return;
  const bool growing = torn_bytes_ > 0 && files_.is_locked(path_);
  completeness_ = torn_bytes_ > 0 && !growing ? Completeness::torn : Completeness::complete;
}

bool LogReaderImpl::refresh() {
  const std::uint64_t before = last_.step;
  follow();
  // The writer may have finished a record and gone between our look at the file and at its lock.
  if (completeness_ == Completeness::torn && file_->size() != file_end_) follow();
  return last_.step > before;
}

void LogReaderImpl::follow() {
  const std::uint64_t size = file_->size();
  if (size < end_) {
    throw LogError(ErrorKind::damaged, path_, "the file became shorter while it was followed",
                   static_cast<std::int64_t>(size));
  }
  file_end_ = size;
  if (!walk_on()) scan_all();
  settle();
}

}  // namespace varve::io
