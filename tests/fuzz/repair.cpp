#include "repair.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>

#include "io/bytes.h"
#include "io/digest.h"
#include "io/errors.h"
#include "io/framing.h"
#include "io/messages.h"
#include "io/packing.h"

namespace varve::fuzz {

namespace {

constexpr std::size_t checksum_at = io::header_bytes - 8;

// Decodes a header whatever its checksum says; nothing where no record fits at `offset`.
std::optional<io::RecordHeader> header_at(const std::vector<std::byte>& log, std::size_t offset) {
  if (std::memcmp(log.data() + offset, io::record_magic.data(), io::record_magic.size()) != 0)
    return std::nullopt;
  io::HeaderBytes raw;
  std::memcpy(raw.data(), log.data() + offset, raw.size());
  io::store_le(raw.data() + 16, io::format_version);
  io::store_le(raw.data() + checksum_at, io::checksum(std::span(raw).first(checksum_at)));
  io::RecordHeader header;
  if (io::decode(raw, header) != io::HeaderState::valid) return std::nullopt;
  const std::uint64_t room = log.size() - offset;
  if (header.body_bytes > room || header.record_bytes() > room) return std::nullopt;
  return header;
}

// Carries what one record must know of those before it.
class Repair {
 public:
  Repair(std::vector<std::byte>& log, std::uint8_t mode) : log_(log), mode_(mode) {}

  // Returns the length of the record at `offset`, 0 where none is.
  std::size_t at(std::size_t offset) {
    auto header = header_at(log_, offset);
    if (!header) return 0;
    const auto message = std::span(log_).subspan(offset + io::header_bytes, header->message_stored);
    const auto body = std::span(log_).subspan(
        offset + io::header_bytes + io::aligned(header->message_stored), header->body_bytes);
    if ((mode_ & repair_contents) != 0) contents(*header, message, body);
    if ((mode_ & repair_places) != 0) place(*header);
    header->message_checksum = io::checksum(message);
    header->body_checksum = body.empty() ? 0 : io::checksum(body);
    const io::HeaderBytes encoded = io::encode(*header);
    std::memcpy(log_.data() + offset, encoded.data(), encoded.size());
    return header->record_bytes();
  }

 private:
  void place(io::RecordHeader& header) {
    if (!log_id_) log_id_ = header.log_id;
    header.log_id = *log_id_;
    header.sequence = sequence_++;
    header.durable_seq = std::min(header.durable_seq, header.sequence - (header.sequence > 0));
  }

  void contents(const io::RecordHeader& header, std::span<std::byte> message,
                std::span<const std::byte> body) {
    if (header.packing != io::Packing::plain) return;
    std::vector<std::byte> raw(message.begin(), message.end());
    try {
      if (header.kind == io::RecordKind::genesis) {
        repair_run_id(raw);
        const io::Genesis genesis = io::decode_genesis(raw, {}).genesis;
        chain_ = genesis.lineage ? genesis.lineage->chain_base : io::chain_base(genesis.schema);
      } else if (io::is_step(header.kind)) {
        raw = step(io::decode_step(raw, {}), body);
      } else {
        return;
      }
    } catch (const io::LogError&) {
      return;
    }
    if (raw.size() == message.size()) std::copy(raw.begin(), raw.end(), message.begin());
  }

  std::vector<std::byte> step(io::StepMessage message, std::span<const std::byte> body) {
    const auto sum = [&](std::uint64_t stored) {
      const auto blob = body.first(std::min<std::uint64_t>(stored, body.size()));
      body = body.subspan(std::min<std::uint64_t>(io::aligned(stored), body.size()));
      return io::checksum(blob);
    };
    for (io::FieldBlob& blob : message.fields) blob.checksum = sum(blob.stored);
    for (io::TableBlob& blob : message.tables) blob.checksum = sum(blob.stored);
    chain_ = message.chain = io::chain_next(chain_, message.digest);
    return io::encode(message);
  }

  std::vector<std::byte>& log_;
  std::uint8_t mode_;
  std::uint64_t sequence_ = 0;
  std::optional<io::LogId> log_id_;
  io::Digest chain_;
};

}  // namespace

void repair(std::vector<std::byte>& log, std::uint8_t mode) {
  if ((mode & repair_checksums) == 0) return;
  Repair repair(log, mode);
  for (std::size_t at = 0; at + io::header_bytes <= log.size();) {
    const std::size_t length = repair.at(at);
    at += length > 0 ? length : io::alignment_bytes;
  }
}

void repair_run_id(std::vector<std::byte>& message) {
  try {
    io::decode_genesis(message, {});
  } catch (const io::LogError& error) {
    // "genesis: run id RECORDED recorded, its content gives RIGHT"
    const std::string text = error.what();
    const std::string_view before = "genesis: run id ", between = " recorded, its content gives ";
    const std::size_t middle = text.find(between);
    if (text.compare(0, before.size(), before) != 0 || middle == std::string::npos) return;
    const std::string recorded = text.substr(before.size(), middle - before.size());
    const std::string right = text.substr(middle + between.size());
    if (recorded.size() != right.size()) return;
    const auto found = std::search(message.begin(), message.end(), recorded.begin(),
                                   recorded.end(), [](std::byte a, char b) {
                                     return a == static_cast<std::byte>(b);
                                   });
    if (found == message.end()) return;
    std::transform(right.begin(), right.end(), found,
                   [](char c) { return static_cast<std::byte>(c); });
  }
}

}  // namespace varve::fuzz
