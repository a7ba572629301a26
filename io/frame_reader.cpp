#include "io/frame_reader.h"

#include <fmt/format.h>

#include "io/bytes.h"
#include "io/digest.h"
#include "io/errors.h"
#include "io/packing.h"
#include "io/schema_check.h"

namespace varve::io {

namespace {

CodecLimits codec_limits(const Limits& limits) {
  CodecLimits out;
  out.field_bytes_max = limits.field_bytes_max;
  out.ratio_max = limits.ratio_max;
  return out;
}

}  // namespace

FrameReader::FrameReader(RecordSource& source, const Schema& schema, std::uint64_t particles_max)
    : source_(source),
      schema_(schema),
      particles_max_(particles_max),
      decoder_(FrameDecoder::create(schema, codec_limits(source.limits()))),
      all_(schema.fields.size(), true),
      none_(schema.fields.size(), false) {}

void FrameReader::fail(const Record& record, const std::string& text) const {
  throw LogError(ErrorKind::damaged, source_.file().path(),
                 fmt::format("{} record of step {}: {}", name_of(record.header.kind),
                             record.header.step, text),
                 static_cast<std::int64_t>(record.offset));
}

void FrameReader::check_shape(const Record& record, const StepMessage& message) const {
  if (!message.fields.empty() && message.fields.size() != schema_.fields.size()) {
    fail(record, fmt::format("{} fields where the schema has {}", message.fields.size(),
                             schema_.fields.size()));
  }
  if (!message.tables.empty() && message.tables.size() != schema_.tables.size()) {
    fail(record, fmt::format("{} tables where the schema has {}", message.tables.size(),
                             schema_.tables.size()));
  }
  if (message.body_bytes() != record.header.body_bytes) {
    fail(record, fmt::format("its blobs take {} bytes, its body has {}", message.body_bytes(),
                             record.header.body_bytes));
  }
  const auto at_most = [&](std::uint64_t value, std::uint64_t cap, const char* name,
                           const std::string& what) {
    if (value <= cap) return;
    throw LogError(ErrorKind::limit, source_.file().path(),
                   fmt::format("step {}, {}: {} exceeds {} {}", record.header.step, what, value,
                               name, cap),
                   static_cast<std::int64_t>(record.offset));
  };
  const Limits& limits = source_.limits();
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    const std::string what = "field '" + schema_.fields[i].name + "'";
    at_most(message.fields[i].count, particles_max_, "particles_max", what);
    at_most(message.fields[i].count * schema_.fields[i].bytes_per_particle(),
            limits.field_bytes_max, "field_bytes_max", what);
  }
  for (std::size_t i = 0; i < message.tables.size(); ++i) {
    const std::string what = "table '" + schema_.tables[i].name + "'";
    at_most(message.tables[i].rows, limits.rows_max, "rows_max", what);
    at_most(message.tables[i].rows * row_bytes(schema_.tables[i]), limits.field_bytes_max,
            "field_bytes_max", what);
  }
}

bool FrameReader::load_body(const Record& record, const StepMessage& message,
                            const std::vector<bool>& wanted) {
  check_shape(record, message);
  tables_at_ = skipped_ = 0;
  bool reading = false;
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    reading = reading || wanted[i];
    (reading ? tables_at_ : skipped_) += aligned(message.fields[i].stored);
  }
  body_.resize(record.header.body_bytes - skipped_);
  source_.read_bytes(record.body_offset() + skipped_, body_);
  std::uint64_t at = 0;
  const auto holds = [&](std::uint64_t expected, std::uint32_t stored) {
    const auto blob = std::span(body_).subspan(at, stored);
    at += aligned(stored);
    return !record.header.has_checksums() || checksum(blob) == expected;
  };
  reading = false;
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    reading = reading || wanted[i];
    if (!reading) continue;
    if (!wanted[i]) {
      at += aligned(message.fields[i].stored);
      continue;
    }
    if (holds(message.fields[i].checksum, message.fields[i].stored)) continue;
    problem_ = "the checksum of field '" + schema_.fields[i].name + "' does not hold";
    return false;
  }
  for (std::size_t i = 0; i < message.tables.size(); ++i) {
    if (holds(message.tables[i].checksum, message.tables[i].stored)) continue;
    problem_ = "the checksum of table '" + schema_.tables[i].name + "' does not hold";
    return false;
  }
  return true;
}

void FrameReader::decode_fields(const Record& record, const StepMessage& message,
                                const std::vector<bool>& wanted) {
  fields_.resize(message.fields.size());
  std::uint64_t at = 0;
  bool reading = false;
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const FieldBlob& blob = message.fields[i];
    reading = reading || wanted[i];
    if (wanted[i]) {
      fields_[i].method = blob.method;
      fields_[i].order = blob.order;
      fields_[i].count = blob.count;
      const auto bytes = std::span(body_).subspan(at, blob.stored);
      fields_[i].payload.assign(bytes.begin(), bytes.end());
    } else {
      fields_[i] = {};
    }
    if (reading) at += aligned(blob.stored);
  }
  const Frame& decoded =
      decoder_->decode(fields_, wanted, record.header.kind == RecordKind::keyframe,
                       record.header.step, message.time, message.dt);
  frame_.counts = decoded.counts;
  frame_.fields.resize(decoded.fields.size());
  for (std::size_t i = 0; i < decoded.fields.size(); ++i) {
    frame_.fields[i].assign(decoded.fields[i].begin(), decoded.fields[i].end());
  }
}

void FrameReader::take_tables(const StepMessage& message) {
  std::uint64_t from = tables_at_;
  frame_.rows.assign(schema_.tables.size(), 0);
  frame_.tables.resize(schema_.tables.size());
  for (std::size_t i = 0; i < schema_.tables.size(); ++i) {
    const TableDescriptor& table = schema_.tables[i];
    frame_.tables[i].resize(table.columns.size());
    const std::uint64_t rows = message.tables.empty() ? 0 : message.tables[i].rows;
    frame_.rows[i] = rows;
    if (!message.tables.empty()) {
      const TableBlob& blob = message.tables[i];
      check_ratio(rows * row_bytes(table), blob.stored, "table '" + table.name + "'",
                  source_.limits());
      plain_.resize(rows * row_bytes(table));
      unpack(blob.packing, std::span(body_).subspan(from, blob.stored), plain_,
             "table '" + table.name + "'", source_.limits());
      from += aligned(blob.stored);
    }
    std::size_t at = 0;
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      const std::size_t scalar = size_of(table.columns[c].type);
      frame_.tables[i][c].resize(rows * scalar);
      copy_le(frame_.tables[i][c].data(), std::span(plain_).subspan(at, rows * scalar), scalar);
      at += rows * scalar;
    }
  }
}

bool FrameReader::read_fields(const Record& record, const StepMessage& message,
                              const std::vector<bool>& wanted) {
  try {
    if (!load_body(record, message, wanted)) return false;
    decode_fields(record, message, wanted);
    take_step(record, message);
  } catch (const LogError& error) {
    rethrow_at(error, source_.file().path(), record.offset);
  }
  return true;
}

bool FrameReader::read(const Record& record, const StepMessage& message) {
  if (!read_fields(record, message, all_)) return false;
  const Digest digest = digest_frame(schema_, frame_.view());
  if (digest != message.digest) {
    fail(record, fmt::format("the decoded state has digest {}, {} is recorded", digest.hex(),
                             message.digest.hex()));
  }
  return true;
}

bool FrameReader::read_some(const Record& record, const StepMessage& message,
                            const std::vector<bool>& wanted) {
  return read_fields(record, message, wanted);
}

bool FrameReader::read_tables(const Record& record, const StepMessage& message) {
  try {
    if (!load_body(record, message, none_)) return false;
    frame_ = {};
    take_step(record, message);
  } catch (const LogError& error) {
    rethrow_at(error, source_.file().path(), record.offset);
  }
  return true;
}

void FrameReader::take_step(const Record& record, const StepMessage& message) {
  frame_.step = record.header.step;
  frame_.time = message.time;
  frame_.dt = message.dt;
  take_tables(message);
}

}  // namespace varve::io
