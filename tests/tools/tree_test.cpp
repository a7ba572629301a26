#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"

namespace varve::tools {
namespace {

using test::fork_genesis;
using test::run_command;
using test::toy_frames;
using test::toy_genesis;
using test::write_log;
using testing::HasSubstr;

class TreeVerb : public testing::Test {
 protected:
  void SetUp() override {
    const auto from = [&](std::size_t step) {
      return std::vector<io::Frame>(frames_.begin() + static_cast<std::ptrdiff_t>(step),
                                    frames_.end());
    };
    write_log(folder_ / "column.varve", root_, frames_);
    const io::Genesis child = fork_genesis(root_, frames_, 12, {{"toy.stiffness", "40", "45"}});
    write_log(folder_ / "stiff.varve", child, from(12));
    write_log(folder_ / "same.varve", fork_genesis(root_, frames_, 5, {}), from(5));
    write_log(folder_ / "grandchild.varve", fork_genesis(child, from(12), 20, {}), from(20));
  }
  std::map<std::string, nlohmann::json> runs() {
    const auto result = run_command({"varve-tree", folder_.path(), "--json"});
    EXPECT_EQ(result.code, 0) << result.errors;
    std::map<std::string, nlohmann::json> out;
    json_ = nlohmann::json::parse(result.output);
    for (const auto& run : json_["runs"]) out[run["run"]] = run;
    return out;
  }

  test::TemporaryFolder folder_;
  std::vector<io::Frame> frames_ = toy_frames({});
  io::Genesis root_ = toy_genesis();
  nlohmann::json json_;
};

TEST_F(TreeVerb, ShowsWhoCameFromWhom) {
  const auto result = run_command({"varve-tree", folder_.path()});
  EXPECT_EQ(result.code, 0);
  const std::string& text = result.output;
  EXPECT_THAT(text, testing::StartsWith("column.varve  steps 0..40  t=0.04 s  "));
  EXPECT_THAT(text, HasSubstr("\n|- same.varve  @5  no change  steps 5..40"));
  EXPECT_THAT(text, HasSubstr("\n`- stiff.varve  @12  toy.stiffness 40 -> 45  steps 12..40"));
  EXPECT_THAT(text, HasSubstr("\n   `- grandchild.varve  @20  no change"));
}

TEST_F(TreeVerb, JsonLinksParentsAndChildren) {
  auto all = runs();
  ASSERT_EQ(all.size(), 4u);
  EXPECT_TRUE(all["column.varve"]["parent"].is_null());
  EXPECT_EQ(all["column.varve"]["children"].size(), 2u);
  EXPECT_EQ(all["stiff.varve"]["parent"], "column.varve");
  EXPECT_EQ(all["stiff.varve"]["lineage"]["step"], "12");
  EXPECT_EQ(all["grandchild.varve"]["parent"], "stiff.varve");
  EXPECT_EQ(all["grandchild.varve"]["orphan"], false);
  EXPECT_EQ(all["same.varve"]["final_chain"], all["column.varve"]["final_chain"]);
}

TEST_F(TreeVerb, ParentsAreFoundByIdNotByName) {
  std::filesystem::rename(folder_ / "column.varve", folder_ / "renamed.varve");
  EXPECT_EQ(runs()["stiff.varve"]["parent"], "renamed.varve");
}

TEST_F(TreeVerb, OrphansAreShownAsSuch) {
  std::filesystem::remove(folder_ / "column.varve");
  auto all = runs();
  EXPECT_EQ(all["stiff.varve"]["orphan"], true);
  EXPECT_EQ(all["grandchild.varve"]["parent"], "stiff.varve");
  EXPECT_THAT(run_command({"varve-tree", folder_.path()}).output,
              HasSubstr("(parent parent.varve not here, run " + root_.run_id() + ")"));
}

TEST_F(TreeVerb, DamagedLogsAreListedAndOtherFilesPassedOver) {
  folder_.write("notes.txt", "not a log");
  folder_.write("empty.varve", "");
  folder_.write("text.varve", "not a log either, whatever its name says");
  runs();
  EXPECT_EQ(json_["runs"].size(), 4u);
  ASSERT_EQ(json_["unreadable"].size(), 2u);
  EXPECT_EQ(json_["unreadable"][0]["file"], "empty.varve");
  EXPECT_NE(json_["unreadable"][0]["reason"], "");
}

TEST_F(TreeVerb, WrongFoldersAreUsageErrors) {
  EXPECT_EQ(run_command({"varve-tree", folder_ / "missing"}).code, 2);
  EXPECT_EQ(run_command({"varve-tree", folder_ / "column.varve"}).code, 2);
  const test::TemporaryFolder empty;
  const auto result =
      run_command({"varve-tree"}, {.folder = empty.path(), .environment = {}, .input = ""});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.output, HasSubstr("no runs in ."));
}

}  // namespace
}  // namespace varve::tools
