// What is written is what is read: states, tables, events, in every tier, by every way of asking.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "toy_run.h"

namespace varve::test {

using io::LogReader;
using io::LogWriter;
using io::MemoryFileSystem;
using io::Tier;

class LogRoundTrip : public testing::Test {
 protected:
  std::unique_ptr<LogReader> record(const ToyOptions& options, bool close = true) {
    write_toy_log("run.varve", options, untimed(files_), close);
    return LogReader::open("run.varve", &files_);
  }

  // Every step in order, at random and backwards equals what was written; digests and chain hold.
  void expect_all_states(const LogReader& reader, const ToyOptions& options) {
    const auto frames = toy_frames(options);
    const io::Schema& schema = reader.genesis().schema;
    io::Digest chain = io::chain_base(schema);
    for (const auto& [step, frame] : frames) {
      const auto header = reader.header(step);
      ASSERT_TRUE(header) << step;
      EXPECT_EQ(header->step, step);
      EXPECT_EQ(header->time, frame.time);
      EXPECT_EQ(header->dt, frame.dt);
      EXPECT_EQ(header->digest, io::digest_frame(schema, frame.view())) << step;
      chain = io::chain_next(chain, header->digest);
      EXPECT_EQ(header->chain, chain) << step;
      ASSERT_EQ(reader.frame(step).has_value(), header->has_state) << step;
      expect_state(reader, options, frame);
    }
    for (auto at = frames.rbegin(); at != frames.rend(); ++at) {
      expect_state(reader, options, at->second);
    }
    std::mt19937 generator(7);
    for (int i = 0; i < 100; ++i) {
      const std::uint64_t step = options.first_step + generator() % (options.steps + 1);
      expect_state(reader, options, frames.at(step));
    }
  }

  // Tables follow by re-execution in the digests tier, so they are not recorded there.
  static void expect_state(const LogReader& reader, const ToyOptions& options, io::Frame expected) {
    const auto read = reader.frame(expected.step);
    if (!read) return;
    if (options.tier == Tier::digests) {
      expected.rows = {0};
      expected.tables = {{{}, {}}};
    }
    EXPECT_TRUE(same_frame(*read, expected)) << expected.step;
  }

  MemoryFileSystem files_;
};

TEST_F(LogRoundTrip, DeltasGiveEveryStateBack) {
  ToyOptions options;
  options.steps = 100;
  const auto reader = record(options);
  EXPECT_EQ(reader->first_step(), 0U);
  EXPECT_EQ(reader->last_step(), 100U);
  EXPECT_TRUE(reader->closed());
  EXPECT_EQ(reader->completeness(), io::Completeness::complete);
  EXPECT_EQ(reader->torn_bytes(), 0U);
  for (std::uint64_t step = 0; step <= 100; ++step) EXPECT_TRUE(reader->header(step)->has_state);
  expect_all_states(*reader, options);
}

TEST_F(LogRoundTrip, LogWithoutEndRecordIsCompleteButNotClosed) {
  ToyOptions options;
  options.steps = 33;
  const auto reader = record(options, false);
  EXPECT_FALSE(reader->closed());
  EXPECT_EQ(reader->completeness(), io::Completeness::complete);
  expect_all_states(*reader, options);
}

TEST_F(LogRoundTrip, SingleStateIsAWholeLog) {
  ToyOptions options;
  options.steps = 0;
  const auto reader = record(options);
  EXPECT_EQ(reader->last_step(), 0U);
  expect_all_states(*reader, options);
  EXPECT_FALSE(reader->header(1));
  EXPECT_FALSE(reader->frame(1));
}

TEST_F(LogRoundTrip, DigestsTierStoresOnlyKeyframes) {
  ToyOptions options;
  options.steps = 70;
  options.tier = Tier::digests;
  const auto reader = record(options);
  for (std::uint64_t step = 0; step <= 70; ++step) {
    EXPECT_EQ(reader->header(step)->has_state, step % 16 == 0) << step;
    EXPECT_EQ(reader->stored_step_at_or_before(step), step / 16 * 16);
  }
  expect_all_states(*reader, options);
}

TEST_F(LogRoundTrip, DeltasEveryThirdStepKeepEveryDigest) {
  ToyOptions options;
  options.steps = 70;
  options.every = 3;
  const auto reader = record(options);
  for (std::uint64_t step = 0; step <= 70; ++step) {
    EXPECT_EQ(reader->header(step)->has_state, step % 3 == 0) << step;
    EXPECT_EQ(reader->stored_step_at_or_before(step), step / 3 * 3);
  }
  expect_all_states(*reader, options);
}

TEST_F(LogRoundTrip, ChangeOfCountMakesAKeyframe) {
  for (const Tier tier : {Tier::deltas, Tier::digests}) {
    ToyOptions options;
    options.steps = 60;
    options.bead_added_every = 7;
    options.tier = tier;
    const auto reader = record(options);
    expect_all_states(*reader, options);
    EXPECT_TRUE(reader->header(7)->has_state);
    EXPECT_EQ(reader->frame(7)->counts[0], 7U);
    files_.remove("run.varve");
  }
}

TEST_F(LogRoundTrip, FirstStepNeedNotBeZero) {
  ToyOptions options;
  options.first_step = 1234567;
  options.steps = 20;
  const auto reader = record(options);
  EXPECT_EQ(reader->first_step(), 1234567U);
  EXPECT_FALSE(reader->header(1234566));
  EXPECT_FALSE(reader->header(0));
  expect_all_states(*reader, options);
}

TEST_F(LogRoundTrip, ForEachVisitsEveryStepOnceInOrder) {
  ToyOptions options;
  options.steps = 60;
  options.every = 2;
  const auto reader = record(options);
  const auto frames = toy_frames(options);
  using Range = std::pair<std::uint64_t, std::uint64_t>;
  for (const auto& [from, to] : {Range{0, 60}, Range{17, 43}, Range{50, 99}}) {
    std::uint64_t next = from;
    reader->for_each(from, to, [&](const io::StepHeader& header, const io::Frame* frame) {
      EXPECT_EQ(header.step, next++);
      EXPECT_EQ(frame != nullptr, header.step % 2 == 0);
      if (frame) {
        EXPECT_TRUE(same_frame(*frame, frames.at(header.step)));
      }
      return true;
    });
    EXPECT_EQ(next, std::min<std::uint64_t>(to, 60) + 1);
  }
  std::uint64_t visited = 0;
  reader->for_each_header(3, 60, [&](const io::StepHeader&) { return ++visited < 5; });
  EXPECT_EQ(visited, 5U);
}

TEST_F(LogRoundTrip, ForEachPartDecodesWhatIsWantedAndNothingElse) {
  ToyOptions options;
  options.steps = 100;
  const auto reader = record(options);
  const auto frames = toy_frames(options);
  for (const char* population : {"bead", "clock"}) {
    for (const std::uint64_t from : {0U, 21U}) {
      io::StatePart part;
      part.populations = {population};
      part.keyframes = from == 0;
      // Whole at 25 and 27 (one segment), then at 71, and at none after.
      part.next_whole = [](std::uint64_t step) -> std::optional<std::uint64_t> {
        for (const std::uint64_t each : {25U, 27U, 71U})
          if (each >= step) return each;
        return std::nullopt;
      };
      std::uint64_t next = from, wholes = 0, without = 0;
      reader->for_each_part(
          from, 100, part, [&](const io::StepHeader& header, const io::Frame* frame, bool whole) {
            EXPECT_EQ(header.step, next++);
            EXPECT_TRUE(frame);
            const io::Frame& expected = frames.at(header.step);
            wholes += whole;
            EXPECT_TRUE(!whole || same_frame(*frame, expected)) << header.step;
            for (std::size_t f = 0; f < frame->fields.size(); ++f) {
              const bool wanted = toy_schema().fields[f].population == population;
              EXPECT_TRUE(!wanted || frame->fields[f] == expected.fields[f]) << header.step;
              without += !wanted && frame->fields[f].empty();
            }
            EXPECT_EQ(frame->tables, expected.tables);
            return true;
          });
      EXPECT_EQ(next, 101U);
      // Keyframes at 0, 16 ... 96.
      EXPECT_EQ(wholes, from == 0 ? 3U + 7U : 3U);
      EXPECT_GT(without, 40U);
    }
  }
}

TEST_F(LogRoundTrip, TablesComeWithTheirStepAndAlone) {
  ToyOptions options;
  options.steps = 40;
  const auto reader = record(options);
  const auto frames = toy_frames(options);
  for (const auto& [step, frame] : frames) {
    const auto tables = reader->tables(step);
    ASSERT_TRUE(tables);
    EXPECT_EQ(tables->rows, frame.rows) << step;
    EXPECT_EQ(tables->tables, frame.tables) << step;
    EXPECT_TRUE(tables->fields.empty());
  }
  EXPECT_FALSE(reader->tables(41));
}

TEST_F(LogRoundTrip, EventsComeBackInOrder) {
  ToyOptions options;
  options.steps = 1500;  // several index records, and a part behind the last
  options.event_every = 100;
  for (const bool close : {true, false}) {
    const auto reader = record(options, close);
    std::vector<io::Event> expected;
    ToyRun run(options);
    for (std::uint64_t i = 0; i <= options.steps; ++i) {
      if (i > 0) run.advance();
      for (const auto& event : run.events()) expected.push_back(event);
    }
    EXPECT_EQ(reader->events(), expected);
    files_.remove("run.varve");
  }
}

TEST_F(LogRoundTrip, GenesisComesBackWhole) {
  ToyOptions options;
  io::Genesis genesis = toy_genesis(options);
  genesis.lineage = io::Lineage{std::string(32, 'a'),
                                "parent.varve",
                                41,
                                io::digest_text("digest"),
                                io::digest_text("chain"),
                                io::digest_text("base"),
                                {{"damping", "0.2", "0.25"}},
                                {std::string(32, 'a'), std::string(32, 'b')}};
  const ToyRun run(options);
  LogWriter::create("fork.varve", genesis, run.frame().view(), {}, untimed(files_))->close();
  const auto reader = LogReader::open("fork.varve", &files_);
  const io::Genesis& read = reader->genesis();
  EXPECT_EQ(read.engine, genesis.engine);
  EXPECT_EQ(read.engine_revision, genesis.engine_revision);
  EXPECT_EQ(read.schema, genesis.schema);
  EXPECT_EQ(read.scenario, genesis.scenario);
  EXPECT_EQ(read.parameters, genesis.parameters);
  EXPECT_EQ(read.models, genesis.models);
  EXPECT_EQ(read.files, genesis.files);
  EXPECT_EQ(read.log_id, genesis.log_id);
  EXPECT_EQ(read.build, genesis.build);
  ASSERT_TRUE(read.lineage);
  EXPECT_EQ(read.lineage->parent_name, "parent.varve");
  EXPECT_EQ(read.lineage->step, 41U);
  EXPECT_EQ(read.lineage->changes, genesis.lineage->changes);
  EXPECT_EQ(read.lineage->ancestors, genesis.lineage->ancestors);
  EXPECT_EQ(read.run_id(), genesis.run_id());
  // A fork's chain goes on from its parent's, not from its own schema.
  EXPECT_EQ(reader->header(0)->chain,
            io::chain_next(genesis.lineage->chain_base, reader->header(0)->digest));
}

TEST_F(LogRoundTrip, StepAtTimeIsTheLastStepNotAfterIt) {
  ToyOptions options;
  options.steps = 700;
  const auto reader = record(options);
  const double dt = reader->header(1)->dt;
  EXPECT_EQ(reader->step_at_time(-1.0), 0U);
  EXPECT_EQ(reader->step_at_time(0.0), 0U);
  EXPECT_EQ(reader->step_at_time(0.999 * dt), 0U);
  EXPECT_EQ(reader->step_at_time(1e9), 700U);
  for (const std::uint64_t step : {1U, 2U, 255U, 511U, 512U, 513U, 699U}) {
    const double time = reader->header(step)->time;
    EXPECT_EQ(reader->step_at_time(time), step);
    EXPECT_EQ(reader->step_at_time(time - 1e-7 * dt), step);
    EXPECT_EQ(reader->step_at_time(time - 1e-3 * dt), step - 1);
    EXPECT_EQ(reader->step_at_time(time + 0.5 * dt), step);
  }
}

TEST_F(LogRoundTrip, ReopenContinuesWithTheSameBytesOfState) {
  ToyOptions options;
  options.steps = 90;
  for (const bool close : {true, false}) {
    ToyOptions half = options;
    half.steps = 41;
    write_toy_log("run.varve", half, untimed(files_), close);
    ToyRun run(options);
    while (run.frame().step < 41) run.advance();
    const auto writer = LogWriter::reopen("run.varve", run.frame().view(), untimed(files_));
    EXPECT_EQ(writer->cut_bytes(), 0U);
    EXPECT_EQ(writer->status().last_step, 41U);
    while (run.frame().step < 90) {
      run.advance();
      writer->append(run.frame().view(), {});
    }
    writer->close();
    const auto reader = LogReader::open("run.varve", &files_);
    expect_all_states(*reader, options);
    const auto verification = reader->verify();
    EXPECT_EQ(verification.completeness, io::Completeness::complete);
    EXPECT_TRUE(verification.damage.empty()) << verification.damage.front().what;
    EXPECT_EQ(verification.steps, 91U);
    EXPECT_EQ(verification.bytes_checked, verification.file_bytes);
    files_.remove("run.varve");
  }
}

TEST_F(LogRoundTrip, ReopenRefusesAnotherState) {
  ToyOptions options;
  write_toy_log("run.varve", options, untimed(files_));
  ToyRun run(options);
  while (run.frame().step < options.steps) run.advance();
  io::Frame other = run.frame();
  other.fields[2][3] ^= std::byte{1};
  const auto before = files_.content("run.varve");
  try {
    LogWriter::reopen("run.varve", other.view(), untimed(files_));
    FAIL();
  } catch (const io::LogError& error) {
    EXPECT_EQ(error.kind(), io::ErrorKind::mismatch);
  }
  EXPECT_EQ(files_.content("run.varve"), before);
}

TEST_F(LogRoundTrip, AppendRefusesFramesThatDoNotFit) {
  ToyOptions options;
  ToyRun run(options);
  const auto writer = LogWriter::create("run.varve", toy_genesis(options), run.frame().view(), {},
                                        untimed(files_));
  run.advance();
  const auto refuses = [&](const io::Frame& frame) {
    try {
      writer->append(frame.view(), {});
      return false;
    } catch (const io::LogError& error) {
      return error.kind() == io::ErrorKind::mismatch;
    }
  };
  io::Frame frame = run.frame();
  frame.step = 2;
  EXPECT_TRUE(refuses(frame)) << "a step left out";
  frame = run.frame();
  frame.fields[2].pop_back();
  EXPECT_TRUE(refuses(frame)) << "too few bytes";
  frame = run.frame();
  frame.counts[1] = 5;
  frame.fields[1].resize(20);
  EXPECT_TRUE(refuses(frame)) << "populations of two counts";
  frame = run.frame();
  frame.fields.pop_back();
  frame.counts.pop_back();
  EXPECT_TRUE(refuses(frame)) << "a field left out";
  EXPECT_FALSE(refuses(run.frame())) << "the writer is still usable";
  writer->close();
  EXPECT_TRUE(refuses(run.frame())) << "closed";
}

TEST_F(LogRoundTrip, CountsByKindAddUpToTheFile) {
  ToyOptions options;
  options.steps = 600;
  options.event_every = 50;
  const auto reader = record(options);
  std::uint64_t stored = 0;
  for (const auto& count : reader->bytes_by_kind()) stored += count.stored;
  EXPECT_EQ(stored, files_.content("run.varve").size());
  const auto fields = reader->bytes_by_field();
  ASSERT_EQ(fields.size(), 7U);
  EXPECT_EQ(fields[2].name, "bead.x");
  EXPECT_EQ(fields[2].raw, 601U * 6 * 16);
  EXPECT_EQ(fields[6].name, "hit");
  EXPECT_EQ(fields[6].records, 120U);
}

// ---- how much must be read ----

class LongLog : public testing::Test {
 protected:
  // A log of many small steps; tables and events make nothing easier, so there are none.
  static void SetUpTestSuite() {
    files_ = new MemoryFileSystem;
    ToyOptions options;
    options.beads = 1;
    options.steps = steps;
    options.with_tables = false;
    options.tier = Tier::digests;
    options.keyframe_steps = 256;
    write_toy_log("long.varve", options, untimed(*files_));
  }
  static void TearDownTestSuite() { delete files_; }

  static constexpr std::uint64_t steps = 100000;
  static MemoryFileSystem* files_;
};
MemoryFileSystem* LongLog::files_ = nullptr;

TEST_F(LongLog, BisectionReadsAtMostTwiceTheLogarithm) {
  const double bound = 2 * std::log2(static_cast<double>(steps)) + 8;
  std::mt19937_64 generator(11);
  std::uint64_t most = 0;
  for (int i = 0; i < 300; ++i) {
    const auto reader = LogReader::open("long.varve", files_);
    const std::uint64_t target = generator() % (steps + 1);
    ASSERT_TRUE(reader->header(reader->first_step()));
    ASSERT_TRUE(reader->header(reader->last_step()));
    std::uint64_t low = reader->first_step();
    std::uint64_t high = reader->last_step();
    while (high - low > 1) {
      const std::uint64_t middle = low + (high - low) / 2;
      ASSERT_EQ(reader->header(middle)->step, middle);
      (middle < target ? low : high) = middle;
    }
    most = std::max(most, reader->header_reads());
    ASSERT_LE(static_cast<double>(reader->header_reads()), bound) << target;
  }
  RecordProperty("header_reads_most", static_cast<int>(most));
}

TEST_F(LongLog, OpeningReadsAHandfulOfRecords) {
  const auto reader = LogReader::open("long.varve", files_);
  EXPECT_EQ(reader->last_step(), steps);
  EXPECT_LE(reader->header_reads(), 6U);
}

TEST_F(LongLog, DigestsTierCostsAtMostTwoHundredBytesPerStep) {
  const auto reader = LogReader::open("long.varve", files_);
  std::uint64_t keyframes = 0;
  std::uint64_t rest = 0;
  for (const auto& count : reader->bytes_by_kind()) {
    (count.name == "keyframe" ? keyframes : rest) += count.stored;
  }
  EXPECT_LE(static_cast<double>(rest) / static_cast<double>(steps), 200.0);
}

}  // namespace varve::test
