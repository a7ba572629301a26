// varve tradeoff: fronts and errors on numbers made by hand, ladders as settings, and the verb as a
// user runs it on scenes of well under a second.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/criteria.h"
#include "tests/tools/json_schema.h"
#include "tests/tools/verbs.h"
#include "tests/tools/xml.h"
#include "tools/svg_plot.h"
#include "tools/tradeoff.h"

namespace varve::test {
namespace {

using namespace varve::tools;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

// ---- fronts and errors ----

TEST(ParetoFront, HoldsWhatNothingBeats) {
  EXPECT_THAT(pareto_front(std::vector{1.0, 2.0, 3.0, 4.0}, std::vector{0.4, 0.1, 0.2, 0.05}),
              ElementsAre(true, true, false, true));
  EXPECT_THAT(pareto_front(std::vector{1.0, 1.0, 1.0}, std::vector{0.1, 0.1, 0.2}),
              ElementsAre(true, true, false));
  EXPECT_THAT(pareto_front(std::vector{1.0, none, 2.0}, std::vector{none, 0.1, 0.3}),
              ElementsAre(false, false, true));
}

TEST(ParetoFront, TheCheapestWithinALimit) {
  const std::vector cost{5.0, 1.0, 2.0, 2.0, none}, error{0.0, 0.3, 0.02, 0.01, 0.0};
  EXPECT_EQ(cheapest_within(cost, error, 0.5), 1u);
  EXPECT_EQ(cheapest_within(cost, error, 0.02), 3u);
  EXPECT_EQ(cheapest_within(cost, error, 0.005), 0u);
  EXPECT_EQ(cheapest_within(std::vector{1.0}, std::vector{none}, 1), std::nullopt);
}

RungResult rung_of(const std::string& name, std::vector<std::vector<double>> values, double cpu) {
  RungResult rung;
  rung.rung.name = name;
  rung.status = "ran";
  for (const auto& each : values) {
    RungRun run;
    run.cost.cpu_s = cpu;
    run.cost.steps = 10;
    if (!each.empty()) run.values["m"] = each;
    rung.runs.push_back(run);
  }
  return rung;
}

TradeMeasure measure_m(std::optional<double> known = {}, double scale = 1) {
  TradeMeasure measure;
  measure.name = "m";
  measure.known = known;
  measure.scale = scale;
  return measure;
}

TEST(Judge, ErrorsAreRelativeToTheReferenceWithItsSpread) {
  std::vector<TradeMeasure> measures{measure_m()};
  std::vector<RungResult> rungs{rung_of("a", {{1.1}, {1.3}}, 2), rung_of("b", {{2}, {2}}, 8)};
  EXPECT_TRUE(judge(measures, rungs, 1).empty());
  EXPECT_NEAR(*rungs[0].judged[0].value, 1.2, 1e-12);
  EXPECT_NEAR(*rungs[0].judged[0].error, -0.4, 1e-12);
  EXPECT_NEAR(rungs[0].judged[0].spread, std::sqrt(0.02) / 2, 1e-12);
  EXPECT_NEAR(*rungs[0].worst, 0.4 + std::sqrt(0.01) / 2, 1e-12);
  EXPECT_EQ(*rungs[1].judged[0].error, 0);
  EXPECT_TRUE(rungs[0].front && rungs[1].front && rungs[1].reference);
}

TEST(Judge, AKnownValueStandsInForTheReference) {
  std::vector<TradeMeasure> measures{measure_m(4.0, 4.0)};
  std::vector<RungResult> rungs{rung_of("a", {{5}}, 2), rung_of("b", {{3}}, 8)};
  judge(measures, rungs, 1);
  EXPECT_NEAR(*rungs[0].judged[0].error, 0.25, 1e-12);
  EXPECT_NEAR(*rungs[1].judged[0].error, -0.25, 1e-12);
  EXPECT_TRUE(rungs[0].front);
  EXPECT_FALSE(rungs[1].front);
}

TEST(Judge, ACurveIsComparedPointByPoint) {
  std::vector<TradeMeasure> measures{measure_m()};
  std::vector<RungResult> rungs{rung_of("a", {{0, 2, 0, 4}}, 1), rung_of("b", {{0, 0, 0, 4}}, 8)};
  judge(measures, rungs, 1);
  EXPECT_NEAR(*rungs[0].judged[0].error, 0.25, 1e-12);  // rms 1 over the largest, 4
}

TEST(Judge, WhatDidNotHappenIsNoError) {
  std::vector<TradeMeasure> measures{measure_m()};
  std::vector<RungResult> rungs{rung_of("a", {{}}, 1), rung_of("b", {{2}}, 8)};
  EXPECT_TRUE(judge(measures, rungs, 1).empty());
  EXPECT_FALSE(rungs[0].worst.has_value());
  EXPECT_FALSE(rungs[0].front);
  // Where the reference itself lacks it, it is no measure of this scene.
  std::vector<RungResult> turned{rung_of("a", {{2}}, 1), rung_of("b", {{}}, 8)};
  EXPECT_THAT(judge(measures, turned, 1), ElementsAre("m"));
  EXPECT_TRUE(measures.empty());
  EXPECT_FALSE(turned[0].front);
}

TEST(Judge, AnotherWayToRecordHasTheValuesOfItsBits) {
  std::vector<RungResult> rungs{rung_of("standard", {{1}}, 1), rung_of("digests", {{1.5}}, 1),
                                rung_of("every 8", {{1.7}}, 1)};
  for (RungResult& rung : rungs) rung.rung.knob = rung.rung.name == "standard" ? "level" : "record";
  rungs[0].runs[0].chain = rungs[1].runs[0].chain = "aa";
  rungs[2].runs[0].chain = "bb";
  share_values(rungs);
  EXPECT_EQ(rungs[1].runs[0].values["m"], std::vector<double>{1});
  EXPECT_EQ(rungs[2].runs[0].values["m"], std::vector<double>{1.7});
}

TEST(Share, IsReadWithOrWithoutPercent) {
  EXPECT_NEAR(fraction("2%", "--within"), 0.02, 1e-15);
  EXPECT_NEAR(fraction("0.5 %", "--within"), 0.005, 1e-15);
  EXPECT_NEAR(fraction("0.05", "--within"), 0.05, 1e-15);
  for (const char* bad : {"", "%", "two", "-1%", "0", "nan", "2%%"})
    EXPECT_THROW(fraction(bad, "--within"), UsageError) << bad;
}

// ---- plots ----

TEST(SvgPlot, IsWellFormedAndHoldsItsPoints) {
  Plot plot;
  plot.title = "a < b & \"c\"";
  plot.log_x = plot.log_y = true;
  PlotSeries series;
  series.name = "front";
  series.x = {1, 10, 0, 1};
  series.y = {0.1, 0.01, 1, none};
  series.labels = {"x<y"};
  series.tips = {"first", "second"};
  plot.series = {series};
  const std::string svg = svg_of(plot);
  EXPECT_EQ(broken_xml(svg), "");
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; &quot;c&quot;"));
  EXPECT_THAT(svg, HasSubstr("x&lt;y"));
  EXPECT_THAT(svg, HasSubstr("<title>second</title>"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  // Two points: what can't be drawn is left out.
  std::size_t circles = 0;
  for (std::size_t at = 0; (at = svg.find("<circle", at)) != std::string::npos; ++at) ++circles;
  EXPECT_EQ(circles, 2u);
  plot.series.front().x = {0, -1, 0, -1};
  EXPECT_THAT(svg_of(plot), HasSubstr("nothing to draw"));
  EXPECT_NE(broken_xml("<svg><g></svg>"), "");
}

TEST(SvgPlot, TicksAreRoundAndInside) {
  EXPECT_THAT(axis_ticks(0, 10, 6), ElementsAre(0, 2, 4, 6, 8, 10));
  EXPECT_THAT(log_ticks(0.9, 21), ElementsAre(1, 2, 5, 10, 20));
  EXPECT_THAT(log_ticks(1, 1e5), ElementsAre(1, 10, 100, 1000, 1e4, 1e5));
}

// ---- ladders ----

/// A fluid driven between two plates: cheap, with a known profile.
std::string channel_scene() {
  return R"([domain]
width = 4 mm
height = 8 mm
sides = periodic
[fluid]
viscosity = 0.1 Pa.s
spacing = 0.5 mm
smoothing_ratio = 1.5
body_force_x = 0.4 m/s2
[time]
until = 60 ms
[record]
tier = digests
)";
}

std::string dry_scene() {
  return R"([domain]
width = 1 cm
height = 1 cm
[gravity]
magnitude = 0
[fluid]
present = off
[grains]
rows = 1
columns = 1
diameter = 2 mm
density = 2000
lowest_y = 3 mm
velocity_y = -0.5 m/s
[contact]
time = 0.5 ms
damping = 0
friction = 0
[time]
until = 20 ms
)";
}

TEST(Ladder, LevelsAreRatiosToWhatTheSceneWrites) {
  const TemporaryFolder folder;
  const std::string file = folder.write("disc.cfg", disc_scene());
  const TradeScene scene = load_trade_scene(file, {}, {});
  EXPECT_NEAR(scene.until, 160 * scene.base.time.dt, 1e-12);
  LadderOptions options;
  options.levels = {"draft", "fine", "reference"};
  const std::vector<Rung> rungs = make_ladder(scene, options);
  ASSERT_EQ(rungs.size(), 4u);
  const auto spacing = [&](std::size_t k) { return rungs[k].scenario.fluid.spacing; };
  EXPECT_EQ(rungs[0].name, "standard");
  EXPECT_EQ(spacing(0), 1e-3);
  EXPECT_GT(spacing(1), 1e-3);
  EXPECT_LT(spacing(2), 0.72e-3);
  EXPECT_EQ(spacing(3), 0.5e-3);
  EXPECT_EQ(rungs[3].scenario.fluid.sound_speed, 2);
  EXPECT_EQ(rungs[3].scenario.time.cfl, 0.125);
  EXPECT_EQ(rungs[1].scenario.precision, core::Precision::float_);
  for (const Rung& rung : rungs) EXPECT_EQ(rung.scenario.time.until, scene.until) << rung.name;
}

TEST(Ladder, KnobsTurnOneThingAndEqualRungsAreLeftOut) {
  const TemporaryFolder folder;
  const TradeScene scene =
      load_trade_scene(folder.write("disc.cfg", disc_scene()), {}, {});
  LadderOptions options;
  options.knobs = {"cfl", "h/dx", "kernel", "substeps", "record"};
  options.vary = {"coupling.length=2.5mm,4mm"};
  options.rungs = {"time.cfl=0.5,scenario.precision=float"};
  std::set<std::string> names;
  for (const Rung& rung : make_ladder(scene, options)) {
    EXPECT_TRUE(names.insert(rung.name).second) << rung.name;
    EXPECT_EQ(rung.refused, "") << rung.name;
  }
  EXPECT_TRUE(names.count("cfl 0.5") && names.count("h/dx 2") && names.count("substeps 1"));
  EXPECT_TRUE(names.count("digests") && names.count("coupling.length 4mm"));
  EXPECT_TRUE(names.count("time.cfl=0.5,scenario.precision=float"));
  // What the scene has already is `standard`.
  for (const char* same : {"cfl 0.25", "h/dx 1.25", "kernel wendland_c2", "deltas",
                           "coupling.length 2.5mm"})
    EXPECT_FALSE(names.count(same)) << same;
}

TEST(Ladder, ARungThatMakesNoSenseSaysWhy) {
  const TemporaryFolder folder;
  const TradeScene scene = load_trade_scene(folder.write("disc.cfg", disc_scene()), {}, {});
  LadderOptions options;
  options.vary = {"fluid.smoothing_ratio=2,9"};
  const std::vector<Rung> rungs = make_ladder(scene, options);
  ASSERT_EQ(rungs.size(), 3u);
  EXPECT_EQ(rungs[1].refused, "");
  EXPECT_THAT(rungs[2].refused, HasSubstr("fluid.smoothing_ratio"));
  options.vary = {"fluid.smothing_ratio=2"};
  EXPECT_THROW(make_ladder(scene, options), UsageError);
  options.vary = {};
  options.knobs = {"clf"};
  EXPECT_THROW(make_ladder(scene, options), UsageError);
}

// ---- the verb ----

std::string text_of_file(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

const Json& rung_named(const Json& report, const std::string& name) {
  for (const Json& rung : report.at("rungs"))
    if (rung.at("name") == name) return rung;
  throw std::runtime_error("no rung " + name);
}

TEST(TradeoffVerb, WritesTableCsvJsonAndPlotAndRunsNothingTwice) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const std::vector<std::string> words{"tradeoff", "disc.cfg", "--levels", "draft,fine", "--knobs",
                                       "cfl,record", "--measure", "peak_speed", "--measure",
                                       "first_contact", "--within", "30%", "--within", "1e-9",
                                       "-o", "out", "-q"};
  const Json first = json_verb(0, words, folder.path());
  EXPECT_THAT(JsonSchema("tradeoff").breaches(first), ElementsAre());
  EXPECT_EQ(first["reference"], "fine");
  const Json& standard = rung_named(first, "standard");
  EXPECT_EQ(standard["status"], "ran");
  EXPECT_EQ(whole(standard["cost"]["steps"]), 160u);
  EXPECT_GT(standard["cost"]["cpu_s"], 0);
  EXPECT_GT(whole(standard["cost"]["bytes"]), 1000u);
  EXPECT_EQ(rung_named(first, "fine")["worst_error"], 0);
  // The error is what the two values say.
  const Json &here = standard["measures"][0], &there = rung_named(first, "fine")["measures"][0];
  EXPECT_NEAR(here["error"], here["value"].get<double>() / there["value"].get<double>() - 1, 1e-12);
  // The same bits, however they are recorded.
  EXPECT_EQ(rung_named(first, "digests")["runs"][0]["chain"], standard["runs"][0]["chain"]);
  EXPECT_EQ(rung_named(first, "digests")["worst_error"], standard["worst_error"]);
  EXPECT_EQ(first["recommended"][1]["rung"], "fine");
  EXPECT_LE(rung_named(first, first["recommended"][0]["rung"])["worst_error"], 0.3);

  EXPECT_EQ(broken_xml(text_of_file(folder / "out/tradeoff.svg")), "");
  std::istringstream csv(text_of_file(folder / "out/tradeoff.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_THAT(line, HasSubstr("cpu_s,wall_s,steps,bytes,worst_error,front,peak_speed"));
  std::size_t lines = 0;
  while (std::getline(csv, line)) ++lines;
  EXPECT_EQ(lines, first["rungs"].size());

  const Json again = json_verb(0, words, folder.path());
  for (const Json& rung : again["rungs"]) {
    for (const Json& run : rung["runs"]) EXPECT_TRUE(run["cached"]) << rung["name"];
    EXPECT_EQ(rung["cost"], rung_named(first, rung["name"])["cost"]);
  }
  // No logs are left, one result for each rung.
  std::size_t results = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "out/rungs")) {
    EXPECT_EQ(entry.path().extension(), ".json");
    ++results;
  }
  EXPECT_EQ(results, first["rungs"].size());
}

TEST(TradeoffVerb, GoesOnWhereItWasKilled) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const std::vector<std::string> words{"tradeoff", folder / "disc.cfg", "--levels", "draft",
                                       "--knobs", "cfl", "--measure", "peak_speed", "-o",
                                       folder / "out", "-q"};
  const auto results = [&] {
    std::set<std::string> names;
    std::error_code missing;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "out/rungs", missing))
      if (entry.path().extension() == ".json") names.insert(entry.path().filename());
    return names;
  };
  {
    Background killed(words);
    for (int k = 0; k < 2000 && results().size() < 2 && !killed.ended(); ++k)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    killed.signal(SIGKILL);
    killed.wait();
  }
  const std::size_t before = results().size();
  ASSERT_GE(before, 2u);
  const Json report = json_verb(0, words);
  std::size_t cached = 0;
  for (const Json& rung : report["rungs"]) cached += rung["runs"][0]["cached"] ? 1 : 0;
  EXPECT_EQ(cached, before);
  EXPECT_EQ(results().size(), report["rungs"].size());
}

TEST(TradeoffVerb, AStopIsExit75AndKeepsWhatIsFinished) {
  const TemporaryFolder folder;
  folder.write("long.cfg", long_scene());
  Background stopped({"tradeoff", folder / "long.cfg", "--levels", "reference", "--knobs", "none",
                      "-s", "time.steps=300", "-o", folder / "out", "-q"});
  const auto finished = [&] {
    std::error_code missing;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "out/rungs", missing))
      if (entry.path().extension() == ".json") return true;
    return false;
  };
  for (int k = 0; k < 4000 && !finished() && !stopped.ended(); ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  stopped.signal(SIGTERM);
  EXPECT_EQ(stopped.wait(), 75);
  EXPECT_TRUE(finished());
  for (const auto& entry : std::filesystem::directory_iterator(folder / "out/rungs"))
    EXPECT_EQ(entry.path().extension(), ".json");
}

TEST(TradeoffVerb, AKnownProfileIsTheReference) {
  const TemporaryFolder folder;
  folder.write("channel.cfg", channel_scene());
  const Json report =
      json_verb(0, {"tradeoff", "channel.cfg", "--levels", "draft", "--knobs", "spacing", "-q"},
                folder.path());
  EXPECT_THAT(JsonSchema("tradeoff").breaches(report), ElementsAre());
  ASSERT_EQ(report["measures"].size(), 1u);
  EXPECT_EQ(report["measures"][0]["name"], "poiseuille");
  EXPECT_EQ(report["measures"][0]["known"], 0);
  // Twice the resolution, a smaller error; and no error is nothing, not even the finest rung's.
  const double coarse = rung_named(report, "spacing / 0.8")["worst_error"];
  const double fine = rung_named(report, "spacing / 2")["worst_error"];
  EXPECT_GT(fine, 0);
  EXPECT_LT(fine, 0.6 * coarse);
  EXPECT_LT(fine, 0.03);
  EXPECT_TRUE(std::filesystem::exists(folder / "channel.tradeoff/tradeoff.csv"));
}

TEST(TradeoffVerb, MeasuresByExpressionAgainstAKnownValue) {
  const TemporaryFolder folder;
  folder.write("dry.cfg", dry_scene());
  // An undamped disc 2 mm above the floor's reach at 0.5 m/s touches it after 4 ms, and rebounds as
  // fast as it came.
  const Json report = json_verb(
      0, {"tradeoff", "dry.cfg", "--levels", "draft", "--knobs", "cfl", "-q", "--measure",
          "touch=contacts.first_s", "--known", "touch=0.004", "--measure", "restitution", "--known",
          "restitution=1", "--measure", "energy_drift"},
      folder.path());
  EXPECT_THAT(JsonSchema("tradeoff").breaches(report), ElementsAre());
  for (const Json& rung : report["rungs"]) {
    ASSERT_EQ(rung["status"], "ran") << rung["why"];
    EXPECT_LT(rung["worst_error"], 0.02) << rung["name"];
  }
  EXPECT_EQ(report["measures"][0]["known"], 0.004);
}

TEST(TradeoffVerb, SeedsGiveASpread) {
  const TemporaryFolder folder;
  folder.write("crowd.cfg", crowd_scene());
  const Json report = json_verb(0, {"tradeoff", "crowd.cfg", "--levels", "fine", "--knobs", "none",
                                    "--seeds", "3", "--measure", "peak_speed", "--measure", "fall",
                                    "-q"},
                                folder.path());
  EXPECT_THAT(JsonSchema("tradeoff").breaches(report), ElementsAre());
  const Json& standard = rung_named(report, "standard");
  ASSERT_EQ(standard["runs"].size(), 3u);
  EXPECT_NE(standard["runs"][0]["chain"], standard["runs"][1]["chain"]);
  EXPECT_GT(standard["measures"][0]["spread"], 0);
  EXPECT_LT(standard["measures"][0]["spread"], 0.5);
  folder.write("disc.cfg", disc_scene());
  const CommandResult same =
      verb(2, {"tradeoff", "disc.cfg", "--seeds", "2"}, folder.path());
  EXPECT_THAT(same.errors, HasSubstr("nothing in this scene is drawn from a seed"));
}

TEST(TradeoffVerb, ARungThatFailsIsShownAndTheOthersStand) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const std::vector<std::string> words{
      "tradeoff", "disc.cfg", "--levels", "fine", "--knobs", "none", "--vary",
      "guards.speed=1e-4", "--vary", "fluid.smoothing_ratio=9", "--measure", "peak_speed", "-q"};
  const Json report = json_verb(0, words, folder.path());
  EXPECT_THAT(JsonSchema("tradeoff").breaches(report), ElementsAre());
  const Json& failed = rung_named(report, "guards.speed 1e-4");
  EXPECT_EQ(failed["status"], "failed");
  EXPECT_THAT(failed["why"].get<std::string>(), HasSubstr("exit 5: step 1:"));
  EXPECT_TRUE(failed["worst_error"].is_null());
  EXPECT_FALSE(failed["front"]);
  EXPECT_EQ(rung_named(report, "fluid.smoothing_ratio 9")["status"], "refused");
  const CommandResult text = verb(0, words, folder.path());
  EXPECT_THAT(text.output, HasSubstr("guards.speed 1e-4: failed: exit 5: step 1:"));
}

TEST(TradeoffVerb, TheBudgetIsStatedRefusedAndTrimmed) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const std::vector<std::string> words{"tradeoff", "disc.cfg", "--levels", "reference", "--knobs",
                                       "substeps,cfl"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), words.begin(), words.end());
    return more;
  };
  const CommandResult plan = verb(0, with({"--dry-run"}), folder.path());
  EXPECT_THAT(plan.output, HasSubstr("substeps 1"));
  EXPECT_THAT(plan.output, HasSubstr("CPU-seconds to run"));
  EXPECT_FALSE(std::filesystem::exists(folder / "disc.tradeoff"));
  const CommandResult refused = verb(2, with({"--budget", "1ms"}), folder.path());
  EXPECT_THAT(refused.errors, HasSubstr("CPU-seconds, more than 0.001"));
  EXPECT_THAT(verb(2, with({"--budget", "1ms", "--trim"}), folder.path()).errors,
              HasSubstr("`standard` and the reference alone"));
  EXPECT_EQ(verb(2, with({"--trim"}), folder.path()).code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder / "disc.tradeoff"));
}

TEST(TradeoffVerb, RefusesWhatMeansNothing) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const auto refused = [&](std::vector<std::string> words, int code = 2) {
    words.insert(words.begin(), {"tradeoff", "disc.cfg"});
    return verb(code, words, folder.path()).errors;
  };
  EXPECT_THAT(refused({"--measure", "poiseuille"}), HasSubstr("settling_speed"));
  EXPECT_THAT(refused({"--measure", "x=contacts.first"}), HasSubstr("column"));
  EXPECT_THAT(refused({"--known", "nothing=1"}), HasSubstr("not among the measures"));
  EXPECT_THAT(refused({"--within", "lots"}), HasSubstr("expected a share"));
  EXPECT_THAT(refused({"--knobs", "clf"}), HasSubstr("no knob 'clf'"));
  EXPECT_THAT(refused({"--levels", "best"}), HasSubstr("no level 'best'"));
  EXPECT_THAT(refused({"--reference", "nobody", "--dry-run", "--knobs", "none"}),
              HasSubstr("no rung 'nobody'"));
  EXPECT_THAT(refused({"--log", "--limits"}), HasSubstr("exclude each other"));
  EXPECT_THAT(refused({"-s", "fluid.spacing=0.3mm"}, 3), HasSubstr("spacings"));
  EXPECT_THAT(verb(2, {"tradeoff", "none.cfg"}, folder.path()).errors, HasSubstr("none.cfg"));
}

// ---- the price of recording ----

TEST(TradeoffLog, PricesEveryTierAndCadence) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const Json report = json_verb(0, {"tradeoff", "disc.cfg", "--log", "--steps", "96", "--seeks",
                                    "6", "-q", "-o", "out"},
                                folder.path());
  EXPECT_THAT(JsonSchema("tradeoff_log").breaches(report), ElementsAre());
  EXPECT_EQ(whole(report["steps"]), 96u);
  const auto row = [&](const std::string& name) -> Json {
    for (const Json& each : report["recordings"])
      if (each["name"] == name) return each;
    throw std::runtime_error("no recording " + name);
  };
  // Digests hold less than deltas, and rarer keyframes less than frequent ones.
  EXPECT_LT(row("digests, keyframes 64")["bytes_per_step"],
            0.5 * row("deltas, keyframes 64")["bytes_per_step"].get<double>());
  EXPECT_LT(row("digests, keyframes 64")["bytes_per_step"],
            row("digests, keyframes 16")["bytes_per_step"].get<double>());
  EXPECT_LT(row("deltas, keyframes 256")["bytes_per_step"],
            row("deltas, keyframes 64")["bytes_per_step"].get<double>());
  for (const Json& each : report["recordings"]) {
    EXPECT_GT(each["encode_cpu_s_per_step"], 0);
    EXPECT_GT(each["seek_cpu_s"], 0);
  }
  EXPECT_EQ(broken_xml(text_of_file(folder / "out/log.svg")), "");
  EXPECT_THAT(text_of_file(folder / "out/log.csv"), HasSubstr("\"every 16\","));
  EXPECT_EQ(verb(2, {"tradeoff", "disc.cfg", "--log", "--budget", "1us"}, folder.path()).code, 2);
}

// ---- limits ----

Json limit_named(const Json& report, const std::string& name) {
  for (const Json& each : report.at("limits"))
    if (each.at("name") == name) return each;
  throw std::runtime_error("no limit " + name);
}

TEST(TradeoffLimits, ADryContactMeetsTheSpringsLimit) {
  const TemporaryFolder folder;
  folder.write("dry.cfg", dry_scene());
  const Json report = json_verb(
      0, {"tradeoff", "dry.cfg", "--limits", "--steps", "1200", "--precise", "5%", "-q"},
      folder.path());
  EXPECT_THAT(JsonSchema("tradeoff_limits").breaches(report), ElementsAre());
  // An explicit step of an undamped spring grows beyond 2 sqrt(m / k).
  const TradeScene scene = load_trade_scene(folder / "dry.cfg", {}, {});
  const double spring = 2 * std::sqrt(core::grain_mass(scene.base) /
                                      scene.base.contact.stiffness);
  const Json step = limit_named(report, "time step");
  EXPECT_GT(step["stable"], 0.6 * spring);
  EXPECT_LT(step["stable"], 1.3 * spring);
  EXPECT_GT(step["failing"], step["stable"].get<double>());
  EXPECT_LT(step["failing"], 1.06 * step["stable"].get<double>());
  EXPECT_NEAR(step["theory"].back()["value"], spring, 1e-9 * spring);
  EXPECT_EQ(step["announced"]["exit"], 5);
  EXPECT_THAT(step["announced"]["criterion"].get<std::string>(), HasSubstr("overlap"));
  // By stiffness at the scene's step it is the same limit: k grows with the square.
  const Json stiff = limit_named(report, "stiffness");
  const double ratio = std::sqrt(stiff["stable"].get<double>() / scene.base.contact.stiffness) *
                       scene.base.time.dt / spring;
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.3);
}

TEST(TradeoffLimits, ACoupledSceneIsDrivenInAllItsNumbers) {
  const TemporaryFolder folder;
  folder.write("disc.cfg", disc_scene());
  const Json report = json_verb(
      0, {"tradeoff", "disc.cfg", "--limits", "--steps", "100", "--precise", "20%", "-q"},
      folder.path());
  EXPECT_THAT(JsonSchema("tradeoff_limits").breaches(report), ElementsAre());
  std::set<std::string> names;
  for (const Json& each : report["limits"]) {
    names.insert(each["name"]);
    EXPECT_FALSE(each["stable"].is_null()) << each["name"];
  }
  for (const char* name : {"time step", "stiffness", "CFL number", "density ratio, heavy",
                           "density ratio, light", "coupling length"})
    EXPECT_TRUE(names.count(name)) << name;
  const Json step = limit_named(report, "time step");
  EXPECT_GT(step["stable"], step["scene"].get<double>());
  EXPECT_FALSE(step["failing"].is_null());
  EXPECT_FALSE(step["announced"]["text"].get<std::string>().empty());
  const CommandResult text = verb(
      0, {"tradeoff", "disc.cfg", "--limits", "--steps", "20", "--precise", "50%", "-q"},
      folder.path());
  EXPECT_THAT(text.output, HasSubstr("announced by     exit 5, "));
}

}  // namespace
}  // namespace varve::test
