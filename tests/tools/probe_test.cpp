// The size that check --probe predicts, against that of the run.
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

struct Case {
  const char* scene;
  const char* tier;
  const char* until;  ///< shorter than the scene's own, to be quick; VARVE_LONG: the scene's own
};

class Probe : public ::testing::TestWithParam<Case> {};

TEST_P(Probe, PredictsTheLogWithinAFifth) {
  const TemporaryFolder folder;
  const std::string path = folder / "run.varve";
  const auto [scene, tier, until] = GetParam();
  std::vector<std::string> check = {"check", scene, "--probe", "-s",
                                    std::string("record.tier=") + tier};
  std::vector<std::string> run = {"run", scene, "--tier", tier, "-o", path, "--threads", "2"};
  if (*until != '\0' && std::getenv("VARVE_LONG") == nullptr) {
    check.insert(check.end(), {"-s", std::string("time.until=") + until});
    run.insert(run.end(), {"--until", until});
  }
  const Json bytes = json_verb(0, check)["log_bytes"];
  json_verb(0, run);
  const auto real = static_cast<double>(std::filesystem::file_size(path));
  const auto predicted = static_cast<double>(whole(bytes["probe"]["predicted"]));
  EXPECT_NEAR(predicted / real, 1, 0.2) << predicted << " predicted, " << real << " real";
  // The range that needs no probe holds as well.
  EXPECT_LE(static_cast<double>(whole(bytes["low"])), real);
  EXPECT_GE(static_cast<double>(whole(bytes["high"])), real);
  std::printf("%s, %s: %.4g MB predicted, %.4g MB real\n", scene, tier, predicted / 1e6,
              real / 1e6);
}
INSTANTIATE_TEST_SUITE_P(Scenes, Probe,
                         ::testing::Values(Case{"single_disc", "deltas", ""},
                                           Case{"single_disc", "digests", ""},
                                           Case{"column", "deltas", "0.15 s"},
                                           Case{"column", "digests", "0.15 s"}));

TEST(ProbeOption, AProbeAsLongAsTheRunIsExact) {
  const TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  const std::string path = folder / "disc.varve";
  json_verb(0, {"run", scene, "-o", path});
  const Json probe = json_verb(0, {"check", scene, "--probe=160"})["log_bytes"]["probe"];
  EXPECT_EQ(probe["steps"], "160");
  // Times, host and the like differ in length by some bytes, nothing else does.
  EXPECT_NEAR(static_cast<double>(whole(probe["predicted"])),
              static_cast<double>(std::filesystem::file_size(path)), 64);
}

TEST(ProbeOption, TakesItsNumberOnlyBehindAnEqualsSign) {
  const TemporaryFolder folder;
  const std::string scene = folder.write("disc.cfg", disc_scene());
  EXPECT_EQ(json_verb(0, {"check", "--probe", scene})["log_bytes"]["probe"]["steps"], "160");
  EXPECT_EQ(json_verb(0, {"check", scene, "--probe=80"})["log_bytes"]["probe"]["steps"], "80");
  EXPECT_FALSE(json_verb(0, {"check", scene})["log_bytes"].contains("probe"));
  EXPECT_NE(verb(2, {"check", scene, "--probe=many"}).errors.find("whole number"),
            std::string::npos);
  verb(2, {"check", scene, "--probe=0"});
  verb(2, {"check", scene, "--probe", "80"});
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1)
      << "a probe writes nothing";
}

}  // namespace
}  // namespace varve::test
