// varve run as a user meets it: what it records, how it ends, what it refuses.
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

TEST(Run, RecordsEveryStepFromTheFirstState) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  const Json result = json_verb(0, {"run", scene, "-o", folder / "disc.varve"});
  EXPECT_EQ(result["stop_reason"], "end");
  EXPECT_EQ(whole(result["steps"]), 160u);
  EXPECT_EQ(whole(result["last_step"]), 160u);
  EXPECT_EQ(whole(result["log_bytes"]), fs::file_size(folder / "disc.varve"));
  EXPECT_EQ(result["final_chain"], chain_at(folder / "disc.varve", 160));
  EXPECT_EQ(whole(json_verb(0, {"show", folder / "disc.varve", "--at", "first"})["step"]), 0u);
  verb(0, {"verify", folder / "disc.varve"});
}

TEST(Run, ThreadsAndTiersGiveTheSameChain) {
  TemporaryFolder folder;
  const std::string scene = folder.write("crowd.cfg", crowd_scene());
  const std::vector<std::vector<std::string>> variants{
      {}, {"--threads", "3"}, {"--tier", "digests"}, {"--every", "7", "--keyframe-steps", "10"}};
  std::vector<Json> chains;
  for (std::size_t i = 0; i < variants.size(); ++i) {
    std::vector<std::string> words{"run", scene, "-o", folder / std::to_string(i)};
    words.insert(words.end(), variants[i].begin(), variants[i].end());
    chains.push_back(json_verb(0, words)["final_chain"]);
    EXPECT_EQ(chains.back(), chains.front()) << i;
    // Any step is reachable whatever is stored.
    EXPECT_EQ(chain_at(folder / std::to_string(i), 53), chain_at(folder / "0", 53));
    EXPECT_EQ(json_verb(0, {"show", folder / std::to_string(i), "--at", "53"})["fields"],
              json_verb(0, {"show", folder / "0", "--at", "53"})["fields"]);
  }
  EXPECT_LT(fs::file_size(folder / "2"), fs::file_size(folder / "0") / 2);
}

TEST(Run, LengthByStepsIsTheTotalAndByTimeTheFirstStepNotBefore) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  const Json steps = json_verb(0, {"run", scene, "-o", folder / "a", "--steps", "12"});
  EXPECT_EQ(whole(steps["last_step"]), 12u);
  const double dt = json_verb(0, {"show", folder / "a", "--at", "last"})["dt_s"];
  const std::string until = std::to_string(7.5 * dt * 1e6) + " us";
  const Json time = json_verb(0, {"run", scene, "-o", folder / "b", "--until", until});
  EXPECT_EQ(whole(time["last_step"]), 8u);
  EXPECT_GE(time["time_s"].get<double>(), 7.5 * dt);
  EXPECT_EQ(whole(json_verb(0, {"run", scene, "-o", folder / "c", "--steps", "0"})["steps"]), 0u);
  verb(2, {"run", scene, "-o", folder / "d", "--steps", "1", "--until", "1"});
}

TEST(Run, CommandLineWinsOverTheFile) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  json_verb(0, {"run", scene, "-o", folder / "a", "--steps", "3", "-s", "contact.damping=0.5"});
  const CommandResult info = verb(0, {"info", folder / "a", "--scenario"});
  EXPECT_NE(info.output.find("damping = 0.5\n"), std::string::npos) << info.output;
  const CommandResult bad =
      verb(3, {"run", scene, "-o", folder / "b", "-s", "contact.damping=lots"});
  EXPECT_NE(bad.errors.find("<command line>:1: error: contact.damping: 'lots'"), std::string::npos)
      << bad.errors;
  EXPECT_FALSE(fs::exists(folder / "b"));
}

TEST(Run, RefusesWithoutHarm) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  const std::string taken = folder.write("taken", "something of the user's");
  const CommandResult exists = verb(2, {"run", scene, "-o", taken, "--steps", "1"});
  EXPECT_NE(exists.errors.find(taken), std::string::npos) << exists.errors;
  EXPECT_EQ(fs::file_size(taken), 23u);
  verb(0, {"run", scene, "-o", taken, "--steps", "1", "--overwrite"});
  verb(2, {"run", scene, "-o", scene, "--steps", "1", "--overwrite"});
  EXPECT_EQ(fs::file_size(scene), disc_scene().size());
  verb(2, {"run", folder / "missing.cfg"});
  verb(2, {"run", folder.path()});
  verb(2, {"run", scene, "-o", folder.path()});
  verb(3, {"run", folder.write("bad.cfg", "[domain]\nwidht = 2 cm\n"), "-o", folder / "x"});
  EXPECT_FALSE(fs::exists(folder / "x"));
  verb(2, {"run", scene, "--no-such-option"});
  verb(2, {"run", scene, "-o", folder / "x", "--threads", "many"});
}

TEST(Run, WithoutAFileRunsTheBuiltInDisc) {
  TemporaryFolder folder;
  const Json result = json_verb(0, {"run", "--steps", "2"}, folder.path());
  EXPECT_EQ(result["run"], "single_disc.varve");
  EXPECT_TRUE(fs::exists(folder / "single_disc.varve"));
}

TEST(Run, NumericalFailureKeepsTheLogUpToTheLastGoodStep) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene("[guards]\nspeed = 0.05\n"));
  const CommandResult result = verb(5, {"run", scene, "-o", folder / "fast", "--json"});
  const Json object = Json::parse(result.output);
  EXPECT_EQ(object["stop_reason"], "numerical_failure");
  for (const char* key : {"criterion", "step", "field", "id", "value", "limit", "advice"})
    EXPECT_TRUE(object["failure"].contains(key)) << key;
  const std::uint64_t last = whole(object["last_step"]);
  EXPECT_EQ(whole(object["failure"]["step"]), last + 1);
  EXPECT_NE(result.errors.find("keeps every step up to " + std::to_string(last)), std::string::npos)
      << result.errors;
  verb(0, {"verify", folder / "fast"});
  verb(0, {"replay", folder / "fast"});
}

TEST(Run, AnImpossibleScheduledChangeIsAFailureToo) {
  TemporaryFolder folder;
  const std::string scene = folder.write(
      "crowd.cfg", crowd_scene("[event.squeeze]\nat_step = 20\ndomain.width = 6 mm\n"));
  const CommandResult result = verb(5, {"run", scene, "-o", folder / "squeezed", "--json"});
  EXPECT_EQ(whole(Json::parse(result.output)["last_step"]), 19u);
  EXPECT_NE(result.errors.find("scheduled change"), std::string::npos) << result.errors;
  verb(0, {"verify", folder / "squeezed"});
  verb(0, {"replay", folder / "squeezed"});
}

TEST(Run, AFullDiskEndsWith74AndNamesTheLastDurableStep) {
  TemporaryFolder folder;
  const std::string scene = folder.write("crowd.cfg", crowd_scene());
  const std::string log = folder / "crowd.varve";
  // The shell's limit on file size stands in for a full disk; units of 1 KiB.
  const std::string command = "ulimit -f 64; trap '' XFSZ; exec " + bin_folder() + "/varve-run " +
                              scene + " -o " + log + " --progress none";
  const CommandResult result = run_command({"/bin/bash", "-c", command});
  EXPECT_EQ(result.code, 74) << result.errors;
  EXPECT_NE(result.errors.find("the last step known to be on disk is"), std::string::npos)
      << result.errors;
  const Json rest = json_verb(0, {"resume", log});
  EXPECT_EQ(whole(rest["last_step"]), 120u);
  json_verb(0, {"run", scene, "-o", folder / "whole"});
  EXPECT_EQ(chain_at(log, 120), chain_at(folder / "whole", 120));
}

TEST(Run, ProgressIsLinesOrJsonOnStandardError) {
  TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  const CommandResult quiet = verb(0, {"run", scene, "-o", folder / "a", "-q", "--steps", "5"});
  EXPECT_EQ(quiet.output, "");
  EXPECT_EQ(quiet.errors, "");
  const CommandResult plain = verb(0, {"run", scene, "-o", folder / "b", "--steps", "5"});
  EXPECT_NE(plain.output.find("steps 0 to 5"), std::string::npos) << plain.output;
  EXPECT_EQ(plain.errors.find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace varve::test
