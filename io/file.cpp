#include "io/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "io/errors.h"

namespace varve::io {

namespace {

// Attempts to take a lock, spaced 20 ms apart, so that a writer which is just closing, or one that
// has not written its pid yet, is not mistaken for one that stays.
constexpr int lock_attempts = 5;
constexpr auto lock_pause = std::chrono::milliseconds(20);

std::string reason(int error) { return std::strerror(error); }

[[noreturn]] void fail_write(const std::string& path, const std::string& what, int error,
                             std::int64_t offset = -1) {
  throw LogError(ErrorKind::write_failed, path, what + ": " + reason(error), offset);
}

[[noreturn]] void fail_open(const std::string& path, int error) {
  throw LogError(ErrorKind::not_found, path, "cannot be opened: " + reason(error));
}

// While it lives, a write beyond the process's file size limit fails with EFBIG like any other
// failed write, instead of ending the process by SIGXFSZ.
class NoSizeSignal {
 public:
  NoSizeSignal() {
    sigemptyset(&signal_);
    sigaddset(&signal_, SIGXFSZ);
    ::pthread_sigmask(SIG_BLOCK, &signal_, &before_);
  }
  NoSizeSignal(const NoSizeSignal&) = delete;
  NoSizeSignal& operator=(const NoSizeSignal&) = delete;
  ~NoSizeSignal() {
    const int error = errno;
    if (raised_) {
      const timespec at_once{};
      while (::sigtimedwait(&signal_, nullptr, &at_once) < 0 && errno == EINTR) {
      }
    }
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    errno = error;
  }
  /// A call has failed with `error`.
  void failed(int error) { raised_ = raised_ || error == EFBIG; }

 private:
  sigset_t signal_;
  sigset_t before_;
  bool raised_ = false;
};

class PosixFile final : public File {
 public:
  PosixFile(int descriptor, std::string path, FileSystem& files)
      : descriptor_(descriptor), path_(std::move(path)), files_(files) {}
  PosixFile(const PosixFile&) = delete;
  PosixFile& operator=(const PosixFile&) = delete;
  ~PosixFile() override {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

  const std::string& path() const override { return path_; }
  void set_path(std::string path) override { path_ = std::move(path); }

  std::uint64_t size() const override {
    struct stat info {};
    if (::fstat(descriptor_, &info) != 0) {
      throw LogError(ErrorKind::damaged, path_, "its length cannot be read: " + reason(errno));
    }
    return static_cast<std::uint64_t>(info.st_size);
  }

  std::size_t read_at(std::uint64_t offset, std::span<std::byte> out) const override {
    std::size_t done = 0;
    while (done < out.size()) {
      const ssize_t got = ::pread(descriptor_, out.data() + done, out.size() - done,
                                  static_cast<off_t>(offset + done));
      if (got == 0) break;
      if (got < 0) {
        if (errno == EINTR) continue;
        throw LogError(ErrorKind::damaged, path_,
                       fmt::format("reading {} bytes: {}", out.size(), reason(errno)),
                       static_cast<std::int64_t>(offset));
      }
      done += static_cast<std::size_t>(got);
    }
    return done;
  }

  void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
    NoSizeSignal guard;
    std::size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t put = ::pwrite(descriptor_, bytes.data() + done, bytes.size() - done,
                                   static_cast<off_t>(offset + done));
      if (put < 0 && errno == EINTR) continue;
      if (put <= 0) {
        const int error = put < 0 ? errno : EIO;
        guard.failed(error);
        const auto left = files_.space_left(path_);
        fail_write(path_,
                   fmt::format("writing {} bytes: {} written, {} bytes free", bytes.size(), done,
                               left ? std::to_string(*left) : "unknown"),
                   error, static_cast<std::int64_t>(offset));
      }
      done += static_cast<std::size_t>(put);
    }
  }

  void sync() override {
    if (::fdatasync(descriptor_) != 0) fail_write(path_, "syncing", errno);
  }

  void truncate(std::uint64_t size) override {
    if (::ftruncate(descriptor_, static_cast<off_t>(size)) != 0) {
      fail_write(path_, fmt::format("cutting to {} bytes", size), errno);
    }
  }

  void close() override {
    if (descriptor_ < 0) return;
    if (::close(std::exchange(descriptor_, -1)) != 0) fail_write(path_, "closing", errno);
  }

 private:
  int descriptor_;
  std::string path_;
  FileSystem& files_;
};

// A file of its own beside the log, so that the log can be replaced by rename while it is held and
// so that the holder's pid can be read. The lock belongs to the open file, not to the process:
// closing another descriptor of the same file does not drop it, and the kernel drops it when the
// holder dies.
class PosixLock final : public FileLock {
 public:
  PosixLock(int descriptor, std::string path) : descriptor_(descriptor), path_(std::move(path)) {}
  PosixLock(const PosixLock&) = delete;
  PosixLock& operator=(const PosixLock&) = delete;
  ~PosixLock() override {
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }

 private:
  int descriptor_;
  std::string path_;
};

bool same_inode(const struct stat& one, const struct stat& other) {
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

bool still_named(int descriptor, const std::string& path) {
  struct stat open_one {};
  struct stat named {};
  return ::fstat(descriptor, &open_one) == 0 && ::stat(path.c_str(), &named) == 0 &&
         same_inode(open_one, named);
}

struct flock whole_file(short type) {
  struct flock range {};
  range.l_type = type;
  range.l_whence = SEEK_SET;
  return range;
}

std::string read_pid(int descriptor) {
  char text[32] = {};
  const ssize_t got = ::pread(descriptor, text, sizeof(text) - 1, 0);
  std::string pid(text, got > 0 ? static_cast<std::size_t>(got) : 0);
  while (!pid.empty() && pid.back() == '\n') pid.pop_back();
  return pid;
}

class PosixFileSystem final : public FileSystem {
 public:
  std::unique_ptr<File> open_read(const std::string& path) override {
    return open_existing(path, O_RDONLY);
  }

  std::unique_ptr<File> open_write(const std::string& path) override {
    return open_existing(path, O_RDWR);
  }

  std::unique_ptr<File> create(const std::string& path) override {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (descriptor < 0) fail_write(path, "cannot be created", errno);
    return std::make_unique<PosixFile>(descriptor, path, *this);
  }

  PathKind kind(const std::string& path) override {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) return PathKind::nothing;
    if (S_ISREG(info.st_mode)) return PathKind::file;
    return S_ISDIR(info.st_mode) ? PathKind::directory : PathKind::other;
  }

  bool same_file(const std::string& one, const std::string& other) override {
    struct stat first {};
    struct stat second {};
    return ::stat(one.c_str(), &first) == 0 && ::stat(other.c_str(), &second) == 0 &&
           same_inode(first, second);
  }

  void rename(const std::string& from, const std::string& to) override {
    if (::rename(from.c_str(), to.c_str()) != 0) {
      fail_write(to, fmt::format("giving '{}' this name", from), errno);
    }
  }

  void remove(const std::string& path) override {
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) fail_write(path, "removing", errno);
  }

  void sync_directory(const std::string& path) override {
    const auto slash = path.rfind('/');
    const std::string directory =
        slash == std::string::npos ? "." : (slash == 0 ? "/" : path.substr(0, slash));
    const int descriptor = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) fail_write(directory, "opening the directory", errno);
    const int error = ::fsync(descriptor) != 0 ? errno : 0;
    ::close(descriptor);
    // Some file systems cannot sync a directory and say so; that is not a failed write.
    if (error != 0 && error != EINVAL) fail_write(directory, "syncing the directory", error);
  }

  std::unique_ptr<FileLock> lock(const std::string& path) override {
    const std::string name = lock_path(path);
    std::string pid;
    for (int attempt = 0; attempt < lock_attempts; ++attempt) {
      if (attempt > 0) std::this_thread::sleep_for(lock_pause);
      if (auto taken = try_lock(name, pid)) return taken;
      if (!pid.empty() && attempt > 0) break;
    }
    throw LogError(ErrorKind::locked, path,
                   fmt::format("another writer (process {}) holds the log",
                               pid.empty() ? "unknown" : pid));
  }

  bool is_locked(const std::string& path) override {
    const int descriptor = ::open(lock_path(path).c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return false;
    struct flock range = whole_file(F_WRLCK);
    const int asked = ::fcntl(descriptor, F_OFD_GETLK, &range);
    ::close(descriptor);
    return asked == 0 && range.l_type != F_UNLCK;
  }

  std::optional<std::uint64_t> space_left(const std::string& path) override {
    struct statvfs info {};
    if (::statvfs(path.c_str(), &info) != 0) return std::nullopt;
    return static_cast<std::uint64_t>(info.f_bavail) * info.f_frsize;
  }

 private:
  std::unique_ptr<File> open_existing(const std::string& path, int mode) {
    const int descriptor = ::open(path.c_str(), mode | O_CLOEXEC);
    if (descriptor < 0) {
      if (errno == EISDIR) throw LogError(ErrorKind::not_found, path, "is a directory, not a log");
      fail_open(path, errno);
    }
    auto file = std::make_unique<PosixFile>(descriptor, path, *this);
    if (kind(path) == PathKind::directory) {
      throw LogError(ErrorKind::not_found, path, "is a directory, not a log");
    }
    return file;
  }

  // Null where another holds the lock; `pid` is then its process id, if it has said so already.
  std::unique_ptr<FileLock> try_lock(const std::string& name, std::string& pid) {
    const int descriptor = ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor < 0) fail_write(name, "cannot create the lock file", errno);
    struct flock range = whole_file(F_WRLCK);
    if (::fcntl(descriptor, F_OFD_SETLK, &range) != 0) {
      const int error = errno;
      pid = read_pid(descriptor);
      ::close(descriptor);
      if (error == EAGAIN || error == EACCES) return nullptr;
      fail_write(name, "locking", error);
    }
    // The holder before us may have removed the name between our open and our lock.
    if (!still_named(descriptor, name)) {
      ::close(descriptor);
      return nullptr;
    }
    const std::string text = fmt::format("{}\n", ::getpid());
    if (::ftruncate(descriptor, 0) != 0 ||
        ::pwrite(descriptor, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size())) {
      const int error = errno;
      ::close(descriptor);
      fail_write(name, "writing the lock file", error);
    }
    return std::make_unique<PosixLock>(descriptor, name);
  }
};

}  // namespace

namespace {

void refuse_existing(FileSystem& files, const std::string& path, bool overwrite) {
  switch (files.kind(path)) {
    case PathKind::nothing: return;
    case PathKind::directory: throw LogError(ErrorKind::exists, path, "is a directory");
    case PathKind::other: throw LogError(ErrorKind::exists, path, "exists and is no regular file");
    case PathKind::file:
      if (!overwrite) throw LogError(ErrorKind::exists, path, "exists already");
  }
}

}  // namespace

std::unique_ptr<FileLock> lock_new_file(FileSystem& files, const std::string& path,
                                        bool overwrite) {
  refuse_existing(files, path, overwrite);  // first, so that no lock file appears for nothing
  auto lock = files.lock(path);
  refuse_existing(files, path, overwrite);
  return lock;
}

void remove_quietly(FileSystem& files, const std::string& path) {
  try {
    files.remove(path);
  } catch (const LogError&) {
    // The failure that led here is the one to report.
  }
}

std::string lock_path(const std::string& path) { return path + ".lock"; }

FileSystem& system_files() {
  static PosixFileSystem files;
  return files;
}

}  // namespace varve::io
