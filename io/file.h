// What the log needs of a file system, behind an interface, so that tests can fail any call.
// Every method reports failure by LogError; nothing is retried as if it had gone well.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace varve::io {

class File {
 public:
  virtual ~File() = default;
  /// The name that messages give.
  virtual const std::string& path() const = 0;
  /// Another name was given to the open file.
  virtual void set_path(std::string path) = 0;
  /// Current length in bytes.
  virtual std::uint64_t size() const = 0;
  /// Reads at `offset`; returns the bytes read, fewer than asked for only at the file's end.
  virtual std::size_t read_at(std::uint64_t offset, std::span<std::byte> out) const = 0;
  /// Writes all of `bytes` at `offset` or throws LogError(write_failed), which says how many bytes
  /// went out and how much space is left.
  virtual void write_at(std::uint64_t offset, std::span<const std::byte> bytes) = 0;
  /// Returns once the content is on stable storage.
  virtual void sync() = 0;
  virtual void truncate(std::uint64_t size) = 0;
  /// Closes and reports what close() reports. The destructor closes silently.
  virtual void close() = 0;
};

/// Held from lock() until destroyed.
class FileLock {
 public:
  virtual ~FileLock() = default;
};

enum class PathKind { nothing, file, directory, other };

class FileSystem {
 public:
  virtual ~FileSystem() = default;
  /// Throws LogError(not_found) for a missing file and for a directory.
  virtual std::unique_ptr<File> open_read(const std::string& path) = 0;
  /// Opens an existing file for reading and writing.
  virtual std::unique_ptr<File> open_write(const std::string& path) = 0;
  /// Creates an empty file, replacing what is there.
  virtual std::unique_ptr<File> create(const std::string& path) = 0;
  virtual PathKind kind(const std::string& path) = 0;
  /// True where both paths lead to one existing file.
  virtual bool same_file(const std::string& one, const std::string& other) = 0;
  /// Atomically gives `from` the name `to`, replacing what is there.
  virtual void rename(const std::string& from, const std::string& to) = 0;
  /// Removes a file if it is there.
  virtual void remove(const std::string& path) = 0;
  /// Makes the entry of `path` in its directory durable.
  virtual void sync_directory(const std::string& path) = 0;
  /// Takes the writer's lock on `path`; throws LogError(locked), naming the holder's pid.
  virtual std::unique_ptr<FileLock> lock(const std::string& path) = 0;
  /// True while some process holds the writer's lock on `path`. Takes no lock itself.
  virtual bool is_locked(const std::string& path) = 0;
  /// Bytes free where `path` is, where that is known.
  virtual std::optional<std::uint64_t> space_left(const std::string& path) = 0;
};

/// The operating system's files.
FileSystem& system_files();

/// `files`, or the operating system's where null.
inline FileSystem& files_or_system(FileSystem* files) { return files ? *files : system_files(); }

/// Takes the writer's lock for a file that is to be created. Throws LogError (exists, locked): an
/// existing regular file is only accepted with `overwrite`, anything else never.
std::unique_ptr<FileLock> lock_new_file(FileSystem& files, const std::string& path,
                                        bool overwrite);

/// Removes what a failed creation left; says nothing if that fails too.
void remove_quietly(FileSystem& files, const std::string& path);

/// Name of the file that carries the writer's lock on `path`.
std::string lock_path(const std::string& path);

}  // namespace varve::io
