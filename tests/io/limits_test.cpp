// Whatever a log declares is checked against a cap before anything is allocated, and the message
// names the cap.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zstd.h>

#include <chrono>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "io/messages.h"
#include "io/packing.h"
#include "log_damage.h"
#include "toy_run.h"

namespace varve::test {

using io::ErrorKind;
using io::Limits;
using io::LogError;
using io::LogReader;
using io::LogWriter;
using io::MemoryFileSystem;
using io::RecordKind;
using testing::HasSubstr;

namespace {

long peak_kilobytes() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

std::vector<std::byte> zstd_of_zeros(std::size_t size) {
  const std::vector<std::byte> zeros(size);
  std::vector<std::byte> out(ZSTD_compressBound(size));
  out.resize(ZSTD_compress(out.data(), out.size(), zeros.data(), size, 19));
  return out;
}

}  // namespace

class LogLimits : public testing::Test {
 protected:
  void SetUp() override {
    options_.beads = 2;
    options_.steps = 10;
    options_.keyframe_steps = 4;
    write_toy_log("log", options_, untimed(files_), false);
  }

  // Replaces the last step's record by one with this message and body.
  void replace_last(const io::StepMessage& message, const std::vector<std::byte>& body) {
    LogBytes bytes(files_, "log");
    const PlacedRecord last = bytes.records().back();
    bytes.truncate(last.offset);
    bytes.append(make_record(last.header, io::encode(message), body)).put(files_, "log");
  }

  io::StepMessage last_message() {
    const LogBytes bytes(files_, "log");
    const PlacedRecord last = bytes.records().back();
    const auto from = last.offset + io::header_bytes;
    return io::decode_step(bytes.slice(from, from + last.header.message_stored), {});
  }

  // The failure of what is done, which must come at once and without much memory.
  template <typename Do>
  std::string refusal(ErrorKind kind, Do&& what) {
    const long memory = peak_kilobytes();
    const auto begin = std::chrono::steady_clock::now();
    std::string text = "no failure";
    try {
      what();
    } catch (const LogError& error) {
      EXPECT_EQ(error.kind(), kind) << error.what();
      text = error.what();
    }
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(1));
    EXPECT_LT(peak_kilobytes() - memory, 64 * 1024);
    return text;
  }

  MemoryFileSystem files_;
  ToyOptions options_;
};

TEST_F(LogLimits, TableBombIsRefused) {
  io::StepMessage message = last_message();
  const auto bomb = zstd_of_zeros(std::size_t{1} << 29);
  message.fields.clear();
  message.tables = {{io::checksum(bomb), 1U << 25, static_cast<std::uint32_t>(bomb.size()),
                     io::Packing::zstd}};
  std::vector<std::byte> body = bomb;
  body.resize(io::aligned(body.size()));
  replace_last(message, body);
  const auto reader = LogReader::open("log", &files_);
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { reader->tables(10); }), HasSubstr("ratio_max"));
  message.tables[0].rows = UINT32_MAX;
  replace_last(message, body);
  const auto other = LogReader::open("log", &files_);
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { other->tables(10); }), HasSubstr("rows_max"));
}

TEST_F(LogLimits, CountBombIsRefused) {
  io::StepMessage message = last_message();
  LogBytes bytes(files_, "log");
  const PlacedRecord last = bytes.records().back();
  const auto body = bytes.slice(last.end() - last.header.body_bytes, last.end());
  message.fields[2].count = 1U << 27;
  replace_last(message, body);
  const auto reader = LogReader::open("log", &files_);
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { reader->frame(10); }), HasSubstr("particles_max"));
  // Below the declared number of particles the codec's own caps decide.
  message.fields[2].count = 1U << 20;
  replace_last(message, body);
  const auto other = LogReader::open("log", &files_);
  EXPECT_THROW(other->frame(10), LogError);
}

TEST_F(LogLimits, MessageBombIsRefused) {
  LogBytes bytes(files_, "log");
  const PlacedRecord genesis = bytes.records().front();
  const auto bomb = zstd_of_zeros(std::size_t{60} << 20);
  io::RecordHeader header = genesis.header;
  header.packing = io::Packing::zstd;
  std::vector<std::byte> record = make_record(header, bomb);
  header.message_stored = static_cast<std::uint32_t>(bomb.size());
  header.message_raw = 60U << 20;
  header.message_checksum = io::checksum(bomb);
  LogBytes(record).set_header(0, header).put(files_, "log");
  const auto open = [&] { LogReader::open("log", &files_); };
  EXPECT_THAT(refusal(ErrorKind::limit, open), HasSubstr("ratio_max"));
  header.message_raw = 1U << 30;
  LogBytes(record).set_header(0, header).put(files_, "log");
  EXPECT_THAT(refusal(ErrorKind::limit, open), HasSubstr("message_bytes_max"));
}

TEST_F(LogLimits, LengthsBeyondTheFileAreRefused) {
  LogBytes bytes(files_, "log");
  io::RecordHeader header = bytes.records().front().header;
  header.body_bytes = std::uint64_t{1} << 29;
  LogBytes(bytes).set_header(0, header).put(files_, "log");
  const auto open = [&] { LogReader::open("log", &files_); };
  EXPECT_THAT(refusal(ErrorKind::damaged, open), HasSubstr("the file ends after"));
  header.body_bytes = UINT64_MAX - 3;
  LogBytes(bytes).set_header(0, header).put(files_, "log");
  EXPECT_THAT(refusal(ErrorKind::limit, open), HasSubstr("body_bytes_max"));
}

TEST_F(LogLimits, CapsCanBeSet) {
  Limits limits;
  limits.fields_max = 3;
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { LogReader::open("log", &files_, limits); }),
              HasSubstr("fields_max 3"));
  limits = {};
  limits.particles_max = 100;
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { LogReader::open("log", &files_, limits); }),
              HasSubstr("particles_max 100"));
  limits = {};
  limits.string_bytes_max = 4;
  EXPECT_THAT(refusal(ErrorKind::limit, [&] { LogReader::open("log", &files_, limits); }),
              HasSubstr("string_bytes_max 4"));
}

TEST_F(LogLimits, WriterKeepsTheCapsThatReadersHave) {
  const ToyRun run(options_);
  const auto create = [&](auto&& edit) {
    io::Genesis genesis = toy_genesis(options_);
    edit(genesis);
    return refusal(ErrorKind::limit, [&] {
      LogWriter::create("new", genesis, run.frame().view(), {}, untimed(files_));
    });
  };
  EXPECT_THAT(create([](io::Genesis& g) { g.engine = std::string(70000, 'x'); }),
              HasSubstr("string_bytes_max"));
  EXPECT_THAT(create([](io::Genesis& g) { g.scenario = std::string(17 << 20, 'x'); }),
              HasSubstr("text_bytes_max"));
  EXPECT_THAT(create([](io::Genesis& g) {
                g.lineage = io::Lineage{};
                g.lineage->parent_run_id = std::string(32, 'a');
                g.lineage->ancestors.assign(10001, std::string(32, 'a'));
              }),
              HasSubstr("lineage_depth_max"));
  EXPECT_EQ(files_.kind("new"), io::PathKind::nothing);
}

TEST_F(LogLimits, SchemasThatMakeNoSenseAreRefused) {
  const ToyRun run(options_);
  const auto create = [&](auto&& edit) {
    io::Genesis genesis = toy_genesis(options_);
    edit(genesis.schema);
    return refusal(ErrorKind::mismatch, [&] {
      LogWriter::create("new", genesis, run.frame().view(), {}, untimed(files_));
    });
  };
  EXPECT_THAT(create([](io::Schema& s) { s.fields[1].name = "bead.id"; }), HasSubstr("bead.id"));
  EXPECT_THAT(create([](io::Schema& s) { s.fields[1].components = 0; }), HasSubstr("bead.mass"));
  EXPECT_THAT(create([](io::Schema& s) { s.fields[2].follows = "none"; }), HasSubstr("none"));
  EXPECT_THAT(create([](io::Schema& s) { s.fields[2].follows = "bead.mass"; }),
              HasSubstr("same shape"));
  EXPECT_THAT(create([](io::Schema& s) { s.fields[3].is_id = true; }),
              HasSubstr("whole numbers"));
  EXPECT_THAT(create([](io::Schema& s) {
                s.fields[3].is_id = true;
                s.fields[3].type = io::ScalarType::u64;
              }),
              HasSubstr("two id fields"));
  EXPECT_THAT(create([](io::Schema& s) { s.fields[3].type = static_cast<io::ScalarType>(9); }),
              HasSubstr("scalar type 9"));
}

TEST_F(LogLimits, IdsMustAscend) {
  io::Frame frame = ToyRun(options_).frame();
  frame.fields[0][0] = std::byte{200};
  EXPECT_THAT(refusal(ErrorKind::mismatch,
                      [&] {
                        LogWriter::create("new", toy_genesis(options_), frame.view(), {},
                                          untimed(files_));
                      }),
              HasSubstr("do not ascend"));
}

TEST(Packing, GivesBackWhatItGotAndRefusesAnythingElse) {
  const Limits limits;
  for (const std::size_t size : {0U, 1U, 127U, 128U, 5000U, 3000000U}) {
    std::vector<std::byte> raw(size);
    for (std::size_t i = 0; i < size; ++i) raw[i] = static_cast<std::byte>(i * i >> 9);
    std::vector<std::byte> stored;
    const io::Packing packing = io::pack(raw, stored, limits);
    std::vector<std::byte> back(size);
    io::unpack(packing, stored, back, "it", limits);
    EXPECT_EQ(back, raw);
    if (packing == io::Packing::plain) continue;
    std::vector<std::byte> other(size + 1);
    EXPECT_THROW(io::unpack(packing, stored, other, "it", limits), LogError) << "another length";
    stored.push_back(std::byte{0});
    EXPECT_THROW(io::unpack(packing, stored, back, "it", limits), LogError) << "trailing bytes";
  }
}

TEST(Packing, NeverPacksTighterThanAReaderAccepts) {
  const Limits limits;
  const std::vector<std::byte> zeros(std::size_t{64} << 20);
  std::vector<std::byte> stored;
  const io::Packing packing = io::pack(zeros, stored, limits);
  std::vector<std::byte> back(zeros.size());
  EXPECT_NO_THROW(io::unpack(packing, stored, back, "zeros", limits));
}

TEST(Packing, FrameWithoutContentSizeIsRefused) {
  const std::vector<std::byte> raw(1000, std::byte{3});
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  std::vector<std::byte> stored(ZSTD_compressBound(raw.size()));
  stored.resize(ZSTD_compress2(context, stored.data(), stored.size(), raw.data(), raw.size()));
  ZSTD_freeCCtx(context);
  std::vector<std::byte> back(raw.size());
  EXPECT_THROW(io::unpack(io::Packing::zstd, stored, back, "it", {}), LogError);
}

}  // namespace varve::test
