#include "io/log_writer.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "io/codec.h"
#include "io/errors.h"
#include "io/file.h"
#include "io/log_appender.h"
#include "io/schema_check.h"
#include "io/step_encoder.h"

namespace varve::io {

namespace {

using Clock = std::chrono::steady_clock;

// A log can never hold more particles in a field than genesis declares; this leaves room to grow.
constexpr std::uint64_t particles_floor = std::uint64_t{1} << 20;
constexpr std::uint64_t particles_growth = 16;

constexpr std::uint32_t slots_min = 3;

double thread_cpu_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// A copy of one frame in one block of memory that is reused.
class Slot {
 public:
  void copy(const FrameView& frame, std::span<const Event> events) {
    view_.step = frame.step;
    view_.time = frame.time;
    view_.dt = frame.dt;
    std::size_t total = 0;
    for (const FieldView& field : frame.fields) total += aligned(field.bytes.size());
    for (const TableView& table : frame.tables) {
      for (const auto& column : table.columns) total += aligned(column.size());
    }
    if (block_.size() < total) block_.resize(total);
    std::byte* at = block_.data();
    view_.fields.resize(frame.fields.size());
    for (std::size_t i = 0; i < frame.fields.size(); ++i) {
      view_.fields[i] = {frame.fields[i].count, place(at, frame.fields[i].bytes)};
    }
    view_.tables.resize(frame.tables.size());
    for (std::size_t i = 0; i < frame.tables.size(); ++i) {
      const TableView& table = frame.tables[i];
      view_.tables[i].rows = table.rows;
      view_.tables[i].columns.resize(table.columns.size());
      for (std::size_t c = 0; c < table.columns.size(); ++c) {
        view_.tables[i].columns[c] = place(at, table.columns[c]);
      }
    }
    events_.assign(events.begin(), events.end());
  }
  const FrameView& view() const { return view_; }
  const std::vector<Event>& events() const { return events_; }
  void reserve(std::size_t bytes) { block_.resize(std::max(block_.size(), bytes)); }

 private:
  static std::span<const std::byte> place(std::byte*& at, std::span<const std::byte> bytes) {
    if (!bytes.empty()) std::memcpy(at, bytes.data(), bytes.size());
    const std::span<const std::byte> out(at, bytes.size());
    at += aligned(bytes.size());
    return out;
  }

  FrameView view_;
  std::vector<Event> events_;
  std::vector<std::byte> block_;
};

std::size_t state_bytes(const FrameView& frame) {
  std::size_t sum = 0;
  for (const FieldView& field : frame.fields) sum += aligned(field.bytes.size());
  return sum;
}

class LogWriterImpl final : public LogWriter {
 public:
  LogWriterImpl(std::string path, Genesis genesis, std::uint64_t particles_max,
                const WriterOptions& options, std::unique_ptr<FileLock> lock,
                std::unique_ptr<File> file, LogAppender log, StepEncoder encoder)
      : path_(std::move(path)),
        genesis_(std::move(genesis)),
        particles_max_(particles_max),
        options_(options),
        lock_(std::move(lock)),
        file_(std::move(file)),
        log_(std::move(log)),
        encoder_(std::move(encoder)),
        last_appended_(log_.summary().last_step),
        last_sync_(Clock::now()) {
    publish_status(0);
  }
  LogWriterImpl(const LogWriterImpl&) = delete;
  LogWriterImpl& operator=(const LogWriterImpl&) = delete;

  ~LogWriterImpl() override {
    if (thread_.joinable()) stop(false);
  }

  void start(const FrameView& frame) {
    const std::size_t bytes = std::max<std::size_t>(state_bytes(frame), 1);
    const auto fitting =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(options_.queue_bytes / bytes, 1 << 20));
    const std::uint32_t most = std::max<std::uint32_t>(options_.queue_slots, 1);
    slots_.resize(std::clamp(fitting, std::min(slots_min, most), most));
    for (Slot& slot : slots_) slot.reserve(bytes);
    thread_ = std::thread([this] { run(); });
  }

  void append(const FrameView& frame, std::span<const Event> events) override {
    check_frame(genesis_.schema, frame, path_, particles_max_, limits_);
    check_events(events, frame.step, path_, limits_);
    std::unique_lock guard(mutex_);
    check_open();
    if (frame.step != last_appended_ + 1) {
      throw LogError(ErrorKind::mismatch, path_,
                     fmt::format("step {} appended after step {}", frame.step, last_appended_));
    }
    slot_free_.wait(guard, [this] { return used_ < slots_.size() || error_; });
    check_open();
    Slot& slot = slots_[(head_ + used_) % slots_.size()];
    guard.unlock();  // the slot is ours until it is counted: the copy needs no lock
    slot.copy(frame, events);
    guard.lock();
    ++used_;
    last_appended_ = frame.step;
    const bool was_idle = idle_;
    guard.unlock();
    if (was_idle) work_.notify_one();
  }

  void flush() override {
    std::unique_lock guard(mutex_);
    check_open();
    flush_wanted_ = true;
    work_.notify_one();
    flushed_.wait(guard, [this] { return !flush_wanted_ || error_; });
    if (error_) std::rethrow_exception(error_);
  }

  void close() override {
    {
      const std::lock_guard guard(mutex_);
      check_open();
    }
    stop(true);
    if (error_) std::rethrow_exception(error_);
  }

  WriterStatus status() const override {
    const std::lock_guard guard(mutex_);
    return status_;
  }
  std::uint64_t cut_bytes() const override { return log_.cut_bytes(); }
  const Genesis& genesis() const override { return genesis_; }

 private:
  void check_open() const {
    if (error_) std::rethrow_exception(error_);
    if (stopping_) throw LogError(ErrorKind::mismatch, path_, "the log is closed");
  }

  void stop(bool with_end) {
    {
      const std::lock_guard guard(mutex_);
      stopping_ = true;
      with_end_ = with_end;
    }
    work_.notify_one();
    thread_.join();
    lock_.reset();
  }

  // The writer thread: records, then whatever was asked for while there was nothing to record.
  void run() {
    try {
      std::unique_lock guard(mutex_);
      for (;;) {
        wait_for_work(guard);
        if (used_ > 0) {
          const Slot& slot = slots_[head_];
          guard.unlock();
          record(slot);
          guard.lock();
          head_ = (head_ + 1) % slots_.size();
          --used_;
          publish_status(thread_cpu_seconds());
          slot_free_.notify_one();
          continue;
        }
        const bool stop_now = stopping_;
        const bool flush_now = flush_wanted_;
        guard.unlock();
        if (stop_now && with_end_) log_.end();
        log_.write();
        sync();
        if (stop_now) file_->close();
        guard.lock();
        publish_status(thread_cpu_seconds());
        if (flush_now) {
          flush_wanted_ = false;
          flushed_.notify_all();
        }
        if (stop_now) return;
      }
    } catch (...) {
      const std::lock_guard guard(mutex_);
      error_ = std::current_exception();
      publish_status(thread_cpu_seconds());
    }
    slot_free_.notify_all();
    flushed_.notify_all();
  }

  // Returns when there is a frame, a wish to flush or stop, or something unsynced for too long.
  void wait_for_work(std::unique_lock<std::mutex>& guard) {
    const auto ready = [this] { return used_ > 0 || flush_wanted_ || stopping_; };
    idle_ = true;
    if (log_.has_unsynced()) {
      work_.wait_until(guard, last_sync_ + seconds(options_.sync_seconds), ready);
    } else {
      work_.wait(guard, ready);
    }
    idle_ = false;
  }

  static Clock::duration seconds(double value) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(value));
  }

  void record(const Slot& slot) {
    for (const Event& event : slot.events()) {
      Event placed = event;
      placed.step = slot.view().step;
      log_.event(placed);
    }
    const bool keyframe = encoder_.add(slot.view(), log_);
    log_.write();
    const auto since = Clock::now() - last_sync_;
    if (since >= seconds(options_.sync_seconds) ||
        (keyframe && since >= seconds(options_.keyframe_sync_apart_seconds))) {
      sync();
    }
  }

  void sync() {
    log_.sync();
    last_sync_ = Clock::now();
  }

  void publish_status(double cpu_seconds) {
    status_.last_step = log_.summary().last_step;
    status_.durable_step = log_.durable_step();
    status_.bytes = log_.bytes();
    status_.chain = log_.summary().chain;
    status_.writer_cpu_s = cpu_seconds;
  }

  const std::string path_;
  const Genesis genesis_;
  const std::uint64_t particles_max_;
  const WriterOptions options_;
  const Limits limits_;
  std::unique_ptr<FileLock> lock_;
  // Used by the writer thread alone once it runs.
  std::unique_ptr<File> file_;
  LogAppender log_;
  StepEncoder encoder_;

  mutable std::mutex mutex_;
  std::condition_variable work_, slot_free_, flushed_;
  // Guarded by mutex_.
  std::vector<Slot> slots_;
  std::size_t head_ = 0, used_ = 0;
  std::uint64_t last_appended_;
  bool idle_ = false, flush_wanted_ = false, stopping_ = false, with_end_ = false;
  std::exception_ptr error_;
  WriterStatus status_;

  Clock::time_point last_sync_;
  std::thread thread_;
};

std::uint64_t declared_particles(const FrameView& frame, const Limits& limits) {
  std::uint64_t most = 0;
  for (const FieldView& field : frame.fields) most = std::max(most, field.count);
  return std::min(std::max(particles_floor, particles_growth * most), limits.particles_max);
}

}  // namespace

std::unique_ptr<LogWriter> LogWriter::create(const std::string& path, const Genesis& genesis,
                                             const FrameView& first, std::span<const Event> events,
                                             const WriterOptions& options) {
  const Limits limits;
  FileSystem& files = files_or_system(options.files);
  check_genesis(genesis, ErrorKind::mismatch, path, limits);
  const std::uint64_t particles_max = declared_particles(first, limits);
  check_frame(genesis.schema, first, path, particles_max, limits);
  check_events(events, first.step, path, limits);
  auto lock = lock_new_file(files, path, options.overwrite);
  Genesis own = genesis;
  if (own.log_id.empty()) own.log_id = to_text(random_log_id());
  // Under another name until it is whole and durable: a log that can be seen can be read.
  const std::string temporary = path + ".new";
  try {
    auto file = files.create(temporary);
    LogAppender log(*file, *log_id_from(own.log_id), limits);
    StepEncoder encoder(own, path, limits, {});
    log.genesis(own, particles_max);
    for (const Event& event : events) {
      Event placed = event;
      placed.step = first.step;
      log.event(placed);
    }
    encoder.add(first, log);
    log.write();
    log.sync();
    files.rename(temporary, path);
    file->set_path(path);
    files.sync_directory(path);
    auto writer = std::make_unique<LogWriterImpl>(path, std::move(own), particles_max, options,
                                                  std::move(lock), std::move(file),
                                                  std::move(log), std::move(encoder));
    writer->start(first);
    return writer;
  } catch (...) {
    remove_quietly(files, temporary);
    throw;
  }
}

std::unique_ptr<LogWriter> LogWriter::reopen(const std::string& path, const FrameView& last,
                                             const WriterOptions& options) {
  const Limits limits;
  FileSystem& files = files_or_system(options.files);
  auto file = files.open_write(path);
  auto lock = files.lock(path);
  RecordSource source(*file, limits);
  const GenesisMessage found = read_genesis(source);
  const Genesis& genesis = found.genesis;
  check_frame(genesis.schema, last, path, found.particles_max, limits);
  LogAppender log = LogAppender::continuing(*file, *log_id_from(genesis.log_id), limits);
  const EndMessage& summary = log.summary();
  if (last.step != summary.last_step || digest_frame(genesis.schema, last) != summary.digest) {
    throw LogError(ErrorKind::mismatch, path,
                   fmt::format("the state handed over (step {}) is not the log's last one (step "
                               "{})",
                               last.step, summary.last_step));
  }
  if (log.cut_bytes() > 0) file->truncate(log.bytes());
  // Also what an earlier writer left unsynced counts as durable from here on.
  file->sync();
  StepEncoder encoder(genesis, path, limits, summary.chain);
  auto writer = std::make_unique<LogWriterImpl>(path, genesis, found.particles_max, options,
                                                std::move(lock), std::move(file), std::move(log),
                                                std::move(encoder));
  writer->start(last);
  return writer;
}

}  // namespace varve::io
