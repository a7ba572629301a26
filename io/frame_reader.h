// Decodes the state and the tables of consecutive step records. Private to io.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/codec.h"
#include "io/record_io.h"

namespace varve::io {

class FrameReader {
 public:
  FrameReader(RecordSource& source, const Schema& schema, std::uint64_t particles_max);

  /// The state of a record that stores one, which must be a keyframe or follow the record decoded
  /// before. False where its bytes do not hold (`problem()`). Throws LogError (damaged, limit)
  /// where they hold and yet make no sense, or where the state's digest is not the recorded one.
  bool read(const Record& record, const StepMessage& message);
  /// The same of the fields wanted (FrameDecoder::decode); the others are not read, and the digest,
  /// which is one of all, is not compared. The blobs have checksums of their own.
  bool read_some(const Record& record, const StepMessage& message,
                 const std::vector<bool>& wanted);
  /// Only the tables; `frame()` then has no fields.
  bool read_tables(const Record& record, const StepMessage& message);
  const Frame& frame() const { return frame_; }
  const std::string& problem() const { return problem_; }

 private:
  bool load_body(const Record& record, const StepMessage& message,
                 const std::vector<bool>& wanted);
  bool read_fields(const Record& record, const StepMessage& message,
                   const std::vector<bool>& wanted);
  void check_shape(const Record& record, const StepMessage& message) const;
  void take_step(const Record& record, const StepMessage& message);
  void take_tables(const StepMessage& message);
  void decode_fields(const Record& record, const StepMessage& message,
                     const std::vector<bool>& wanted);
  [[noreturn]] void fail(const Record& record, const std::string& text) const;

  RecordSource& source_;
  const Schema& schema_;
  std::uint64_t particles_max_;
  std::unique_ptr<FrameDecoder> decoder_;
  Frame frame_;
  std::vector<EncodedField> fields_;
  std::vector<bool> all_, none_;  // of the fields
  Bytes body_;  // from the first field's that is wanted, or the first table's blob on
  std::uint64_t skipped_ = 0;    // bytes before it
  std::uint64_t tables_at_ = 0;  // in body_
  Bytes plain_;
  std::string problem_;
};

}  // namespace varve::io
