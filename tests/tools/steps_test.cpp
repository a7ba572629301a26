// Names of steps, against real logs.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/log_reader.h"
#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"
#include "tools/cli.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

using ::testing::HasSubstr;

/// A log of the steps first..first + steps, 1 ms each, on disk while it lives.
class StepLog {
 public:
  explicit StepLog(std::uint64_t first, std::uint64_t steps = 200, std::uint64_t contact = 57) {
    test::ToyOptions options;
    options.steps = steps;
    options.first_step = first;
    options.beads = 3;
    options.links = false;
    std::vector<io::Frame> frames = test::toy_frames(options);
    io::Genesis genesis = test::toy_genesis(false);
    genesis.schema.tables.push_back({"contacts", {{"grain", io::ScalarType::u64, ""},
                                                  {"begin", io::ScalarType::u8, ""}}});
    for (io::Frame& frame : frames) {
      // A contact that goes on has rows, too; only its first has begin = 1.
      const bool touching = contact > 0 && frame.step >= contact && frame.step < contact + 5;
      frame.rows.push_back(touching ? 2 : 0);
      frame.tables.resize(2, std::vector<std::vector<std::byte>>(2));
      frame.tables[1].resize(2);
      for (std::uint64_t row = 0; touching && row < 2; ++row) {
        test::append_value(frame.tables[1][0], row);
        const bool begins = row == 1 && (frame.step == contact || frame.step == contact + 3);
        test::append_value(frame.tables[1][1], static_cast<std::uint8_t>(begins));
      }
    }
    test::write_log(folder_ / "toy.varve", genesis, frames);
    log_ = io::LogReader::open(folder_ / "toy.varve");
  }
  const io::LogReader& operator*() const { return *log_; }

 private:
  test::TemporaryFolder folder_;
  std::unique_ptr<io::LogReader> log_;
};

std::string refusal(std::string_view text, const io::LogReader& log) {
  try {
    const std::uint64_t step = parse_step(text, log);
    return "step " + std::to_string(step);
  } catch (const UsageError& error) {
    return error.what();
  }
}

TEST(Steps, EveryForm) {
  const StepLog log(0);
  EXPECT_EQ(parse_step("120", *log), 120u);
  EXPECT_EQ(parse_step(" 0 ", *log), 0u);
  EXPECT_EQ(parse_step("first", *log), 0u);
  EXPECT_EQ(parse_step("last", *log), 200u);
  EXPECT_EQ(parse_step("last-0", *log), 200u);
  EXPECT_EQ(parse_step("last-200", *log), 0u);
  EXPECT_EQ(parse_step("first+7", *log), 7u);
  EXPECT_EQ(parse_step("last-good", *log), 200u);
  EXPECT_EQ(parse_step("50%", *log), 100u);
  EXPECT_EQ(parse_step("0%", *log), 0u);
  EXPECT_EQ(parse_step("100%", *log), 200u);
  EXPECT_EQ(parse_step("33.3%", *log), 66u);
  EXPECT_EQ(parse_step("t=0.03", *log), 30u);
  EXPECT_EQ(parse_step("t=0.03s", *log), 30u);
  EXPECT_EQ(parse_step("t=30 ms", *log), 30u);
  EXPECT_EQ(parse_step("t=30.9ms", *log), 30u);
  EXPECT_EQ(parse_step("t=29999.9999us", *log), 30u);  // within a millionth of dt
  EXPECT_EQ(parse_step("t=29999us", *log), 29u);
  EXPECT_EQ(parse_step("t=200ms", *log), 200u);
  EXPECT_EQ(parse_step("first-contact", *log), 57u);
}

TEST(Steps, OfALogThatDoesNotStartAtZero) {
  const StepLog log(1000);
  EXPECT_EQ(parse_step("first", *log), 1000u);
  EXPECT_EQ(parse_step("50%", *log), 1100u);
  EXPECT_EQ(parse_step("1000", *log), 1000u);
  EXPECT_EQ(parse_step("t=1.05s", *log), 1050u);
  EXPECT_THAT(refusal("999", *log), HasSubstr("toy.varve: step: expected 1000..1200, got 999"));
  EXPECT_THAT(refusal("last-201", *log), HasSubstr("expected 1000..1200, got last-201"));
  EXPECT_THAT(refusal("t=0.5s", *log), HasSubstr("expected a time 1..1.2 s, got 0.5 s"));
  EXPECT_EQ(parse_step("999", *log, true), 999u);
  EXPECT_EQ(parse_step("last-201", *log, true), 999u);
}

TEST(Steps, WhatIsNoStep) {
  const StepLog log(0, 200, 0);
  for (const char* text :
       {"", "x", "-1", "1.5", "last-", "last-x", "last+1", "first-1", "t=", "t=x", "t=1m", "%",
        "x%", "t=nan", "0x10", "1e3", "99999999999999999999"})
    EXPECT_THAT(refusal(text, *log), HasSubstr("expected")) << text;
  EXPECT_THAT(refusal("120%", *log), HasSubstr("expected 0%..100%, got '120%'"));
  EXPECT_THAT(refusal("-1%", *log), HasSubstr("expected 0%..100%"));
  EXPECT_THAT(refusal("201", *log), HasSubstr("expected 0..200, got 201"));
  EXPECT_THAT(refusal("last-201", *log), HasSubstr("expected 0..200"));
  EXPECT_THAT(refusal("first+201", *log), HasSubstr("expected 0..200"));
  EXPECT_THAT(refusal("t=0.3s", *log), HasSubstr("expected a time 0..0.2 s, got 0.3 s"));
  EXPECT_THAT(refusal("first-contact", *log),
              HasSubstr("first-contact: expected a contact, got none in steps 0..200"));
}

TEST(Steps, Ranges) {
  const StepLog log(0);
  const auto is = [&](std::string_view text, std::uint64_t first, std::uint64_t last,
                      std::uint64_t stride) {
    const StepRange range = parse_range(text, *log);
    EXPECT_EQ(range.first, first) << text;
    EXPECT_EQ(range.last, last) << text;
    EXPECT_EQ(range.stride, stride) << text;
  };
  is("10:20:5", 10, 20, 5);
  is("10:20", 10, 20, 1);
  is("10:", 10, 200, 1);
  is(":20", 0, 20, 1);
  is("::3", 0, 200, 3);
  is(":", 0, 200, 1);
  is("42", 42, 42, 1);
  is("t=0.01s:last-100:2", 10, 100, 2);
  is("first-contact:last", 57, 200, 1);
  for (const char* bad : {"20:10", "1:2:0", "1:2:x", "1:2:3:4", "a:b", "1:2:-1", "1:2:"})
    EXPECT_THROW((void)parse_range(bad, *log), UsageError) << bad;
}

TEST(Steps, Seconds) {
  EXPECT_EQ(parse_seconds("1.5", "--until"), 1.5);
  EXPECT_EQ(parse_seconds("1.5s", "--until"), 1.5);
  EXPECT_EQ(parse_seconds(" 300 ms ", "--until"), 0.3);
  EXPECT_EQ(parse_seconds("20us", "--until"), 20e-6);
  EXPECT_EQ(parse_seconds("2min", "--until"), 120);
  EXPECT_EQ(parse_seconds("1h", "--until"), 3600);
  for (const char* bad : {"", "s", "1 m", "x", "inf", "1e999", "1,5"}) {
    try {
      (void)parse_seconds(bad, "--until");
      ADD_FAILURE() << bad;
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("--until: expected a time, such as 1.2s or 300ms, got"));
    }
  }
}

}  // namespace
}  // namespace varve::tools
