// varve validate: every fast case as a test of its own, the verdicts, and the verb as a user runs
// it.
#include <cmath>
#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/tools/process.h"
#include "tools/validate.h"

namespace varve::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using namespace varve::tools;

bool long_form() {
  const char* given = std::getenv("VARVE_LONG");
  return given != nullptr && std::string_view(given) == "1";
}

class ValidateGate : public testing::TestWithParam<const ValidationCase*> {};

TEST_P(ValidateGate, Holds) {
  if (GetParam()->kind != CaseKind::fast && !long_form())
    GTEST_SKIP() << "slow: runs with VARVE_LONG=1";
  const CaseResult result = run_case(*GetParam());
  ASSERT_FALSE(result.rows.empty());
  for (const ValidationRow& row : result.rows)
    EXPECT_NE(row.verdict(), Verdict::fail)
        << row.quantity << ": reference " << row.reference << ", ours " << row.ours << ' '
        << row.unit << ", tolerance " << row.tolerance << ' ' << row.note;
}

std::vector<const ValidationCase*> all_cases() {
  std::vector<const ValidationCase*> cases;
  for (const ValidationCase& test : validation_cases()) cases.push_back(&test);
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Cases, ValidateGate, testing::ValuesIn(all_cases()),
                         [](const auto& given) { return given.param->name; });

TEST(ValidateVerdict, ComparesTheDeviationWithTheTolerance) {
  EXPECT_EQ(relative_row("a", "", 2, 2.019, 0.01).verdict(), Verdict::pass);
  EXPECT_EQ(relative_row("a", "", 2, 1.981, 0.01).verdict(), Verdict::pass);
  EXPECT_EQ(relative_row("a", "", 2, 2.021, 0.01).verdict(), Verdict::fail);
  EXPECT_EQ(relative_row("a", "", -2, -2.021, 0.01).verdict(), Verdict::fail);
  EXPECT_EQ(scaled_row("a", "", 0, 0.02, 10, "ten", 0.01).verdict(), Verdict::pass);
  EXPECT_EQ(scaled_row("a", "", 0, 0.2, 10, "ten", 0.01).verdict(), Verdict::fail);
  EXPECT_EQ(absolute_row("a", "", 0, -2e-6, 1e-6).verdict(), Verdict::fail);
  EXPECT_EQ(relative_row("a", "", 2, 5, no_gate).verdict(), Verdict::reported);
}

TEST(ValidateVerdict, AnExcuseCoversAMissButNotANumberThatIsNone) {
  ValidationRow row = relative_row("a", "", 2, 2.5, 0.01);
  row.excuse = "known";
  EXPECT_EQ(row.verdict(), Verdict::missed);
  row.ours = 2;
  EXPECT_EQ(row.verdict(), Verdict::pass);
  row.ours = std::nan("");
  EXPECT_EQ(row.verdict(), Verdict::fail);
}

TEST(ValidateVerdict, ACaseIsAsGoodAsItsWorstRow) {
  CaseResult result;
  EXPECT_EQ(result.verdict(), Verdict::fail);  // nothing measured
  result.rows.push_back(relative_row("a", "", 1, 3, no_gate));
  EXPECT_EQ(result.verdict(), Verdict::reported);
  result.rows.push_back(relative_row("a", "", 1, 1, 0.1));
  EXPECT_EQ(result.verdict(), Verdict::pass);
  result.rows.push_back(relative_row("a", "", 1, 2, 0.1));
  EXPECT_EQ(result.verdict(), Verdict::fail);
}

TEST(ValidateVerdict, WhatStopsACaseFailsIt) {
  ValidationCase broken{"broken", "-", CaseKind::fast, "", "",
                        []() -> std::vector<ValidationRow> {
                          throw std::runtime_error("the fluid left");
                        }};
  const CaseResult result = run_case(broken);
  EXPECT_EQ(result.verdict(), Verdict::fail);
  EXPECT_THAT(text_of(result), HasSubstr("the fluid left"));
  EXPECT_EQ(json::parse(json_of({result})).at("verdict"), "fail");
}

TEST(ValidateVerb, ListsEveryCaseAndEveryGate) {
  const CommandResult listed = run_command({"varve-validate", "--list"});
  EXPECT_EQ(listed.code, 0) << listed.errors;
  for (const ValidationCase& test : validation_cases())
    EXPECT_THAT(listed.output, HasSubstr(test.name));
  for (const char* gate : {"T1 ", "T2 ", "T3 ", "T4 ", "T5 ", "T6 ", "T7 ", "T8 ", "T9 ", "T10 ",
                           "T11 ", "T12 ", "T13 ", "T14 ", "T16 ", "T17 "})
    EXPECT_THAT("\n" + listed.output, HasSubstr(std::string("\n") + gate));
}

TEST(ValidateVerb, RunsByNameOrGateAndSpeaksJson) {
  const CommandResult ran = run_command({"varve-validate", "--only", "T6", "--only", "kernels",
                                         "--json", "--jobs", "2"});
  ASSERT_EQ(ran.code, 0) << ran.errors;
  const json object = json::parse(ran.output);
  EXPECT_EQ(object.at("schema"), "varve-validate-1");
  EXPECT_EQ(object.at("verdict"), "pass");
  ASSERT_EQ(object.at("cases").size(), 3u);
  EXPECT_EQ(object["cases"][0].at("name"), "kernels");
  EXPECT_EQ(object["cases"][1].at("gate"), "T6");
  for (const json& test : object["cases"])
    for (const json& row : test.at("rows")) {
      EXPECT_EQ(row.at("verdict"), "pass");
      EXPECT_LE(std::abs(row.at("deviation").get<double>()), row.at("tolerance").get<double>());
    }
  const CommandResult text = run_command({"varve-validate", "--only", "drag"});
  EXPECT_THAT(text.output, HasSubstr("3 rows pass, 0 fail"));
}

TEST(ValidateVerb, RefusesWhatNamesNothing) {
  const CommandResult misspelt = run_command({"varve-validate", "--only", "poisseuille"});
  EXPECT_EQ(misspelt.code, 2);
  EXPECT_THAT(misspelt.errors, HasSubstr("did you mean 'poiseuille'?"));
  EXPECT_EQ(run_command({"varve-validate", "--only", "drag", "--all"}).code, 2);
  EXPECT_EQ(run_command({"varve-validate", "--only", "drag", "--jobs", "0"}).code, 2);
}

}  // namespace
}  // namespace varve::test
