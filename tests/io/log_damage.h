// Verbs for damaging a log held in memory, byte by byte or record by record.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/framing.h"
#include "io/memory_file.h"

namespace varve::test {

struct PlacedRecord {
  std::uint64_t offset = 0;
  io::RecordHeader header;
  std::uint64_t end() const { return offset + header.record_bytes(); }
};

/// A copy of a log's bytes; nothing reaches the file system before put().
class LogBytes {
 public:
  LogBytes(const io::MemoryFileSystem& files, const std::string& path)
      : bytes_(files.content(path)) {}
  explicit LogBytes(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}

  std::uint64_t size() const { return bytes_.size(); }
  const std::vector<std::byte>& bytes() const { return bytes_; }
  /// All records, in order; stops at the first that is not whole.
  std::vector<PlacedRecord> records() const;
  /// The `nth` (from 0) record of a kind; fails the test where there is none.
  PlacedRecord record(io::RecordKind kind, std::size_t nth = 0) const;

  LogBytes& set_byte(std::uint64_t offset, std::uint8_t value);
  LogBytes& flip_bit(std::uint64_t bit);
  LogBytes& fill(std::uint64_t from, std::uint64_t to, std::uint8_t value);
  LogBytes& truncate(std::uint64_t size);
  LogBytes& append(const std::vector<std::byte>& more);
  LogBytes& insert(std::uint64_t offset, const std::vector<std::byte>& more);
  LogBytes& erase(std::uint64_t from, std::uint64_t to);
  LogBytes& erase_record(const PlacedRecord& record) { return erase(record.offset, record.end()); }
  std::vector<std::byte> slice(std::uint64_t from, std::uint64_t to) const;
  /// Writes a header over that of a record, with a checksum that holds.
  LogBytes& set_header(std::uint64_t offset, const io::RecordHeader& header);
  /// Makes the checksums of the record at `offset` fit its bytes as they are now.
  LogBytes& fix_checksums(std::uint64_t offset);

  void put(io::MemoryFileSystem& files, const std::string& path) const {
    files.set_content(path, bytes_);
  }

 private:
  std::vector<std::byte> bytes_;
};

/// A whole record with the given header fields; lengths and checksums are set here.
std::vector<std::byte> make_record(io::RecordHeader header, const std::vector<std::byte>& message,
                                   const std::vector<std::byte>& body = {});

}  // namespace varve::test
