// init and check, run as a user runs them.
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"

namespace varve::test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using nlohmann::json;

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

const std::string box = "[domain]\nwidth = 2 cm\nheight = 6 cm\n[time]\nsteps = 10\n";

TEST(Init, PrintsAScenarioThatChecksOut) {
  for (const char* preset : {"single_disc", "column", "hydrostatic"}) {
    const TemporaryFolder folder;
    const CommandResult made = run_command({"varve-init", preset});
    ASSERT_EQ(made.code, 0) << made.errors;
    EXPECT_EQ(made.errors, "");
    EXPECT_THAT(made.output, HasSubstr("# "));
    const CommandResult checked =
        run_command({"varve-check", folder.write("scene.cfg", made.output)});
    EXPECT_EQ(checked.code, 0) << checked.errors;
  }
}

TEST(Init, WithoutAPresetIsTheDisc) {
  EXPECT_EQ(run_command({"varve-init"}).output, run_command({"varve-init", "single_disc"}).output);
}

TEST(Init, EveryKeyIsTheSameScenario) {
  for (const char* preset : {"single_disc", "column", "hydrostatic"}) {
    const TemporaryFolder folder;
    const CommandResult all = run_command({"varve-init", preset, "--all"});
    ASSERT_EQ(all.code, 0) << all.errors;
    EXPECT_THAT(all.output, HasSubstr("# porosity_floor = auto"));
    const std::string path = folder.write("all.cfg", all.output);
    EXPECT_EQ(run_command({"varve-check", path, "--resolved"}).output,
              run_command({"varve-check", preset, "--resolved"}).output);
    // Every commented default is a legal line, too.
    std::string open = all.output;
    for (std::size_t at = 0; (at = open.find("\n# ", at)) != std::string::npos; ++at) {
      const std::size_t end = open.find('\n', at + 1);
      const std::string line = open.substr(at + 3, end - at - 3);
      if (line.find(" = ") != std::string::npos && line.find(' ') == line.find(" = "))
        open.erase(at + 1, 2);
    }
    EXPECT_EQ(run_command({"varve-check", folder.write("open.cfg", open), "--resolved"}).output,
              run_command({"varve-check", preset, "--resolved"}).output);
  }
}

TEST(Init, WritesAFileAndOverwritesNothing) {
  const TemporaryFolder folder;
  const std::string path = folder / "scene.cfg";
  const CommandResult made = run_command({"varve-init", "column", "-o", path});
  EXPECT_EQ(made.code, 0);
  EXPECT_EQ(made.output, "");
  EXPECT_THAT(made.errors, HasSubstr("wrote " + path));
  EXPECT_EQ(content_of(path), run_command({"varve-init", "column"}).output);
  const CommandResult again = run_command({"varve-init", "hydrostatic", "-o", path});
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.errors, HasSubstr("expected a new file, got one that exists"));
  EXPECT_EQ(content_of(path), run_command({"varve-init", "column"}).output);
  EXPECT_EQ(run_command({"varve-init", "hydrostatic", "-q", "-o", path, "--overwrite"}).errors, "");
  EXPECT_EQ(content_of(path), run_command({"varve-init", "hydrostatic"}).output);
}

TEST(Init, Failures) {
  const TemporaryFolder folder;
  const CommandResult unknown = run_command({"varve-init", "colum"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_EQ(unknown.errors,
            "varve init: preset: expected one of single_disc, column, hydrostatic, "
            "hydrostatic_full, inclined, polydisperse, pipe3d, cavity, poiseuille, "
            "taylor_green, dam_break, got 'colum'; "
            "did you mean 'column'?\n");
  EXPECT_EQ(run_command({"varve-init", "-o", folder / "no/such/folder.cfg"}).code, 2);
  EXPECT_EQ(run_command({"varve-init", "-o", folder.path()}).code, 2);
  const CommandResult full = run_command({"varve-init", "-o", "/dev/full", "--overwrite"});
  EXPECT_EQ(full.code, 74);
  EXPECT_THAT(full.errors, HasSubstr("/dev/full: could not be written: No space left"));
  EXPECT_EQ(run_command({"varve-init", "a", "b"}).code, 2);
}

TEST(Check, TellsWhatFollows) {
  const CommandResult result = run_command({"varve-check", "single_disc"});
  EXPECT_EQ(result.code, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  for (const char* expected :
       {"particles          1200 (20 x 60)", "set by cfl", "Reynolds number    12.26",
        "Stokes number", "terminal speed     0.04905 m/s", "sub-steps per step",
        "excess pressure        on", "free surface           off", "warning: coupling.length"})
    EXPECT_THAT(result.output, HasSubstr(expected));
}

TEST(Check, JsonHasTheSameNumbers) {
  const CommandResult result = run_command({"varve-check", "column", "--json"});
  ASSERT_EQ(result.code, 0) << result.errors;
  const json object = json::parse(result.output);
  EXPECT_EQ(object["schema"], "varve-check-1");
  EXPECT_EQ(object["particles"]["fluid"], "7200");
  EXPECT_EQ(object["particles"]["grains"], "32");
  EXPECT_EQ(object["dt_s"], 1.25e-4);
  EXPECT_EQ(object["dt_set_by"], "cfl");
  EXPECT_EQ(object["steps"], "4800");
  EXPECT_EQ(object["per"], "m depth");
  EXPECT_EQ(object["resolved"]["contact.damping"], "0.2");
  bool has_drag = false;
  for (const json& model : object["models"])
    if (model["name"] == "drag") has_drag = model["active"];
  EXPECT_TRUE(has_drag);
  EXPECT_GT(std::stod(object["log_bytes"]["high"].get<std::string>()),
            std::stod(object["log_bytes"]["low"].get<std::string>()));
}

TEST(Check, SettingsAndEventsOfTheCommandLine) {
  const CommandResult result =
      run_command({"varve-check", "column", "--json", "-s", "grains.rows=2", "--set",
                   "event.thin.at=0.1s", "-sevent.thin.fluid.viscosity=0.005"});
  ASSERT_EQ(result.code, 0) << result.errors;
  const json object = json::parse(result.output);
  EXPECT_EQ(object["particles"]["grains"], "16");
  EXPECT_EQ(object["events"][0]["at_step"], "800");
  EXPECT_EQ(object["events"][0]["settings"]["fluid.viscosity"], "0.005");
}

TEST(Check, ResolvedReadsBackToItself) {
  const TemporaryFolder folder;
  const CommandResult once = run_command({"varve-check", "column", "--resolved"});
  ASSERT_EQ(once.code, 0);
  const CommandResult twice =
      run_command({"varve-check", folder.write("resolved.cfg", once.output), "--resolved"});
  EXPECT_EQ(twice.output, once.output) << twice.errors;
}

TEST(Check, SceneWithoutFluidOrGrains) {
  const TemporaryFolder folder;
  const std::string dry = folder.write(
      "dry.cfg", box + "[fluid]\npresent = off\n[grains]\nrows = 1\ncolumns = 2\n");
  const json object = json::parse(run_command({"varve-check", dry, "--json"}).output);
  EXPECT_EQ(object["particles"]["fluid"], "0");
  EXPECT_EQ(object["dt_set_by"], "contact");
  EXPECT_TRUE(object["sound_speed_m_s"].is_null());
  const CommandResult wet = run_command({"varve-check", folder.write("wet.cfg", box)});
  EXPECT_EQ(wet.code, 0);
  EXPECT_THAT(wet.output, HasSubstr("grains                 off"));
}

TEST(Check, InvalidScenarioIsExit3WithAllErrors) {
  const TemporaryFolder folder;
  folder.write("bad.cfg",
               "[domain]\n"
               "width = 2 s\n"
               "height = 6 cm\n"
               "widht = 3\n"
               "[contact]\n"
               "damping = lots\n"
               "damping = 1\n");
  const CommandResult result = run_command({"varve-check", "bad.cfg"}, {folder.path(), {}, ""});
  EXPECT_EQ(result.code, 3);
  EXPECT_EQ(result.output, "");
  EXPECT_EQ(result.errors,
            "bad.cfg:1:1: error: time.until: missing; expected a time, such as '1.5 s' (or "
            "time.steps, a number of steps)\n"
            "bad.cfg:2:9: error: domain.width: '2 s' is a time; a length is needed\n"
            "bad.cfg:4:1: error: unknown key 'domain.widht'; did you mean 'domain.width'?\n"
            "bad.cfg:6:11: error: contact.damping: 'lots' is not a number; expected a ratio 0..2\n"
            "bad.cfg:7:1: error: 'contact.damping' was already set on line 6\n");
  const CommandResult setting =
      run_command({"varve-check", "column", "-s", "contact.damping=lots"});
  EXPECT_EQ(setting.code, 3);
  EXPECT_EQ(setting.errors,
            "<command line>:1: error: contact.damping: 'lots' is not a number; expected a ratio "
            "0..2\n");
}

TEST(Check, UsageFailures) {
  const TemporaryFolder folder;
  const CommandResult missing = run_command({"varve-check", "no_such.cfg"});
  EXPECT_EQ(missing.code, 2);
  EXPECT_THAT(missing.errors, StartsWith("varve check: no_such.cfg: No such file or directory; "
                                         "expected a scenario file or one of the presets"));
  const CommandResult directory = run_command({"varve-check", folder.path()});
  EXPECT_EQ(directory.code, 2);
  EXPECT_THAT(directory.errors, HasSubstr("expected a scenario file, got a directory"));
  EXPECT_EQ(run_command({"varve-check"}).code, 2);
  EXPECT_EQ(run_command({"varve-check", "a", "b"}).code, 2);
  EXPECT_EQ(run_command({"varve-check", "column", "-s"}).code, 2);
  // An empty file is a scenario that lacks everything.
  EXPECT_EQ(run_command({"varve-check", folder.write("empty.cfg", "")}).code, 3);
  EXPECT_EQ(run_command({"varve-check", "/dev/null"}).code, 3);
  EXPECT_EQ(run_command({"varve-check", "/dev/zero"}).code, 3);
}

TEST(Check, AFileWinsOverThePresetOfItsName) {
  const TemporaryFolder folder;
  folder.write("column", box);
  const CommandResult result =
      run_command({"varve-check", "column", "--json"}, {folder.path(), {}, ""});
  EXPECT_EQ(json::parse(result.output)["particles"]["grains"], "0") << result.errors;
}

TEST(Check, OutputThatCannotBeWritten) {
  const CommandResult full = run_command(
      {"/bin/sh", "-c", bin_folder() + "/varve-check column > /dev/full"});
  EXPECT_EQ(full.code, 74);
  EXPECT_THAT(full.errors, HasSubstr("standard output: could not be written"));
}

}  // namespace
}  // namespace varve::test
