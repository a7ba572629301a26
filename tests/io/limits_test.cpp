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

// ---- every cap, one by one ----

struct Cap {
  const char* name;
  std::uint64_t Limits::*cap;
  std::uint64_t value;  ///< below what the log needs
  const char* said;     ///< what the message names, where it is not the name and the value
};

class LogCap : public LogLimits, public testing::WithParamInterface<Cap> {
 protected:
  void SetUp() override {
    options_.beads = 3;
    options_.steps = 20;
    options_.keyframe_steps = 8;
    options_.event_every = 6;
    ToyRun run(options_);
    io::Genesis genesis = toy_genesis(options_);
    genesis.lineage.emplace();
    genesis.lineage->parent_run_id = std::string(32, 'a');
    genesis.lineage->ancestors.assign(3, std::string(32, 'a'));
    const auto writer =
        LogWriter::create("log", genesis, run.frame().view(), run.events(), untimed(files_));
    while (run.frame().step < options_.steps) {
      run.advance();
      writer->append(run.frame().view(), run.events());
    }
    writer->close();
    LogBytes bytes(files_, "log");  // damage in two places, for the cap on their number
    if (GetParam().cap == &Limits::damage_max) {
      for (const std::size_t nth : {2U, 9U})
        bytes.set_byte(bytes.record(RecordKind::step, nth).end() - 30, 0x77);
    }
    bytes.put(files_, "log");
  }

  // All that a reader with these limits has to say of the log.
  std::string everything(const Limits& limits) {
    std::string said;
    const auto listen = [&](auto&& what) {
      try {
        what();
      } catch (const LogError& error) {
        EXPECT_TRUE(error.kind() == ErrorKind::limit || error.kind() == ErrorKind::damaged);
        EXPECT_EQ(error.path(), "log") << error.what();
        EXPECT_GE(error.offset(), 0) << error.what();
        said += std::string(error.what()) + "\n";
      }
    };
    listen([&] {
      const auto reader = LogReader::open("log", &files_, limits);
      for (const auto& damage : reader->verify().damage) said += damage.what + "\n";
      for (std::uint64_t step = 0; step <= options_.steps; ++step) {
        listen([&] { reader->frame(step); });
        listen([&] { reader->tables(step); });
      }
    });
    return said;
  }
};

TEST_P(LogCap, IsEnforcedAndNamed) {
  if (GetParam().cap != &Limits::damage_max) {
    EXPECT_EQ(everything({}), "") << "the log keeps the defaults";
  }
  Limits limits;
  limits.*GetParam().cap = GetParam().value;
  if (GetParam().cap == &Limits::ratio_max) limits.ratio_free_bytes = 16;
  if (GetParam().cap == &Limits::ratio_free_bytes) limits.ratio_max = 1;
  const std::string expected =
      GetParam().said != nullptr
          ? std::string(GetParam().said)
          : std::string(GetParam().name) + " " + std::to_string(GetParam().value);
  EXPECT_THAT(everything(limits), HasSubstr(expected));
}

INSTANTIATE_TEST_SUITE_P(
    All, LogCap,
    testing::Values(Cap{"message_bytes_max", &Limits::message_bytes_max, 64, nullptr},
                    Cap{"body_bytes_max", &Limits::body_bytes_max, 16, nullptr},
                    Cap{"field_bytes_max", &Limits::field_bytes_max, 40, nullptr},
                    Cap{"ratio_max", &Limits::ratio_max, 1, "ratio_max 1:1"},
                    Cap{"ratio_free_bytes", &Limits::ratio_free_bytes, 16, "ratio_max 1:1"},
                    Cap{"particles_max", &Limits::particles_max, 100, nullptr},
                    Cap{"rows_max", &Limits::rows_max, 1, nullptr},
                    Cap{"string_bytes_max", &Limits::string_bytes_max, 4, nullptr},
                    Cap{"text_bytes_max", &Limits::text_bytes_max, 4, nullptr},
                    Cap{"list_items_max", &Limits::list_items_max, 1, nullptr},
                    Cap{"fields_max", &Limits::fields_max, 3, nullptr},
                    Cap{"tables_max", &Limits::tables_max, 0, nullptr},
                    Cap{"columns_max", &Limits::columns_max, 1, nullptr},
                    Cap{"components_max", &Limits::components_max, 1, nullptr},
                    Cap{"lineage_depth_max", &Limits::lineage_depth_max, 2, nullptr},
                    Cap{"index_steps_max", &Limits::index_steps_max, 4, nullptr},
                    Cap{"step_max", &Limits::step_max, 11, nullptr},
                    Cap{"damage_max", &Limits::damage_max, 1, nullptr}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

TEST(Limits, AllHaveATestAbove) {
  EXPECT_EQ(sizeof(Limits), 18 * sizeof(std::uint64_t)) << "a cap was added: test it too";
}

TEST_F(LogLimits, FailureInTheCodecNamesFileAndOffset) {
  io::StepMessage message = last_message();
  const PlacedRecord last = LogBytes(files_, "log").records().back();
  const auto body = LogBytes(files_, "log").slice(last.end() - last.header.body_bytes, last.end());
  message.fields[3].method = 77;
  message.fields[3].order = 0;
  replace_last(message, body);
  const auto reader = LogReader::open("log", &files_);
  try {
    reader->frame(10);
    FAIL() << "decoded";
  } catch (const LogError& error) {
    EXPECT_EQ(error.path(), "log");
    EXPECT_EQ(error.offset(), static_cast<std::int64_t>(last.offset));
    EXPECT_THAT(error.what(), HasSubstr("log: " + std::to_string(last.offset) + ": "));
    EXPECT_THAT(error.what(), HasSubstr("bead.v"));
    EXPECT_THAT(error.what(), HasSubstr("77"));
  }
}

TEST_F(LogLimits, EventsThatCouldNotBeReadAgainAreRefusedAtOnce) {
  ToyRun run(options_);
  const auto writer =
      LogWriter::create("new", toy_genesis(options_), run.frame().view(), {}, untimed(files_));
  run.advance();
  const auto append = [&](const std::vector<io::Event>& events) {
    return refusal(ErrorKind::limit, [&] { writer->append(run.frame().view(), events); });
  };
  const std::string large(70000, 'x');
  EXPECT_THAT(append({{1, large, {}}}), HasSubstr("string_bytes_max 65536"));
  EXPECT_THAT(append({{1, "note", {{"text", large}}}}), HasSubstr("string_bytes_max 65536"));
  std::vector<std::pair<std::string, std::string>> items(65537, {"k", "v"});
  EXPECT_THAT(append({{1, "note", items}}), HasSubstr("list_items_max 65536"));
  items.assign(1000, {"k", std::string(60000, 'x')});
  EXPECT_THAT(append({{1, "note", items}}), HasSubstr("message_bytes_max"));
  EXPECT_THAT(append(std::vector<io::Event>(32769, {1, "note", {}})),
              HasSubstr("half of list_items_max 32768"));
  // As many as a step can have, step after step: the index names them all.
  for (int i = 0; i < 3; ++i) {
    writer->append(run.frame().view(), std::vector<io::Event>(32768, {1, "note", {}}));
    run.advance();
  }
  writer->close();
  const auto reader = LogReader::open("new", &files_);
  EXPECT_EQ(reader->events().size(), 3U * 32768U);
  EXPECT_EQ(reader->verify().completeness, io::Completeness::complete);
}

TEST_F(LogLimits, StepsBeyondTheCapAreRefused) {
  ToyOptions options = options_;
  options.first_step = (std::uint64_t{1} << 53) - 1;
  ToyRun run(options);
  const auto writer =
      LogWriter::create("new", toy_genesis(options), run.frame().view(), {}, untimed(files_));
  run.advance();
  writer->append(run.frame().view(), {});
  run.advance();
  EXPECT_THAT(refusal(ErrorKind::limit,
                      [&] {
                        writer->append(run.frame().view(), {});
                        writer->close();
                      }),
              HasSubstr("step_max 9007199254740992"));
  EXPECT_EQ(LogReader::open("new", &files_)->last_step(), options.first_step + 1);
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
