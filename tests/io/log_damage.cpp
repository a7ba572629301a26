#include "log_damage.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "io/digest.h"

namespace varve::test {

namespace {

std::span<const std::byte, io::header_bytes> header_at(const std::vector<std::byte>& bytes,
                                                       std::uint64_t offset) {
  return std::span(bytes).subspan(offset).first<io::header_bytes>();
}

}  // namespace

std::vector<PlacedRecord> LogBytes::records() const {
  std::vector<PlacedRecord> out;
  std::uint64_t at = 0;
  while (at + io::header_bytes <= bytes_.size()) {
    PlacedRecord record{at, {}};
    if (io::decode(header_at(bytes_, at), record.header) != io::HeaderState::valid) break;
    if (record.end() > bytes_.size()) break;
    out.push_back(record);
    at = record.end();
  }
  return out;
}

PlacedRecord LogBytes::record(io::RecordKind kind, std::size_t nth) const {
  for (const PlacedRecord& record : records()) {
    if (record.header.kind == kind && nth-- == 0) return record;
  }
  throw std::runtime_error("the test's log has no such record: " + io::name_of(kind));
}

LogBytes& LogBytes::set_byte(std::uint64_t offset, std::uint8_t value) {
  bytes_.at(offset) = static_cast<std::byte>(value);
  return *this;
}

LogBytes& LogBytes::flip_bit(std::uint64_t bit) {
  bytes_.at(bit / 8) ^= static_cast<std::byte>(1U << (bit % 8));
  return *this;
}

LogBytes& LogBytes::fill(std::uint64_t from, std::uint64_t to, std::uint8_t value) {
  for (std::uint64_t at = from; at < to; ++at) set_byte(at, value);
  return *this;
}

LogBytes& LogBytes::truncate(std::uint64_t size) {
  bytes_.resize(size);
  return *this;
}

LogBytes& LogBytes::append(const std::vector<std::byte>& more) {
  bytes_.insert(bytes_.end(), more.begin(), more.end());
  return *this;
}

LogBytes& LogBytes::insert(std::uint64_t offset, const std::vector<std::byte>& more) {
  bytes_.insert(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), more.begin(), more.end());
  return *this;
}

LogBytes& LogBytes::erase(std::uint64_t from, std::uint64_t to) {
  bytes_.erase(bytes_.begin() + static_cast<std::ptrdiff_t>(from),
               bytes_.begin() + static_cast<std::ptrdiff_t>(to));
  return *this;
}

std::vector<std::byte> LogBytes::slice(std::uint64_t from, std::uint64_t to) const {
  return {bytes_.begin() + static_cast<std::ptrdiff_t>(from),
          bytes_.begin() + static_cast<std::ptrdiff_t>(to)};
}

LogBytes& LogBytes::set_header(std::uint64_t offset, const io::RecordHeader& header) {
  const io::HeaderBytes encoded = io::encode(header);
  std::memcpy(bytes_.data() + offset, encoded.data(), encoded.size());
  return *this;
}

LogBytes& LogBytes::fix_checksums(std::uint64_t offset) {
  // The lengths are taken from the header whatever its checksum says.
  io::RecordHeader header;
  io::HeaderBytes raw;
  std::memcpy(raw.data(), bytes_.data() + offset, raw.size());
  const std::uint64_t sum = io::checksum(std::span(raw).first(io::header_bytes - 8));
  for (std::size_t i = 0; i < 8; ++i) {
    raw[io::header_bytes - 8 + i] = static_cast<std::byte>(sum >> (8 * i));
  }
  if (io::decode(raw, header) != io::HeaderState::valid) {
    throw std::runtime_error("no header to fix at this offset");
  }
  const auto all = std::span<const std::byte>(bytes_);
  const std::uint64_t message_at = offset + io::header_bytes;
  header.message_checksum = io::checksum(all.subspan(message_at, header.message_stored));
  if (header.body_bytes > 0) {
    header.body_checksum = io::checksum(
        all.subspan(message_at + io::aligned(header.message_stored), header.body_bytes));
  }
  return set_header(offset, header);
}

std::vector<std::byte> make_record(io::RecordHeader header, const std::vector<std::byte>& message,
                                   const std::vector<std::byte>& body) {
  header.message_stored = static_cast<std::uint32_t>(message.size());
  header.message_raw = static_cast<std::uint32_t>(message.size());
  header.body_bytes = body.size();
  header.message_checksum = io::checksum(message);
  header.body_checksum = body.empty() ? 0 : io::checksum(body);
  const io::HeaderBytes encoded = io::encode(header);
  std::vector<std::byte> out(header.record_bytes());
  std::copy(encoded.begin(), encoded.end(), out.begin());
  const auto message_at = out.begin() + io::header_bytes;
  std::copy(message.begin(), message.end(), message_at);
  const auto body_at = message_at + static_cast<std::ptrdiff_t>(io::aligned(message.size()));
  std::copy(body.begin(), body.end(), body_at);
  return out;
}

}  // namespace varve::test
