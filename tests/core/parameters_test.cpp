// The parameter table, and values as text.
#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/parameters.h"

namespace varve::core {
namespace {

using ::testing::HasSubstr;

std::string error_of(std::string_view key, std::string_view value) {
  Scenario scenario;
  const auto error = set_parameter(scenario, *find_parameter(key), value);
  return error ? error->text : "";
}

TEST(ParameterTable, EveryKeyOnceUnderItsSection) {
  std::set<std::string_view> seen;
  std::string_view section;
  std::set<std::string_view> closed;
  for (const Parameter& parameter : parameters()) {
    EXPECT_TRUE(seen.insert(parameter.key).second) << parameter.key;
    EXPECT_FALSE(parameter.meaning.empty()) << parameter.key;
    const std::string_view own = parameter.key.substr(0, parameter.key.find('.'));
    if (own != section) {
      EXPECT_TRUE(closed.insert(own).second) << "section " << own << " comes twice";
      section = own;
    }
    EXPECT_EQ(find_parameter(parameter.key), &parameter);
  }
  EXPECT_EQ(find_parameter("domain.widht"), nullptr);
}

/// A value other than the default, for every kind of parameter.
std::string other_value(const Parameter& parameter) {
  struct {
    const Parameter& p;
    std::string operator()(Parameter::Real) const {
      const double low = std::max(p.lowest, -10.0), high = std::min(p.highest, 10.0);
      return number_text(low + 0.371 * (high - low));
    }
    std::string operator()(Parameter::Integer) const {
      return std::to_string(p.lowest + 1 > p.highest ? static_cast<int>(p.lowest)
                                                     : static_cast<int>(p.lowest) + 1);
    }
    std::string operator()(Parameter::Flag) const {
      return default_text(p) == "on" ? "off" : "on";
    }
    std::string operator()(Parameter::Text) const { return "some other text"; }
    std::string operator()(const Parameter::Choice&) const {
      return std::string(p.choices.back() == default_text(p) ? p.choices.front()
                                                             : p.choices.back());
    }
  } const pick{parameter};
  return std::visit(pick, parameter.access);
}

TEST(ParameterTable, EachKeyMovesItsOwnMemberAndNoOther) {
  const Scenario defaults;
  for (const Parameter& parameter : parameters()) {
    Scenario scenario;
    std::string value = other_value(parameter);
    if (value == default_text(parameter)) value = "2";  // where the default is lowest + 1
    const auto error = set_parameter(scenario, parameter, value);
    ASSERT_FALSE(error) << parameter.key << ": " << error->text;
    for (const Parameter& other : parameters()) {
      if (other.key == parameter.key) {
        EXPECT_EQ(get_parameter(scenario, other), value) << other.key;
        EXPECT_NE(get_parameter(scenario, other), get_parameter(defaults, other)) << other.key;
      } else {
        EXPECT_EQ(get_parameter(scenario, other), get_parameter(defaults, other))
            << parameter.key << " moved " << other.key;
      }
    }
  }
}

TEST(ParameterTable, DefaultsAreAccepted) {
  for (const Parameter& parameter : parameters()) {
    if (default_text(parameter) == "auto" && !parameter.may_be_automatic &&
        parameter.choices.empty())
      continue;  // domain.width and height have none
    EXPECT_EQ(error_of(parameter.key, default_text(parameter)), "") << parameter.key;
  }
}

TEST(ParameterTable, WhatAForkMayChange) {
  std::set<std::string_view> changeable;
  for (const Parameter& parameter : parameters()) {
    EXPECT_EQ(fixed_reason(parameter).empty(), parameter.change != Change::never) << parameter.key;
    const bool recording = parameter.key.starts_with("record.");
    if (recording) {
      EXPECT_EQ(parameter.change, Change::outputs) << parameter.key;
    } else if (parameter.change != Change::never) {
      changeable.insert(parameter.key);
    }
  }
  const std::set<std::string_view> expected{
      "contact.damping",   "contact.stiffness", "contact.friction", "contact.youngs_modulus",
      "fluid.viscosity",   "gravity.magnitude", "gravity.tilt",     "domain.width",
      "time.dt",           "time.until",        "time.steps"};
  EXPECT_EQ(changeable, expected);
}

TEST(ParameterTable, MisspeltKeysAreRecognised) {
  EXPECT_EQ(nearest_key("domain.widht"), "domain.width");
  EXPECT_EQ(nearest_key("contact.dampling"), "contact.damping");
  EXPECT_EQ(nearest_key("fluid.friction"), "contact.friction");
  EXPECT_EQ(nearest_key("grain.rows"), "grains.rows");
  EXPECT_EQ(nearest_key("viscosity"), "fluid.viscosity");
  EXPECT_EQ(nearest_key("nothing.like_this_at_all"), "");
  EXPECT_EQ(nearest_key(""), "");
  EXPECT_EQ(nearest_key(std::string(100000, 'x')), "");
}

TEST(ParameterTable, EditDistanceCountsSwapsAsOne) {
  EXPECT_EQ(edit_distance("width", "widht"), 1u);
  EXPECT_EQ(edit_distance("width", "width"), 0u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
}

TEST(ParameterValues, ErrorsSayWhatWasFoundAndWhatIsExpected) {
  EXPECT_EQ(error_of("contact.damping", "lots"), "'lots' is not a number; expected a ratio 0..2");
  EXPECT_EQ(error_of("domain.width", "2 s"), "'2 s' is a time; a length is needed");
  EXPECT_EQ(error_of("fluid.density", "3 m/s"), "'3 m/s' is a speed; a density is needed");
  EXPECT_EQ(error_of("contact.damping", "3 cm"), "'3 cm' is a length; a pure number is needed");
  EXPECT_EQ(error_of("contact.damping", "3 deg"), "'3 deg' is an angle; a pure number is needed");
  EXPECT_EQ(error_of("gravity.tilt", "3 m"), "'3 m' is a length; an angle is needed");
  EXPECT_EQ(error_of("domain.width", "-6 cm"),
            "'-6 cm' is out of range; expected a length > 0 (m, cm, mm, um)");
  EXPECT_EQ(error_of("domain.width", "0"),
            "'0' is out of range; expected a length > 0 (m, cm, mm, um)");
  EXPECT_EQ(error_of("contact.damping", "2.5"), "'2.5' is out of range; expected a ratio 0..2");
  EXPECT_THAT(error_of("domain.width", "nan"), HasSubstr("'nan' is not a finite number; expected"));
  EXPECT_THAT(error_of("domain.width", "inf m"), HasSubstr("is not a finite number"));
  EXPECT_THAT(error_of("domain.width", "1e999"), HasSubstr("is too large for a number"));
  EXPECT_THAT(error_of("domain.width", "6 parsec"), HasSubstr("has an unknown unit"));
  EXPECT_THAT(error_of("domain.width", "6 cm ; wide"), HasSubstr("comments start with '#'"));
  EXPECT_THAT(error_of("domain.width", "auto"), HasSubstr("'auto' is not a number"));
  EXPECT_EQ(error_of("grains.rows", "2.5"),
            "'2.5' is not a whole number; expected a whole number 0..1000000000");
  EXPECT_THAT(error_of("grains.rows", "-1"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("grains.rows", "99999999999999999999"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("grains.rows", ""), HasSubstr("'' is not a whole number"));
  EXPECT_EQ(error_of("fluid.present", "maybe"),
            "'maybe' is neither on nor off; expected on or off");
  EXPECT_EQ(error_of("coupling.drag", "stoks"),
            "'stoks' is not known; expected stokes, schiller_naumann, dallavalle_di_felice, "
            "gidaspow or cylinder; did you mean 'stokes'?");
  EXPECT_THAT(error_of("domain.sides", "free"),
              HasSubstr("expected no_slip, free_slip or periodic"));
  EXPECT_THAT(error_of("scenario.title", "a # b"), HasSubstr("'#'"));
  EXPECT_THAT(error_of("scenario.title", std::string(300, 'x')), HasSubstr("too long"));
}

TEST(ParameterValues, AFailedSettingChangesNothing) {
  Scenario scenario;
  const std::string before = canonical_text(scenario);
  for (const Parameter& parameter : parameters()) {
    if (std::holds_alternative<Parameter::Text>(parameter.access)) continue;
    EXPECT_TRUE(set_parameter(scenario, parameter, "?")) << parameter.key;
  }
  EXPECT_EQ(canonical_text(scenario), before);
}

TEST(ParameterValues, UnitsReachTheScenario) {
  Scenario s;
  EXPECT_FALSE(set_parameter(s, *find_parameter("domain.width"), " 6 cm "));
  EXPECT_EQ(s.domain.width, 0.06);
  EXPECT_FALSE(set_parameter(s, *find_parameter("gravity.tilt"), "90 deg"));
  EXPECT_DOUBLE_EQ(s.gravity.tilt, 1.5707963267948966);
  EXPECT_FALSE(set_parameter(s, *find_parameter("fluid.viscosity"), "10 cP"));
  EXPECT_EQ(s.fluid.viscosity, 0.01);
  EXPECT_FALSE(set_parameter(s, *find_parameter("fluid.jitter"), "5 %"));
  EXPECT_EQ(s.fluid.jitter, 0.05);
  EXPECT_FALSE(set_parameter(s, *find_parameter("contact.stiffness"), "220 kN/m"));
  EXPECT_EQ(s.contact.stiffness, 220000);
  EXPECT_FALSE(set_parameter(s, *find_parameter("time.dt"), "auto"));
  EXPECT_TRUE(std::isnan(s.time.dt));
}

}  // namespace
}  // namespace varve::core
