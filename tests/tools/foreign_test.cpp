// An engine that is not varve's, and the verbs on its logs: they read fields, particles and events
// by the names that it gave them.
#include <filesystem>
#include <fstream>
#include <memory>

#include <gtest/gtest.h>

#include "tests/tools/toy_engine.h"
#include "tests/tools/verbs.h"
#include "tools/recording.h"

namespace varve::tools {
namespace {

using test::Json;
using test::json_verb;
using test::verb;
using test::whole;
using testing::HeatRod;

bool always(const io::FrameView&) { return true; }

class ForeignEngine : public ::testing::Test {
 protected:
  static constexpr std::uint64_t steps = 120;

  std::string record_rod(const std::string& name, io::Tier tier = io::Tier::deltas,
                         std::uint32_t every = 1) {
    HeatRod rod;
    io::Genesis genesis = testing::rod_genesis(rod);
    genesis.tier = tier;
    genesis.every = every;
    const std::string path = folder_ / name;
    const auto writer = io::LogWriter::create(path, genesis, rod.frame(), rod.events());
    record(rod, *writer, {steps, {}}, always);
    return path;
  }

  /// A fork at `step`; `spoil` may change the state that it goes on from.
  std::string fork_rod(const std::string& parent_path, std::uint64_t step, const std::string& name,
                       const std::vector<io::Setting>& settings = {},
                       const std::function<void(io::Frame&)>& spoil = nullptr) {
    const auto parent = io::LogReader::open(parent_path);
    HeatRod rod;
    seek(*parent, step, rod);
    if (spoil) {
      io::Frame frame = io::Frame::copy_of(rod.frame());
      spoil(frame);
      rod.restore(frame.view());
    }
    rod.change(settings);
    io::Genesis genesis = testing::rod_genesis(rod);
    std::vector<io::Lineage::Change> changes;
    for (const auto& [key, value] : settings) changes.push_back({key, "0.2", value});
    genesis.lineage = make_lineage(*parent, step, changes);
    const std::string path = folder_ / name;
    const auto writer = io::LogWriter::create(path, genesis, rod.frame(), rod.events());
    record(rod, *writer, {steps, {}}, always);
    return path;
  }

  test::TemporaryFolder folder_;
};

TEST_F(ForeignEngine, InfoNamesItsFieldsAndEvents) {
  const Json info = json_verb(0, {"info", record_rod("rod.varve")});
  EXPECT_EQ(info["engine"], "heat rod");
  EXPECT_EQ(info["steps"], "120");
  EXPECT_EQ(info["particles"]["rod"], "25");  // 24, three added, two removed
  EXPECT_TRUE(info["bytes"]["by_field"].contains("rod.temperature"));
  EXPECT_TRUE(info["bytes"]["by_field"].contains("knob.conductivity"));
  std::vector<std::string> kinds;
  for (const Json& event : info["events"]) kinds.push_back(event["kind"]);
  const std::vector<std::string> expected = {"cell_added", "cell_removed", "annotation",
                                             "cell_added", "cell_removed", "cell_added"};
  EXPECT_EQ(kinds, expected);
  EXPECT_EQ(info["events"][2]["items"]["text"], "24 cells");
}

TEST_F(ForeignEngine, ShowHasItsValuesWhereCellsCameAndWent) {
  const std::string path = record_rod("rod.varve");
  HeatRod rod;
  for (const std::uint64_t step : {0, 39, 40, 49, 50, 64, 100, 120}) {
    while (rod.frame().step < step) rod.advance();
    const Json shown = json_verb(0, {"show", path, "--at", std::to_string(step)});
    EXPECT_EQ(shown["digest"], io::digest_frame(rod.schema(), rod.frame()).hex()) << step;
    const io::FrameView frame = rod.frame();
    ASSERT_EQ(shown["fields"]["rod.temperature"].size(), frame.fields[2].count) << step;
    std::vector<double> temperature(frame.fields[2].count);
    std::memcpy(temperature.data(), frame.fields[2].bytes.data(), frame.fields[2].bytes.size());
    EXPECT_EQ(shown["fields"]["rod.temperature"].get<std::vector<double>>(), temperature) << step;
    EXPECT_EQ(shown["units"]["rod.temperature"], "K");
  }
  // A cell is found by its id, also where that is no longer its index.
  const Json one = json_verb(0, {"show", path, "--at", "last", "--particle", "rod:25"});
  EXPECT_EQ(one["fields"]["rod.id"], Json::parse(R"(["25"])"));
  verb(2, {"show", path, "--at", "last", "--particle", "rod:0"});  // removed at step 50
  verb(0, {"show", path, "--at", "49", "--particle", "rod:0"});
}

TEST_F(ForeignEngine, AStateThatIsNotStoredNeedsItsOwnEngine) {
  const std::string path = record_rod("digests.varve", io::Tier::digests);
  verb(0, {"show", path, "--at", "32"});  // a keyframe
  EXPECT_NE(verb(2, {"show", path, "--at", "33"}).errors.find("recorded by the engine 'heat rod'"),
            std::string::npos);
  EXPECT_NE(verb(2, {"replay", path}).errors.find("heat rod"), std::string::npos);
}

TEST_F(ForeignEngine, VerifyAndDigestHoldAndDigestFilesCompare) {
  const std::string path = record_rod("rod.varve"), file = folder_ / "rod.digest";
  const Json verified = json_verb(0, {"verify", path});
  EXPECT_EQ(verified["verdict"], "complete");
  EXPECT_EQ(whole(verified["bytes_checked"]), std::filesystem::file_size(path));
  verb(0, {"digest", path, "--every", "10", "-o", file});
  EXPECT_EQ(json_verb(0, {"diff", record_rod("again.varve"), file})["verdict"], "identical");
  const std::string other = fork_rod(path, 60, "other.varve", {{"knob.conductivity", "0.3"}});
  verb(1, {"diff", other, file});
}

TEST_F(ForeignEngine, DiffNamesFieldAndCell) {
  const std::string path = record_rod("rod.varve");
  EXPECT_EQ(json_verb(0, {"diff", path, fork_rod(path, 70, "same.varve")})["verdict"],
            "identical");

  const std::string knob = fork_rod(path, 70, "knob.varve", {{"knob.conductivity", "0.3"}});
  const Json turned = json_verb(1, {"diff", path, knob})["first"];
  EXPECT_EQ(turned["step"], "70");
  EXPECT_EQ(turned["field"], "knob.conductivity");

  const std::string bit =
      fork_rod(path, 70, "bit.varve", {}, [](io::Frame& frame) {
        frame.fields[2][5 * sizeof(double)] ^= std::byte{1};  // the sixth cell: 0 is gone by now
      });
  const Json found = json_verb(1, {"diff", path, bit})["first"];
  EXPECT_EQ(found["step"], "70");
  EXPECT_EQ(found["field"], "rod.temperature");
  EXPECT_EQ(found["particle"], "6");
  EXPECT_EQ(found["ulp"], "1");
}

TEST_F(ForeignEngine, DiffNamesACellThatIsMissing) {
  const std::string path = record_rod("rod.varve");
  const std::string shorter = fork_rod(path, 70, "shorter.varve", {}, [](io::Frame& frame) {
    for (const std::size_t field : {1, 2}) {
      frame.fields[field].erase(frame.fields[field].begin() + 3 * 8,
                                frame.fields[field].begin() + 4 * 8);
      --frame.counts[field];
    }
  });
  const Json first = json_verb(1, {"diff", path, shorter})["first"];
  EXPECT_EQ(first["step"], "70");
  EXPECT_EQ(first["particle"], "4");
}

TEST_F(ForeignEngine, RecoverKeepsItsEventsOnBothSidesOfDamage) {
  const std::string path = record_rod("rod.varve"), broken = folder_ / "broken.varve";
  std::filesystem::copy_file(path, broken);
  {  // In the middle: the remark of step 64 and the cells before it lie on one side or the other.
    std::fstream file(broken, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path) / 2));
    file.write("damage", 6);
  }
  verb(4, {"verify", broken});
  const std::string saved = folder_ / "saved.varve";
  const Json recovered = json_verb(4, {"recover", broken, "-o", saved});
  ASSERT_FALSE(recovered["lost"].empty()) << recovered;
  verb(0, {"verify", saved});
  const Json before = json_verb(0, {"info", path}), after = json_verb(0, {"info", saved});
  EXPECT_EQ(after["engine"], "heat rod");
  EXPECT_EQ(after["final_chain"], before["final_chain"]);
  // Nothing but the damaged record may be missing.
  EXPECT_GE(after["events"].size() + 1, before["events"].size());
  EXPECT_EQ(after["events"].back(), before["events"].back());
  EXPECT_EQ(after["events"].front(), before["events"].front());
}

class TierOf : public ForeignEngine,
               public ::testing::WithParamInterface<std::pair<io::Tier, std::uint32_t>> {};

TEST_P(TierOf, ARodReplaysAndForksThroughTheInterface) {
  const auto [tier, every] = GetParam();
  const std::string path = record_rod("rod.varve", tier, every);
  const auto log = io::LogReader::open(path);
  HeatRod rod;
  const ReplayResult result = replay(*log, rod, 0, steps, always);
  EXPECT_FALSE(result.first) << describe(*result.first);
  EXPECT_EQ(result.steps_checked, steps + 1);

  for (const std::uint64_t step : {0, 40, 50, 63, 64, 120}) {
    const std::string child = fork_rod(path, step, "child.varve");
    EXPECT_EQ(json_verb(0, {"diff", path, child})["verdict"], "identical") << step;
    EXPECT_EQ(json_verb(0, {"info", child})["lineage"]["step"], std::to_string(step));
    std::filesystem::remove(child);
  }
}
INSTANTIATE_TEST_SUITE_P(All, TierOf,
                         ::testing::Values(std::pair{io::Tier::deltas, 1u},
                                           std::pair{io::Tier::deltas, 7u},
                                           std::pair{io::Tier::digests, 1u}));

TEST_F(ForeignEngine, ADifferentRemarkIsNoDivergenceADifferentRemovalIs) {
  class Talkative : public HeatRod {
   public:
    explicit Talkative(std::string kind) : kind_(std::move(kind)) {}
    void advance() override {
      HeatRod::advance();
      events_ = HeatRod::events();
      if (HeatRod::frame().step == 70) events_.push_back({70, kind_, {{"id", "3"}}});
    }
    const std::vector<io::Event>& events() const override { return events_; }

   private:
    std::string kind_;
    std::vector<io::Event> events_;
  };
  const auto log = io::LogReader::open(record_rod("rod.varve"));
  Talkative remark("annotation"), removal("cell_removed");
  EXPECT_FALSE(replay(*log, remark, 0, steps, always).first);
  const ReplayResult result = replay(*log, removal, 0, steps, always);
  ASSERT_TRUE(result.first);
  EXPECT_EQ(result.first->field, "events");
  EXPECT_EQ(result.first->step, 70u);
}

}  // namespace
}  // namespace varve::tools
