// The reader behind LogReader::open. Private to io.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/file.h"
#include "io/frame_reader.h"
#include "io/log_index.h"
#include "io/log_reader.h"
#include "io/log_scan.h"

namespace varve::io {

class LogReaderImpl final : public LogReader {
 public:
  LogReaderImpl(std::string path, FileSystem& files, const Limits& limits);

  const std::string& path() const override { return path_; }
  const Genesis& genesis() const override { return genesis_.genesis; }
  std::uint64_t first_step() const override { return first_.step; }
  std::uint64_t last_step() const override { return last_.step; }
  Completeness completeness() const override { return completeness_; }
  bool closed() const override { return closed_; }
  std::uint64_t torn_bytes() const override {
    return completeness_ == Completeness::complete ? 0 : torn_bytes_;
  }

  std::optional<StepHeader> header(std::uint64_t step) const override;
  std::uint64_t held_at_or_before(std::uint64_t step) const override;
  std::optional<std::uint64_t> stored_step_at_or_before(std::uint64_t step) const override;
  std::optional<Frame> frame(std::uint64_t step) const override;
  std::optional<Frame> tables(std::uint64_t step) const override;
  void for_each(std::uint64_t from, std::uint64_t to,
                const std::function<bool(const StepHeader&, const Frame*)>& visit) const override;
  void for_each_part(std::uint64_t from, std::uint64_t to, const StatePart& part,
                     const std::function<bool(const StepHeader&, const Frame*, bool)>& visit)
      const override;
  void for_each_header(std::uint64_t from, std::uint64_t to,
                       const std::function<bool(const StepHeader&)>& visit) const override;
  std::vector<Event> events() const override;
  std::uint64_t step_at_time(double time) const override;

  bool refresh() override;
  Verification verify(bool decode) const override;
  std::vector<ByteCount> bytes_by_kind() const override;
  std::vector<ByteCount> bytes_by_field() const override;
  std::uint64_t header_reads() const override { return source_.reads(); }

 private:
  // Opening and following (log_reader.cpp).
  void find_first();
  [[noreturn]] void refuse_without_step();
  void find_end();
  bool close_by_end_record(const RecordHeader& header, std::uint64_t offset);
  bool start_from_index(std::uint64_t index_offset);
  bool start_from_durable_index(std::uint64_t index_offset);
  void follow();
  bool walk_on() const;
  void scan_all() const;
  void check_order(const Record& record) const;
  void absorb(const Record& record) const;
  void absorb_index(const Record& record) const;
  void settle() const;

  // Looking up (log_lookup.cpp). Each tries the index, and scans where that does not hold.
  template <typename Ask>
  auto ask(Ask&& ask) const;
  std::optional<StepEntry> entry(std::uint64_t step) const;
  std::optional<StepEntry> keyframe_at_or_before(std::uint64_t step) const;
  std::vector<std::uint64_t> event_offsets() const;
  bool read_event(std::uint64_t offset, Event& event) const;
  bool read_step(const StepEntry& entry, Record& record, StepMessage& message) const;
  void found_damage() const;

  // Decoding (log_frames.cpp).
  bool decode_to(const StepEntry& keyframe, std::uint64_t step) const;
  std::uint64_t start_of_walk(std::uint64_t from, bool decode) const;
  /// Decodes the state of a record, or does not; false where its bytes do not hold.
  enum class Decoding { none, failed, part, whole };
  using Decode = std::function<Decoding(FrameReader&, const Record&, const StepMessage&)>;
  void walk_steps(
      std::uint64_t from, std::uint64_t to, bool decode, const Decode& read,
      const std::function<bool(const StepHeader&, const Frame*, bool whole)>& visit) const;

  StepHeader header_of(const Record& record, const StepMessage& message) const;
  StepMessage step_message(const Record& record) const;

  std::string path_;
  FileSystem& files_;
  std::unique_ptr<File> file_;
  mutable RecordSource source_;
  std::uint64_t genesis_end_ = 0;
  GenesisMessage genesis_;

  // What is known of the log's end. Mutable: any read may find damage and go over to scanning.
  mutable StepHeader first_, last_;
  bool first_known_ = false;  ///< the first step could be read without a scan
  mutable std::uint64_t steps_seen_ = 0;
  mutable std::uint64_t file_end_ = 0;
  mutable std::uint64_t end_ = 0;  ///< behind the last record that counts
  mutable std::uint64_t next_sequence_ = 0;
  mutable std::uint64_t durable_seq_ = 0;
  mutable bool closed_ = false;
  mutable Completeness completeness_ = Completeness::complete;
  mutable std::uint64_t torn_bytes_ = 0;

  // Steps and events behind the last index record; bounded, since index records come regularly.
  mutable std::vector<StepEntry> pending_;
  mutable std::vector<std::uint64_t> pending_events_, loose_events_;
  mutable bool after_gap_ = false;  ///< the record before was one
  mutable IndexLookup index_;
  mutable std::optional<LogScan> scan_;  ///< set: the index is not used

  // The position of the decoder behind frame().
  mutable FrameReader decoder_;
  mutable std::optional<std::uint64_t> decoded_step_;
  mutable std::uint64_t decoded_end_ = 0;
  mutable std::uint64_t decoded_sequence_ = 0;
};

/// A full check of the log in `file`.
LogReader::Verification verify_log(const File& file, const Limits& limits, bool decode);

}  // namespace varve::io
