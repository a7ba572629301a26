// Recording, seeking and replaying, with a foreign engine: nothing here knows of particles.
#include "tools/recording.h"

#include <memory>

#include <gtest/gtest.h>

#include "io/digest.h"
#include "io/errors.h"
#include "tests/tools/process.h"
#include "tests/tools/toy_engine.h"

namespace varve::tools {
namespace {

using testing::HeatRod;

bool always(const io::FrameView&) { return true; }

/// A rod that goes wrong at one step: in a temperature, in what it reports, or altogether.
class FaultyRod : public HeatRod {
 public:
  enum class Fault { state, table, event, failure };
  FaultyRod(Fault fault, std::uint64_t step) : fault_(fault), at_(step) {}

  void advance() override {
    if (fault_ == Fault::failure && HeatRod::frame().step + 1 == at_)
      throw EngineFailure("the rod melted", {{"criterion", "temperature"}});
    HeatRod::advance();
    bytes_.clear();
    events_.clear();
    if (HeatRod::frame().step != at_) return;
    const io::FrameView view = HeatRod::frame();
    const auto source = fault_ == Fault::table ? view.tables[0].columns[1] : view.fields[2].bytes;
    bytes_.assign(source.begin(), source.end());
    const std::size_t which = fault_ == Fault::table ? 0 : 3;  // the fourth cell
    bytes_[which * sizeof(double)] ^= std::byte{1};
    if (fault_ == Fault::event) events_.push_back({at_, "spark", {{"cell", "3"}}});
  }
  io::FrameView frame() const override {
    io::FrameView view = HeatRod::frame();
    if (!bytes_.empty() && fault_ == Fault::state) view.fields[2].bytes = bytes_;
    if (!bytes_.empty() && fault_ == Fault::table) view.tables[0].columns[1] = bytes_;
    return view;
  }
  const std::vector<io::Event>& events() const override {
    return fault_ == Fault::event && !events_.empty() ? events_ : HeatRod::events();
  }

 private:
  Fault fault_;
  std::uint64_t at_;
  std::vector<std::byte> bytes_;
  std::vector<io::Event> events_;
};

class RecordingTest : public ::testing::Test {
 protected:
  /// Records `steps` steps of a rod.
  std::string record_rod(const std::string& name, std::uint64_t steps,
                         io::Tier tier = io::Tier::deltas, std::uint32_t every = 1) {
    const std::string path = folder_ / name;
    HeatRod rod;
    io::Genesis genesis = testing::rod_genesis(rod);
    genesis.tier = tier;
    genesis.every = every;
    auto writer = io::LogWriter::create(path, genesis, rod.frame(), {});
    const RecordingResult result = record(rod, *writer, {steps, {}}, always);
    EXPECT_EQ(result.reason, StopReason::reached);
    EXPECT_EQ(result.last_step, steps);
    return path;
  }

  static io::Digest digest_after(std::uint64_t steps) {
    HeatRod rod;
    for (std::uint64_t i = 0; i < steps; ++i) rod.advance();
    return io::digest_frame(rod.schema(), rod.frame());
  }

  test::TemporaryFolder folder_;
};

TEST_F(RecordingTest, EveryStepIsRecordedWithItsDigestTablesAndEvents) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 100));
  EXPECT_EQ(log->first_step(), 0u);
  EXPECT_EQ(log->last_step(), 100u);
  HeatRod rod;
  for (std::uint64_t step = 0;; ++step) {
    const auto header = log->header(step);
    ASSERT_TRUE(header);
    EXPECT_EQ(header->digest, io::digest_frame(rod.schema(), rod.frame())) << step;
    const auto tables = log->tables(step);
    ASSERT_TRUE(tables);
    EXPECT_FALSE(first_table_difference(rod.schema(), tables->view(), rod.frame())) << step;
    if (step == 100) break;
    rod.advance();
  }
  const std::vector<io::Event> events = {{40, "cell_added", {{"id", "24"}}},
                                         {50, "cell_removed", {{"id", "0"}}},
                                         {64, "annotation", {{"text", "24 cells"}}},
                                         {80, "cell_added", {{"id", "25"}}},
                                         {100, "cell_removed", {{"id", "1"}}}};
  EXPECT_EQ(log->events(), events);
}

TEST_F(RecordingTest, EveryStepIsReachedInEveryTier) {
  const std::string paths[] = {record_rod("a.varve", 70),
                               record_rod("b.varve", 70, io::Tier::deltas, 7),
                               record_rod("c.varve", 70, io::Tier::digests)};
  for (const std::string& path : paths) {
    const auto log = io::LogReader::open(path);
    for (std::uint64_t step = 0; step <= 70; ++step) {
      HeatRod rod;
      const std::uint64_t executed = seek(*log, step, rod);
      EXPECT_EQ(executed, rod.executed);
      EXPECT_EQ(executed, step - *log->stored_step_at_or_before(step)) << path << " " << step;
      EXPECT_EQ(io::digest_frame(rod.schema(), rod.frame()), digest_after(step));
      const io::Frame frame =
          state_at(*log, step, [] { return std::make_unique<HeatRod>(); });
      EXPECT_EQ(io::digest_frame(rod.schema(), frame.view()), digest_after(step));
    }
  }
}

TEST_F(RecordingTest, SeekRefusesAStepThatIsNotThere) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 10));
  HeatRod rod;
  try {
    seek(*log, 11, rod);
    FAIL() << "expected an error";
  } catch (const io::LogError& error) {
    EXPECT_EQ(error.kind(), io::ErrorKind::not_found);
    EXPECT_NE(std::string(error.what()).find("0 to 10"), std::string::npos) << error.what();
  }
}

TEST_F(RecordingTest, ReplayExecutesEveryStepAndAgrees) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 90, io::Tier::deltas, 5));
  HeatRod rod;
  const ReplayResult result = replay(*log, rod, 0, 90, always);
  EXPECT_FALSE(result.first);
  EXPECT_EQ(result.steps_checked, 91u);
  EXPECT_EQ(rod.executed, 90u);

  HeatRod other;
  const ReplayResult part = replay(*log, other, 37, 52, always);
  EXPECT_FALSE(part.first);
  EXPECT_EQ(part.started_at, 35u);  // the nearest stored state
  EXPECT_EQ(part.last_step, 52u);
  EXPECT_EQ(other.executed, 17u);
}

TEST_F(RecordingTest, ReplayNamesStepFieldAndParticle) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 60));
  FaultyRod rod(FaultyRod::Fault::state, 43);
  const ReplayResult result = replay(*log, rod, 0, 60, always);
  ASSERT_TRUE(result.first);
  EXPECT_EQ(result.first->step, 43u);
  EXPECT_EQ(result.first->field, "rod.temperature");
  EXPECT_EQ(result.first->particle, "3");
  EXPECT_EQ(result.first->ulp, 1u);
  EXPECT_NE(result.first->recorded, result.first->computed);
  EXPECT_EQ(result.first->recorded_digest, log->header(43)->digest);
  EXPECT_NE(describe(*result.first).find("step 43"), std::string::npos);
}

TEST_F(RecordingTest, ReplayNamesTheStepAloneWhereOnlyDigestsAreStored) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 60, io::Tier::digests));
  FaultyRod rod(FaultyRod::Fault::state, 43);
  const ReplayResult result = replay(*log, rod, 0, 60, always);
  ASSERT_TRUE(result.first);
  EXPECT_EQ(result.first->step, 43u);
  EXPECT_EQ(result.first->field, "");
}

TEST_F(RecordingTest, ReplayComparesTablesAndEvents) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 60));
  FaultyRod table(FaultyRod::Fault::table, 20);
  const ReplayResult in_table = replay(*log, table, 0, 60, always);
  ASSERT_TRUE(in_table.first);
  EXPECT_EQ(in_table.first->step, 20u);
  EXPECT_EQ(in_table.first->field, "hot.temperature");
  EXPECT_EQ(in_table.first->row, 0u);

  FaultyRod event(FaultyRod::Fault::event, 30);
  const ReplayResult in_event = replay(*log, event, 0, 60, always);
  ASSERT_TRUE(in_event.first);
  EXPECT_EQ(in_event.first->step, 30u);
  EXPECT_EQ(in_event.first->field, "events");
  EXPECT_EQ(in_event.first->recorded, "none");
  EXPECT_EQ(in_event.first->computed, "spark cell=3");
}

TEST_F(RecordingTest, ReplayThatFailsWhereTheRecordDidNotIsADifference) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 60));
  FaultyRod rod(FaultyRod::Fault::failure, 25);
  const ReplayResult result = replay(*log, rod, 0, 60, always);
  ASSERT_TRUE(result.first);
  EXPECT_EQ(result.first->step, 25u);
  EXPECT_EQ(result.first->computed, "the rod melted");
}

TEST_F(RecordingTest, SeekByAnEngineThatDiffersIsADivergence) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 60, io::Tier::digests));
  FaultyRod rod(FaultyRod::Fault::state, 19);
  try {
    seek(*log, 25, rod);
    FAIL() << "expected a divergence";
  } catch (const Divergence& divergence) {
    EXPECT_EQ(divergence.mismatch.step, 19u);
    EXPECT_EQ(divergence.code(), exit_differ);
  }
}

TEST_F(RecordingTest, AFailureKeepsEveryGoodStep) {
  const std::string path = folder_ / "rod.varve";
  FaultyRod rod(FaultyRod::Fault::failure, 25);
  auto writer = io::LogWriter::create(path, testing::rod_genesis(rod), rod.frame(), {});
  const RecordingResult result = record(rod, *writer, {60, {}}, always);
  EXPECT_EQ(result.reason, StopReason::failed);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->details[0].second, "temperature");
  const auto log = io::LogReader::open(path);
  EXPECT_EQ(log->last_step(), 24u);
  EXPECT_TRUE(log->closed());
}

TEST_F(RecordingTest, StoppedAndContinuedEqualsUninterrupted) {
  const auto whole = io::LogReader::open(record_rod("whole.varve", 90));
  const std::string path = folder_ / "parts.varve";
  {
    HeatRod rod;
    auto writer = io::LogWriter::create(path, testing::rod_genesis(rod), rod.frame(), {});
    const auto result = record(rod, *writer, {90, {}},
                               [](const io::FrameView& frame) { return frame.step < 33; });
    EXPECT_EQ(result.reason, StopReason::asked);
    EXPECT_EQ(result.last_step, 33u);
  }
  HeatRod rod;
  {
    const auto log = io::LogReader::open(path);
    seek(*log, log->last_step(), rod);
  }
  auto writer = io::LogWriter::reopen(path, rod.frame());
  record(rod, *writer, {90, {}}, always);
  const auto parts = io::LogReader::open(path);
  ASSERT_EQ(parts->last_step(), 90u);
  for (std::uint64_t step = 0; step <= 90; ++step)
    EXPECT_EQ(parts->header(step)->chain, whole->header(step)->chain) << step;
}

TEST_F(RecordingTest, TargetByTimeIsTheFirstStepNotBeforeIt) {
  const std::string path = folder_ / "rod.varve";
  HeatRod rod;  // half a second a step
  auto writer = io::LogWriter::create(path, testing::rod_genesis(rod), rod.frame(), {});
  EXPECT_EQ(record(rod, *writer, {{}, 10.2}, always).last_step, 21u);
}

class ForkOfStep : public RecordingTest, public ::testing::WithParamInterface<std::uint64_t> {};

TEST_P(ForkOfStep, WithoutAChangeHasItsParentsChain) {
  const auto parent = io::LogReader::open(record_rod("parent.varve", 80));
  HeatRod rod;
  seek(*parent, GetParam(), rod);
  const std::string path = folder_ / "child.varve";
  io::Genesis genesis = testing::rod_genesis(rod);
  genesis.lineage = make_lineage(*parent, GetParam(), {});
  EXPECT_EQ(genesis.lineage->parent_chain, parent->header(GetParam())->chain);
  auto writer = io::LogWriter::create(path, genesis, rod.frame(), {});
  record(rod, *writer, {80, {}}, always);
  const auto child = io::LogReader::open(path);
  EXPECT_EQ(child->first_step(), GetParam());
  for (std::uint64_t step = GetParam(); step <= 80; ++step)
    EXPECT_EQ(child->header(step)->chain, parent->header(step)->chain) << step;

  // A fork of the fork at its first step goes back to the same base.
  EXPECT_EQ(make_lineage(*child, GetParam(), {}).chain_base, genesis.lineage->chain_base);
  EXPECT_EQ(make_lineage(*child, GetParam(), {}).ancestors.size(), 2u);
}
INSTANTIATE_TEST_SUITE_P(FirstSecondKeyframeMiddleLast, ForkOfStep,
                         ::testing::Values(0, 1, 16, 41, 80));

TEST_F(RecordingTest, AChangeIsRecordedAndDiffersFromTheParent) {
  const auto parent = io::LogReader::open(record_rod("parent.varve", 80));
  HeatRod rod;
  seek(*parent, 30, rod);
  rod.change({{"knob.conductivity", "0.3"}});
  const std::string path = folder_ / "child.varve";
  io::Genesis genesis = testing::rod_genesis(rod);
  genesis.lineage = make_lineage(*parent, 30, {{"knob.conductivity", "0.2", "0.3"}});
  auto writer = io::LogWriter::create(path, genesis, rod.frame(), rod.events());
  record(rod, *writer, {80, {}}, always);
  const auto child = io::LogReader::open(path);
  EXPECT_NE(child->header(30)->chain, parent->header(30)->chain);  // the knob is part of the state
  ASSERT_FALSE(child->events().empty());
  EXPECT_EQ(child->events()[0].kind, "change");
  HeatRod again;
  EXPECT_FALSE(replay(*child, again, 30, 80, always).first);
}

TEST_F(RecordingTest, LogsOfOtherEnginesAndRevisionsAreRefused) {
  const auto log = io::LogReader::open(record_rod("rod.varve", 3));
  EXPECT_NO_THROW(require_same_engine(*log, "heat rod", 1, ""));
  EXPECT_THROW(require_same_engine(*log, "varve", 1, ""), UsageError);
  try {
    require_same_engine(*log, "heat rod", 2, "");
    FAIL() << "expected an error";
  } catch (const UsageError& error) {
    EXPECT_NE(std::string(error.what()).find("recorded by engine revision 1, this is 2"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace varve::tools
