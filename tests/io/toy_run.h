// A small made-up run for tests of the log: two populations, all scalar types, a table, events,
// counts that change. Nothing in it is physics; it only has to be reproducible and to move.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/log_writer.h"

namespace varve::test {

struct ToyOptions {
  std::uint64_t beads = 6;
  std::uint64_t first_step = 0;
  std::uint64_t steps = 40;              ///< steps after the first
  std::uint64_t bead_added_every = 0;    ///< 0: the count never changes
  std::uint64_t event_every = 0;         ///< 0: no events
  bool with_tables = true;
  io::Tier tier = io::Tier::deltas;
  std::uint32_t every = 1;
  std::uint32_t keyframe_steps = 16;
  std::uint64_t seed = 1;
};

/// Field descriptors of the toy run.
io::Schema toy_schema();
io::Genesis toy_genesis(const ToyOptions& options);

/// The states of a toy run, one after the other.
class ToyRun {
 public:
  explicit ToyRun(const ToyOptions& options);
  const io::Frame& frame() const { return frame_; }
  std::vector<io::Event> events() const;
  void advance();

 private:
  void publish();
  void add_bead();
  double random(std::uint64_t counter) const;

  ToyOptions options_;
  std::uint64_t step_;
  double time_ = 0;
  std::vector<std::uint64_t> ids_;
  std::vector<double> x_, v_;
  std::vector<float> mass_;
  std::vector<std::uint32_t> hits_;
  io::Frame frame_;
};

/// All frames of a toy run, by step.
std::map<std::uint64_t, io::Frame> toy_frames(const ToyOptions& options);

/// Records a toy run. Without `close` the log ends without an end record, but whole.
void write_toy_log(const std::string& path, const ToyOptions& options,
                   const io::WriterOptions& writer_options, bool close = true);

/// Writer options with no wall clock in them: every keyframe is synced, nothing else.
io::WriterOptions untimed(io::FileSystem& files);

/// Every byte of both frames, tables included.
bool same_frame(const io::Frame& one, const io::Frame& other);

}  // namespace varve::test
