// Damage is found wherever it is, named for what it is, and never read as a value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "io/messages.h"
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
using testing::HasSubstr;

namespace {

bool long_form() { return std::getenv("VARVE_LONG") != nullptr; }

ToyOptions small(std::uint64_t steps = 20) {
  ToyOptions options;
  options.beads = 2;
  options.steps = steps;
  options.keyframe_steps = 8;
  options.event_every = 6;
  return options;
}

}  // namespace

class LogDamage : public testing::Test {
 protected:
  // Appends to a log so that it ends at `last`; the states are those of `options`.
  void extend(const std::string& path, const ToyOptions& options, std::uint64_t last) {
    ToyRun run(options);
    const std::uint64_t from = LogReader::open(path, &files_)->last_step();
    while (run.frame().step < from) run.advance();
    const auto writer = LogWriter::reopen(path, run.frame().view(), untimed(files_));
    while (run.frame().step < last) {
      run.advance();
      writer->append(run.frame().view(), run.events());
    }
    writer->close();
  }

  // A log with records of every kind: recovered from damage, continued, closed twice, with a record
  // of an unknown skippable kind at its end.
  LogBytes all_kinds(const ToyOptions& options) {
    const std::uint64_t half = options.steps / 2;
    ToyOptions first = options;
    first.steps = half;
    write_toy_log("first", first, untimed(files_));
    LogBytes damaged(files_, "first");
    damaged.set_byte(damaged.record(RecordKind::step, 2).offset + 200, 0xff);
    damaged.put(files_, "first");
    io::recover("first", "all", true, &files_);
    extend("all", options, options.steps);
    LogBytes bytes(files_, "all");
    const PlacedRecord last = bytes.records().back();
    bytes.append(make_record(next_header(last, static_cast<RecordKind>(0xc5)), text("later")));
    bytes.put(files_, "all");
    return bytes;
  }

  static io::RecordHeader next_header(const PlacedRecord& last, RecordKind kind) {
    io::RecordHeader header = last.header;
    header.kind = kind;
    header.packing = io::Packing::plain;
    ++header.sequence;
    if (last.header.kind == RecordKind::index) header.index_offset = last.offset;
    return header;
  }

  static std::vector<std::byte> text(const std::string& value) {
    const auto bytes = std::as_bytes(std::span(value));
    return {bytes.begin(), bytes.end()};
  }

  ErrorKind open_fails() {
    try {
      LogReader::open("log", &files_);
    } catch (const LogError& error) {
      what_ = error.what();
      return error.kind();
    }
    ADD_FAILURE() << "opened";
    return ErrorKind::exists;
  }

  // Opens and verifies; a log that does not open counts as damaged.
  Completeness verdict() {
    try {
      const auto reader = LogReader::open("log", &files_);
      return reader->verify().completeness;
    } catch (const LogError& error) {
      what_ = error.what();
      return Completeness::damaged;
    }
  }

  MemoryFileSystem files_;
  std::string what_;
};

TEST_F(LogDamage, LogOfAllKindsIsWhole) {
  const LogBytes bytes = all_kinds(small());
  bytes.put(files_, "log");
  std::set<RecordKind> kinds;
  for (const auto& record : bytes.records()) kinds.insert(record.header.kind);
  EXPECT_THAT(kinds, testing::UnorderedElementsAre(
                         RecordKind::genesis, RecordKind::step, RecordKind::keyframe,
                         RecordKind::event, RecordKind::end, RecordKind::gap, RecordKind::index,
                         static_cast<RecordKind>(0xc5)));
  EXPECT_EQ(bytes.records().back().end(), bytes.size());
  const auto verification = LogReader::open("log", &files_)->verify();
  EXPECT_EQ(verification.completeness, Completeness::complete);
  EXPECT_TRUE(verification.damage.empty()) << verification.damage.front().what;
  EXPECT_EQ(verification.bytes_checked, bytes.size());
}

TEST_F(LogDamage, TruncationAtEveryByteKeepsExactlyTheWholeRecordsBeforeIt) {
  const ToyOptions options = small(long_form() ? 400 : 20);
  const auto frames = toy_frames(options);
  const LogBytes whole = all_kinds(options);
  const auto records = whole.records();
  std::uint64_t opens = 0;
  std::optional<std::uint64_t> last_step;
  std::size_t counted = 0;        // records that end at or before the cut
  std::uint64_t solid_end = 0;    // behind the last of them that needs none after it
  for (std::uint64_t cut = 0; cut <= whole.size(); ++cut) {
    for (; counted < records.size() && records[counted].end() <= cut; ++counted) {
      const RecordKind kind = records[counted].header.kind;
      if (io::is_step(kind)) last_step = records[counted].header.step;
      const bool waits = kind == RecordKind::event || kind == RecordKind::gap;  // for its step
      if (!waits) solid_end = records[counted].end();
    }
    LogBytes(whole).truncate(cut).put(files_, "log");
    if (!last_step) {
      const ErrorKind kind = open_fails();
      EXPECT_TRUE(kind == ErrorKind::not_a_log || kind == ErrorKind::damaged) << cut;
      continue;
    }
    ++opens;
    const auto reader = LogReader::open("log", &files_);
    ASSERT_EQ(reader->last_step(), *last_step) << cut;
    ASSERT_EQ(reader->torn_bytes(), cut - solid_end) << cut;
    const Completeness expected =
        cut == solid_end ? Completeness::complete : Completeness::torn;
    ASSERT_EQ(reader->completeness(), expected) << cut;
    if (cut % 16 == 0) {
      ASSERT_EQ(reader->verify().completeness, expected) << cut;
    }
    const auto frame = reader->frame(*last_step);
    ASSERT_TRUE(frame) << cut;
    ASSERT_TRUE(same_frame(*frame, frames.at(*last_step))) << cut;
  }
  RecordProperty("opens", static_cast<int>(opens));
}

TEST_F(LogDamage, TornLogIsCutOnReopenAndEndsEqualToAnUnkilledOne) {
  const ToyOptions options = small();
  write_toy_log("whole", options, untimed(files_));
  const LogBytes whole(files_, "whole");
  const auto chain = LogReader::open("whole", &files_)->header(options.steps)->chain;
  const std::uint64_t first_cut = whole.record(RecordKind::keyframe).end();
  for (std::uint64_t cut = first_cut; cut < whole.size(); cut += long_form() ? 1 : 37) {
    LogBytes(whole).truncate(cut).put(files_, "log");
    const std::uint64_t torn = LogReader::open("log", &files_)->torn_bytes();
    const std::uint64_t from = LogReader::open("log", &files_)->last_step();
    ToyRun run(options);
    while (run.frame().step < from) run.advance();
    const auto writer = LogWriter::reopen("log", run.frame().view(), untimed(files_));
    ASSERT_EQ(writer->cut_bytes(), torn) << cut;
    while (run.frame().step < options.steps) {
      run.advance();
      writer->append(run.frame().view(), run.events());
    }
    writer->close();
    const auto reader = LogReader::open("log", &files_);
    ASSERT_EQ(reader->header(options.steps)->chain, chain) << cut;
    ASSERT_EQ(reader->events(), LogReader::open("whole", &files_)->events()) << cut;
    ASSERT_EQ(verdict(), Completeness::complete) << cut;
  }
}

/// One bit of every byte at a time, so that the long form can use more than one core.
class LogDamageBit : public LogDamage, public testing::WithParamInterface<unsigned> {};

TEST_P(LogDamageBit, FlippedInAnyByteIsDetected) {
  LogBytes bytes = all_kinds(small(long_form() ? 700 : 12));
  if (long_form()) {
    ASSERT_GE(bytes.size(), 256U << 10);
  }
  RecordProperty("flips", static_cast<int>(bytes.size()));
  for (std::uint64_t byte = 0; byte < bytes.size(); ++byte) {
    bytes.flip_bit(8 * byte + GetParam()).put(files_, "log");
    ASSERT_NE(verdict(), Completeness::complete) << "byte " << byte << " of " << bytes.size();
    bytes.flip_bit(8 * byte + GetParam());
  }
  bytes.put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::complete);
}
INSTANTIATE_TEST_SUITE_P(EverySingleBit, LogDamageBit, testing::Range(0U, 8U));

TEST_F(LogDamage, NoBitFlipEverGivesAWrongValue) {
  const ToyOptions options = small();
  const auto frames = toy_frames(options);
  const LogBytes whole = all_kinds(options);
  for (std::uint64_t bit = 3; bit < 8 * whole.size(); bit += long_form() ? 13 : 211) {
    LogBytes(whole).flip_bit(bit).put(files_, "log");
    try {
      const auto reader = LogReader::open("log", &files_);
      for (std::uint64_t step = 0; step <= options.steps; ++step) {
        const auto frame = reader->frame(step);
        if (frame) {
          ASSERT_TRUE(same_frame(*frame, frames.at(step))) << bit << ' ' << step;
        }
      }
      reader->for_each(0, options.steps, [&](const io::StepHeader& header, const io::Frame* frame) {
        EXPECT_TRUE(!frame || same_frame(*frame, frames.at(header.step))) << bit;
        return true;
      });
      for (const auto& event : reader->events()) EXPECT_EQ(event.step % 6, 0U);
    } catch (const LogError& error) {
      EXPECT_NE(error.kind(), ErrorKind::exists);
    }
  }
}

// ---- torn against rot ----

TEST_F(LogDamage, DamageBehindTheLastDurableRecordIsATornTail) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  const auto records = bytes.records();
  const std::uint64_t durable = records.back().header.durable_seq;
  const PlacedRecord& first_unsynced = records[durable + 1];
  ASSERT_TRUE(io::is_step(first_unsynced.header.kind));
  bytes.set_byte(first_unsynced.offset + 130, 0x55).put(files_, "log");

  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->completeness(), Completeness::torn);
  EXPECT_EQ(reader->last_step(), first_unsynced.header.step - 1);
  EXPECT_EQ(reader->torn_bytes(), bytes.size() - first_unsynced.offset)
      << "valid records behind the damage are torn with it";
  EXPECT_EQ(reader->verify().completeness, Completeness::torn);
  extend("log", small(), 20);
  EXPECT_EQ(verdict(), Completeness::complete);
}

TEST_F(LogDamage, DamageInWhatWasDurableIsRotAndNeverCut) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  const auto records = bytes.records();
  const PlacedRecord last_durable = records[records.back().header.durable_seq];
  bytes.set_byte(last_durable.offset + 130, 0x55).put(files_, "log");

  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->completeness(), Completeness::damaged);
  EXPECT_EQ(reader->verify().completeness, Completeness::damaged);
  EXPECT_EQ(reader->last_step(), 20U) << "what lies behind stays readable";
  ToyRun run(small());
  while (run.frame().step < 20) run.advance();
  try {
    LogWriter::reopen("log", run.frame().view(), untimed(files_));
    FAIL() << "reopened";
  } catch (const LogError& error) {
    EXPECT_EQ(error.kind(), ErrorKind::damaged);
    EXPECT_THAT(error.what(), HasSubstr("durable"));
  }
  EXPECT_EQ(files_.content("log"), bytes.bytes());
}

TEST_F(LogDamage, RotInTheMiddleOfAClosedLogIsFoundByWhoeverReadsIt) {
  write_toy_log("log", small(40), untimed(files_));
  const auto frames = toy_frames(small(40));
  LogBytes bytes(files_, "log");
  const PlacedRecord rotten = bytes.record(RecordKind::step, 10);  // step 12
  ASSERT_EQ(rotten.header.step, 12U);
  const std::uint64_t body = rotten.offset + io::header_bytes +
                             io::aligned(rotten.header.message_stored);
  bytes.flip_bit(8 * body + 3).put(files_, "log");

  const auto reader = LogReader::open("log", &files_);
  EXPECT_TRUE(reader->frame(11));
  EXPECT_FALSE(reader->frame(13)) << "a delta upon the lost one";
  EXPECT_EQ(reader->completeness(), Completeness::damaged);
  EXPECT_FALSE(reader->frame(12));
  EXPECT_EQ(reader->stored_step_at_or_before(15), 11U);
  EXPECT_TRUE(reader->frame(16)) << "the next keyframe";
  EXPECT_TRUE(same_frame(*reader->frame(39), frames.at(39)));
  EXPECT_TRUE(reader->header(13)) << "its digest stands by itself";
  const auto verification = reader->verify();
  ASSERT_EQ(verification.damage.size(), 1U);
  EXPECT_EQ(verification.damage[0].step_from, 12U);
  EXPECT_EQ(verification.damage[0].step_to, 15U);
  EXPECT_EQ(verification.damage[0].offset, static_cast<std::int64_t>(rotten.offset));
}

TEST_F(LogDamage, LostIndexCostsNoStep) {
  ToyOptions options = small(1100);
  options.keyframe_steps = 64;
  write_toy_log("log", options, untimed(files_));
  const auto frames = toy_frames(options);
  for (const std::size_t nth : {0U, 1U, 2U}) {
    LogBytes bytes(files_, "log");
    const PlacedRecord index = bytes.record(RecordKind::index, nth);
    LogBytes(bytes).fill(index.offset, index.end(), 0).put(files_, "copy");
    const auto reader = LogReader::open("copy", &files_);
    for (std::uint64_t step = 0; step <= options.steps; step += 97) {
      ASSERT_TRUE(reader->header(step)) << step;
      const auto frame = reader->frame(step);
      ASSERT_TRUE(frame) << step;
      EXPECT_TRUE(same_frame(*frame, frames.at(step)));
    }
    EXPECT_EQ(reader->events(), LogReader::open("log", &files_)->events());
    EXPECT_EQ(reader->step_at_time(frames.at(777).time), 777U);
    EXPECT_EQ(reader->stored_step_at_or_before(700), 700U);
    const auto verification = reader->verify();
    EXPECT_EQ(verification.completeness, Completeness::damaged);
    EXPECT_EQ(verification.steps, options.steps + 1);
    for (const auto& damage : verification.damage) EXPECT_GT(damage.step_from, damage.step_to);
  }
}

TEST_F(LogDamage, LostFirstStepIsNotInvented) {
  write_toy_log("log", small(), untimed(files_));
  LogBytes bytes(files_, "log");
  const PlacedRecord record = bytes.record(RecordKind::keyframe);
  bytes.set_byte(record.offset + 50, 0x77).put(files_, "log");
  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->completeness(), Completeness::damaged);
  EXPECT_EQ(reader->first_step(), 1U);
  EXPECT_FALSE(reader->header(0));
  EXPECT_FALSE(reader->frame(1)) << "a delta upon the lost keyframe";
  EXPECT_TRUE(reader->frame(8));
  EXPECT_EQ(reader->last_step(), 20U);
}

// ---- records out of place ----

TEST_F(LogDamage, RecordLeftOutIsNoticed) {
  write_toy_log("whole", small(), untimed(files_));
  const LogBytes whole(files_, "whole");
  const auto records = whole.records();
  for (std::size_t i = 1; i + 1 < records.size(); ++i) {
    LogBytes(whole).erase_record(records[i]).put(files_, "log");
    EXPECT_EQ(verdict(), Completeness::damaged) << i;
  }
}

TEST_F(LogDamage, RecordRepeatedOrMovedIsRefused) {
  write_toy_log("whole", small(), untimed(files_));
  const LogBytes whole(files_, "whole");
  const auto records = whole.records();
  const PlacedRecord third = whole.record(RecordKind::step, 3);
  const PlacedRecord ninth = whole.record(RecordKind::step, 9);
  const auto third_bytes = whole.slice(third.offset, third.end());
  LogBytes(whole).insert(ninth.offset, third_bytes).put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::damaged);
  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->verify().steps, 21U) << "every record in its place is kept";
  LogBytes(whole).erase_record(ninth).insert(third.offset, whole.slice(ninth.offset, ninth.end()))
      .put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::damaged);
  EXPECT_EQ(LogReader::open("log", &files_)->verify().steps, 20U);
}

TEST_F(LogDamage, AStepThatGoesBackIsDamageToEveryReader) {
  write_toy_log("log", small(), untimed(files_));
  LogBytes bytes(files_, "log");
  const PlacedRecord record = bytes.record(RecordKind::step, 5);
  io::RecordHeader header = record.header;
  const std::uint64_t lost = header.step;
  header.step = lost - 3;
  bytes.set_header(record.offset, header).put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::damaged);
  const auto reader = LogReader::open("log", &files_);
  std::uint64_t before = 0, visited = 0;
  reader->for_each(0, reader->last_step(), [&](const io::StepHeader& step, const io::Frame*) {
    EXPECT_TRUE(visited == 0 || step.step > before) << step.step;
    before = step.step;
    return ++visited < 100;
  });
  EXPECT_EQ(visited, 20U) << "20 of 21 steps";
  EXPECT_EQ(reader->completeness(), Completeness::damaged);
  EXPECT_TRUE(reader->frame(lost - 3));
  EXPECT_FALSE(reader->frame(lost));
}

TEST_F(LogDamage, DamageInFrontOfAnIndexThatWasNotSyncedIsATornTail) {
  // A machine that stops may have written a later page and not an earlier one.
  ToyOptions options = small();
  options.steps = 600;
  io::WriterOptions unsynced = untimed(files_);
  unsynced.keyframe_sync_apart_seconds = 1e6;
  write_toy_log("log", options, unsynced, false);
  LogBytes bytes(files_, "log");
  const auto records = bytes.records();
  const auto index = std::find_if(records.begin(), records.end(), [](const PlacedRecord& record) {
    return record.header.kind == RecordKind::index;
  });
  ASSERT_NE(index, records.end());
  ASSERT_LT(records.back().header.durable_seq, 10U) << "nothing but the start was synced";
  const PlacedRecord& torn = *std::find_if(records.begin() + 20, records.end(), [](const auto& r) {
    return r.header.kind == RecordKind::step;
  });
  ASSERT_LT(torn.offset, index->offset);
  bytes.set_byte(torn.offset + io::header_bytes + 40, 0x55).put(files_, "log");
  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->completeness(), Completeness::torn);
  EXPECT_EQ(reader->last_step(), torn.header.step - 1);
  EXPECT_EQ(reader->verify().completeness, Completeness::torn);
  extend("log", options, 610);
  EXPECT_EQ(verdict(), Completeness::complete);
}

TEST_F(LogDamage, RecordOfAnotherLogIsRefused) {
  write_toy_log("log", small(), untimed(files_));
  LogBytes bytes(files_, "log");
  const PlacedRecord record = bytes.record(RecordKind::step, 5);
  io::RecordHeader header = record.header;
  header.log_id.fill(0x77);
  bytes.set_header(record.offset, header).put(files_, "log");
  const auto verification = LogReader::open("log", &files_)->verify();
  ASSERT_EQ(verification.damage.size(), 1U);
  EXPECT_THAT(verification.damage[0].what, HasSubstr("belongs to log 7777"));
}

TEST_F(LogDamage, ZeroBytesAreNeverARecord) {
  write_toy_log("whole", small(), untimed(files_), false);
  LogBytes bytes(files_, "whole");
  const std::uint64_t before = bytes.size();
  bytes.append(std::vector<std::byte>(4096)).put(files_, "log");
  const auto reader = LogReader::open("log", &files_);
  EXPECT_EQ(reader->completeness(), Completeness::torn);
  EXPECT_EQ(reader->torn_bytes(), 4096U);
  EXPECT_EQ(reader->last_step(), 20U);
  extend("log", small(), 22);
  EXPECT_GT(files_.content("log").size(), before);
  EXPECT_EQ(verdict(), Completeness::complete);
}

// ---- kinds and versions ----

TEST_F(LogDamage, UnknownSkippableRecordIsSkipped) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  bytes.append(make_record(next_header(bytes.records().back(), static_cast<RecordKind>(0x90)),
                           text("stage"), text("a body of its own")));
  bytes.put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::complete);
  EXPECT_EQ(LogReader::open("log", &files_)->last_step(), 20U);
  extend("log", small(), 25);
  EXPECT_EQ(verdict(), Completeness::complete);
  EXPECT_EQ(LogReader::open("log", &files_)->last_step(), 25U);
}

TEST_F(LogDamage, UnknownCriticalRecordIsRefused) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  bytes.append(make_record(next_header(bytes.records().back(), static_cast<RecordKind>(0x21)), {}));
  bytes.put(files_, "log");
  EXPECT_EQ(open_fails(), ErrorKind::unsupported);
  EXPECT_THAT(what_, HasSubstr("0x21"));
}

TEST_F(LogDamage, UnknownCriticalFlagIsRefusedOtherFlagsAreNot) {
  write_toy_log("whole", small(), untimed(files_), false);
  const LogBytes whole(files_, "whole");
  io::RecordHeader header = next_header(whole.records().back(), static_cast<RecordKind>(0x90));
  header.flags |= 0x10000;
  LogBytes(whole).append(make_record(header, text("x"))).put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::complete);
  header.flags |= 0x2;
  LogBytes(whole).append(make_record(header, text("x"))).put(files_, "log");
  EXPECT_EQ(open_fails(), ErrorKind::unsupported);
  EXPECT_THAT(what_, HasSubstr("flags"));
}

TEST_F(LogDamage, OtherFormatVersionIsRefusedByNumber) {
  write_toy_log("log", small(), untimed(files_));
  LogBytes bytes(files_, "log");
  io::RecordHeader header = bytes.records().front().header;
  header.version = 7;
  bytes.set_header(0, header).put(files_, "log");
  EXPECT_EQ(open_fails(), ErrorKind::unsupported);
  EXPECT_THAT(what_, HasSubstr("format version 7"));
  EXPECT_THAT(what_, HasSubstr("reads version 1"));
}

TEST_F(LogDamage, OtherFilesAreNotLogs) {
  files_.set_content("log", {});
  EXPECT_EQ(open_fails(), ErrorKind::not_a_log);
  EXPECT_THAT(what_, HasSubstr("empty"));
  files_.set_content("log", text("[domain]\nwidth = 6 cm\n"));
  EXPECT_EQ(open_fails(), ErrorKind::not_a_log);
  EXPECT_THROW(LogReader::open("nowhere", &files_), LogError);
}

TEST_F(LogDamage, ChecksumsAreAFlagNotAValue) {
  // Without the flag a record is read unverified; with it, zero is a checksum like any other.
  write_toy_log("whole", small(), untimed(files_), false);
  const LogBytes whole(files_, "whole");
  const PlacedRecord last = whole.records().back();
  io::RecordHeader header = last.header;
  header.message_checksum = 0;
  header.body_checksum = 0;
  LogBytes(whole).set_header(last.offset, header).put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::torn);
  header.flags = 0;
  LogBytes(whole).set_header(last.offset, header).put(files_, "log");
  EXPECT_EQ(verdict(), Completeness::complete);
}

TEST_F(LogDamage, ChainThatDoesNotHoldIsNamed) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  const PlacedRecord record = bytes.record(RecordKind::step, 4);
  const std::uint64_t chain_at = record.offset + io::header_bytes + 8 + 32;
  bytes.set_byte(chain_at, 0x77).fix_checksums(record.offset).put(files_, "log");
  const auto verification = LogReader::open("log", &files_)->verify();
  EXPECT_EQ(verification.completeness, Completeness::damaged);
  EXPECT_THAT(verification.damage.at(0).what, HasSubstr("step 5: the chain does not hold"));
}

TEST_F(LogDamage, StateThatDoesNotGiveItsDigestIsRefused) {
  write_toy_log("log", small(), untimed(files_), false);
  LogBytes bytes(files_, "log");
  const PlacedRecord record = bytes.record(RecordKind::step, 4);
  const std::uint64_t digest_at = record.offset + io::header_bytes + 8 + 16;
  bytes.set_byte(digest_at, 0x77).fix_checksums(record.offset).put(files_, "log");
  const auto reader = LogReader::open("log", &files_);
  try {
    reader->frame(5);
    FAIL();
  } catch (const LogError& error) {
    EXPECT_EQ(error.kind(), ErrorKind::damaged);
    EXPECT_THAT(error.what(), HasSubstr("step 5"));
    EXPECT_THAT(error.what(), HasSubstr("digest"));
    EXPECT_EQ(error.offset(), static_cast<std::int64_t>(record.offset));
  }
}

TEST_F(LogDamage, RecordsThatContradictEachOtherAreNamed) {
  write_toy_log("whole", small(), untimed(files_));
  const LogBytes whole(files_, "whole");
  const auto with_header = [&](RecordKind kind, auto&& edit) {
    const PlacedRecord record = whole.record(kind);
    io::RecordHeader header = record.header;
    edit(header);
    LogBytes(whole).set_header(record.offset, header).put(files_, "log");
    const auto verification = LogReader::open("log", &files_)->verify();
    EXPECT_EQ(verification.completeness, Completeness::damaged);
    return verification.damage.empty() ? std::string() : verification.damage[0].what;
  };
  const auto later = [](io::RecordHeader& header) { ++header.step; };
  EXPECT_THAT(with_header(RecordKind::event, later), HasSubstr("an event of step 1 before step 0"));
  EXPECT_THAT(with_header(RecordKind::index, later), HasSubstr("its header says step 21"));
  EXPECT_THAT(with_header(RecordKind::end, later), HasSubstr("its header says step 21"));
  EXPECT_THAT(with_header(RecordKind::keyframe,
                          [](io::RecordHeader& header) { header.kind = RecordKind::step; }),
              HasSubstr("coded upon a state that is not there"));
}

TEST_F(LogDamage, FileThatChangesIntoAnotherLogIsNotBelieved) {
  // Records of a run of the same shape, spliced in: every checksum holds, log id and sequence fit.
  ToyOptions options = small();
  write_toy_log("one", options, untimed(files_), false);
  options.seed = 2;
  write_toy_log("two", options, untimed(files_), false);
  const LogBytes one(files_, "one"), two(files_, "two");
  const auto ours = one.records(), theirs = two.records();
  const std::size_t from = 12;
  ASSERT_EQ(ours[from].header.step, theirs[from].header.step);
  LogBytes(one).truncate(ours[from].offset)
      .append(two.slice(theirs[from].offset, two.size())).put(files_, "log");
  const auto verification = LogReader::open("log", &files_)->verify();
  EXPECT_EQ(verification.completeness, Completeness::damaged);
  EXPECT_THAT(verification.damage.at(0).what, HasSubstr("the chain does not hold"));
}

// Whatever stands in a record, with checksums that hold: an answer or a LogError, never a crash.
TEST_F(LogDamage, HostileBytesBehindGoodChecksumsNeverCrash) {
  const ToyOptions options = small();
  const LogBytes whole = all_kinds(options);
  const auto records = whole.records();
  std::mt19937_64 generator(5);
  const int rounds = long_form() ? 200000 : 2500;
  for (int round = 0; round < rounds; ++round) {
    LogBytes bytes(whole);
    const PlacedRecord& record = records[generator() % records.size()];
    const std::uint64_t inside = record.end() - record.offset - io::header_bytes;
    for (std::uint64_t edits = 1 + generator() % 3; edits > 0; --edits) {
      bytes.set_byte(record.offset + io::header_bytes + generator() % inside,
                     static_cast<std::uint8_t>(generator()));
    }
    bytes.fix_checksums(record.offset).put(files_, "log");
    try {
      const auto reader = LogReader::open("log", &files_);
      reader->verify();
      for (std::uint64_t step = 0; step <= options.steps; step += 5) {
        reader->header(step);
        reader->frame(step);
      }
      reader->events();
      reader->step_at_time(0.01);
    } catch (const LogError&) {
    }
  }
}

}  // namespace varve::test
