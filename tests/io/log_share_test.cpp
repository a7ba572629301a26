// One writer, many readers, on the operating system's own files.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <thread>

#include "io/errors.h"
#include "io/file.h"
#include "io/log_reader.h"
#include "toy_run.h"

namespace varve::test {

using io::Completeness;
using io::ErrorKind;
using io::LogError;
using io::LogReader;
using io::LogWriter;
using testing::HasSubstr;

class LogShare : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "varve-io-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    directory_ = name;
    path_ = (directory_ / "run.varve").string();
    options_.beads = 3;
    options_.steps = 300;
    options_.keyframe_steps = 16;
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<LogWriter> create(const ToyRun& run, bool overwrite = false) {
    io::WriterOptions options;
    options.overwrite = overwrite;
    return LogWriter::create(path_, toy_genesis(options_), run.frame().view(), {}, options);
  }

  // Starts or continues the run and goes on to its end; never returns.
  [[noreturn]] void record_on(std::atomic<std::uint64_t>& durable) {
    try {
      ToyRun run(options_);
      io::WriterOptions options;
      options.sync_seconds = 0.002;
      options.keyframe_sync_apart_seconds = 0;
      std::unique_ptr<LogWriter> writer;
      if (std::filesystem::exists(path_)) {
        const std::uint64_t from = LogReader::open(path_)->last_step();
        while (run.frame().step < from) run.advance();
        writer = LogWriter::reopen(path_, run.frame().view(), options);
      } else {
        writer = LogWriter::create(path_, toy_genesis(options_), run.frame().view(), {}, options);
      }
      while (run.frame().step < options_.steps) {
        run.advance();
        writer->append(run.frame().view(), {});
        durable = writer->status().durable_step;
      }
      writer->close();
      ::_exit(0);
    } catch (const LogError&) {
      ::_exit(1);
    }
  }

  template <typename Do>
  std::pair<ErrorKind, std::string> failure(Do&& what) {
    try {
      what();
    } catch (const LogError& error) {
      return {error.kind(), error.what()};
    }
    ADD_FAILURE() << "did not fail";
    return {};
  }

  std::filesystem::path directory_;
  std::string path_;
  ToyOptions options_;
};

TEST_F(LogShare, SecondWriterIsRefusedAtOnceAndToldTheHoldersPid) {
  ToyRun run(options_);
  const auto writer = create(run);
  const auto begin = std::chrono::steady_clock::now();
  const auto [kind, text] =
      failure([&] { LogWriter::reopen(path_, run.frame().view()); });
  EXPECT_EQ(kind, ErrorKind::locked);
  EXPECT_THAT(text, HasSubstr(std::to_string(::getpid())));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(1));
  EXPECT_EQ(failure([&] { create(run, true); }).first, ErrorKind::locked);
  EXPECT_TRUE(io::system_files().is_locked(path_));
  run.advance();
  writer->append(run.frame().view(), {});
  writer->close();
  EXPECT_FALSE(io::system_files().is_locked(path_));
  EXPECT_EQ(LogReader::open(path_)->last_step(), 1U);
  EXPECT_FALSE(std::filesystem::exists(path_ + ".lock"));
  EXPECT_FALSE(std::filesystem::exists(path_ + ".new"));
}

TEST_F(LogShare, LockOfAKilledWriterIsNoObstacle) {
  const pid_t child = ::fork();
  if (child == 0) {
    ToyRun run(options_);
    const auto writer = create(run);
    for (int i = 0; i < 40; ++i) {
      run.advance();
      writer->append(run.frame().view(), {});
    }
    writer->flush();
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_TRUE(std::filesystem::exists(path_ + ".lock")) << "nobody could remove it";
  EXPECT_FALSE(io::system_files().is_locked(path_));
  const auto reader = LogReader::open(path_);
  ASSERT_EQ(reader->last_step(), 40U);
  ToyRun run(options_);
  while (run.frame().step < 40) run.advance();
  const auto writer = LogWriter::reopen(path_, run.frame().view());
  run.advance();
  writer->append(run.frame().view(), {});
  writer->close();
  EXPECT_EQ(LogReader::open(path_)->verify().completeness, Completeness::complete);
}

TEST_F(LogShare, KillNineAtAnyMomentLosesNoSyncedStepAndEndsLikeAnUnkilledRun) {
  options_.steps = 400;
  options_.beads = 20;
  write_toy_log(path_, options_, {});
  const io::Digest chain = LogReader::open(path_)->header(options_.steps)->chain;
  std::filesystem::remove(path_);
  // Where the child says what it knows to be durable.
  auto* const durable = static_cast<std::atomic<std::uint64_t>*>(
      ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  ASSERT_NE(durable, MAP_FAILED);
  *durable = 0;
  const int cycles = std::getenv("VARVE_LONG") ? 10000 : 25;
  std::mt19937 generator(3);
  int kills = 0;
  // How long a child lives depends on the machine: where children end by themselves, kill sooner.
  double longest_us = 30000;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    const pid_t child = ::fork();
    if (child == 0) record_on(*durable);
    const auto delay_us = generator() % static_cast<unsigned>(longest_us);
    std::this_thread::sleep_for(std::chrono::microseconds(delay_us));
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0) << "the child failed";
    kills += WIFSIGNALED(status) ? 1 : 0;
    longest_us = WIFSIGNALED(status) ? std::min(30000.0, 1.05 * longest_us)
                                     : std::max(500.0, 0.75 * longest_us);
    if (!std::filesystem::exists(path_)) continue;
    const auto reader = LogReader::open(path_);
    ASSERT_GE(reader->last_step(), durable->load());
    ASSERT_NE(reader->completeness(), Completeness::damaged);
    if (reader->last_step() < options_.steps) continue;
    ASSERT_EQ(reader->header(options_.steps)->chain, chain);
    ASSERT_EQ(reader->verify().completeness, Completeness::complete);
    std::filesystem::remove(path_);
    *durable = 0;
  }
  RecordProperty("kills", kills);
  EXPECT_GT(kills, cycles / 2);
  ::munmap(durable, 4096);
}

TEST_F(LogShare, FileSizeLimitIsAnErrorNotADeath) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::rlimit limit{20000, 20000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ToyRun run(options_);
    const auto writer = create(run);
    try {
      for (;;) {
        run.advance();
        writer->append(run.frame().view(), {});
      }
    } catch (const LogError& error) {
      ::_exit(error.kind() == ErrorKind::write_failed ? 17 : 18);
    }
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 17);
  const auto reader = LogReader::open(path_);
  EXPECT_GT(reader->last_step(), 10U);
  EXPECT_NE(reader->completeness(), Completeness::damaged);
}

TEST_F(LogShare, OfRacingWritersExactlyOneWins) {
  ToyRun run(options_);
  create(run)->close();
  const int rounds = std::getenv("VARVE_LONG") ? 1000 : 30;
  for (int round = 0; round < rounds; ++round) {
    std::atomic<int> won = 0;
    std::atomic<int> refused = 0;
    std::atomic<int> ready = 0;
    std::vector<std::unique_ptr<LogWriter>> writers(3);
    std::vector<std::thread> threads;
    for (auto& writer : writers) {
      threads.emplace_back([&] {
        ++ready;
        while (ready < 3) std::this_thread::yield();
        try {
          writer = LogWriter::reopen(path_, run.frame().view());
          ++won;
        } catch (const LogError& error) {
          EXPECT_EQ(error.kind(), ErrorKind::locked) << error.what();
          ++refused;
        }
      });
    }
    for (auto& thread : threads) thread.join();
    ASSERT_EQ(won, 1) << round;
    ASSERT_EQ(refused, 2) << round;
  }
}

TEST_F(LogShare, ReadersFollowAGrowingLog) {
  if (std::getenv("VARVE_LONG")) options_.steps = 20000;
  ToyRun run(options_);
  const auto frames = toy_frames(options_);
  const auto writer = create(run);
  std::vector<std::thread> readers;
  std::atomic<std::uint64_t> seen = 0;
  for (int i = 0; i < 8; ++i) {
    readers.emplace_back([&] {
      const auto reader = LogReader::open(path_);
      std::uint64_t last = 0;
      while (last < options_.steps) {
        const std::uint64_t before = reader->last_step();
        const bool more = reader->refresh();
        EXPECT_EQ(more, reader->last_step() > before);
        ASSERT_NE(reader->completeness(), Completeness::damaged);
        for (std::uint64_t step = last + 1; step <= reader->last_step(); ++step) {
          const auto frame = reader->frame(step);
          ASSERT_TRUE(frame) << step;
          ASSERT_TRUE(same_frame(*frame, frames.at(step))) << step;
          ++seen;
        }
        last = reader->last_step();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
  while (run.frame().step < options_.steps) {
    run.advance();
    writer->append(run.frame().view(), {});
    if (run.frame().step % 20 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  writer->close();
  for (auto& thread : readers) thread.join();
  // Each reader has seen every step, none of them cut short.
  EXPECT_EQ(seen, 8 * options_.steps);
}

TEST_F(LogShare, ReaderSeesALogClosedAndContinued) {
  ToyRun run(options_);
  auto writer = create(run);
  const auto reader = LogReader::open(path_);
  EXPECT_FALSE(reader->closed());
  for (int i = 0; i < 30; ++i) {
    run.advance();
    writer->append(run.frame().view(), {});
  }
  writer->close();
  EXPECT_TRUE(reader->refresh());
  EXPECT_TRUE(reader->closed());
  EXPECT_EQ(reader->last_step(), 30U);
  EXPECT_FALSE(reader->refresh());
  writer = LogWriter::reopen(path_, run.frame().view());
  run.advance();
  writer->append(run.frame().view(), {});
  writer->flush();
  EXPECT_TRUE(reader->refresh());
  EXPECT_FALSE(reader->closed());
  EXPECT_EQ(reader->last_step(), 31U);
  EXPECT_TRUE(same_frame(*reader->frame(31), run.frame()));
}

TEST_F(LogShare, PartOfARecordIsNotTornWhileTheWriterLives) {
  ToyRun run(options_);
  auto writer = create(run);
  writer->flush();
  const std::uint64_t before = std::filesystem::file_size(path_);
  const auto file = io::system_files().open_write(path_);
  file->write_at(before, std::vector<std::byte>(100, std::byte{0x89}));
  EXPECT_EQ(LogReader::open(path_)->completeness(), Completeness::complete);
  writer.reset();
  EXPECT_EQ(LogReader::open(path_)->completeness(), Completeness::torn);
}

TEST_F(LogShare, NothingIsOverwrittenUnasked) {
  ToyRun run(options_);
  create(run)->close();
  EXPECT_EQ(failure([&] { create(run); }).first, ErrorKind::exists);
  EXPECT_NO_THROW(create(run, true)->close());
  path_ = directory_.string();
  EXPECT_EQ(failure([&] { create(run, true); }).first, ErrorKind::exists);
  EXPECT_EQ(failure([&] { LogReader::open(path_); }).first, ErrorKind::not_found);
  EXPECT_EQ(failure([&] { LogReader::open(path_ + "/none"); }).first, ErrorKind::not_found);
  path_ += "/no/such/folder/run.varve";
  EXPECT_EQ(failure([&] { create(run); }).first, ErrorKind::write_failed);
}

TEST_F(LogShare, FullDeviceIsNamedWithBytesAndSpace) {
  const auto file = io::system_files().open_write("/dev/full");
  const auto [kind, text] =
      failure([&] { file->write_at(0, std::vector<std::byte>(4096)); });
  EXPECT_EQ(kind, ErrorKind::write_failed);
  EXPECT_THAT(text, HasSubstr("writing 4096 bytes: 0 written"));
  EXPECT_THAT(text, HasSubstr("No space left on device"));
}

TEST_F(LogShare, OverwritingLeavesOpenReadersTheOldLog) {
  ToyRun run(options_);
  create(run)->close();
  const auto reader = LogReader::open(path_);
  ToyOptions other = options_;
  other.seed = 2;
  const ToyRun replacement(other);
  create(replacement, true)->close();
  EXPECT_TRUE(same_frame(*reader->frame(0), run.frame()));
  EXPECT_TRUE(same_frame(*LogReader::open(path_)->frame(0), replacement.frame()));
}

}  // namespace varve::test
