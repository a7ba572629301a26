// Grains of several kinds, from packings and from lists, through the verbs.
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

using ::testing::HasSubstr;

void write(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

const std::string listed_scene =
    "[domain]\nwidth = 2 cm\nheight = 4 cm\n[fluid]\npresent = off\n[grains]\nfile = list.csv\n"
    "diameter = 2 mm\n[species.fine]\ndiameter = 1 mm\n[time]\nsteps = 400\n";
const std::string list =
    "x,y,species,vx,vy,wz\n0.010,0.0015,grains,0,-0.1,5\n0.013,0.002,fine,-0.5,0,0\n";

TEST(PolydisperseScene, RunsReplaysForksAndDiffs) {
  const TemporaryFolder folder;
  const std::string run = folder / "run.varve", same = folder / "same.varve",
                    other = folder / "other.varve";
  const std::string scene = std::string(VARVE_SCENARIOS) + "/polydisperse.cfg";
  verb(0, {"run", scene, "-o", run, "--steps", "200"});
  EXPECT_EQ(json_verb(0, {"replay", run, "--threads", "3"})["verdict"], "identical");
  EXPECT_EQ(json_verb(0, {"verify", run})["verdict"], "complete");
  verb(0, {"fork", run, "--at", "100", "-o", same});
  EXPECT_EQ(json_verb(0, {"diff", run, same})["verdict"], "identical");
  verb(0, {"fork", run, "--at", "100", "-s", "fluid.viscosity=0.012", "-o", other});
  EXPECT_EQ(json_verb(1, {"diff", run, other})["verdict"], "different");
  const Json shown = json_verb(0, {"show", run, "--at", "last", "--fields", "grains"});
  bool kinds[3] = {};
  for (const Json& each : shown["fields"]["grains.species"])
    kinds[std::stoul(each.is_string() ? each.get<std::string>() : each.dump())] = true;
  EXPECT_TRUE(kinds[0] && kinds[1] && kinds[2]);
  EXPECT_THAT(verb(0, {"info", run}).output, HasSubstr("species.fine.diameter"));
}

TEST(GrainList, IsPrintedWithTheScenarioThatReproducesTheRun) {
  for (const std::string end : {"\n", ""}) {
    const TemporaryFolder folder;
    const std::string run = folder / "run.varve", again = folder / "again.varve";
    write(folder / "list.cfg", listed_scene);
    write(folder / "list.csv", list.substr(0, list.size() - 1) + end);
    verb(0, {"run", folder / "list.cfg", "-o", run});
    write(folder / "again.cfg", verb(0, {"info", run, "--scenario"}).output);
    std::filesystem::remove(folder / "list.csv");
    verb(0, {"run", folder / "again.cfg", "-o", again});
    EXPECT_EQ(json_verb(0, {"diff", run, again})["verdict"], "identical");
    const Json a = json_verb(0, {"info", run}), b = json_verb(0, {"info", again});
    EXPECT_EQ(a["run_id"], b["run_id"]);
  }
  const TemporaryFolder folder;
  write(folder / "bad.cfg", listed_scene + "#embedded file: list.csv\n#|x,y\nwidth = 3 cm\n");
  EXPECT_THAT(verb(3, {"check", folder / "bad.cfg"}).errors,
              HasSubstr("expected a line of an embedded file"));
  write(folder / "other.cfg", listed_scene + "#embedded file: other.csv\n#|x,y\n");
  EXPECT_THAT(verb(3, {"check", folder / "other.cfg"}).errors,
              HasSubstr("grains.file: 'list.csv': not embedded with the scenario"));
}

TEST(GrainList, IsReadBesideTheScenarioAndKeptInTheLog) {
  const TemporaryFolder folder;
  write(folder / "list.cfg", listed_scene);
  write(folder / "list.csv", list);
  const std::string run = folder / "run.varve", fork = folder / "fork.varve";
  verb(0, {"run", folder / "list.cfg", "-o", run});
  // The log does not need the file any more, nor does a fork of it.
  std::filesystem::remove(folder / "list.csv");
  EXPECT_EQ(json_verb(0, {"replay", run})["verdict"], "identical");
  verb(0, {"fork", run, "--at", "200", "-o", fork});
  EXPECT_EQ(json_verb(0, {"diff", run, fork})["verdict"], "identical");
  std::filesystem::remove(run);
  EXPECT_EQ(json_verb(0, {"replay", fork})["verdict"], "identical");
  EXPECT_THAT(verb(3, {"check", folder / "list.cfg"}).errors,
              HasSubstr("list.cfg:7:8: error: grains.file: 'list.csv': No such file"));
}

TEST(GrainList, AnotherContentIsAnotherScenario) {
  const TemporaryFolder folder;
  write(folder / "list.cfg", listed_scene);
  write(folder / "list.csv", list);
  verb(0, {"run", folder / "list.cfg", "-o", folder / "a.varve"});
  write(folder / "list.csv", list + "0.005,0.03,fine,0,0,0\n");
  verb(0, {"run", folder / "list.cfg", "-o", folder / "b.varve"});
  // The lists explain; the states decide.
  const std::string output = verb(1, {"diff", folder / "a.varve", folder / "b.varve"}).output;
  EXPECT_NE(output.find("file list.csv"), std::string::npos) << output;
}

TEST(GrainList, ErrorsNameFileLineAndValue) {
  const TemporaryFolder folder;
  write(folder / "list.cfg", listed_scene);
  write(folder / "list.csv", "x,y,species\n0.01,0.01,coarse\n0.015,wide,fine\n");
  const std::string errors = verb(3, {"check", folder / "list.cfg"}).errors;
  EXPECT_THAT(errors, HasSubstr("list.csv:2: error: species: 'coarse' is not known; expected one "
                                "of grains, fine or its number"));
  EXPECT_THAT(errors, HasSubstr("list.csv:3: error: y: 'wide' is not a finite number"));
}

TEST(SpeciesSections, MisspeltKeysAndValuesAreErrorsInTheirPlace) {
  const TemporaryFolder folder;
  write(folder / "bad.cfg",
        "[domain]\nwidth = 2 cm\nheight = 4 cm\n[fluid]\npresent = off\n[grains]\nrows = 1\n"
        "columns = 1\n[species.fine]\ndiamter = 1 mm\ndensity = 2 s\n[time]\nsteps = 4\n");
  const std::string errors = verb(3, {"check", folder / "bad.cfg"}).errors;
  EXPECT_THAT(errors, HasSubstr("bad.cfg:10:1: error: unknown key 'species.fine.diamter'"));
  EXPECT_THAT(errors, HasSubstr("bad.cfg:11:11: error: species.fine.density: '2 s' is a time"));
}

}  // namespace
}  // namespace varve::test
