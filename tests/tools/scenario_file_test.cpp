// Scenario files: what is read, and every form of error with its place.
#include <clocale>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/parameters.h"
#include "tools/cli.h"
#include "tools/scenario_file.h"

namespace varve::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// The messages of a text that can't be used; none if it can.
std::vector<std::string> errors_of(const std::string& text,
                                   const std::vector<std::string>& settings = {},
                                   bool needs_length = true) {
  std::vector<std::string> messages;
  try {
    read_scenario_text(text, "bad.cfg", {settings, needs_length, false});
  } catch (const ScenarioError& error) {
    for (const Diagnostic& diagnostic : error.diagnostics())
      messages.push_back(diagnostic.message());
  }
  return messages;
}

core::Scenario read(const std::string& text, const std::vector<std::string>& settings = {}) {
  return read_scenario_text(text, "good.cfg", {settings, true, false}).scenario;
}

const std::string box = "[domain]\nwidth = 2 cm\nheight = 6 cm\n[time]\nsteps = 10\n";

TEST(ScenarioFile, AllErrorsAtOnceWithTheirPlaces) {
  const std::string text =
      "# a scene with every usual slip\n"
      "[domain]\n"
      "height = 6 cm\n"
      "[domain]\n"
      "widht = 2 cm\n"
      "[contact]\n"
      "damping = lots\n"
      "stiffness = 2e5\n"
      "   time = 3 m\n"
      "friction = nan\n"
      "[fluid]\n"
      "spacing = -1 mm\n"
      "[contact]\n"
      "stiffness = 3e5 N/m\n"
      "[grains]\n"
      "rows = 2.5\n"
      "motion = fixed\n"
      "just some words\n"
      "= 3\n";
  EXPECT_THAT(
      errors_of(text),
      ElementsAre(
          "bad.cfg:1:1: error: time.until: missing; expected a time, such as '1.5 s' (or "
          "time.steps, a number of steps)",
          "bad.cfg:4:1: error: domain.width: missing; expected a length > 0 (m, cm, mm, um)",
          "bad.cfg:5:1: error: unknown key 'domain.widht'; did you mean 'domain.width'?",
          "bad.cfg:7:11: error: contact.damping: 'lots' is not a number; expected a ratio 0..2",
          "bad.cfg:9:11: error: contact.time: '3 m' is a length; a time is needed",
          "bad.cfg:10:12: error: contact.friction: 'nan' is not a finite number; expected a ratio "
          "0..1e+06",
          "bad.cfg:12:11: error: fluid.spacing: '-1 mm' is out of range; expected a length > 0 (m, "
          "cm, mm, um), or auto",
          "bad.cfg:14:1: error: 'contact.stiffness' was already set on line 8",
          "bad.cfg:16:8: error: grains.rows: '2.5' is not a whole number; expected a whole number "
          "0..1000000000",
          "bad.cfg:17:10: error: grains.motion: 'fixed' is not known; expected free, frozen or "
          "driven",
          "bad.cfg:18:1: error: expected 'key = value', got 'just some words'",
          "bad.cfg:19:1: error: expected 'key = value', got '= 3'"));
}

TEST(ScenarioFile, FormsOfTheProductPage) {
  EXPECT_THAT(errors_of("[domain]\nwidth = 2 s\nheight = 6 cm\n[time]\nsteps = 1\n"),
              ElementsAre("bad.cfg:2:9: error: domain.width: '2 s' is a time; a length is needed"));
  EXPECT_THAT(errors_of(box + "dt = 0.01 s\n[fluid]\nsound_speed = 1 m/s\n"),
              ElementsAre("bad.cfg:6:6: error: time.dt: 0.01 s is above the cfl limit cfl h / c0; "
                          "largest safe value 0.0003125 s"));
}

TEST(ScenarioFile, BadSections) {
  EXPECT_THAT(errors_of(box + "[domian]\nleft = 1 cm\n[]\n[fluid\nspacing = x\n[zzz]\nq = 1\n"),
              ElementsAre("bad.cfg:6:1: error: unknown section 'domian'; did you mean 'domain'?",
                          "bad.cfg:8:1: error: expected '[section]', got '[]'",
                          "bad.cfg:9:1: error: expected '[section]', got '[fluid'",
                          HasSubstr("bad.cfg:10:11: error: fluid.spacing: 'x' is not a number"),
                          HasSubstr("bad.cfg:11:1: error: unknown section 'zzz'; expected one of "
                                    "scenario, domain, gravity, fluid, grains, contact, coupling, "
                                    "time, guards, record, species.NAME, event.NAME")));
}

TEST(ScenarioFile, KeysOutsideASection) {
  EXPECT_THAT(errors_of("width = 1\n" + box),
              ElementsAre("bad.cfg:1:1: error: key 'width' stands before any [section]; did you "
                          "mean 'domain.width'?"));
  const std::string dotted = "domain.width = 2 cm\ndomain.height = 4 cm\ntime.steps = 1\n";
  EXPECT_EQ(read(dotted).domain.height, 0.04);
}

TEST(ScenarioFile, CommentsMarksAndLineEndings) {
  const core::Scenario s = read(
      "\xef\xbb\xbf; a comment of the other kind\r\n"
      "# one of ours\r\n"
      "[domain]   # behind a section\r\n"
      "  width=2 cm# close behind a value\r\n"
      "\theight\t=\t6 cm\t\r\n"
      "\r\n"
      "[time]\r\n"
      "steps = 10");
  EXPECT_EQ(s.domain.width, 0.02);
  EXPECT_EQ(s.domain.height, 0.06);
  EXPECT_EQ(s.time.steps, 10);
  EXPECT_THAT(errors_of(box + "[fluid]\nspacing = 1 mm ; fine\n"),
              ElementsAre(HasSubstr("bad.cfg:7:11: error: fluid.spacing: '1 mm ; fine' has an "
                                    "unknown unit; expected a length > 0 (m, cm, mm, um), or auto "
                                    "(comments start with '#')")));
}

TEST(ScenarioFile, WhatIsNoText) {
  EXPECT_THAT(errors_of(std::string("\xff\xfe[\0d\0", 6)),
              ::testing::Contains("bad.cfg:1:1: error: UTF-16 text; expected UTF-8"));
  EXPECT_THAT(errors_of(std::string("[domain]\nwi\0dth = 2", 18)),
              ::testing::Contains("bad.cfg:2:1: error: a zero byte; expected a text file"));
  EXPECT_THAT(errors_of(std::string(2000000, 'x')),
              ::testing::Contains(HasSubstr("expected a scenario of at most 1048576 bytes")));
  EXPECT_THAT(errors_of(box + "[scenario]\ntitle = " + std::string(5000, 'x') + "\n"),
              ElementsAre(HasSubstr("bad.cfg:7:1: error: a line of 5008 bytes")));
  EXPECT_THAT(errors_of(box + "[\x01\x02]\n"), ElementsAre(HasSubstr("unknown section '?" "?'")));
}

TEST(ScenarioFile, CombinationsAreShownAtTheirKey) {
  EXPECT_THAT(errors_of(box + "[coupling]\nlength = 1 mm\n[grains]\nrows = 1\ncolumns = 1\n"),
              ElementsAre(HasSubstr("bad.cfg:7:10: error: coupling.length: 0.001 m is 0.4 d: the "
                                    "porosity inside a grain would not be positive; smallest safe "
                                    "value 0.00165")));
  // A key that was not written is shown at its section, or at the file.
  EXPECT_THAT(errors_of("[domain]\nheight = 6 cm\n[time]\nsteps = 1\n"),
              ElementsAre(HasSubstr("bad.cfg:1:1: error: domain.width: missing")));
  EXPECT_THAT(errors_of("# nothing\n[time]\nsteps = 1\n[fluid]\n[domain]\n"),
              ElementsAre(HasSubstr("bad.cfg:5:1: error: domain.width: missing"),
                          HasSubstr("bad.cfg:5:1: error: domain.height: missing")));
}

TEST(ScenarioFile, LengthOfTheRun) {
  const std::string open = "[domain]\nwidth = 2 cm\nheight = 6 cm\n";
  EXPECT_THAT(errors_of(open), ElementsAre(HasSubstr("time.until: missing")));
  EXPECT_TRUE(errors_of(open, {}, false).empty());
  EXPECT_THAT(errors_of(box + "until = 1 s\n"),
              ElementsAre("bad.cfg:5:1: error: 'time.steps' excludes 'time.until', set on line 6"));
  EXPECT_EQ(read(box, {"time.until=1"}).time.steps, 0);
  EXPECT_EQ(read(box, {"time.until=1"}).time.until, 1.0);
  EXPECT_TRUE(std::isnan(read(open + "[time]\nuntil=1 s\n", {"time.steps=7"}).time.until));
}

TEST(ScenarioFile, CommandLineWinsAndHasPlacesOfItsOwn) {
  EXPECT_EQ(read(box, {"domain.width=3cm"}).domain.width, 0.03);
  EXPECT_EQ(read(box, {" domain.width = 3 cm "}).domain.width, 0.03);
  EXPECT_THAT(errors_of(box, {"domain.width=3 cm", "contact.damping=lots", "contact.dampling=1",
                              "nonsense", "=1", "domain.width=4 cm"}),
              ElementsAre(
                  "<command line>:2: error: contact.damping: 'lots' is not a number; expected a "
                  "ratio 0..2",
                  "<command line>:3: error: unknown key 'contact.dampling'; did you mean "
                  "'contact.damping'?",
                  "<command line>:4: error: expected KEY=VALUE, got 'nonsense'",
                  "<command line>:5: error: expected KEY=VALUE, got '=1'",
                  "<command line>:6: error: 'domain.width' was already set by setting 1"));
  EXPECT_THAT(errors_of(box, {"time.dt=1"}),
              ElementsAre(HasSubstr("<command line>:1: error: time.dt: 1 s is above the cfl")));
  // A file's errors come first.
  EXPECT_THAT(errors_of(box + "[fluid]\nspacing = x\n", {"time.dt=x"}),
              ElementsAre(HasSubstr("bad.cfg:7:11"), HasSubstr("<command line>:1")));
}

TEST(ScenarioFile, PresetUnderAFile) {
  const core::Scenario s = read("[scenario]\npreset = column\n[grains]\nrows = 2\n");
  EXPECT_EQ(s.grains.rows, 2);
  EXPECT_EQ(s.grains.columns, 8);
  EXPECT_EQ(s.fluid.sound_speed, 2.5);
  EXPECT_THAT(errors_of(box + "[scenario]\npreset = colunm\n"),
              ElementsAre(HasSubstr("bad.cfg:7:10: error: scenario.preset: 'colunm' is not known; "
                                    "expected one of single_disc, column, hydrostatic")));
}

TEST(ScenarioFile, Events) {
  const core::Scenario s = read(box +
                                "[event.softer]\nat = 0.5 ms\ncontact.damping = 0.25\n"
                                "[event.wider]\nat_step = 3\ndomain.width = 3 cm\nanchor = left\n",
                                {"event.softer.contact.friction=0.1", "event.late.at_step=8",
                                 "event.late.gravity.tilt=10 deg"});
  ASSERT_EQ(s.changes.size(), 3u);
  EXPECT_EQ(s.changes[0].name, "softer");
  EXPECT_EQ(s.time.dt, 0.3125e-3);
  EXPECT_EQ(s.changes[0].at_step, 1);
  EXPECT_THAT(s.changes[0].settings, ElementsAre(std::pair<std::string, std::string>(
                                                     "contact.damping", "0.25"),
                                                 std::pair<std::string, std::string>(
                                                     "contact.friction", "0.1")));
  EXPECT_EQ(s.changes[1].name, "wider");
  EXPECT_EQ(s.changes[1].anchor, -1);
  EXPECT_EQ(s.changes[2].settings[0].first, "gravity.tilt");
  EXPECT_DOUBLE_EQ(std::stod(s.changes[2].settings[0].second), 10 * 3.14159265358979323846 / 180);
}

TEST(ScenarioFile, BadEvents) {
  EXPECT_THAT(
      errors_of(box +
                "[event.a]\n"
                "at = 5 m\n"
                "contact.dampling = 1\n"
                "grains.rows = 3\n"
                "contact.damping = 3\n"
                "[event.b]\n"
                "at = 1 s\n"
                "at_step = 3\n"
                "at = 2 s\n"
                "[event]\n"
                "x = 1\n"),
      ElementsAre(
          "bad.cfg:7:6: error: event.a.at: '5 m' is a length; a time is needed",
          "bad.cfg:8:1: error: unknown key 'event.a.contact.dampling'; did you mean "
          "'event.a.contact.damping'?",
          "bad.cfg:9:1: error: event.a.grains.rows: cannot change in a fork or an event: number, "
          "size, material and start of the grains are fixed in a family of runs",
          "bad.cfg:10:19: error: event.a.contact.damping: '3' is out of range; expected a ratio "
          "0..2",
          "bad.cfg:13:1: error: 'event.b.at_step' excludes 'event.b.at', set on line 12",
          "bad.cfg:14:1: error: 'event.b.at' was already set on line 12",
          HasSubstr("bad.cfg:15:1: error: unknown section 'event'")));
  EXPECT_THAT(errors_of(box + "[event.a]\ncontact.damping = 1\n"),
              ElementsAre(HasSubstr("bad.cfg:6:1: error: event.a.at: missing")));
  EXPECT_THAT(errors_of(box + "[event.a]\nat = 1 ms\n"),
              ElementsAre(HasSubstr("bad.cfg:6:1: error: event.a: the event changes nothing")));
  EXPECT_THAT(errors_of(box + "[event.a]\nat = 1 ms\ndomain.width = 2.1 cm\n"),
              ElementsAre(HasSubstr("bad.cfg:8:16: error: event.a.domain.width: 0.021 m moves each "
                                    "wall by 0.0005 m, not a multiple of fluid.spacing 0.001 m; "
                                    "nearest: 0.02 m or 0.022 m")));
}

TEST(ScenarioFile, CanonicalTextReadsBackToTheBit) {
  for (const Preset& preset : presets()) {
    const core::Scenario s = read(std::string(preset.text),
                                  {"event.softer.at=10ms", "event.softer.contact.damping=0.123456",
                                   "fluid.viscosity=0.0123456789012345678"});
    const std::string text = core::canonical_text(s);
    EXPECT_EQ(core::canonical_text(read(text)), text) << preset.name;
    EXPECT_EQ(core::canonical_text(
                  read_scenario_text(text, "genesis", {{}, false, true}).scenario),
              text);
  }
}

TEST(ScenarioFile, WrittenKeepsWhatWasLeftOpen) {
  const ScenarioSource source = read_scenario_text(box, "box.cfg");
  EXPECT_TRUE(std::isnan(source.written.time.dt));
  EXPECT_FALSE(std::isnan(source.scenario.time.dt));
  EXPECT_EQ(source.name, "box.cfg");
  EXPECT_EQ(source.text, box);
}

TEST(ScenarioFile, NumbersDoNotDependOnTheLocale) {
  const char* german = std::setlocale(LC_ALL, "de_DE.UTF-8");
  EXPECT_EQ(read(box, {"contact.damping=0.25"}).contact.damping, 0.25);
  if (german) std::setlocale(LC_ALL, "C");
}

TEST(ScenarioFile, PresetsAreTheShippedFiles) {
  for (const Preset& preset : presets()) {
    const std::string path = std::string(VARVE_SCENARIOS) + "/" + std::string(preset.name) + ".cfg";
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_EQ(text.str(), preset.text) << path;
  }
  EXPECT_EQ(find_preset("single_disc"), &presets()[0]);
  EXPECT_EQ(find_preset("nothing"), nullptr);
}

TEST(ScenarioFile, ShippedFilesAreValid) {
  for (const auto& entry : std::filesystem::directory_iterator(VARVE_SCENARIOS)) {
    if (entry.path().extension() != ".cfg") continue;
    std::ifstream file(entry.path(), std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_NO_THROW(read(text.str())) << entry.path();
  }
}

TEST(ScenarioFile, SingleDiscIsTheBenchmark) {
  const core::Scenario s = read(std::string(find_preset("single_disc")->text));
  EXPECT_EQ(s.domain.width, 0.02);
  EXPECT_EQ(s.domain.height, 0.06);
  EXPECT_EQ(s.grains.diameter, 2.5e-3);
  EXPECT_EQ(s.grains.density, 1250);
  EXPECT_EQ(s.grains.centre_x, 0.01);
  EXPECT_EQ(s.grains.lowest_y, 0.04);
  EXPECT_EQ(s.fluid.viscosity, 0.01);
  EXPECT_EQ(s.contact.damping, 0.2);
  EXPECT_EQ(s.time.dt, 0.25 * (1.25 * 1e-3));
  EXPECT_EQ(s.time.until, 1.5);
}

TEST(ScenarioFile, MutatedTextsNeverCrash) {
  // A deterministic walk over broken variants of a real file: any result is fine but a crash.
  const std::string text(find_preset("column")->text);
  std::uint64_t state = 12345;
  const auto draw = [&state](std::size_t n) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::size_t>(state >> 33) % n;
  };
  std::size_t refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string broken = text;
    for (std::size_t k = draw(4) + 1; k > 0; --k) {
      const std::size_t at = draw(broken.size());
      switch (draw(4)) {
        case 0: broken[at] = static_cast<char>(draw(256)); break;
        case 1: broken.erase(at, draw(20)); break;
        case 2: broken.insert(at, broken.substr(draw(broken.size()), draw(30))); break;
        default: broken.insert(at, 1, "[]=#;.%-\n\"e9"[draw(12)]); break;
      }
    }
    refused += errors_of(broken).empty() ? 0 : 1;
  }
  EXPECT_GT(refused, 300u);
}

}  // namespace
}  // namespace varve::tools
