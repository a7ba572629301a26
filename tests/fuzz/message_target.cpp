// The Cap'n Proto body of each record type. The first byte says which; what is accepted is written
// and read again and must stay the same.
#include "io/errors.h"
#include "io/messages.h"
#include "io/schema_check.h"
#include "repair.h"
#include "target.h"

namespace {

using namespace varve;

template <typename Decode>
void check_stable(std::span<const std::byte> bytes, Decode&& decode) {
  const auto message = decode(bytes);
  const io::Bytes once = io::encode(message);
  fuzz::require(io::encode(decode(once)) == once, "what was read is written and read alike");
}

void genesis(std::vector<std::byte> bytes, std::uint8_t mode) {
  if ((mode & fuzz::repair_contents) != 0) fuzz::repair_run_id(bytes);
  const io::GenesisMessage message = io::decode_genesis(bytes, {});
  io::check_genesis(message.genesis, io::ErrorKind::damaged, "", {});
  const io::Bytes once = io::encode_genesis(message.genesis, message.particles_max);
  const io::GenesisMessage again = io::decode_genesis(once, {});
  fuzz::require(io::encode_genesis(again.genesis, again.particles_max) == once &&
                    again.genesis.run_id() == message.genesis.run_id(),
                "a genesis is written and read alike");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto mode = input.number<std::uint8_t>();
  const std::vector<std::byte> bytes = input.rest();
  const io::Limits limits;
  using Span = std::span<const std::byte>;
  try {
    switch (mode & 7) {
      case 0: genesis(bytes, mode); break;
      case 1: check_stable(bytes, [&](Span b) { return io::decode_step(b, limits); }); break;
      case 2: check_stable(bytes, [&](Span b) { return io::decode_event(b, 7, limits); }); break;
      case 3: check_stable(bytes, [&](Span b) { return io::decode_index(b, limits); }); break;
      case 4: check_stable(bytes, [&](Span b) { return io::decode_end(b); }); break;
      case 5: check_stable(bytes, [&](Span b) { return io::decode_gap(b, limits); }); break;
      default: break;
    }
  } catch (const io::LogError& error) {
    fuzz::require(error.kind() == io::ErrorKind::damaged || error.kind() == io::ErrorKind::limit,
                  error.what());
  }
  return 0;
}
