// Decoding states, tables and events; counting bytes.
#include <algorithm>
#include <map>

#include "io/errors.h"
#include "io/log_reader_impl.h"
#include "io/schema_check.h"

namespace varve::io {

bool LogReaderImpl::decode_to(const StepEntry& keyframe, std::uint64_t step) const {
  if (decoded_step_ == step) return true;
  std::uint64_t offset = keyframe.offset;
  std::uint64_t sequence = RecordWalk::any_sequence;
  if (decoded_step_ && *decoded_step_ >= keyframe.step && *decoded_step_ < step) {
    offset = decoded_end_;
    sequence = decoded_sequence_;
  }
  RecordWalk walk(source_, offset, sequence, end_, Check::message);
  std::optional<std::uint64_t> before;
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::bad) {
      completeness_ = Completeness::damaged;
      continue;
    }
    const Record& record = walk.record();
    if (!is_step(record.header.kind)) continue;
    // A missing step breaks the chain of deltas; damage that took no step does not.
    if (record.header.step > step || (before && record.header.step != *before + 1)) return false;
    before = record.header.step;
    const StepMessage message = step_message(record);
    if (message.fields.empty()) continue;
    decoded_step_.reset();  // stays so where reading throws
    if (!decoder_.read(record, message)) return false;
    decoded_step_ = record.header.step;
    decoded_end_ = walk.offset();
    decoded_sequence_ = walk.sequence();
    if (record.header.step == step) return true;
  }
  return false;
}

std::optional<Frame> LogReaderImpl::frame(std::uint64_t step) const {
  for (;;) {
    const bool scanned = scan_.has_value();
    const auto found = entry(step);
    if (!found || found->state == StoredState::none) return std::nullopt;
    const auto keyframe = keyframe_at_or_before(step);
    if (!keyframe) return std::nullopt;
    if (decode_to(*keyframe, step)) return decoder_.frame();
    found_damage();
    if (scanned) return std::nullopt;
  }
}

std::optional<Frame> LogReaderImpl::tables(std::uint64_t step) const {
  FrameReader reader(source_, genesis_.genesis.schema, genesis_.particles_max);
  Record record;
  StepMessage message;
  for (int attempt = 0; attempt < 2; ++attempt) {
    const auto found = entry(step);
    if (!found) return std::nullopt;
    if (read_step(*found, record, message) && reader.read_tables(record, message)) {
      return reader.frame();
    }
    found_damage();
  }
  return std::nullopt;
}

// Where a walk must begin so that every state from `from` on can be decoded, if any can.
std::uint64_t LogReaderImpl::start_of_walk(std::uint64_t from, bool decode) const {
  if (from <= first_.step) return genesis_end_;
  if (decode) {
    if (const auto keyframe = keyframe_at_or_before(from)) return keyframe->offset;
  }
  const auto found = entry(held_at_or_before(from));
  return found ? found->offset : genesis_end_;
}

void LogReaderImpl::walk_steps(
    std::uint64_t from, std::uint64_t to, bool decode, const Decode& read,
    const std::function<bool(const StepHeader&, const Frame*, bool)>& visit) const {
  if (to < from || from > last_.step) return;
  FrameReader reader(source_, genesis_.genesis.schema, genesis_.particles_max);
  RecordWalk walk(source_, start_of_walk(from, decode), RecordWalk::any_sequence, end_,
                  Check::message);
  DeltaChain chain;
  std::optional<std::uint64_t> before;
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::bad) {
      completeness_ = Completeness::damaged;
      continue;
    }
    const Record& record = walk.record();
    if (!is_step(record.header.kind)) continue;
    if (before && record.header.step <= *before) {  // it goes back: as if it were not there
      completeness_ = Completeness::damaged;
      continue;
    }
    before = record.header.step;
    if (record.header.step > to) return;
    const StepMessage message = step_message(record);
    const StepHeader header = header_of(record, message);
    const bool decodable = chain.add(record.header) && header.has_state;
    const Decoding decoded = decodable ? read(reader, record, message) : Decoding::none;
    if (decoded == Decoding::failed) {
      completeness_ = Completeness::damaged;
      chain.interrupt();
    }
    if (header.step < from) continue;
    const bool whole = decoded == Decoding::whole;
    if (!visit(header, whole || decoded == Decoding::part ? &reader.frame() : nullptr, whole))
      return;
  }
}

void LogReaderImpl::for_each(
    std::uint64_t from, std::uint64_t to,
    const std::function<bool(const StepHeader&, const Frame*)>& visit) const {
  walk_steps(
      from, to, true,
      [](FrameReader& reader, const Record& record, const StepMessage& message) {
        return reader.read(record, message) ? Decoding::whole : Decoding::failed;
      },
      [&visit](const StepHeader& header, const Frame* frame, bool) {
        return visit(header, frame);
      });
}

void LogReaderImpl::for_each_part(
    std::uint64_t from, std::uint64_t to, const StatePart& part,
    const std::function<bool(const StepHeader&, const Frame*, bool)>& visit) const {
  const Schema& schema = genesis_.genesis.schema;
  std::vector<bool> some;
  for (const FieldDescriptor& field : schema.fields) {
    some.push_back(std::find(part.populations.begin(), part.populations.end(), field.population) !=
                   part.populations.end());
  }
  const std::vector<bool> all(schema.fields.size(), true);
  // The next state wanted whole, and where decoding must begin to get there.
  std::optional<std::uint64_t> next;
  std::uint64_t begin = 0;
  bool asked = false;
  walk_steps(
      from, to, true,
      [&](FrameReader& reader, const Record& record, const StepMessage& message) {
        const std::uint64_t step = record.header.step;
        if (part.next_whole && (!asked || (next && *next < step))) {
          next = part.next_whole(std::max(step, from));
          asked = true;
          const auto keyframe = next && *next <= to ? keyframe_at_or_before(*next) : std::nullopt;
          begin = keyframe ? keyframe->step : step;
          if (next && *next > to) next.reset();
        }
        const bool whole = (next && *next == step) ||
                           (part.keyframes && record.header.kind == RecordKind::keyframe);
        if (whole) return reader.read(record, message) ? Decoding::whole : Decoding::failed;
        const bool on_the_way = next && begin <= step;
        return reader.read_some(record, message, on_the_way ? all : some) ? Decoding::part
                                                                         : Decoding::failed;
      },
      visit);
}

void LogReaderImpl::for_each_header(std::uint64_t from, std::uint64_t to,
                                    const std::function<bool(const StepHeader&)>& visit) const {
  walk_steps(
      from, to, false,
      [](FrameReader&, const Record&, const StepMessage&) { return Decoding::none; },
      [&visit](const StepHeader& header, const Frame*, bool) { return visit(header); });
}

bool LogReaderImpl::read_event(std::uint64_t offset, Event& event) const {
  Record record;
  if (!source_.read(offset, file_end_, Check::message, record)) return false;
  if (record.header.kind != RecordKind::event) return false;
  try {
    event = decode_event(record.message, record.header.step, source_.limits());
  } catch (const LogError&) {
    return false;  // its bytes hold and make no sense: as if not there
  }
  return true;
}

std::vector<Event> LogReaderImpl::events() const {
  std::vector<Event> out;
  for (int attempt = 0; attempt < 2; ++attempt) {
    const std::vector<std::uint64_t> offsets = event_offsets();
    out.clear();
    for (const std::uint64_t offset : offsets) {
      Event event;
      if (read_event(offset, event)) out.push_back(std::move(event));
    }
    if (out.size() == offsets.size()) break;
    found_damage();
  }
  return out;
}

std::vector<ByteCount> LogReaderImpl::bytes_by_kind() const {
  std::map<std::string, ByteCount> counts;
  RecordWalk walk(source_, 0, 0, end_, Check::message);
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::bad) continue;
    const RecordHeader& header = walk.record().header;
    ByteCount& count = counts[name_of(header.kind)];
    count.name = name_of(header.kind);
    ++count.records;
    count.stored += header.record_bytes();
    count.raw += header_bytes + header.message_raw;
    if (!is_step(header.kind)) continue;
    const StepMessage message = step_message(walk.record());
    const Schema& schema = genesis_.genesis.schema;
    for (std::size_t i = 0; i < std::min(message.fields.size(), schema.fields.size()); ++i) {
      if (message.fields[i].stored == 0 && schema.fields[i].constant) continue;
      count.raw += message.fields[i].count * schema.fields[i].bytes_per_particle();
    }
    for (std::size_t i = 0; i < std::min(message.tables.size(), schema.tables.size()); ++i) {
      count.raw += message.tables[i].rows * row_bytes(schema.tables[i]);
    }
  }
  std::vector<ByteCount> out;
  for (auto& [name, count] : counts) out.push_back(std::move(count));
  return out;
}

std::vector<ByteCount> LogReaderImpl::bytes_by_field() const {
  const Schema& schema = genesis_.genesis.schema;
  std::vector<ByteCount> fields(schema.fields.size());
  std::vector<ByteCount> tables(schema.tables.size());
  for (std::size_t i = 0; i < fields.size(); ++i) fields[i].name = schema.fields[i].name;
  for (std::size_t i = 0; i < tables.size(); ++i) tables[i].name = schema.tables[i].name;
  RecordWalk walk(source_, genesis_end_, 1, end_, Check::message);
  for (auto item = walk.next(); item != RecordWalk::Item::end; item = walk.next()) {
    if (item == RecordWalk::Item::bad || !is_step(walk.record().header.kind)) continue;
    const StepMessage message = step_message(walk.record());
    for (std::size_t i = 0; i < std::min(message.fields.size(), fields.size()); ++i) {
      const FieldBlob& blob = message.fields[i];
      if (blob.stored == 0 && schema.fields[i].constant) continue;
      ++fields[i].records;
      fields[i].stored += blob.stored;
      fields[i].raw += blob.count * schema.fields[i].bytes_per_particle();
    }
    for (std::size_t i = 0; i < std::min(message.tables.size(), tables.size()); ++i) {
      const TableBlob& blob = message.tables[i];
      if (blob.rows == 0) continue;
      ++tables[i].records;
      tables[i].stored += blob.stored;
      tables[i].raw += blob.rows * row_bytes(schema.tables[i]);
    }
  }
  fields.insert(fields.end(), std::make_move_iterator(tables.begin()),
                std::make_move_iterator(tables.end()));
  return fields;
}

LogReader::Verification LogReaderImpl::verify(bool decode) const {
  return verify_log(*file_, source_.limits(), decode);
}

}  // namespace varve::io
