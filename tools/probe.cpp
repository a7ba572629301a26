#include "tools/probe.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>

#include "io/file.h"
#include "io/log_writer.h"
#include "tools/simulation_engine.h"

namespace varve::tools {

namespace {

/// A file that is only as long as what was written to it.
class Length : public io::File {
 public:
  const std::string& path() const override { return path_; }
  void set_path(std::string path) override { path_ = std::move(path); }
  std::uint64_t size() const override { return size_; }
  std::size_t read_at(std::uint64_t, std::span<std::byte>) const override { return 0; }
  void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
    size_ = std::max(size_, offset + bytes.size());
  }
  void sync() override {}
  void truncate(std::uint64_t size) override { size_ = size; }
  void close() override {}

 private:
  std::string path_ = "the probe's log";
  std::uint64_t size_ = 0;
};

/// Where nothing is and everything can be made.
class Nowhere : public io::FileSystem {
 public:
  std::unique_ptr<io::File> open_read(const std::string&) override { return create({}); }
  std::unique_ptr<io::File> open_write(const std::string&) override { return create({}); }
  std::unique_ptr<io::File> create(const std::string&) override {
    return std::make_unique<Length>();
  }
  io::PathKind kind(const std::string&) override { return io::PathKind::nothing; }
  bool same_file(const std::string&, const std::string&) override { return false; }
  void rename(const std::string&, const std::string&) override {}
  void remove(const std::string&) override {}
  void sync_directory(const std::string&) override {}
  std::unique_ptr<io::FileLock> lock(const std::string&) override {
    return std::make_unique<io::FileLock>();
  }
  bool is_locked(const std::string&) override { return false; }
  std::optional<std::uint64_t> space_left(const std::string&) override { return std::nullopt; }
};

double particles_of(const io::Engine& engine) {
  double particles = 0;
  const io::FrameView frame = engine.frame();
  for (std::size_t f = 0; f < frame.fields.size(); ++f) {
    const io::FieldDescriptor& field = engine.schema().fields[f];
    if (field.is_id && field.constant) particles += static_cast<double>(frame.fields[f].count);
  }
  return particles;
}

}  // namespace

std::uint64_t default_probe_steps(const core::Scenario& resolved) {
  constexpr std::uint64_t steps_min = 64, steps_max = 1024;
  return std::clamp(2 * static_cast<std::uint64_t>(resolved.record.keyframe_steps), steps_min,
                    steps_max);
}

Probe probe_log(const core::Scenario& resolved, std::uint64_t run_steps, std::uint64_t steps,
                const core::RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const auto interval = static_cast<std::uint64_t>(resolved.record.keyframe_steps);
  const bool whole_run = run_steps != 0 && steps >= run_steps;
  if (whole_run) steps = run_steps;
  // The later half, whole intervals of it if there are two: the first steps have no past to be
  // predicted from, and every interval has one keyframe.
  const bool intervals = steps >= 2 * interval;
  const std::uint64_t measured =
      intervals ? std::max<std::uint64_t>(1, steps / interval / 2) * interval : (steps + 1) / 2;

  const auto engine = SimulationEngine::fresh(resolved, options);
  Nowhere files;
  io::WriterOptions writer_options;
  writer_options.files = &files;
  const auto writer =
      io::LogWriter::create("probe", make_genesis(resolved, engine->schema(), options.threads),
                            engine->frame(), engine->events(), writer_options);
  const auto bytes_now = [&] {
    writer->flush();
    return static_cast<double>(writer->status().bytes);
  };
  const double first_state = bytes_now();
  double before = first_state;
  for (std::uint64_t n = 1; n <= steps; ++n) {
    engine->advance();
    writer->append(engine->frame(), engine->events());
    if (n == steps - measured) before = bytes_now();
  }
  const double after = bytes_now();
  writer->close();

  Probe probe;
  probe.steps = steps;
  probe.bytes_per_step = measured == 0 ? 0 : (after - before) / static_cast<double>(measured);
  if (!intervals) probe.bytes_per_step += first_state / static_cast<double>(interval);
  const double particles = particles_of(*engine);
  if (particles > 0) probe.bytes_per_particle_step = probe.bytes_per_step / particles;
  if (whole_run) {
    probe.predicted_bytes = static_cast<double>(writer->status().bytes);
  } else if (run_steps != 0) {
    probe.predicted_bytes = after + probe.bytes_per_step * static_cast<double>(run_steps - steps);
  }
  probe.wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return probe;
}

}  // namespace varve::tools
