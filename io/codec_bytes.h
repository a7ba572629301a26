// Little-endian cursors over a payload: one appends, one reads and checks every length.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/errors.h"

namespace varve::io::codec {

/// Damage found in a field's payload; the reader of the log adds file and offset.
[[noreturn]] inline void fail_damaged(const std::string& field, const std::string& text) {
  throw LogError(ErrorKind::damaged, "", "field '" + field + "': " + text);
}

[[noreturn]] inline void fail_limit(const std::string& field, const std::string& text) {
  throw LogError(ErrorKind::limit, "", "field '" + field + "': " + text);
}

class ByteSink {
 public:
  explicit ByteSink(std::vector<std::byte>& out) : out_(out) {}
  void u8(std::uint8_t value) { out_.push_back(static_cast<std::byte>(value)); }
  void u16(std::uint16_t value) { fixed(value, 2); }
  void u32(std::uint32_t value) { fixed(value, 4); }
  void u64(std::uint64_t value) { fixed(value, 8); }
  void f64(double value) { fixed(std::bit_cast<std::uint64_t>(value), 8); }
  /// LEB128: 7 bits a byte, lowest first, at most 10 bytes.
  void varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) {
      u8(static_cast<std::uint8_t>(value | 0x80));
    }
    u8(static_cast<std::uint8_t>(value));
  }
  void bytes(std::span<const std::byte> data) { out_.insert(out_.end(), data.begin(), data.end()); }

 private:
  void fixed(std::uint64_t value, int width) {
    for (int i = 0; i < width; ++i) {
      u8(static_cast<std::uint8_t>(value >> (8 * i)));
    }
  }
  std::vector<std::byte>& out_;
};

class ByteSource {
 public:
  ByteSource(std::span<const std::byte> data, const std::string& field)
      : data_(data), field_(field) {}
  std::size_t left() const { return data_.size() - at_; }
  std::uint8_t u8() { return static_cast<std::uint8_t>(fixed(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(fixed(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(fixed(4)); }
  std::uint64_t u64() { return fixed(8); }
  double f64() { return std::bit_cast<double>(fixed(8)); }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const std::uint64_t byte = fixed(1);
      if (shift == 63 && byte > 1) {
        fail_damaged(field_, "a variable-length number exceeds 64 bits");
      }
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) {
        return value;
      }
    }
    fail_damaged(field_, "a variable-length number does not end");
  }
  std::span<const std::byte> bytes(std::size_t size) {
    need(size);
    const auto part = data_.subspan(at_, size);
    at_ += size;
    return part;
  }
  std::span<const std::byte> rest() { return bytes(left()); }
  /// Throws unless everything was read.
  void finish() const {
    if (left() != 0) {
      fail_damaged(field_, std::to_string(left()) + " bytes behind the end of the payload");
    }
  }
  const std::string& field() const { return field_; }

 private:
  void need(std::size_t size) const {
    if (size > left()) {
      fail_damaged(field_, "payload ends early: " + std::to_string(size) + " bytes wanted, " +
                               std::to_string(left()) + " left");
    }
  }
  std::uint64_t fixed(std::size_t width) {
    need(width);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < width; ++i) {
      value |= static_cast<std::uint64_t>(data_[at_ + i]) << (8 * i);
    }
    at_ += width;
    return value;
  }
  std::span<const std::byte> data_;
  const std::string& field_;
  std::size_t at_ = 0;
};

}  // namespace varve::io::codec
