// Failing disks: whatever call fails, the first error is kept, nothing synced is lost, and the log
// goes on from its last whole step once there is room.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "log_damage.h"
#include "toy_run.h"

namespace varve::test {

using io::Completeness;
using io::ErrorKind;
using io::Fault;
using io::FaultKind;
using io::LogError;
using io::LogReader;
using io::LogWriter;
using io::MemoryFileSystem;
using testing::HasSubstr;

namespace {

ToyOptions small() {
  ToyOptions options;
  options.beads = 2;
  options.steps = std::getenv("VARVE_LONG") ? 1000 : 60;
  options.keyframe_steps = 8;
  options.event_every = 6;
  return options;
}

// Durability as the writer claimed it at the moment of its failure.
struct Attempt {
  bool created = false;
  bool finished = false;
  std::uint64_t durable_step = 0;
  std::string what;
  ErrorKind kind = ErrorKind::exists;
};

// Records the whole run on `files`, one step at a time, until something fails.
Attempt attempt(MemoryFileSystem& files, const ToyOptions& options) {
  Attempt out;
  std::unique_ptr<LogWriter> writer;
  ToyRun run(options);
  try {
    writer = LogWriter::create("log", toy_genesis(options), run.frame().view(), run.events(),
                               untimed(files));
    out.created = true;
    while (run.frame().step < options.steps) {
      run.advance();
      writer->append(run.frame().view(), run.events());
    }
    writer->close();
    out.finished = true;
  } catch (const LogError& error) {
    out.what = error.what();
    out.kind = error.kind();
    if (writer) {
      // Latched: the same failure at every further call; nothing is retried as if all were well.
      run.advance();
      EXPECT_THROW(writer->append(run.frame().view(), {}), LogError);
      EXPECT_THROW(writer->flush(), LogError);
      EXPECT_THROW(writer->close(), LogError);
    }
  }
  if (writer) out.durable_step = writer->status().durable_step;
  return out;
}

}  // namespace

class LogFault : public testing::TestWithParam<FaultKind> {
 protected:
  // Continues what a failed attempt left and expects it to end like an undisturbed run.
  static void expect_finishes(MemoryFileSystem& files, const ToyOptions& options,
                              const io::Digest& chain, std::uint64_t call) {
    ToyRun run(options);
    const std::uint64_t from = LogReader::open("log", &files)->last_step();
    while (run.frame().step < from) run.advance();
    const auto writer = LogWriter::reopen("log", run.frame().view(), untimed(files));
    while (run.frame().step < options.steps) {
      run.advance();
      writer->append(run.frame().view(), run.events());
    }
    writer->close();
    const auto reader = LogReader::open("log", &files);
    ASSERT_EQ(reader->header(options.steps)->chain, chain) << call;
    ASSERT_EQ(reader->verify().completeness, Completeness::complete) << call;
  }
};

TEST_P(LogFault, FailureOfAnyCallIsLatchedAndTheLogGoesOnAfterwards) {
  const ToyOptions options = small();
  MemoryFileSystem undisturbed;
  ASSERT_TRUE(attempt(undisturbed, options).finished);
  const io::Digest chain = LogReader::open("log", &undisturbed)->header(options.steps)->chain;
  std::uint64_t failures = 0;
  for (std::uint64_t call = 1;; ++call) {
    MemoryFileSystem files;
    files.set_fault({GetParam(), call});
    const Attempt result = attempt(files, options);
    if (result.finished) {
      ASSERT_GT(call, 10U) << "nothing failed";
      break;
    }
    ++failures;
    EXPECT_EQ(result.kind, ErrorKind::write_failed) << result.what;
    files.set_fault({});
    if (!result.created) continue;
    {
      const auto reader = LogReader::open("log", &files);
      ASSERT_GE(reader->last_step(), result.durable_step) << "call " << call;
      ASSERT_NE(reader->completeness(), Completeness::damaged) << "call " << call;
    }
    if (call % 5 == 0) files.lose_power(call % 3 * 50);
    const auto reader = LogReader::open("log", &files);
    ASSERT_GE(reader->last_step(), result.durable_step) << "a synced step was lost, call " << call;
    expect_finishes(files, options, chain, call);
  }
  RecordProperty("failures", static_cast<int>(failures));
}

TEST_P(LogFault, FailureThatPassesAgainIsNotForgotten) {
  const ToyOptions options = small();
  MemoryFileSystem files;
  files.set_fault({GetParam(), 9, 1});
  const Attempt result = attempt(files, options);
  EXPECT_FALSE(result.finished);
  EXPECT_EQ(result.kind, ErrorKind::write_failed);
}

TEST_P(LogFault, RecoverThatFailsLeavesNoOutputAndItsInputAlone) {
  const ToyOptions options = small();
  MemoryFileSystem files;
  ASSERT_TRUE(attempt(files, options).finished);
  const auto before = files.content("log");
  for (std::uint64_t call = 1;; ++call) {
    files.set_fault({GetParam(), call});
    try {
      io::recover("log", "out", false, &files);
      files.set_fault({});
      EXPECT_GT(call, 1U);
      EXPECT_EQ(LogReader::open("out", &files)->verify().completeness, Completeness::complete);
      break;
    } catch (const LogError& error) {
      EXPECT_EQ(error.kind(), ErrorKind::write_failed);
    }
    files.set_fault({});
    EXPECT_EQ(files.content("log"), before);
    if (files.kind("out") != io::PathKind::nothing) {  // only the directory's sync had failed
      EXPECT_EQ(LogReader::open("out", &files)->verify().completeness, Completeness::complete);
      files.remove("out");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, LogFault,
                         testing::Values(FaultKind::no_space, FaultKind::io_error,
                                         FaultKind::short_write, FaultKind::lost_sync),
                         [](const auto& parameter) -> std::string {
                           switch (parameter.param) {
                             case FaultKind::no_space: return "NoSpace";
                             case FaultKind::io_error: return "IoError";
                             case FaultKind::short_write: return "ShortWrite";
                             case FaultKind::lost_sync: return "LostSync";
                             case FaultKind::none: break;
                           }
                           return "None";
                         });

TEST(LogFaultText, SaysWhatWhereAndHowMuch) {
  MemoryFileSystem files;
  files.set_fault({FaultKind::short_write, 6});
  const Attempt result = attempt(files, small());
  EXPECT_THAT(result.what, HasSubstr("log: "));
  EXPECT_THAT(result.what, HasSubstr("writing "));
  EXPECT_THAT(result.what, HasSubstr(" written"));
  EXPECT_THAT(result.what, HasSubstr("No space left on device"));
}

TEST(LogPower, WhatWasSyncedSurvivesAnyLossOfTheRest) {
  const ToyOptions options = small();
  for (std::uint64_t kept = 0; kept < 3000; kept += 61) {
    MemoryFileSystem files;
    ToyRun run(options);
    auto writer = LogWriter::create("log", toy_genesis(options), run.frame().view(), {},
                                    untimed(files));
    for (int i = 0; i < 29; ++i) {
      run.advance();
      writer->append(run.frame().view(), {});
    }
    while (writer->status().last_step < 29) {
    }
    const std::uint64_t durable = writer->status().durable_step;
    EXPECT_EQ(durable, 24U) << "the last keyframe";
    files.lose_power(kept);
    const auto reader = LogReader::open("log", &files);
    EXPECT_GE(reader->last_step(), durable);
    EXPECT_NE(reader->completeness(), Completeness::damaged);
    EXPECT_TRUE(reader->frame(durable));
  }
}

TEST(LogPower, FlushMakesEveryStepDurable) {
  const ToyOptions options = small();
  MemoryFileSystem files;
  ToyRun run(options);
  auto writer =
      LogWriter::create("log", toy_genesis(options), run.frame().view(), {}, untimed(files));
  for (int i = 0; i < 5; ++i) {
    run.advance();
    writer->append(run.frame().view(), {});
  }
  writer->flush();
  EXPECT_EQ(writer->status().durable_step, 5U);
  EXPECT_EQ(writer->status().last_step, 5U);
  EXPECT_GT(writer->status().writer_cpu_s, 0.0);
  files.lose_power();
  EXPECT_EQ(LogReader::open("log", &files)->last_step(), 5U);
}

TEST(LogPower, IdleWriterSyncsAfterAWhile) {
  const ToyOptions options = small();
  MemoryFileSystem files;
  ToyRun run(options);
  io::WriterOptions writer_options = untimed(files);
  writer_options.sync_seconds = 0.02;
  auto writer =
      LogWriter::create("log", toy_genesis(options), run.frame().view(), {}, writer_options);
  run.advance();
  writer->append(run.frame().view(), {});
  for (int i = 0; i < 2000 && writer->status().durable_step < 1; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(writer->status().durable_step, 1U);
}

TEST(LogWriterEnd, DestroyedWithoutCloseKeepsEveryStepButWritesNoEndRecord) {
  const ToyOptions options = small();
  MemoryFileSystem files;
  {
    ToyRun run(options);
    auto writer =
        LogWriter::create("log", toy_genesis(options), run.frame().view(), {}, untimed(files));
    for (int i = 0; i < 11; ++i) {
      run.advance();
      writer->append(run.frame().view(), {});
    }
  }
  const auto reader = LogReader::open("log", &files);
  EXPECT_EQ(reader->last_step(), 11U);
  EXPECT_FALSE(reader->closed());
  EXPECT_EQ(reader->completeness(), Completeness::complete);
}

}  // namespace varve::test
