// The header and framing of one record: whatever 112 and more bytes say of themselves.
#include "io/errors.h"
#include "io/memory_file.h"
#include "io/record_io.h"
#include "repair.h"
#include "target.h"

namespace {

using namespace varve;

// What reading a record may end in, apart from a record.
bool allowed(io::ErrorKind kind) {
  return kind == io::ErrorKind::damaged || kind == io::ErrorKind::limit ||
         kind == io::ErrorKind::unsupported || kind == io::ErrorKind::not_a_log;
}

void read_all(io::RecordSource& source, std::uint64_t size) {
  io::Record record;
  for (std::uint64_t at = 0; at < size; at += 8) {
    if (!source.read(at, size, io::Check::body, record)) {
      fuzz::require(!source.problem().empty(), "a record that does not hold is told why");
      continue;
    }
    fuzz::require(record.end() <= size, "a record ends inside the file");
    fuzz::require(record.message.size() == record.header.message_raw, "a message is as declared");
    io::RecordHeader again;
    fuzz::require(io::decode(io::encode(record.header), again) == io::HeaderState::valid &&
                      io::encode(again) == io::encode(record.header),
                  "a header that was accepted is written back as it was read");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto mode = input.number<std::uint8_t>();
  std::vector<std::byte> bytes = input.rest();
  fuzz::repair(bytes, mode);
  io::MemoryFileSystem files;
  files.set_content("log", bytes);
  const auto file = files.open_read("log");
  io::RecordSource source(*file, {});
  try {
    read_all(source, bytes.size());
    io::RecordWalk walk(source, 0, io::RecordWalk::any_sequence, bytes.size(), io::Check::body);
    std::uint64_t items = 0;
    while (walk.next() != io::RecordWalk::Item::end) {
      fuzz::require(++items <= bytes.size() + 2, "a walk comes to an end");
    }
    std::uint64_t offset = 0;
    source.find_last_header(bytes.size(), offset);
  } catch (const io::LogError& error) {
    fuzz::require(allowed(error.kind()), error.what());
  }
  return 0;
}
