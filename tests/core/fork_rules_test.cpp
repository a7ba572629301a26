// What may change in a fork, and how a refusal reads.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/criteria.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

using ::testing::HasSubstr;
using Settings = std::vector<std::pair<std::string, std::string>>;

Scenario pipe() {
  Scenario s;
  s.domain.width = 0.06;
  s.domain.height = 0.12;
  s.grains.rows = 2;
  s.grains.columns = 2;
  s.grains.density = 2000;
  s.grains.gap = 0.1;
  s.fluid.sound_speed = 2.5;
  for (const Problem& problem : resolve(s)) ADD_FAILURE() << problem.key << ": " << problem.text;
  return s;
}

std::string refusal(Scenario s, const Settings& settings, int anchor = 0) {
  const std::string before = canonical_text(s);
  std::string text;
  for (const Problem& problem : apply_settings(s, settings, anchor))
    text += problem.key + ": " + problem.text + "\n";
  if (!text.empty()) {
    EXPECT_EQ(canonical_text(s), before) << "a refused change changed something";
  }
  return text;
}

TEST(Forks, NoSettingIsNoChange) {
  Scenario s = pipe();
  const std::string before = canonical_text(s);
  EXPECT_TRUE(apply_settings(s, {}).empty());
  EXPECT_EQ(canonical_text(s), before);
}

TEST(Forks, ExactlyTheNamedKeysChange) {
  const Scenario parent = pipe();
  const Settings each{{"contact.damping", "0.25"},  {"contact.stiffness", "5e5"},
                      {"contact.friction", "0"},    {"fluid.viscosity", "0.02"},
                      {"gravity.magnitude", "5"},   {"gravity.tilt", "0.1"},
                      {"time.dt", "1e-04"},         {"time.until", "2"},
                      {"time.steps", "100"},        {"record.tier", "digests"},
                      {"record.every", "10"},       {"record.keyframe_steps", "64"}};
  for (const auto& [key, value] : each) {
    Scenario child = parent;
    const auto problems = apply_settings(child, {{key, value}});
    ASSERT_TRUE(problems.empty()) << key << ": " << problems[0].text;
    const auto before = all_settings(parent), after = all_settings(child);
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (before[i].first == key) {
        EXPECT_NE(before[i].second, after[i].second) << key;
      } else {
        EXPECT_EQ(before[i].second, after[i].second) << key << " moved " << before[i].first;
      }
    }
  }
}

TEST(Forks, WidthMovesBothWallsByHalf) {
  Scenario s = pipe();
  EXPECT_TRUE(apply_settings(s, {{"domain.width", "8 cm"}}).empty());
  EXPECT_EQ(s.domain.width, 0.08);
  EXPECT_DOUBLE_EQ(s.domain.left, -0.01);
  s = pipe();
  EXPECT_TRUE(apply_settings(s, {{"domain.width", "8 cm"}}, -1).empty());
  EXPECT_EQ(s.domain.left, 0.0);
  s = pipe();
  EXPECT_TRUE(apply_settings(s, {{"domain.width", "8 cm"}}, 1).empty());
  EXPECT_DOUBLE_EQ(s.domain.left, -0.02);
}

TEST(Forks, WidthIsAWholeNumberOfSpacings) {
  EXPECT_THAT(refusal(pipe(), {{"domain.width", "6.3 cm"}}),
              HasSubstr("domain.width: 0.063 m moves each wall by 0.0015 m, not a multiple of "
                        "fluid.spacing 0.001 m; nearest: 0.062 m or 0.064 m"));
  EXPECT_EQ(refusal(pipe(), {{"domain.width", "6.3 cm"}}, -1), "");
  EXPECT_THAT(refusal(pipe(), {{"domain.width", "5.71 cm"}}),
              HasSubstr("nearest: 0.056 m or 0.058 m"));
  Scenario periodic = pipe();
  periodic.domain.sides = Boundary::periodic;
  EXPECT_THAT(refusal(periodic, {{"domain.width", "8 cm"}}), HasSubstr("only walls can move"));
}

TEST(Forks, FixedKeysNameTheirReason) {
  EXPECT_EQ(refusal(pipe(), {{"grains.diameter", "3 mm"}}),
            "grains.diameter: cannot change in a fork or an event: number, size, material and "
            "start of the grains are fixed in a family of runs\n");
  EXPECT_THAT(refusal(pipe(), {{"fluid.kernel", "cubic"}}), HasSubstr("kernel and resolution"));
  EXPECT_THAT(refusal(pipe(), {{"scenario.precision", "float"}}), HasSubstr("scalar type"));
  EXPECT_THAT(refusal(pipe(), {{"domain.dimension", "3"}}), HasSubstr("dimension"));
  EXPECT_THAT(refusal(pipe(), {{"contact.time", "1 ms"}}), HasSubstr("change contact.stiffness"));
  EXPECT_THAT(refusal(pipe(), {{"time.cfl", "0.1"}}), HasSubstr("change time.dt"));
}

TEST(Forks, EveryProblemIsReported) {
  const std::string text = refusal(pipe(), {{"grains.rows", "3"},
                                            {"contact.dampling", "1"},
                                            {"contact.damping", "a lot"},
                                            {"contact.friction", "0.1"},
                                            {"contact.friction", "0.2"},
                                            {"time.dt", "auto"}});
  EXPECT_THAT(text, HasSubstr("grains.rows: cannot change"));
  EXPECT_THAT(text, HasSubstr("contact.dampling: unknown key; did you mean 'contact.damping'?"));
  EXPECT_THAT(text, HasSubstr("contact.damping: 'a lot' is not a number"));
  EXPECT_THAT(text, HasSubstr("contact.friction: given twice"));
  EXPECT_THAT(text, HasSubstr("time.dt: 'auto' is derived at the start only"));
}

/// The largest safe value that a refusal names.
std::string safe_value(const std::string& text) {
  const std::string mark = "largest safe value ";
  const std::size_t found = text.find(mark);
  if (found == std::string::npos) return "";
  const std::size_t start = found + mark.size();
  return text.substr(start, text.find(' ', start) - start);
}

TEST(Forks, LimitsNameALargestSafeValueThatIsSafeAndLargest) {
  Scenario counted = pipe();
  counted.time.substeps = substeps(counted);
  const auto expect_tight = [](const Scenario& parent, const std::string& key,
                               const std::string& value) {
    const std::string text = refusal(parent, {{key, value}});
    const std::string safe = safe_value(text);
    ASSERT_FALSE(safe.empty()) << key << ": " << text;
    EXPECT_EQ(refusal(parent, {{key, safe}}), "") << key << " " << safe;
    const double above = std::stod(safe) * 1.0001;
    EXPECT_NE(refusal(parent, {{key, number_text(above)}}), "") << key << " " << above;
  };
  expect_tight(pipe(), "time.dt", "1");
  expect_tight(pipe(), "fluid.viscosity", "100");
  expect_tight(counted, "contact.stiffness", number_text(counted.contact.stiffness * 1e4));
  expect_tight(pipe(), "gravity.magnitude", "1e6");
}

TEST(Forks, LimitsNameTheKeyToAdd) {
  const std::string text = refusal(pipe(), {{"fluid.viscosity", "100"}});
  EXPECT_THAT(text, HasSubstr("fluid.viscosity: 100 Pa s puts the viscosity limit 0.125 h^2 rho0 / "
                              "mu below the inherited time.dt 0.000125 s"));
  EXPECT_THAT(text, HasSubstr("or add time.dt of at most 1.95312e-06 s"));
  EXPECT_EQ(refusal(pipe(), {{"fluid.viscosity", "100"}, {"time.dt", "1.9e-6"}}), "");
}

TEST(Forks, StifferContactsAreSubSteppedUnlessTheNumberIsFixed) {
  Scenario s = pipe();
  const std::int64_t before = substeps(s);
  const std::string stiffer = number_text(s.contact.stiffness * 1e4);
  ASSERT_TRUE(apply_settings(s, {{"contact.stiffness", stiffer}}).empty());
  EXPECT_NEAR(static_cast<double>(substeps(s)), 100.0 * static_cast<double>(before), 100);
  Scenario counted = pipe();
  counted.time.substeps = substeps(counted);
  EXPECT_THAT(refusal(counted, {{"contact.stiffness", stiffer}}),
              HasSubstr("puts the contact limit"));
  Scenario light = pipe();
  light.grains.density = 100;
  EXPECT_THAT(refusal(light, {{"contact.stiffness", "1e15"}, {"time.dt", "1e-4"}}),
              HasSubstr("grain sub-steps per step, at most 1000000 are possible"));
}

TEST(Forks, FrictionNeedsItsFieldsFromTheStart) {
  Scenario s = pipe();
  s.contact.rotation = false;
  EXPECT_THAT(refusal(s, {{"contact.friction", "0.5"}}), HasSubstr("contact.rotation is off"));
  EXPECT_EQ(refusal(s, {{"contact.friction", "0"}}), "");
  Scenario open = pipe();
  open.contact.friction = 0;
  EXPECT_EQ(refusal(open, {{"contact.friction", "0.5"}}), "");
}

TEST(Forks, SecondChangeStartsFromTheFirst) {
  Scenario s = pipe();
  ASSERT_TRUE(apply_settings(s, {{"domain.width", "8 cm"}}).empty());
  ASSERT_TRUE(apply_settings(s, {{"domain.width", "4 cm"}}).empty());
  EXPECT_DOUBLE_EQ(s.domain.left, 0.01);
  EXPECT_EQ(s.domain.width, 0.04);
}

}  // namespace
}  // namespace varve::core
