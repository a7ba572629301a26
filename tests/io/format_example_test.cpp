// The worked example of io/FORMAT.md is what the program writes, byte for byte.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "io/log_writer.h"
#include "io/memory_file.h"
#include "log_damage.h"
#include "toy_run.h"

namespace varve::test {

namespace {

// The bytes of the hex dump between the marks in FORMAT.md: lines "offset: xx xx ...  remark".
std::vector<std::byte> documented() {
  std::ifstream file(VARVE_FORMAT_MD);
  std::vector<std::byte> out;
  std::string line;
  bool inside = false;
  while (std::getline(file, line)) {
    if (line.starts_with("<!-- example")) inside = line.find("begin") != std::string::npos;
    if (!inside || line.size() < 10 || line[7] != ':') continue;  // indented by four
    std::istringstream words(line.substr(8, 3 * 8));
    for (std::string word; words >> word;) {
      out.push_back(static_cast<std::byte>(std::stoul(word, nullptr, 16)));
    }
  }
  return out;
}

io::FrameView frame_of(std::uint64_t step, const double& height) {
  io::FrameView frame;
  frame.step = step;
  frame.time = 0.25 * static_cast<double>(step);
  frame.dt = step == 0 ? 0.0 : 0.25;
  frame.fields = {{1, std::as_bytes(std::span(&height, 1))}};
  return frame;
}

}  // namespace

TEST(FormatExample, IsWhatIsWritten) {
  io::MemoryFileSystem files;
  io::Genesis genesis;
  genesis.engine = "example";
  genesis.schema.fields = {{"bead.height", "bead", io::ScalarType::f64, 1, "m", false, false, ""}};
  genesis.tier = io::Tier::digests;
  genesis.log_id = "00112233445566778899aabbccddeeff";
  const double heights[] = {1.0, 0.5};
  const auto writer = io::LogWriter::create("log", genesis, frame_of(0, heights[0]), {},
                                            untimed(files));
  writer->append(frame_of(1, heights[1]), {});
  writer->close();
  const LogBytes bytes(files, "log");
  const PlacedRecord record = bytes.record(io::RecordKind::step);
  const auto written = bytes.slice(record.offset, record.end());
  std::ostringstream dump;
  for (std::size_t i = 0; i < written.size(); ++i) {
    char text[32];
    if (i % 8 == 0) {
      std::snprintf(text, sizeof(text), "\n%3zu:", i);
      dump << text;
    }
    std::snprintf(text, sizeof(text), " %02x", static_cast<unsigned>(written[i]));
    dump << text;
  }
  EXPECT_EQ(documented(), written) << dump.str();
}

}  // namespace varve::test
