#include "tools/diff_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace varve::tools {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

io::FieldDifference velocity(std::uint64_t differing) {
  io::FieldDifference field;
  field.name = "fluid.velocity";
  field.unit = "m/s";
  field.components = 2;
  field.compared = 100;
  field.differing = field.beyond = field.particles = differing;
  if (differing == 0) return field;
  io::ValueDifference value;
  value.component = 1;
  value.particle = {1733};
  value.a = {io::ScalarType::f64, 0x3ff0000000000000};
  value.b = {io::ScalarType::f64, 0x3ff0000000000001};
  value.ulp = 1;
  value.absolute = value.relative = 0x1p-52;
  field.first = field.first_beyond = field.largest = value;
  field.largest_ulp = 1;
  field.largest_relative = value.relative;
  return field;
}

DiffReport different() {
  DiffReport report;
  report.a = "a.varve";
  report.b = "b.varve";
  report.verdict = Verdict::different;
  report.from = 0;
  report.to = 1200;
  report.steps_compared = 1201;
  io::FrameDifference states;
  states.fields = {velocity(3)};
  FirstDifference first;
  first.step = 812;
  first.time = 0.00406;
  describe_first(states, false, first);
  report.first = first;
  report.fields = states.fields;
  report.genesis = {{"parameter", "contact.damping", "0.2", "0.25"}};
  return report;
}

TEST(DiffReport, TheFirstLineNamesStepTimeFieldParticleBothValuesAndUlps) {
  EXPECT_EQ(headline(different()),
            "DIFFER first at step 812 (t=0.00406 s), field fluid.velocity.y, particle 1733: "
            "a=0x1p+0 b=0x1.0000000000001p+0 (1 ULP)");
  EXPECT_THAT(text_report(different(), false), StartsWith(headline(different()) + "\n"));
  EXPECT_EQ(text_report(different(), true), headline(different()) + "\n");
}

TEST(DiffReport, TheTextHoldsInputsDecimalsAndCounts) {
  const std::string text = text_report(different(), false);
  EXPECT_THAT(text, HasSubstr("parameter contact.damping: a=0.2 b=0.25"));
  EXPECT_LT(text.find("contact.damping"), text.find("  b = ")) << "inputs explain first";
  EXPECT_THAT(text, HasSubstr("b = 0x1.0000000000001p+0  (1.0000000000000002)"));
  EXPECT_THAT(text, HasSubstr("fluid.velocity: 3 of 100 values differ, 3 particles"));
}

TEST(DiffReport, VerdictsHaveTheirExitCodes) {
  EXPECT_EQ(exit_code(Verdict::identical), 0);
  EXPECT_EQ(exit_code(Verdict::within_tolerance), 0);
  EXPECT_EQ(exit_code(Verdict::different), 1);
  EXPECT_EQ(exit_code(Verdict::not_comparable), 2);
}

TEST(DiffReport, WithoutStatesTheStepIsNamedAndWhyNoField) {
  DiffReport report = different();
  report.first = FirstDifference{};
  report.first->step = 900;
  report.first->time = 0.0045;
  report.first->last_equal = 800;
  report.first->why_no_field = "field unknown: a digest file holds no states";
  report.fields.clear();
  EXPECT_EQ(headline(report),
            "DIFFER first at a step in 801..900 (t<=0.0045 s), field unknown: a digest file holds "
            "no states");
}

TEST(DiffReport, AParticleOfOneSideOnlyIsAFirstDifference) {
  io::FieldDifference ids;
  ids.name = "fluid.id";
  ids.only_b = 2;
  ids.first_only_b = {2400};
  io::FrameDifference states;
  states.fields = {ids};
  FirstDifference first;
  describe_first(states, false, first);
  EXPECT_EQ(first.field, "fluid.id");
  EXPECT_EQ(first.particle, "2400");
  EXPECT_EQ(first.a, "absent");
  EXPECT_EQ(first.b, "present");
  EXPECT_FALSE(first.ulp);
}

TEST(DiffReport, JsonHasTheKeysThatScriptsRelyOn) {
  const auto json = nlohmann::json::parse(json_report(different()));
  EXPECT_EQ(json["schema"], "varve.diff/1");
  EXPECT_EQ(json["verdict"], "different");
  EXPECT_EQ(json["steps_compared"], "1201");
  EXPECT_EQ(json["header_reads"], "0");
  const auto& first = json["first"];
  EXPECT_EQ(first["step"], "812");
  EXPECT_DOUBLE_EQ(first["time_s"].get<double>(), 0.00406);
  EXPECT_EQ(first["field"], "fluid.velocity.y");
  EXPECT_EQ(first["particle"], "1733");
  EXPECT_EQ(first["a"], "0x1p+0");
  EXPECT_EQ(first["b"], "0x1.0000000000001p+0");
  EXPECT_EQ(first["ulp"], "1");
  EXPECT_EQ(json["fields"][0]["differing"], "3");
}

TEST(DiffReport, JsonOfInfinitiesAndOddNamesStaysJson) {
  DiffReport report = different();
  report.a = "bad\xff\"name\n";
  report.fields[0].largest->absolute = std::numeric_limits<double>::infinity();
  report.first->absolute = std::numeric_limits<double>::infinity();
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_TRUE(json["fields"][0]["largest_absolute"].is_null());
  DiffReport identical;
  EXPECT_TRUE(nlohmann::json::parse(json_report(identical))["first"].is_null());
}

TEST(DiffReport, JunitHasOneCasePerFieldAndEscapes) {
  DiffReport report = different();
  report.a = "<a> & \"b\"";
  report.fields.push_back(velocity(0));
  report.fields.back().name = "fluid.mass";
  const std::string xml = junit_report(report, 0.25);
  EXPECT_THAT(xml, HasSubstr("tests=\"3\" failures=\"2\""));
  EXPECT_THAT(xml, HasSubstr("varve diff &lt;a&gt; &amp; &quot;b&quot; b.varve"));
  EXPECT_THAT(xml, HasSubstr("name=\"field fluid.mass\" time=\"0.000\"/>"));
  EXPECT_THAT(xml, HasSubstr("<failure type=\"different\" message=\"DIFFER first at step 812"));
  EXPECT_EQ(xml_escape("a\x01\tb"), "a?&#9;b");
  EXPECT_EQ(xml_escape("\xc3\xb6 \xe2\x82\xac \xf0\x9f\x98\x80"),
            "\xc3\xb6 \xe2\x82\xac \xf0\x9f\x98\x80");
  EXPECT_EQ(xml_escape("\xff \xc3 \xc0\x80 \xed\xa0\x80 \xe2\x82"), "? ? ?? ??? ??");
  DiffReport identical;
  EXPECT_THAT(junit_report(identical, 0), HasSubstr("tests=\"1\" failures=\"0\""));
}

TEST(DiffReport, AtMostTenAnnotationsAllEscaped) {
  DiffReport report = different();
  report.a = "a:1,2";
  report.genesis.clear();
  for (int k = 0; k < 30; ++k)
    report.genesis.push_back({"parameter", "key" + std::to_string(k), "50%", "two\nlines"});
  const std::string text = github_report(report);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 10);
  EXPECT_THAT(text,
              StartsWith("::error title=varve diff a%3A1%2C2 b.varve::DIFFER first at step "));
  EXPECT_THAT(text, HasSubstr("a=50%25 b=two%0Alines"));
  EXPECT_THAT(text, HasSubstr("and 23 more findings"));
  EXPECT_EQ(github_report(DiffReport{}), "");
}

TEST(DiffReport, WithinToleranceIsNeverCalledIdentical) {
  DiffReport report = different();
  report.verdict = Verdict::within_tolerance;
  report.tolerance_given = true;
  EXPECT_THAT(headline(report), StartsWith("WITHIN TOLERANCE, not bitwise: steps 0..1200"));
  EXPECT_THAT(headline(report), Not(HasSubstr("IDENTICAL")));
}

}  // namespace
}  // namespace varve::tools
