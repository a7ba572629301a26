// Mutates logs record by record, besides byte by byte: changes inside a message or body, records
// left out, repeated, exchanged, headers that say something else. Used by the targets of logs.
#include <algorithm>
#include <random>

#include "io/framing.h"
#include "repair.h"
#include "target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

using namespace varve;
using Bytes = std::vector<std::byte>;
using Random = std::minstd_rand;

struct Place {
  std::size_t offset = 0;
  io::RecordHeader header;
  std::size_t message() const { return offset + io::header_bytes; }
  std::size_t body() const { return message() + io::aligned(header.message_stored); }
  std::size_t end() const { return offset + header.record_bytes(); }
};

std::vector<Place> places(const Bytes& log) {
  std::vector<Place> out;
  for (std::size_t at = 0; at + io::header_bytes <= log.size();) {
    Place place{at, {}};
    const auto bytes = std::span(log).subspan(at).first<io::header_bytes>();
    const bool whole = io::decode(bytes, place.header) == io::HeaderState::valid &&
                       place.header.body_bytes <= log.size() && place.end() <= log.size();
    if (whole) out.push_back(place);
    at += whole ? place.header.record_bytes() : io::alignment_bytes;
  }
  return out;
}

void write_header(Bytes& log, const Place& place) {
  const io::HeaderBytes encoded = io::encode(place.header);
  std::copy(encoded.begin(), encoded.end(),
            log.begin() + static_cast<std::ptrdiff_t>(place.offset));
}

// Mutates `size` bytes at `at`, keeping their number.
void mutate_inside(Bytes& log, std::size_t at, std::size_t size) {
  if (size == 0) return;
  auto* const data = reinterpret_cast<std::uint8_t*>(log.data() + at);
  std::vector<std::uint8_t> part(data, data + size);
  const std::size_t kept = LLVMFuzzerMutate(part.data(), size, size);
  std::copy_n(part.begin(), kept, data);
}

void mutate_header(Bytes& log, Place place, Random& random) {
  io::RecordHeader& header = place.header;
  const auto near = [&](auto value) {
    return static_cast<decltype(value)>(value + random() % 5 - 2);
  };
  constexpr std::uint8_t kinds[] = {0, 1, 2, 3, 4, 5, 6, 0x20, 0x81, 0xc5};
  switch (random() % 9) {
    case 0: header.kind = static_cast<io::RecordKind>(kinds[random() % std::size(kinds)]); break;
    case 1: header.step = near(header.step); break;
    case 2: header.step = std::uint64_t{random()} << (random() % 40); break;
    case 3: header.sequence = near(header.sequence); break;
    case 4: header.durable_seq = near(header.durable_seq); break;
    case 5: header.index_offset += 8 * (random() % 7) - 24; break;
    case 6: header.flags ^= 1U << (random() % 32); break;
    case 7: header.message_raw = near(header.message_raw); break;
    default: header.packing = static_cast<io::Packing>(random() % 3); break;
  }
  write_header(log, place);
}

Bytes slice(const Bytes& log, const Place& place) {
  return {log.begin() + static_cast<std::ptrdiff_t>(place.offset),
          log.begin() + static_cast<std::ptrdiff_t>(place.end())};
}

void mutate_order(Bytes& log, const Place& one, const Place& other, Random& random) {
  const Bytes copy = slice(log, one);
  const auto at = [&](std::size_t offset) {
    return log.begin() + static_cast<std::ptrdiff_t>(offset);
  };
  const auto choice = random() % 3;
  if (choice == 0) {
    log.insert(at(other.offset), copy.begin(), copy.end());
  } else if (choice == 1) {
    log.erase(at(one.offset), at(one.end()));
  } else if (one.end() <= other.offset) {
    std::rotate(at(one.offset), at(one.end()), at(other.end()));
  } else {
    log.resize(one.end());
  }
}

bool mutate_log(Bytes& log, Random& random) {
  const std::vector<Place> all = places(log);
  if (all.empty()) return false;
  const Place& one = all[random() % all.size()];
  switch (random() % 6) {
    case 0:
    case 1: mutate_inside(log, one.message(), one.header.message_stored); break;
    case 2: mutate_inside(log, one.body(), one.header.body_bytes); break;
    case 3: mutate_header(log, one, random); break;
    case 4: mutate_order(log, one, all[random() % all.size()], random); break;
    default: return false;
  }
  return true;
}

// The logs of an input: one behind the first byte, or two with the length of the first before them.
struct Logs {
  std::vector<Bytes> logs;

  Logs(const std::uint8_t* data, std::size_t size) {
    fuzz::Input input(data + 1, size - 1);
    if constexpr (VARVE_FUZZ_LOGS == 2) logs.push_back(input.bytes(input.number<std::uint32_t>()));
    logs.push_back(input.rest());
  }
  std::vector<std::byte> joined(std::uint8_t mode) const {
    fuzz::Output out;
    out.number(mode);
    if constexpr (VARVE_FUZZ_LOGS == 2) out.number(static_cast<std::uint32_t>(logs[0].size()));
    for (const Bytes& log : logs) out.bytes(log);
    return out.all();
  }
};

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  Random random(seed);
  if (size < 2 || random() % 4 == 0) return LLVMFuzzerMutate(data, size, max_size);
  Logs logs(data, size);
  Bytes& log = logs.logs[random() % logs.logs.size()];
  // Records are found by valid headers only: mend what earlier mutations broke.
  fuzz::repair(log, fuzz::repair_checksums);
  if (!mutate_log(log, random)) return LLVMFuzzerMutate(data, size, max_size);
  const auto mode = random() % 8 == 0 ? static_cast<std::uint8_t>(random()) : data[0];
  const auto joined = logs.joined(mode);
  if (joined.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, joined.data(), joined.size());
  return joined.size();
}
