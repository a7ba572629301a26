// The full check: every byte, the chain, the index, and every state against its digest.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "io/digest.h"
#include "io/errors.h"
#include "io/log_appender.h"
#include "io/log_reader_impl.h"
#include "io/step_encoder.h"

namespace varve::io {

namespace {

class Verifier {
 public:
  Verifier(const File& file, const Limits& limits, bool decode)
      : file_(file),
        source_(file, limits),
        genesis_(read_genesis(source_, &genesis_end_)),
        reader_(source_, genesis_.genesis.schema, genesis_.particles_max),
        decode_(decode),
        chain_(chain_before_first(genesis_.genesis)) {}

  LogReader::Verification run() {
    out_.file_bytes = file_.size();
    out_.bytes_checked = genesis_end_;
    std::uint64_t last_offset = 0;
    const auto last_header = source_.find_last_header(out_.file_bytes, last_offset);
    const std::uint64_t durable_seq = last_header ? last_header->durable_seq : 0;
    RecordWalk walk(source_, genesis_end_, 1, out_.file_bytes, Check::body);
    bool torn = false;
    for (auto item = walk.next(); item != RecordWalk::Item::end && !torn; item = walk.next()) {
      if (item == RecordWalk::Item::record) {
        out_.bytes_checked += walk.record().header.record_bytes();
        check(walk.record());
      } else if (walk.bad().sequence > std::max(durable_seq, walk.durable_seq())) {
        torn = true;
        torn_tail(walk.bad());
      } else {
        bad_stretch(walk.bad());
      }
    }
    conclude(torn);
    return std::move(out_);
  }

 private:
  void damage(std::uint64_t offset, std::string what) {
    found_damage_ = true;
    list({static_cast<std::int64_t>(offset), std::move(what)});
  }

  void list(Damage item) {
    const std::uint64_t cap = source_.limits().damage_max;
    if (out_.damage.size() < cap) {
      out_.damage.push_back(std::move(item));
    } else {
      out_.damage.back().what = fmt::format("and {} more places (damage_max {})",
                                            ++unlisted_, cap);
    }
  }

  void bad_stretch(const BadStretch& bad) {
    std::string what = bad.what;
    if (bad.to > bad.from) what += fmt::format(" ({} bytes do not hold)", bad.to - bad.from);
    damage(bad.from, std::move(what));
    any_bad_ = true;
    interrupted_ = true;
    known_lost_ = true;
    out_.closed = false;
    open_damage(out_.damage.size() - 1);
    index_known_ = false;
  }

  void torn_tail(const BadStretch& bad) {
    out_.closed = false;
    list({static_cast<std::int64_t>(bad.from),
          fmt::format("torn tail of {} bytes, none of it known to have been durable: {}",
                      out_.file_bytes - bad.from, bad.what)});
  }

  // Steps are lost from the next one expected until one can be read again.
  void open_damage(std::size_t index) {
    if (open_damage_) return;
    open_damage_ = index;
    lost_from_ = last_step_ ? *last_step_ + 1 : 0;
  }

  void close_damage(std::uint64_t next_step) {
    if (!open_damage_) return;
    if (next_step > lost_from_) {
      out_.damage[*open_damage_].step_from = lost_from_;
      out_.damage[*open_damage_].step_to = next_step - 1;
    }
    open_damage_.reset();
  }

  void check(const Record& record) {
    if (index_known_ && record.header.index_offset != index_offset_) {
      damage(record.offset, fmt::format("{} record: names an index record at {}, the last is at {}",
                                        name_of(record.header.kind), record.header.index_offset,
                                        index_offset_));
    }
    try {
      switch (record.header.kind) {
        case RecordKind::step:
        case RecordKind::keyframe: check_step(record); break;
        case RecordKind::event:
          decode_event(record.message, record.header.step, source_.limits());
          events_.push_back(record.offset);
          last_event_ = record.offset;
          loose_steps_.push_back(record.header.step);
          break;
        case RecordKind::index: check_index(record); break;
        case RecordKind::end: check_end(record); break;
        case RecordKind::gap: check_gap(record); break;
        case RecordKind::genesis: damage(record.offset, "a second genesis record"); break;
        default: break;
      }
    } catch (const LogError& error) {
      damage(record.offset, error.what());
    }
    out_.closed = record.header.kind == RecordKind::end;
    loose_event_ = record.header.kind == RecordKind::event;
    if (!is_step(record.header.kind) && record.header.body_bytes > 0 &&
        is_known(record.header.kind)) {
      damage(record.offset, name_of(record.header.kind) + " record: has a body, needs none");
    }
  }

  void check_step(const Record& record) {
    const std::uint64_t step = record.header.step;
    const StepMessage message = decode_step(record.message, source_.limits());
    if (message.body_bytes() != record.header.body_bytes) {
      damage(record.offset, fmt::format("step {}: its blobs take {} bytes, its body has {}", step,
                                        message.body_bytes(), record.header.body_bytes));
      return;
    }
    const bool follows = last_step_ ? step == *last_step_ + 1 : true;
    if (!follows && !interrupted_) {
      damage(record.offset, fmt::format("step {} follows step {}", step, *last_step_));
    }
    const bool chained = chain_ && follows && (last_step_ || !interrupted_);
    if (chained && chain_next(*chain_, message.digest) != message.chain) {
      damage(record.offset, fmt::format("step {}: the chain does not hold", step));
    }
    chain_ = message.chain;
    loose_gap_.reset();
    last_step_ = step;
    last_recorded_ = step;
    last_ = message;
    if (out_.steps++ == 0) first_step_ = step;
    const bool keyframe = record.header.kind == RecordKind::keyframe;
    const bool has_state = !message.fields.empty();
    if (keyframe && !has_state) {
      damage(record.offset, fmt::format("step {}: a keyframe without a state", step));
    }
    check_events(step);
    const bool decodable = deltas_.add(record.header);
    if (!has_state || decodable) close_damage(step);
    interrupted_ = false;
    entries_.push_back({step, record.offset, keyframe    ? StoredState::keyframe
                                             : has_state ? StoredState::delta
                                                         : StoredState::none});
    if (entries_.size() > source_.limits().index_steps_max) {
      entries_.clear();  // nobody indexes this log: it must be scanned, which is no damage
      index_known_ = false;
    }
    if (!has_state) return;
    if (!decodable && !known_lost_) {
      damage(record.offset, fmt::format("step {}: coded upon a state that is not there", step));
      open_damage(out_.damage.size() - 1);
      lost_from_ = step;
    }
    known_lost_ = !decodable;
    if (decode_ && decodable) check_state(record, message);
  }

  // The events that stand before a step's record are its own.
  void check_events(std::uint64_t step) {
    for (const std::uint64_t of : std::exchange(loose_steps_, {})) {
      if (of != step && !known_lost_) {
        damage(last_event_, fmt::format("an event of step {} before step {}", of, step));
      }
    }
  }

  void check_state(const Record& record, const StepMessage& message) {
    std::string what;
    try {
      if (reader_.read(record, message)) return;
      what = fmt::format("step {}: {}", record.header.step, reader_.problem());
    } catch (const LogError& error) {
      what = error.what();
    }
    damage(record.offset, std::move(what));
    deltas_.interrupt();
    known_lost_ = true;
    open_damage(out_.damage.size() - 1);
    lost_from_ = record.header.step;
  }

  void check_index(const Record& record) {
    const IndexMessage index = decode_index(record.message, source_.limits());
    const auto wrong = [&](const std::string& what) {
      damage(record.offset, fmt::format("index record {}: {}", index.ordinal, what));
    };
    if (index_known_) {
      if (index.ordinal != next_ordinal_) wrong(fmt::format("number {} expected", next_ordinal_));
      if (index.states.size() != entries_.size() || entries_.front().step != index.first_step) {
        wrong("does not name the steps before it");
      } else if (!same_entries(index)) {
        wrong("names other offsets than those of its steps");
      }
      if (index.events != events_) wrong("does not name the events before it");
    }
    if (record.header.step != index.last_step()) {
      wrong(fmt::format("its header says step {}", record.header.step));
    }
    check_skips(record, index, wrong);
    next_ordinal_ = index.ordinal + 1;
    index_known_ = true;
    index_offset_ = record.offset;
    entries_.clear();
    events_.clear();
  }

  bool same_entries(const IndexMessage& index) const {
    std::uint64_t offset = index.first_offset;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (i > 0) offset += std::uint64_t{index.gaps[i - 1]} * alignment_bytes;
      if (entries_[i].offset != offset || entries_[i].state != index.states[i]) return false;
    }
    return true;
  }

  template <typename Wrong>
  void check_skips(const Record& record, const IndexMessage& index, Wrong&& wrong) {
    const auto distances = skip_distances(index.ordinal);
    if (distances.size() != index.skips.size()) {
      wrong(fmt::format("{} pointers where {} are expected", index.skips.size(),
                        distances.size()));
      return;
    }
    Record target;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      const SkipPointer& skip = index.skips[i];
      const bool whole = source_.read(skip.offset, record.offset, Check::message, target);
      if (!whole && any_bad_) continue;  // reported where it stands
      const bool holds = whole && target.header.kind == RecordKind::index &&
                         target.header.step == skip.last_step &&
                         decode_index(target.message, source_.limits()).ordinal ==
                             index.ordinal - distances[i];
      if (!holds) wrong(fmt::format("its pointer {} leads elsewhere", i));
    }
  }

  void check_end(const Record& record) {
    const EndMessage end = decode_end(record.message);
    if (record.header.step != end.last_step) {
      damage(record.offset, fmt::format("end record: its header says step {}, it names {}",
                                        record.header.step, end.last_step));
    }
    if (!interrupted_ && (loose_gap_ || !std::exchange(loose_steps_, {}).empty())) {
      damage(record.offset, "end record: behind an event or a gap without its step");
    }
    loose_gap_.reset();
    if (out_.steps == 0 || interrupted_) return;
    if (end.last_step != last_recorded_ || end.digest != last_.digest || end.chain != last_.chain) {
      damage(record.offset, "end record: does not name the step before it");
    }
    if (!any_bad_ && (end.steps != out_.steps || end.first_step != first_step_)) {
      damage(record.offset, fmt::format("end record: counts {} steps, there are {}", end.steps,
                                        out_.steps));
    }
  }

  void check_gap(const Record& record) {
    const GapMessage gap = decode_gap(record.message, source_.limits());
    const bool any = gap.from <= gap.to;
    if (last_step_ && !interrupted_ && gap.from != *last_step_ + 1) {
      damage(record.offset, fmt::format("gap from step {} follows step {}", gap.from, *last_step_));
    }
    if (record.header.step != gap.from) {
      damage(record.offset, fmt::format("gap from step {}: its header says {}", gap.from,
                                        record.header.step));
    }
    loose_gap_ = record.offset;
    if (any) last_step_ = gap.to;
    loose_steps_.clear();  // of steps that are lost
    chain_.reset();
    deltas_.interrupt();
  }

  void conclude(bool torn) {
    if (open_damage_ && last_step_) close_damage(*last_step_ + 1);
    if (loose_event_ && !torn) {
      torn = true;
      list({static_cast<std::int64_t>(last_event_), "an event without its step"});
    }
    if (loose_gap_ && !torn) {
      torn = true;
      list({static_cast<std::int64_t>(*loose_gap_), "a gap without a step behind it"});
    }
    out_.completeness = found_damage_ ? Completeness::damaged
                        : torn        ? Completeness::torn
                                      : Completeness::complete;
  }

  const File& file_;
  RecordSource source_;
  std::uint64_t genesis_end_ = 0;
  GenesisMessage genesis_;
  FrameReader reader_;
  const bool decode_;
  LogReader::Verification out_;
  bool found_damage_ = false;
  std::uint64_t unlisted_ = 0;

  bool any_bad_ = false;
  bool interrupted_ = false;  // a bad stretch lies between the last step and here
  bool known_lost_ = false;   // no state can be decoded before the next keyframe; it was said why
  std::optional<std::size_t> open_damage_;
  std::uint64_t lost_from_ = 0;

  std::optional<std::uint64_t> last_step_;  // recorded, or named by a gap
  std::uint64_t last_recorded_ = 0;
  std::uint64_t first_step_ = 0;
  StepMessage last_;
  std::optional<Digest> chain_;  // before the next step; nothing behind a gap
  DeltaChain deltas_;
  std::optional<std::uint64_t> loose_gap_;  // behind the last step: its offset
  bool loose_event_ = false;
  std::uint64_t last_event_ = 0;
  std::vector<std::uint64_t> loose_steps_;  // of the events since the last step

  std::vector<StepEntry> entries_;  // since the last index record
  std::vector<std::uint64_t> events_;
  std::uint64_t next_ordinal_ = 0;
  std::uint64_t index_offset_ = 0;
  bool index_known_ = true;  // false behind damage: the last index record may have been lost
};

}  // namespace

LogReader::Verification verify_log(const File& file, const Limits& limits, bool decode) {
  return Verifier(file, limits, decode).run();
}

}  // namespace varve::io
