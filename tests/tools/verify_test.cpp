// verify and recover, as a user runs them.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/log_reader.h"
#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using test::run_command;
using test::toy_frames;
using test::toy_genesis;
using test::write_log;
using testing::HasSubstr;

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(file)), {});
}

class VerifyVerb : public testing::Test {
 protected:
  void SetUp() override { write_log(path_, toy_genesis(), frames_); }
  nlohmann::json verify(const std::string& path, int code) {
    const auto result = run_command({"varve-verify", path, "--json"});
    EXPECT_EQ(result.code, code) << result.output << result.errors;
    return nlohmann::json::parse(result.output);
  }
  /// A copy with one byte changed.
  std::string spoilt(std::size_t offset) {
    std::string bytes = read_file(path_);
    bytes[offset] = static_cast<char>(bytes[offset] ^ 0x10);
    return folder_.write("spoilt.varve", bytes);
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "a.varve";
  std::vector<io::Frame> frames_ = toy_frames({});
};

TEST_F(VerifyVerb, AWholeLogHasEveryByteChecked) {
  const auto found = verify(path_, 0);
  EXPECT_EQ(found["schema"], "varve.verify/1");
  EXPECT_EQ(found["verdict"], "complete");
  EXPECT_EQ(found["bytes_checked"], std::to_string(fs::file_size(path_)));
  EXPECT_EQ(found["steps"], "41");
  EXPECT_TRUE(found["damage"].empty());
  EXPECT_THAT(run_command({"varve-verify", path_}).output, HasSubstr("complete"));
}

TEST_F(VerifyVerb, NoChangedByteGoesUnseen) {
  const std::size_t size = fs::file_size(path_);
  std::mt19937_64 random(3);
  for (int n = 0; n < 60; ++n) {
    const std::size_t offset = random() % size;
    const auto result = run_command({"varve-verify", spoilt(offset), "--json"});
    // 2: the byte made it a log of a version or with a record that this program does not know.
    EXPECT_THAT(result.code, testing::AnyOf(2, 4)) << "byte " << offset << result.output;
    if (result.code != 4) continue;
    EXPECT_NE(nlohmann::json::parse(result.output)["verdict"], "complete") << offset;
  }
}

TEST_F(VerifyVerb, ATornTailIsNamedAndRecovered) {
  const std::string bytes = read_file(path_);
  const std::string torn = folder_.write("torn.varve", bytes.substr(0, bytes.size() * 2 / 3));
  const auto found = verify(torn, 4);
  EXPECT_NE(found["verdict"], "complete");
  EXPECT_FALSE(found["damage"].empty());
  const std::string out = folder_ / "saved.varve";
  const auto recovered = run_command({"varve-recover", torn, "-o", out, "--json"});
  EXPECT_THAT(recovered.code, testing::AnyOf(0, 4)) << recovered.errors;
  const auto json = nlohmann::json::parse(recovered.output);
  EXPECT_EQ(json["lossy"].get<bool>(), recovered.code == 4);
  EXPECT_EQ(verify(out, 0)["steps"], json["steps_kept"]);
  EXPECT_EQ(read_file(torn), bytes.substr(0, bytes.size() * 2 / 3)) << "the input is not touched";
  EXPECT_EQ(run_command({"varve-diff", path_, out}).code, 0);
}

TEST_F(VerifyVerb, RotInTheMiddleLosesStepsAndSaysWhich) {
  const std::string bad = spoilt(fs::file_size(path_) / 2);
  EXPECT_EQ(verify(bad, 4)["verdict"], "damaged");
  const std::string out = folder_ / "saved.varve";
  const auto recovered = run_command({"varve-recover", bad, "-o", out, "--json"});
  ASSERT_THAT(recovered.code, testing::AnyOf(0, 4));
  const auto json = nlohmann::json::parse(recovered.output);
  std::uint64_t lost = 0;
  for (const auto& range : json["lost"])
    lost += std::stoull(range["to"].get<std::string>()) -
            std::stoull(range["from"].get<std::string>()) + 1;
  EXPECT_EQ(lost > 0, json["lossy"].get<bool>());
  EXPECT_EQ(std::stoull(json["steps_kept"].get<std::string>()) + lost, 41u);
  EXPECT_EQ(verify(out, 0)["verdict"], "complete");
  // What was saved is what was recorded: every state that can be read is the original one.
  const auto log = io::LogReader::open(out);
  std::uint64_t read = 0;
  log->for_each(0, 40, [&](const io::StepHeader& header, const io::Frame* frame) {
    if (frame != nullptr) {
      EXPECT_EQ(frame->fields, frames_[header.step].fields) << header.step;
      ++read;
    }
    return true;
  });
  EXPECT_GT(read, 0u);
}

TEST_F(VerifyVerb, ATornTailAndRotAreToldApart) {
  // The last bytes missing: nothing says that they were ever durable. A byte changed in the middle:
  // what stands behind it was written after it had been synced.
  const std::string bytes = read_file(path_);
  const std::string torn = folder_.write("torn.varve", bytes.substr(0, bytes.size() - 9));
  const auto tail = verify(torn, 4);
  EXPECT_EQ(tail["verdict"], "torn");
  EXPECT_EQ(tail["file_bytes"], std::to_string(bytes.size() - 9));
  ASSERT_EQ(tail["damage"].size(), 1u);
  EXPECT_THAT(tail["damage"][0]["what"].get<std::string>(), HasSubstr("torn tail of "));
  // What was checked ends where the torn tail begins.
  EXPECT_EQ(tail["bytes_checked"], tail["damage"][0]["offset"]);
  EXPECT_EQ(tail["steps"], "41");

  const std::string rotten = spoilt(fs::file_size(path_) / 2);
  const auto rot = verify(rotten, 4);
  EXPECT_EQ(rot["verdict"], "damaged");
  EXPECT_LT(std::stoull(rot["bytes_checked"].get<std::string>()), bytes.size());
  EXPECT_LE(std::stoull(rot["damage"][0]["step_from"].get<std::string>()),
            std::stoull(rot["damage"][0]["step_to"].get<std::string>()));

  const auto text = run_command({"varve-verify", torn});
  EXPECT_THAT(text.output, HasSubstr("torn: " + tail["bytes_checked"].get<std::string>() + " of " +
                                     std::to_string(bytes.size() - 9) + " bytes checked"));
  EXPECT_THAT(run_command({"varve-verify", rotten}).output, HasSubstr("can't be read"));
  EXPECT_THAT(run_command({"varve-info", torn}).code, 0) << "readers go on with what is whole";
}

TEST_F(VerifyVerb, ALossyRecoveryExitsWithFourAndListsWhatIsLost) {
  const std::string out = folder_ / "saved.varve";
  const std::string rotten = spoilt(fs::file_size(path_) / 2);
  const auto result = run_command({"varve-recover", rotten, "-o", out});
  EXPECT_EQ(result.code, 4) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("  lost: step"));
  EXPECT_THAT(result.output, HasSubstr("  offset "));
  const auto json = nlohmann::json::parse(
      run_command({"varve-recover", rotten, "-o", out, "--overwrite", "--json"}).output);
  ASSERT_EQ(json["lost"].size(), 1u);
  const auto from = json["lost"][0]["from"].get<std::string>();
  const auto to = json["lost"][0]["to"].get<std::string>();
  EXPECT_THAT(result.output, HasSubstr(from == to ? "step " + from : from + " to " + to));
  // What was saved names its gap: it is complete, and lossless to recover again.
  EXPECT_EQ(verify(out, 0)["verdict"], "complete");
  const std::string before = read_file(out);
  EXPECT_EQ(run_command({"varve-recover", out, "-o", folder_ / "twice.varve"}).code, 4)
      << "the gap is still one";
  EXPECT_EQ(read_file(out), before);
}

TEST_F(VerifyVerb, WrongInputsHaveTheirExitCodes) {
  EXPECT_EQ(run_command({"varve-verify", folder_ / "missing"}).code, 2);
  EXPECT_EQ(run_command({"varve-verify", folder_.path()}).code, 2);
  const std::string empty = folder_.write("empty", "");
  EXPECT_EQ(run_command({"varve-verify", empty}).code, 4);
  EXPECT_EQ(verify(empty, 4)["verdict"], "damaged");
  EXPECT_EQ(run_command({"varve-recover", path_}).code, 2) << "no -o";
  EXPECT_EQ(run_command({"varve-recover", path_, "-o", path_, "--overwrite"}).code, 2);
  EXPECT_EQ(run_command({"varve-recover", path_, "-o", empty}).code, 2) << "exists";
  EXPECT_EQ(run_command({"varve-recover", empty, "-o", folder_ / "x"}).code, 4);
}

TEST_F(VerifyVerb, AWholeLogIsRecoveredWithoutLoss) {
  const std::string out = folder_ / "same.varve";
  const auto result = run_command({"varve-recover", path_, "-o", out});
  EXPECT_EQ(result.code, 0) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("nothing was lost"));
  EXPECT_EQ(run_command({"varve-diff", path_, out}).code, 0);
}

}  // namespace
}  // namespace varve::tools
