// The typed failures of the log. Expected outcomes (a torn tail, a step that is not there) are
// return values; these are thrown where a thing goes wrong and caught once, in a tool's main.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace varve::io {

enum class ErrorKind {
  not_found,     // file missing, a directory given                      -> exit 2
  exists,        // output exists and overwriting was not asked for      -> exit 2
  locked,        // another writer holds the log; its pid is in the text -> exit 2
  unsupported,   // newer format version, unknown critical record        -> exit 2
  not_a_log,     // empty, or does not start like a varve log            -> exit 4
  damaged,       // a checksum, length or chain does not hold            -> exit 4
  limit,         // a declared size exceeds a cap; the cap is named      -> exit 4
  write_failed,  // disk full, I/O error; what was whole stays           -> exit 74
  mismatch,      // a frame does not fit the schema it is meant for      -> exit 2
};

/// A failure of the log: `what()` reads "PATH: OFFSET: text" (offset only where one is known).
class LogError : public std::runtime_error {
 public:
  LogError(ErrorKind kind, std::string path, std::string text, std::int64_t offset = -1);
  ErrorKind kind() const noexcept { return kind_; }
  const std::string& path() const noexcept { return path_; }
  /// Byte offset in the file, or -1 where none applies.
  std::int64_t offset() const noexcept { return offset_; }

 private:
  ErrorKind kind_;
  std::string path_;
  std::int64_t offset_;
};

}  // namespace varve::io
