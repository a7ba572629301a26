// Salvages what is whole. The input is only read; the output is a new log with its own log id, the
// same run id and the same steps, digests and chain.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/digest.h"
#include "io/errors.h"
#include "io/file.h"
#include "io/log_appender.h"
#include "io/log_reader_impl.h"
#include "io/step_encoder.h"

namespace varve::io {

namespace {

// Bytes after which the output is written, so that memory stays bounded by one record.
constexpr std::uint64_t sync_bytes = std::uint64_t{64} << 20;

class Salvage {
 public:
  Salvage(const File& input, RecordSource& source, GenesisMessage genesis,
          std::uint64_t genesis_end)
      : input_(input),
        source_(source),
        genesis_(std::move(genesis)),
        genesis_end_(genesis_end),
        input_end_(input.size()),
        reader_(source, genesis_.genesis.schema, genesis_.particles_max),
        chain_(chain_before_first(genesis_.genesis)) {}

  Recovery run(File& output) {
    genesis_.genesis.log_id = to_text(random_log_id());
    LogAppender log(output, *log_id_from(genesis_.genesis.log_id), source_.limits());
    log_ = &log;
    log.genesis(genesis_.genesis, genesis_.particles_max);
    std::uint64_t last_offset = 0;
    const auto last_header = source_.find_last_header(input_end_, last_offset);
    const std::uint64_t durable_seq = last_header ? last_header->durable_seq : 0;
    RecordWalk walk(source_, genesis_end_, 1, input_end_, Check::body);
    for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
      if (item == RecordWalk::Item::bad) {
        bad_stretch(walk.bad(), std::max(durable_seq, walk.durable_seq()));
      } else {
        take(walk.record());
      }
      if (log.bytes() - synced_ > sync_bytes) {
        log.sync();
        synced_ = log.bytes();
      }
    }
    return finish();
  }

 private:
  void bad_stretch(const BadStretch& bad, std::uint64_t durable_seq) {
    const bool was_durable = bad.sequence <= durable_seq;
    if (out_.damage.size() < source_.limits().damage_max) {
      out_.damage.push_back({static_cast<std::int64_t>(bad.from),
                             was_durable ? bad.what : "torn tail: " + bad.what});
    }
    what_ = bad.what;
    // An index is rebuilt; anything else that was durable may have been an event or a step.
    lost_something_ = lost_something_ || (was_durable && !bad.only_index);
    if (bad.to_end && was_durable && last_step_) lose(*last_step_ + 1, *last_step_ + 1);
  }

  void lose(std::uint64_t from, std::uint64_t to) {
    if (!out_.lost.empty() && out_.lost.back().second + 1 == from) {
      out_.lost.back().second = to;
    } else {
      out_.lost.emplace_back(from, to);
    }
    if (!open_gap_) open_gap_ = std::pair(from, to);
    open_gap_->second = to;
  }

  void write_gap() {
    if (!open_gap_) return;
    // Events of lost steps stand before the gap.
    const auto kept = std::stable_partition(
        events_.begin(), events_.end(), [this](const auto& placed) {
          const std::uint64_t step = placed.second.step;
          return step >= open_gap_->first && step <= open_gap_->second;
        });
    for (auto at = events_.begin(); at != kept; ++at) log_->event(at->second);
    events_.erase(events_.begin(), kept);
    log_->gap({open_gap_->first, open_gap_->second, what_});
    open_gap_.reset();
  }

  // The events that stand before a step's record are its own.
  void write_events(std::uint64_t step) {
    for (const auto& [offset, event] : events_) {
      if (event.step == step) {
        log_->event(event);
      } else {
        spoilt(offset, fmt::format("an event of step {} before step {}", event.step, step));
      }
    }
    events_.clear();
  }

  // What `decode` makes of a record. Nothing where its bytes hold and make no sense: such a record
  // is as good as lost.
  template <typename Decode>
  auto understood(const Record& record, Decode&& decode) -> std::optional<decltype(decode())> {
    try {
      return decode();
    } catch (const LogError& error) {
      spoilt(record.offset, error.what());
      return std::nullopt;
    }
  }

  void spoilt(std::uint64_t offset, std::string what) {
    what_ = what;
    lost_something_ = true;
    if (out_.damage.size() < source_.limits().damage_max) {
      out_.damage.push_back({static_cast<std::int64_t>(offset), std::move(what)});
    }
  }

  void take_gap(const Record& record) {
    const auto gap = understood(
        record, [&] { return decode_gap(record.message, source_.limits()); });
    // One that makes no sense says nothing: whether the next step follows, its chain will tell.
    if (!gap || gap->from > gap->to) return;
    if (last_step_ && gap->to <= *last_step_) {
      spoilt(record.offset, fmt::format("gap to step {} follows step {}", gap->to, *last_step_));
      return;
    }
    deltas_.interrupt();
    chain_.reset();
    what_ = gap->what;
    lose(last_step_ ? *last_step_ + 1 : gap->from, gap->to);
    last_step_ = gap->to;
  }

  void take(const Record& record) {
    switch (record.header.kind) {
      case RecordKind::step:
      case RecordKind::keyframe: take_step(record); break;
      case RecordKind::event: {
        const auto event = understood(record, [&] {
          return decode_event(record.message, record.header.step, source_.limits());
        });
        if (event && events_.size() >= step_events_max(source_.limits())) {
          spoilt(record.offset, "more events before a step than half of list_items_max");
        } else if (event) {
          events_.emplace_back(record.offset, *event);
        }
        break;
      }
      case RecordKind::gap: take_gap(record); break;
      case RecordKind::genesis:
      case RecordKind::index:
      case RecordKind::end: break;
      default: log_->foreign(record, body_of(record));
    }
    log_->write();
  }

  // Notes the steps missing before `step`. False where it does not come after the one before.
  bool comes_next(const Record& record) {
    const std::uint64_t step = record.header.step;
    if (!last_step_) {
      // Where a log begins is not in genesis, except for a fork.
      const std::uint64_t first = genesis_.genesis.lineage ? genesis_.genesis.lineage->step : 0;
      if (!out_.damage.empty() && step > first) {
        lose(first, step - 1);
        chain_.reset();
      }
    } else if (step <= *last_step_) {
      spoilt(record.offset, fmt::format("step {} follows step {}", step, *last_step_));
      return false;
    } else if (step > *last_step_ + 1) {
      lose(*last_step_ + 1, step - 1);
      chain_.reset();
    }
    last_step_ = step;
    return true;
  }

  bool chained(const Record& record, const StepMessage& message) {
    if (!chain_ || chain_next(*chain_, message.digest) == message.chain) return true;
    spoilt(record.offset, fmt::format("step {}: the chain does not hold", record.header.step));
    deltas_.interrupt();
    return false;
  }

  void take_step(const Record& record) {
    const std::uint64_t step = record.header.step;
    const auto message = understood(
        record, [&] { return decode_step(record.message, source_.limits()); });
    if (!comes_next(record)) {
      deltas_.interrupt();
      return;
    }
    bool keep = false;
    if (message && record.header.kind == RecordKind::keyframe && message->fields.empty()) {
      spoilt(record.offset, fmt::format("step {}: a keyframe without a state", step));
    } else if (message && message->body_bytes() != record.header.body_bytes) {
      spoilt(record.offset, fmt::format("step {}: its blobs are not its body", step));
    } else if (message && chained(record, *message)) {
      const bool decodable = deltas_.add(record.header) && decodes(record, *message);
      // Without the keyframe before it a delta is nothing; a digest alone stands by itself.
      keep = decodable || (message->fields.empty() && genesis_.genesis.tier == Tier::digests);
    }
    if (!keep) {
      deltas_.interrupt();
      chain_.reset();
      lose(step, step);
      return;
    }
    write_gap();
    write_events(step);
    const std::vector<std::byte> body = body_of(record);
    const std::span<const std::byte> blobs[] = {body};
    log_->step(step, record.header.kind == RecordKind::keyframe, with_checksums(*message, body),
               body.empty() ? std::span<const std::span<const std::byte>>{} : blobs);
    chain_ = message->chain;
    ++out_.steps_kept;
  }

  // A record may come without checksums; the one that is written has them, of all its blobs.
  static StepMessage with_checksums(StepMessage message, std::span<const std::byte> body) {
    std::uint64_t at = 0;
    const auto renew = [&](auto& blob) {
      blob.checksum = checksum(body.subspan(at, blob.stored));
      at += aligned(blob.stored);
    };
    for (FieldBlob& blob : message.fields) renew(blob);
    for (TableBlob& blob : message.tables) renew(blob);
    return message;
  }

  // A state that does not decode to its digest is as good as lost, and so are the deltas upon it.
  bool decodes(const Record& record, const StepMessage& message) {
    if (message.fields.empty()) return true;
    std::string what;
    try {
      if (reader_.read(record, message)) return true;
      what = reader_.problem();
    } catch (const LogError& error) {
      what = error.what();
    }
    deltas_.interrupt();
    what_ = what;
    if (out_.damage.size() < source_.limits().damage_max) {
      out_.damage.push_back({static_cast<std::int64_t>(record.offset), std::move(what),
                             record.header.step, record.header.step});
    }
    return false;
  }

  std::vector<std::byte> body_of(const Record& record) const {
    std::vector<std::byte> body(record.header.body_bytes);
    source_.read_bytes(record.body_offset(), body);
    return body;
  }

  Recovery finish() {
    if (out_.steps_kept == 0) {
      throw LogError(ErrorKind::damaged, input_.path(), "no step of it can be saved", 0);
    }
    // What is lost behind the last step is told, not recorded: a continued run computes it again.
    log_->end();
    log_->write();
    log_->sync();
    out_.lossy = lost_something_ || !out_.lost.empty();
    return std::move(out_);
  }

  const File& input_;
  RecordSource& source_;
  GenesisMessage genesis_;
  std::uint64_t genesis_end_;
  std::uint64_t input_end_;
  FrameReader reader_;
  LogAppender* log_ = nullptr;
  std::uint64_t synced_ = 0;
  Recovery out_;
  DeltaChain deltas_;
  std::optional<std::uint64_t> last_step_;  // seen: kept, lost or named by a gap
  std::optional<Digest> chain_;             // at the last step; nothing where it is not known
  std::optional<std::pair<std::uint64_t, std::uint64_t>> open_gap_;
  std::string what_;
  std::vector<std::pair<std::uint64_t, Event>> events_;  // since the last step kept: offset, event
  bool lost_something_ = false;
};

void check_output(FileSystem& files, const std::string& path, const Limits& limits) {
  const auto file = files.open_read(path);
  const auto verification = verify_log(*file, limits, true);
  if (verification.completeness == Completeness::complete) return;
  throw LogError(ErrorKind::damaged, path,
                 fmt::format("what was saved does not verify: {}",
                             verification.damage.empty() ? "it is torn"
                                                         : verification.damage.front().what),
                 verification.damage.empty() ? -1 : verification.damage.front().offset);
}

}  // namespace

Recovery recover(const std::string& input, const std::string& output, bool overwrite,
                 FileSystem* files_given) {
  const Limits limits;
  FileSystem& files = files_or_system(files_given);
  const auto file = files.open_read(input);
  if (files.same_file(input, output)) {
    throw LogError(ErrorKind::exists, output, "is the log to be saved; another name is needed");
  }
  RecordSource source(*file, limits);
  std::uint64_t genesis_end = 0;
  GenesisMessage genesis = read_genesis(source, &genesis_end);
  const auto lock = lock_new_file(files, output, overwrite);
  const std::string temporary = output + ".new";
  try {
    auto out = files.create(temporary);
    Recovery recovery = Salvage(*file, source, std::move(genesis), genesis_end).run(*out);
    out->close();
    check_output(files, temporary, limits);
    files.rename(temporary, output);
    files.sync_directory(output);
    return recovery;
  } catch (...) {
    remove_quietly(files, temporary);
    throw;
  }
}

}  // namespace varve::io
