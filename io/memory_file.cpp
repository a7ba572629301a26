#include "io/memory_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <set>

#include "io/errors.h"

namespace varve::io {

namespace {

struct Node {
  std::vector<std::byte> bytes;
  std::vector<std::byte> durable;
  std::size_t changed_from = 0;  // up to here both are equal

  void sync() {
    changed_from = std::min({changed_from, bytes.size(), durable.size()});
    durable.resize(changed_from);
    durable.insert(durable.end(), bytes.begin() + static_cast<std::ptrdiff_t>(changed_from),
                   bytes.end());
    changed_from = bytes.size();
  }
};

using Names = std::map<std::string, std::shared_ptr<Node>>;

[[noreturn]] void fail(const std::string& path, const std::string& what, FaultKind kind) {
  const bool full = kind == FaultKind::no_space || kind == FaultKind::short_write;
  throw LogError(ErrorKind::write_failed, path,
                 what + (full ? ": No space left on device" : ": Input/output error"));
}

}  // namespace

struct MemoryFileSystem::Shared {
  mutable std::mutex mutex;
  Names names;
  Names durable_names;
  std::set<std::string> locks;
  Fault fault;
  std::uint64_t calls = 0;

  // Counts a changing call; returns the fault that hits it.
  FaultKind count(bool is_sync) {
    if (fault.kind == FaultKind::lost_sync && !is_sync) return FaultKind::none;
    ++calls;
    const bool hit = fault.kind != FaultKind::none && calls >= fault.at &&
                     calls - fault.at < fault.times;
    return hit ? fault.kind : FaultKind::none;
  }

  void check(bool is_sync, const std::string& path, const std::string& what) {
    if (const FaultKind hit = count(is_sync); hit != FaultKind::none) fail(path, what, hit);
  }

  std::shared_ptr<Node> find(const std::string& path) const {
    const auto at = names.find(path);
    if (at == names.end()) {
      throw LogError(ErrorKind::not_found, path, "cannot be opened: No such file or directory");
    }
    return at->second;
  }
};

class MemoryFileSystem::MemoryFile final : public File {
 public:
  MemoryFile(std::shared_ptr<Shared> shared, std::shared_ptr<Node> node, std::string path)
      : shared_(std::move(shared)), node_(std::move(node)), path_(std::move(path)) {}

  const std::string& path() const override { return path_; }
  void set_path(std::string path) override { path_ = std::move(path); }

  std::uint64_t size() const override {
    const std::lock_guard guard(shared_->mutex);
    return node_->bytes.size();
  }

  std::size_t read_at(std::uint64_t offset, std::span<std::byte> out) const override {
    const std::lock_guard guard(shared_->mutex);
    const auto& bytes = node_->bytes;
    if (offset >= bytes.size()) return 0;
    const std::size_t got = std::min<std::size_t>(out.size(), bytes.size() - offset);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), got, out.begin());
    return got;
  }

  void write_at(std::uint64_t offset, std::span<const std::byte> bytes) override {
    const std::lock_guard guard(shared_->mutex);
    const FaultKind hit = shared_->count(false);
    std::size_t put = bytes.size();
    if (hit == FaultKind::short_write) put /= 2;
    if (hit == FaultKind::no_space || hit == FaultKind::io_error) put = 0;
    node_->changed_from = std::min<std::size_t>(node_->changed_from, offset);
    if (node_->bytes.size() < offset + put) node_->bytes.resize(offset + put);
    std::copy_n(bytes.begin(), put, node_->bytes.begin() + static_cast<std::ptrdiff_t>(offset));
    if (hit != FaultKind::none) {
      fail(path_, fmt::format("writing {} bytes: {} written, 0 bytes free", bytes.size(), put),
           hit);
    }
  }

  void sync() override {
    const std::lock_guard guard(shared_->mutex);
    shared_->check(true, path_, "syncing");
    node_->sync();
  }

  void truncate(std::uint64_t size) override {
    const std::lock_guard guard(shared_->mutex);
    shared_->check(false, path_, fmt::format("cutting to {} bytes", size));
    node_->changed_from = std::min<std::size_t>(node_->changed_from, size);
    node_->bytes.resize(size);
  }

  void close() override {}

 private:
  std::shared_ptr<Shared> shared_;
  std::shared_ptr<Node> node_;
  std::string path_;
};

class MemoryFileSystem::MemoryLock final : public FileLock {
 public:
  MemoryLock(std::shared_ptr<Shared> shared, std::string path)
      : shared_(std::move(shared)), path_(std::move(path)) {}
  MemoryLock(const MemoryLock&) = delete;
  MemoryLock& operator=(const MemoryLock&) = delete;
  ~MemoryLock() override {
    const std::lock_guard guard(shared_->mutex);
    shared_->locks.erase(path_);
  }

 private:
  std::shared_ptr<Shared> shared_;
  std::string path_;
};

MemoryFileSystem::MemoryFileSystem() : shared_(std::make_shared<Shared>()) {}
MemoryFileSystem::~MemoryFileSystem() = default;

std::unique_ptr<File> MemoryFileSystem::open_read(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  return std::make_unique<MemoryFile>(shared_, shared_->find(path), path);
}

std::unique_ptr<File> MemoryFileSystem::open_write(const std::string& path) {
  return open_read(path);
}

std::unique_ptr<File> MemoryFileSystem::create(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  shared_->check(false, path, "cannot be created");
  auto node = std::make_shared<Node>();
  shared_->names[path] = node;
  return std::make_unique<MemoryFile>(shared_, node, path);
}

PathKind MemoryFileSystem::kind(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  return shared_->names.contains(path) ? PathKind::file : PathKind::nothing;
}

bool MemoryFileSystem::same_file(const std::string& one, const std::string& other) {
  return one == other && kind(one) == PathKind::file;
}

void MemoryFileSystem::rename(const std::string& from, const std::string& to) {
  const std::lock_guard guard(shared_->mutex);
  shared_->check(false, to, fmt::format("giving '{}' this name", from));
  auto node = shared_->find(from);
  shared_->names.erase(from);
  shared_->names[to] = std::move(node);
}

void MemoryFileSystem::remove(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  shared_->check(false, path, "removing");
  shared_->names.erase(path);
}

void MemoryFileSystem::sync_directory(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  shared_->check(true, path, "syncing the directory");
  shared_->durable_names = shared_->names;
}

std::unique_ptr<FileLock> MemoryFileSystem::lock(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  if (!shared_->locks.insert(path).second) {
    throw LogError(ErrorKind::locked, path,
                   fmt::format("another writer (process {}) holds the log", ::getpid()));
  }
  return std::make_unique<MemoryLock>(shared_, path);
}

bool MemoryFileSystem::is_locked(const std::string& path) {
  const std::lock_guard guard(shared_->mutex);
  return shared_->locks.contains(path);
}

std::optional<std::uint64_t> MemoryFileSystem::space_left(const std::string&) {
  return std::nullopt;
}

void MemoryFileSystem::set_fault(const Fault& fault) {
  const std::lock_guard guard(shared_->mutex);
  shared_->fault = fault;
  shared_->calls = 0;
}

std::uint64_t MemoryFileSystem::calls() const {
  const std::lock_guard guard(shared_->mutex);
  return shared_->calls;
}

void MemoryFileSystem::lose_power(std::uint64_t unsynced_bytes) {
  const std::lock_guard guard(shared_->mutex);
  shared_->names = shared_->durable_names;
  for (auto& [name, node] : shared_->names) {
    auto& bytes = node->bytes;
    const std::size_t synced = node->durable.size();
    bytes.resize(std::max(synced, std::min<std::size_t>(bytes.size(), synced + unsynced_bytes)));
    std::copy(node->durable.begin(), node->durable.end(), bytes.begin());
    node->durable = bytes;
    node->changed_from = bytes.size();
  }
}

std::vector<std::byte> MemoryFileSystem::content(const std::string& path) const {
  const std::lock_guard guard(shared_->mutex);
  const auto at = shared_->names.find(path);
  return at == shared_->names.end() ? std::vector<std::byte>{} : at->second->bytes;
}

void MemoryFileSystem::set_content(const std::string& path, std::vector<std::byte> bytes) {
  const std::lock_guard guard(shared_->mutex);
  auto node = std::make_shared<Node>();
  node->durable = bytes;
  node->bytes = std::move(bytes);
  shared_->names[path] = node;
  shared_->durable_names[path] = node;
}

}  // namespace varve::io
