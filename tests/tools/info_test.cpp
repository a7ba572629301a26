#include <chrono>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"

namespace varve::tools {
namespace {

using test::run_command;
using test::toy_frames;
using test::toy_genesis;
using test::write_log;
using testing::HasSubstr;
using testing::StartsWith;

class InfoVerb : public testing::Test {
 protected:
  void SetUp() override {
    genesis_.scenario = "[toy]\nstiffness = 40  # with a comment\n\ttab, \"quotes\" and ö\n";
    write_log(path_, genesis_, frames_, nullptr, {{9, "annotation", {{"text", "look here"}}}});
  }
  nlohmann::json json() {
    const auto result = run_command({"varve-info", path_, "--json"});
    EXPECT_EQ(result.code, 0) << result.errors;
    return nlohmann::json::parse(result.output);
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "a.varve";
  std::vector<io::Frame> frames_ = toy_frames({});
  io::Genesis genesis_ = toy_genesis();
};

TEST_F(InfoVerb, JsonHasTheKeysThatScriptsRelyOn) {
  const auto info = json();
  EXPECT_EQ(info["schema"], "varve.info/1");
  EXPECT_EQ(info["steps"], "40");
  EXPECT_DOUBLE_EQ(info["time_s"].get<double>(), 0.04);
  EXPECT_EQ(info["tier"], "deltas");
  EXPECT_EQ(info["completeness"], "complete");
  EXPECT_EQ(info["closed"], true);
  EXPECT_EQ(info["particles"]["bead"], "12");
  EXPECT_FALSE(info["particles"].contains("link")) << "links come and go: no particles";
  EXPECT_TRUE(info["lineage"].is_null());
  EXPECT_EQ(info["models"]["beads"], "there are some");
  EXPECT_EQ(info["parameters"]["toy.stiffness"], "40");
  EXPECT_EQ(info["events"][0]["items"]["text"], "look here");
  EXPECT_EQ(info["build"]["compiler"], "by hand");
  io::Digest chain = io::chain_base(genesis_.schema);
  for (const io::Frame& frame : frames_)
    chain = io::chain_next(chain, io::digest_frame(genesis_.schema, frame.view()));
  EXPECT_EQ(info["final_chain"], chain.hex());
}

TEST_F(InfoVerb, BytesAddUpToTheFile) {
  const auto bytes = json()["bytes"];
  std::uint64_t sum = 0;
  for (const auto& [kind, entry] : bytes["by_kind"].items())
    sum += std::stoull(entry["stored"].get<std::string>());
  EXPECT_EQ(sum, std::filesystem::file_size(path_));
  EXPECT_EQ(std::stoull(bytes["total"].get<std::string>()), sum);
  EXPECT_DOUBLE_EQ(bytes["per_particle_step"].get<double>(), static_cast<double>(sum) / (41 * 12));
  EXPECT_TRUE(bytes["by_field"].contains("bead.velocity"));
}

TEST_F(InfoVerb, TheScenarioIsPrintedToTheByte) {
  const auto result = run_command({"varve-info", path_, "--scenario"});
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.output, genesis_.scenario);
}

TEST_F(InfoVerb, TheTextNamesWhatMatters) {
  const auto result = run_command({"varve-info", path_});
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.errors, "");
  EXPECT_THAT(result.output,
              StartsWith(path_ + ": 40 steps (0 to 40), t=0.04 s, complete, closed"));
  for (const char* part : {"particles: 12 bead\n", "final chain ", "bytes per particle-step",
                           "bead.velocity", "lineage: none", "toy.stiffness", "there are some",
                           "step 9 annotation text=look here", "compiler"})
    EXPECT_THAT(result.output, HasSubstr(part));
}

TEST_F(InfoVerb, AForkNamesParentStepAndChanges) {
  const std::string child = folder_ / "child.varve";
  write_log(child, test::fork_genesis(genesis_, frames_, 30, {{"toy.stiffness", "40", "45"}}),
            {frames_.begin() + 30, frames_.end()});
  const auto result = run_command({"varve-info", child, "--json"});
  const auto lineage = nlohmann::json::parse(result.output)["lineage"];
  EXPECT_EQ(lineage["parent"], genesis_.run_id());
  EXPECT_EQ(lineage["step"], "30");
  EXPECT_EQ(lineage["digest"], io::digest_frame(genesis_.schema, frames_[30].view()).hex());
  EXPECT_EQ(lineage["changes"][0]["key"], "toy.stiffness");
  EXPECT_THAT(
      run_command({"varve-info", child}).output,
      HasSubstr("lineage: fork of parent.varve (run " + genesis_.run_id() + ") at step 30"));
}

TEST_F(InfoVerb, ATornLogIsReadWithAWarning) {
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 9);
  const auto result = run_command({"varve-info", path_, "--json"});
  const auto info = nlohmann::json::parse(result.output);
  EXPECT_EQ(info["closed"], false);
  if (info["completeness"] == "torn") {
    EXPECT_EQ(result.code, 0);
    EXPECT_THAT(result.errors, HasSubstr("torn"));
  } else {
    EXPECT_EQ(result.code, 4);
  }
}

TEST_F(InfoVerb, FollowingAClosedLogEndsAtOnce) {
  const auto result = run_command({"varve-info", path_, "--follow"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.output, StartsWith("step 40 t=0.04 s chain "));
}

TEST_F(InfoVerb, FollowingAGrowingLogShowsNewStepsUntilItIsClosed) {
  const std::string growing = folder_ / "growing.varve";
  const auto writer = io::LogWriter::create(growing, genesis_, frames_.front().view(), {});
  for (std::size_t k = 1; k < 20; ++k) writer->append(frames_[k].view(), {});
  writer->flush();
  test::CommandResult result;
  std::thread follower([&] {
    result = run_command({"varve-info", growing, "--follow", "--patience", "20"});
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  for (std::size_t k = 20; k < frames_.size(); ++k) writer->append(frames_[k].view(), {});
  writer->close();
  follower.join();
  EXPECT_EQ(result.code, 0) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("step 40 t=0.04 s"));
}

TEST_F(InfoVerb, WrongInputsHaveTheirExitCodes) {
  EXPECT_EQ(run_command({"varve-info"}).code, 2);
  EXPECT_EQ(run_command({"varve-info", folder_ / "missing"}).code, 2);
  EXPECT_EQ(run_command({"varve-info", folder_.path()}).code, 2);
  EXPECT_EQ(run_command({"varve-info", folder_.write("empty", "")}).code, 4);
  EXPECT_EQ(run_command({"varve-info", folder_.write("text", "some text of some length")}).code, 4);
  EXPECT_EQ(run_command({"varve-info", path_, "--sceanrio"}).code, 2);
  EXPECT_EQ(run_command({"varve-info", path_, "--patience", "soon", "--follow"}).code, 2);
}

}  // namespace
}  // namespace varve::tools
