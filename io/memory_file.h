// Files in memory that can fail: the n-th changing call, a full disk, a lost cache. The log runs on
// them unchanged, so the tests need no mock of its own logic.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "io/file.h"

namespace varve::io {

enum class FaultKind {
  none,
  no_space,     ///< nothing is written: No space left on device
  io_error,     ///< nothing is written: Input/output error
  short_write,  ///< a write stops half way, then No space left on device
  lost_sync,    ///< only sync() and sync_directory() fail; other calls pass uncounted
};

/// Fails changing calls (create, write, sync, cut, rename, remove, sync of a directory) number
/// `at`, `at` + 1, ... `at` + `times` - 1, counted from 1 since the fault was set.
struct Fault {
  FaultKind kind = FaultKind::none;
  std::uint64_t at = 0;
  std::uint64_t times = UINT64_MAX;
};

class MemoryFileSystem final : public FileSystem {
 public:
  MemoryFileSystem();
  ~MemoryFileSystem() override;

  std::unique_ptr<File> open_read(const std::string& path) override;
  std::unique_ptr<File> open_write(const std::string& path) override;
  std::unique_ptr<File> create(const std::string& path) override;
  PathKind kind(const std::string& path) override;
  bool same_file(const std::string& one, const std::string& other) override;
  void rename(const std::string& from, const std::string& to) override;
  void remove(const std::string& path) override;
  void sync_directory(const std::string& path) override;
  std::unique_ptr<FileLock> lock(const std::string& path) override;
  bool is_locked(const std::string& path) override;
  std::optional<std::uint64_t> space_left(const std::string& path) override;

  /// Arms a fault and starts counting anew.
  void set_fault(const Fault& fault);
  /// Calls counted since the fault was set.
  std::uint64_t calls() const;
  /// As after a power cut: names and contents go back to what was synced, plus the first
  /// `unsynced_bytes` of what each file got since.
  void lose_power(std::uint64_t unsynced_bytes = 0);

  /// Content of a file; empty where it is not there.
  std::vector<std::byte> content(const std::string& path) const;
  void set_content(const std::string& path, std::vector<std::byte> bytes);

 private:
  struct Shared;
  class MemoryFile;
  class MemoryLock;
  std::shared_ptr<Shared> shared_;
};

}  // namespace varve::io
