// One study at a time in one folder, and none while a killed one's processes are still ending.
#pragma once

#include <chrono>
#include <string>

namespace varve::tools {

/// Lock of a folder, made where it is missing, held while this lives. Every process that is
/// started meanwhile inherits it, across exec too: it is free when the last of them is gone.
class FolderLock {
 public:
  /// Where the process that took the lock has ended without giving it back, those it started are
  /// about to end: waits for them up to `patience`. Throws UsageError that names the holder where
  /// another study is at work, ToolError (exit_output) where the file cannot be written.
  explicit FolderLock(const std::string& folder,
                      std::chrono::milliseconds patience = std::chrono::seconds(60));
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  std::string path_;
  int file_ = -1;
};

}  // namespace varve::tools
