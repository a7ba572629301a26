// Recovery keeps everything whole on both sides of damage and says what is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "log_damage.h"
#include "toy_run.h"

namespace varve::test {

using io::Completeness;
using io::ErrorKind;
using io::LogError;
using io::LogReader;
using io::LogWriter;
using io::MemoryFileSystem;
using io::RecordKind;
using Ranges = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

class LogRecover : public testing::Test {
 protected:
  void SetUp() override {
    options_.beads = 2;
    options_.steps = 40;
    options_.keyframe_steps = 8;
    options_.event_every = 6;
  }

  LogBytes write() {
    write_toy_log("log", options_, untimed(files_));
    return LogBytes(files_, "log");
  }

  // Recovers "log" and checks what holds whatever was damaged.
  io::Recovery recover() {
    const auto before = files_.content("log");
    const io::Recovery recovery = io::recover("log", "out", true, &files_);
    EXPECT_EQ(files_.content("log"), before) << "the input is never touched";
    const auto reader = LogReader::open("out", &files_);
    const auto verification = reader->verify();
    EXPECT_EQ(verification.completeness, Completeness::complete);
    EXPECT_EQ(verification.steps, recovery.steps_kept);
    EXPECT_TRUE(reader->closed());
    const auto frames = toy_frames(options_);
    std::uint64_t kept = 0;
    for (const auto& [step, frame] : frames) {
      const bool lost = std::any_of(
          recovery.lost.begin(), recovery.lost.end(),
          [s = step](const auto& range) { return s >= range.first && s <= range.second; });
      const auto header = reader->header(step);
      EXPECT_EQ(header.has_value(), !lost && step <= reader->last_step()) << step;
      if (!header) continue;
      ++kept;
      EXPECT_EQ(header->digest, io::digest_frame(reader->genesis().schema, frame.view()));
      const auto read = reader->frame(step);
      if (options_.tier == io::Tier::deltas) {
        EXPECT_TRUE(read) << step;
      }
      if (read && options_.tier == io::Tier::deltas) {
        EXPECT_TRUE(same_frame(*read, frame)) << step;
      }
    }
    EXPECT_EQ(kept, recovery.steps_kept);
    return recovery;
  }

  MemoryFileSystem files_;
  ToyOptions options_;
};

TEST_F(LogRecover, WholeLogIsCopiedWithoutLoss) {
  write();
  const auto recovery = recover();
  EXPECT_FALSE(recovery.lossy);
  EXPECT_EQ(recovery.steps_kept, 41U);
  EXPECT_TRUE(recovery.lost.empty());
  const auto one = LogReader::open("log", &files_);
  const auto other = LogReader::open("out", &files_);
  EXPECT_EQ(one->genesis().run_id(), other->genesis().run_id());
  EXPECT_NE(one->genesis().log_id, other->genesis().log_id);
  EXPECT_EQ(one->events(), other->events());
  EXPECT_EQ(one->header(40)->chain, other->header(40)->chain);
}

TEST_F(LogRecover, LostDeltaTakesTheDeltasUponItWithIt) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  ASSERT_EQ(record.header.step, 11U);
  bytes.fill(record.offset + 3, record.offset + 40, 0).put(files_, "log");
  const auto recovery = recover();
  EXPECT_TRUE(recovery.lossy);
  EXPECT_EQ(recovery.lost, (Ranges{{11, 15}}));
  EXPECT_EQ(recovery.damage.size(), 1U);
  const auto reader = LogReader::open("out", &files_);
  EXPECT_EQ(reader->first_step(), 0U);
  EXPECT_EQ(reader->last_step(), 40U);
  EXPECT_EQ(reader->step_at_time(toy_frames(options_).at(13).time), 10U);
  EXPECT_EQ(reader->stored_step_at_or_before(13), 10U);
}

TEST_F(LogRecover, LostKeyframeTakesItsDeltasWithIt) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::keyframe, 2);
  bytes.set_byte(record.end() - 60, 0x11).set_byte(record.end() - 61, 0x22).put(files_, "log");
  EXPECT_EQ(recover().lost, (Ranges{{16, 23}}));
}

TEST_F(LogRecover, LostFirstKeyframeLosesTheBeginning) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::keyframe, 0);
  bytes.fill(record.offset, record.end(), 0xee).put(files_, "log");
  EXPECT_EQ(recover().lost, (Ranges{{0, 7}}));
  EXPECT_EQ(LogReader::open("out", &files_)->first_step(), 8U);
}

TEST_F(LogRecover, LostIndexOrEndRecordLosesNothing) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::index);
  LogBytes(bytes).set_byte(record.end() - 30, 0x99).put(files_, "log");
  const auto recovery = recover();
  EXPECT_FALSE(recovery.lossy);
  EXPECT_EQ(recovery.steps_kept, 41U);
  EXPECT_EQ(recovery.damage.size(), 1U);
  bytes.truncate(bytes.record(RecordKind::end).offset + 20).put(files_, "log");
  EXPECT_FALSE(recover().lossy) << "a torn tail";
}

TEST_F(LogRecover, LostEventIsALossWithoutALostStep) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::event, 3);
  bytes.set_byte(record.offset + 120, 0x99).put(files_, "log");
  const auto recovery = recover();
  EXPECT_TRUE(recovery.lossy);
  EXPECT_TRUE(recovery.lost.empty());
  EXPECT_EQ(recovery.steps_kept, 41U);
  EXPECT_EQ(LogReader::open("out", &files_)->events().size(),
            LogReader::open("log", &files_)->events().size());
}

TEST_F(LogRecover, BytesInsertedOrMissingShiftNothingElse) {
  const LogBytes whole = write();
  const PlacedRecord record = whole.record(RecordKind::step, 20);
  LogBytes(whole).insert(record.offset + 24, std::vector<std::byte>(512)).put(files_, "log");
  EXPECT_EQ(recover().lost.size(), 1U);
  LogBytes(whole).erase(record.offset + 24, record.offset + 48).put(files_, "log");
  EXPECT_EQ(recover().lost.size(), 1U);
}

TEST_F(LogRecover, StepWhoseChainDoesNotHoldIsLostAndTheRestSaved) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  ASSERT_EQ(record.header.step, 11U);
  const std::uint64_t chain_at = record.offset + io::header_bytes + 8 + 32;
  bytes.set_byte(chain_at, 0x77).fix_checksums(record.offset).put(files_, "log");
  EXPECT_EQ(LogReader::open("log", &files_)->verify().completeness, Completeness::damaged);
  const auto recovery = recover();
  EXPECT_TRUE(recovery.lossy);
  EXPECT_EQ(recovery.lost, (Ranges{{11, 15}}));
  EXPECT_THAT(recovery.damage.at(0).what, testing::HasSubstr("the chain does not hold"));
}

TEST_F(LogRecover, RecordsThatHoldAndMakeNoSenseAreLostAlone) {
  const LogBytes whole = write();
  for (const RecordKind kind : {RecordKind::event, RecordKind::step, RecordKind::index}) {
    LogBytes bytes(whole);
    const PlacedRecord record = bytes.record(kind, kind == RecordKind::step ? 9 : 0);
    // The root pointer of the message: a list where a struct is expected.
    bytes.set_byte(record.offset + io::header_bytes, 0x05).fix_checksums(record.offset)
        .put(files_, "log");
    const auto recovery = recover();
    EXPECT_EQ(recovery.lossy, kind != RecordKind::index) << io::name_of(kind);
    EXPECT_EQ(recovery.lost, kind == RecordKind::step ? (Ranges{{11, 15}}) : Ranges{});
  }
}

TEST_F(LogRecover, StepThatComesAgainIsKeptOnce) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  io::RecordHeader header = record.header;
  header.step = 3;
  bytes.set_header(record.offset, header).put(files_, "log");
  EXPECT_EQ(recover().lost, (Ranges{{11, 15}}));
}

TEST_F(LogRecover, LogWhoseEndWasLostIsSavedAndContinued) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 30);
  ASSERT_GT(record.header.step, 32U);
  bytes.fill(record.offset, bytes.record(RecordKind::end).offset, 0x5c).put(files_, "log");
  const auto recovery = recover();
  EXPECT_TRUE(recovery.lossy);
  const std::uint64_t last = LogReader::open("out", &files_)->last_step();
  EXPECT_EQ(last, record.header.step - 1);
  ToyRun run(options_);
  while (run.frame().step < last) run.advance();
  const auto writer = LogWriter::reopen("out", run.frame().view(), untimed(files_));
  while (run.frame().step < options_.steps) {
    run.advance();
    writer->append(run.frame().view(), run.events());
  }
  writer->close();
  EXPECT_EQ(LogReader::open("out", &files_)->verify().completeness, Completeness::complete);
  EXPECT_TRUE(same_frame(*LogReader::open("out", &files_)->frame(40), run.frame()));
}

TEST_F(LogRecover, DigestsThatStandAloneAreKept) {
  options_.tier = io::Tier::digests;
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  bytes.set_byte(record.offset + 30, 0x31).put(files_, "log");
  EXPECT_EQ(recover().lost, (Ranges{{11, 11}}));
}

TEST_F(LogRecover, RecoveringTheRecoveredChangesNothing) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  bytes.set_byte(record.offset + 30, 0x31).put(files_, "log");
  const auto first = recover();
  const LogBytes once(files_, "out");
  once.put(files_, "log");
  const auto second = recover();
  EXPECT_EQ(second.lost, first.lost);
  EXPECT_EQ(second.steps_kept, first.steps_kept);
  EXPECT_EQ(LogBytes(files_, "out").size(), once.size());
}

TEST_F(LogRecover, RecoveredLogCanBeContinued) {
  LogBytes bytes = write();
  const PlacedRecord record = bytes.record(RecordKind::step, 9);
  bytes.set_byte(record.offset + 30, 0x31).put(files_, "log");
  recover();
  ToyOptions more = options_;
  more.steps = 60;
  ToyRun run(more);
  while (run.frame().step < 40) run.advance();
  const auto writer = LogWriter::reopen("out", run.frame().view(), untimed(files_));
  while (run.frame().step < 60) {
    run.advance();
    writer->append(run.frame().view(), run.events());
  }
  writer->close();
  const auto reader = LogReader::open("out", &files_);
  EXPECT_EQ(reader->last_step(), 60U);
  EXPECT_EQ(reader->verify().completeness, Completeness::complete);
}

TEST_F(LogRecover, RefusesToWriteOverItsInputOrAnExistingFile) {
  write();
  const auto kind = [&](const std::string& output, bool overwrite) {
    try {
      io::recover("log", output, overwrite, &files_);
    } catch (const LogError& error) {
      return error.kind();
    }
    return ErrorKind::not_found;
  };
  EXPECT_EQ(kind("log", true), ErrorKind::exists);
  write_toy_log("other", options_, untimed(files_));
  EXPECT_EQ(kind("other", false), ErrorKind::exists);
}

TEST_F(LogRecover, EveryRecordSpoiltInTurnLosesNoMoreThanItsOwnRun) {
  const LogBytes whole = write();
  const auto records = whole.records();
  for (std::size_t i = 1; i < records.size(); ++i) {
    LogBytes bytes(whole);
    bytes.set_byte(records[i].offset + 17, 0xaa).put(files_, "log");
    const auto recovery = recover();
    std::uint64_t lost = 0;
    for (const auto& [from, to] : recovery.lost) lost += to - from + 1;
    EXPECT_LE(lost, 8U) << i;
    EXPECT_GE(recovery.steps_kept + 8, 41U) << i;
  }
}

TEST_F(LogRecover, RandomDamageNeverStopsIt) {
  const LogBytes whole = write();
  const std::uint64_t protected_end = whole.record(RecordKind::keyframe).end();
  std::mt19937_64 generator(17);
  for (int round = 0; round < 60; ++round) {
    LogBytes bytes(whole);
    for (std::uint64_t hits = 1 + generator() % 6; hits > 0; --hits) {
      const std::uint64_t at = protected_end + generator() % (bytes.size() - protected_end - 64);
      switch (generator() % 4) {
        case 0: bytes.fill(at, at + generator() % 64, 0); break;
        case 1: bytes.flip_bit(8 * at + generator() % 8); break;
        case 2: bytes.erase(at, at + 8 * (generator() % 6)); break;
        default: bytes.insert(at, std::vector<std::byte>(8 * (generator() % 6), std::byte{0x41}));
      }
    }
    bytes.put(files_, "log");
    recover();
  }
}

}  // namespace varve::test
