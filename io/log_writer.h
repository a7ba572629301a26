// Appends frames to a log. The caller's thread only copies a frame into a free ring slot; one
// writer thread digests, chains, encodes, writes and syncs.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "io/genesis.h"

namespace varve::io {

class FileSystem;  // io/file.h: the real one, or one that fails on purpose

struct WriterOptions {
  std::uint32_t queue_slots = 16;   ///< at most so many frames in flight before append() waits
  std::uint64_t queue_bytes = std::uint64_t{32} << 20;  ///< fewer (at least 3) where they exceed it
  double sync_seconds = 2.0;        ///< at most this long between syncs, and at every keyframe ...
  double keyframe_sync_apart_seconds = 0.1;  ///< ... unless the last sync is more recent than this
  bool overwrite = false;           ///< create(): replace an existing file
  FileSystem* files = nullptr;      ///< nullptr: the operating system's
};

/// What is known of a log's end; all steps are inclusive.
struct WriterStatus {
  std::uint64_t last_step = 0;     ///< last step handed to the operating system
  std::uint64_t durable_step = 0;  ///< last step known synced
  std::uint64_t bytes = 0;         ///< length of the file
  Digest chain;                    ///< chain at last_step
  double writer_cpu_s = 0;         ///< CPU time of the writer thread so far
};

class LogWriter {
 public:
  /// Creates `path` with a genesis record and `first` as its first keyframe. Throws LogError
  /// (exists, locked, write_failed). The log is complete and readable once this returns.
  static std::unique_ptr<LogWriter> create(const std::string& path, const Genesis& genesis,
                                           const FrameView& first, std::span<const Event> events,
                                           const WriterOptions& options = {});
  /// Opens `path` to continue behind its last whole record; cuts a torn tail (says how many bytes
  /// in cut_bytes()), refuses rot (LogError damaged). `last` must be the state at the last step, as
  /// decoded or re-executed; the next append starts with a keyframe.
  static std::unique_ptr<LogWriter> reopen(const std::string& path, const FrameView& last,
                                           const WriterOptions& options = {});
  virtual ~LogWriter() = default;  // closes without an End record if close() was not called

  /// Takes a copy of the frame of the next step and what happened at its end. Waits while the ring
  /// is full. Throws the first LogError of the writer thread, once it is known, at every call.
  virtual void append(const FrameView& frame, std::span<const Event> events) = 0;
  /// Writes everything out, an End record, syncs and closes. Throws as append().
  virtual void close() = 0;
  /// Waits until everything appended so far is written and synced.
  virtual void flush() = 0;

  virtual WriterStatus status() const = 0;
  virtual std::uint64_t cut_bytes() const = 0;
  virtual const Genesis& genesis() const = 0;
};

}  // namespace varve::io
