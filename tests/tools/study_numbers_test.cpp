// What a report computes, against numbers made by hand: slopes with intervals, spread, verdicts,
// where curves agree. No run is needed: rows are made up.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/verbs.h"
#include "tools/study_report.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// One measure m over damping 0.1, 0.2, 0.3 with two seeds each:
///   seed 1: 1.0 1.2 1.5     seed 2: 1.2 1.2 1.3
/// and a case of one member, 'lone', whose m is 4; nothing of the case 'later' has been run.
class Numbers : public testing::Test {
 protected:
  StudyPlan plan_with(const std::string& claims) {
    const std::string path = folder_.write("numbers.study", R"([study]
title = By hand
[case.c]
scenario = crowd.cfg
vary.contact.damping = 0.1:0.3:0.1
seeds = 2
[case.lone]
scenario = crowd.cfg
set.fluid.viscosity = 20 mPa.s
[case.later]
scenario = crowd.cfg
set.contact.damping = 0.4
[measure.m]
value = settling.terminal_speed_m_s
unit = m/s
flag = > 1.4
[curve.v]
value = settling.settling_speed_m_s
points = 3
)" + claims);
    folder_.write("crowd.cfg", test::crowd_scene());
    std::vector<Diagnostic> found;
    StudyPlan plan = make_plan(read_study(path, found), found);
    for (const Diagnostic& each : found) ADD_FAILURE() << each.message();
    return plan;
  }

  static StudyData data_of(const StudyPlan& plan) {
    const std::string key = measure_key(plan.file.measures[0].measure);
    const std::string curve = curve_key(plan.file.curves[0].curve);
    const double values[] = {1.0, 1.2, 1.2, 1.2, 1.5, 1.3, 4};
    std::vector<std::optional<StudyRow>> rows;
    for (std::size_t i = 0; i < plan.members.size(); ++i) {
      rows.emplace_back();
      if (i >= 7) continue;
      rows.back().emplace();
      rows.back()->id = plan.members[i].id;
      rows.back()->values[key] = values[i];
      rows.back()->curves[curve] = {{0, 1, 2}, {values[i], 2 * values[i], 3 * values[i]}};
    }
    return StudyData(plan, rows);
  }

  test::TemporaryFolder folder_;
};

TEST_F(Numbers, TheSlopeOfSixPointsByHand) {
  const StudyPlan plan = plan_with("");
  ASSERT_EQ(plan.members.size(), 8u);
  const StudyData data = data_of(plan);
  const std::vector<Sensitivity> all = sensitivities_of(data, plan.file.measures[0]);
  ASSERT_EQ(all.size(), 1u);
  const Sensitivity& one = all[0];
  EXPECT_EQ(one.key, "contact.damping");
  EXPECT_EQ(one.members, 6u);
  EXPECT_EQ(one.rank, 1u);
  // Sxx = 0.04, Sxy = 0.06, Syy = 0.4 / 3; t(4) = 2.776.
  EXPECT_NEAR(one.slope, 1.5, 1e-12);
  EXPECT_NEAR(one.half_width, 2.776 * std::sqrt((0.4 / 3 - 0.09) / 4 / 0.04), 1e-9);
  EXPECT_NEAR(one.elasticity, 1.5 * 0.2 / (7.4 / 6), 1e-12);
  EXPECT_NEAR(one.effect, 0.3, 1e-12);
  EXPECT_NEAR(one.spread, std::sqrt(0.04 / 3), 1e-12);
  EXPECT_FALSE(one.below_noise());
}

TEST(GroupedFit, HoldsTheOtherKeys) {
  const std::vector<double> x{0, 1, 0, 1}, y{0, 1, 10, 11};
  const std::vector<std::size_t> group{0, 0, 1, 1}, alone{0, 1, 2, 3};
  const auto fit = grouped_fit(x, y, group);
  ASSERT_TRUE(fit);
  EXPECT_DOUBLE_EQ(fit->slope, 1);
  EXPECT_DOUBLE_EQ(fit->half_width, 0);
  EXPECT_FALSE(grouped_fit(x, y, alone)) << "x does not vary within a group";
  const std::vector<double> two_x{0, 1}, two_y{0, 1};
  const std::vector<std::size_t> one{0, 0};
  EXPECT_TRUE(std::isnan(grouped_fit(two_x, two_y, one)->half_width));
}

struct ClaimCase {
  const char* text;
  Verdict verdict;
};

class Claims : public Numbers, public testing::WithParamInterface<ClaimCase> {};

TEST_P(Claims, AreJudgedByTheNumbers) {
  const StudyPlan plan = plan_with(std::string("[claim.Q]\n") + GetParam().text);
  const ClaimResult result = judge(data_of(plan), plan.file.claims[0]);
  EXPECT_EQ(name_of(result.verdict), name_of(GetParam().verdict));
}

// m at 0.3 over m at 0.1: over all 1.4 / 1.1 = 1.273; by seed 1.5 and 1.083, deviation 0.295.
INSTANTIATE_TEST_SUITE_P(
    ByHand, Claims,
    testing::Values(
        ClaimCase{"kind = value\nexpected = 1.2 .. 1.3\nvalue = mean(m[c, contact.damping=0.3]) / "
                  "mean(m[c, contact.damping=0.1])",
                  Verdict::reproduced},
        ClaimCase{"kind = value\nexpected = 2 +- 0.5\ndirection = > 1\nvalue = "
                  "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]",
                  Verdict::not_reproduced},
        ClaimCase{"kind = value\nexpected = 2 .. 3\ndirection = > 0.5\nvalue = "
                  "m[c, contact.damping=300e-3] / m[c, contact.damping=0.1]",
                  Verdict::direction_only},
        ClaimCase{"kind = direction\nexpected = > 1\nvalue = "
                  "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]",
                  Verdict::below_noise},
        ClaimCase{"kind = direction\nexpected = < 1\nvalue = "
                  "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]",
                  Verdict::below_noise},
        ClaimCase{"kind = direction\nexpected = < 0.5\nvalue = "
                  "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]",
                  Verdict::not_reproduced},
        ClaimCase{"kind = direction\nexpected = > 0.5\nvalue = "
                  "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]",
                  Verdict::reproduced},
        ClaimCase{"kind = direction\nexpected = true\nvalue = "
                  "m[c, contact.damping=0.3] > m[c, contact.damping=0.1]",
                  Verdict::reproduced},
        ClaimCase{"kind = direction\nexpected = true\nvalue = "
                  "m[c, contact.damping=0.2] > m[c, contact.damping=0.1]",
                  Verdict::not_reproduced},
        ClaimCase{"kind = direction\nexpected = > 2\nvalue = mean(m[lone])", Verdict::reproduced},
        ClaimCase{"kind = direction\nexpected = > 2\nvalue = m[later] / m[lone]",
                  Verdict::not_run},
        ClaimCase{"kind = direction\nexpected = > 2\nvalue = sd(m[lone])",
                  Verdict::not_reproduced},
        ClaimCase{"kind = self-contradictory\ncontradicts = K9\nvalue = m[lone]",
                  Verdict::contradicts_itself},
        ClaimCase{"kind = not-testable\nnote = nobody can", Verdict::not_testable}));

TEST_F(Numbers, ClaimsReduceMembersByHand) {
  const auto ours = [&](const std::string& value) {
    const StudyPlan plan =
        plan_with("[claim.Q]\nkind = direction\nexpected = > 0\nvalue = " + value);
    return judge(data_of(plan), plan.file.claims[0]);
  };
  const std::string ratio = "m[c, contact.damping=0.3] / m[c, contact.damping=0.1]";
  EXPECT_NEAR(ours(ratio).ours, 1.4 / 1.1, 1e-12);
  EXPECT_NEAR(ours(ratio).spread, std::abs(1.5 - 1.3 / 1.2) / std::sqrt(2.0), 1e-12);
  EXPECT_EQ(ours(ratio).seeds, 2u);
  EXPECT_NEAR(ours("slope(m[c], contact.damping)").ours, 1.5, 1e-12);
  EXPECT_NEAR(ours("elasticity(m[c], contact.damping)").ours, 0.3 / (7.4 / 6), 1e-12);
  EXPECT_NEAR(ours("correlation(m[c], m[c])").ours, 1, 1e-12);
  EXPECT_EQ(ours("monotone(m[c], contact.damping)").ours, 1);
  EXPECT_EQ(ours("count(m[*])").ours, 7);
  EXPECT_EQ(ours("max(m[*]) - min(m[*]) + median(m[lone])").ours, 7);
  EXPECT_NEAR(ours("sd(m[c, contact.damping=0.1])").ours, std::sqrt(0.02), 1e-12);
  // The lone member has no seeds of its own: it takes part in each.
  EXPECT_EQ(ours("m[c] / m[lone]").seeds, 2u);
}

TEST_F(Numbers, CurvesAgreeFromWhereTheirDifferenceIsNoise) {
  EnsembleCurve a{{0, 1, 2, 3}, {1, 1, 1, 1}, {0.1, 0.1, 0.1, 0.1}, 3};
  EnsembleCurve b{{0, 1, 2, 3}, {2, 1.1, 1.4, 1.1}, {0.1, 0.1, 0.1, 0.1}, 3};
  EXPECT_EQ(agreement_time(a, b), 3);
  b.mean[2] = 1.15;
  EXPECT_EQ(agreement_time(a, b), 1);
  b.mean[3] = 5;
  EXPECT_TRUE(std::isnan(agreement_time(a, b)));
  a.members = b.members = 1;
  EXPECT_TRUE(std::isnan(agreement_time(a, b))) << "no spread to compare with";
}

TEST_F(Numbers, TheReportSaysThem) {
  const StudyPlan plan = plan_with("[figure.9]\ntitle = A <figure>\ncases = c\ncurves = v\n"
                                   "[claim.Q1]\nfigure = 9\ntext = a | b\nkind = direction\n"
                                   "value = m[c] / m[lone]\nexpected = > 0.1\n");
  const StudyData data = data_of(plan);
  const Document document = report_of(data);
  const std::string markdown = markdown_of(document, "plots"), html = html_of(document);
  EXPECT_THAT(markdown, HasSubstr("# By hand"));
  EXPECT_THAT(markdown, HasSubstr("| contact.damping | c | 6 | 1.5 | 0.05532 .. 2.945 | 0.2432 | 1 "
                                  "| 0.3 | 0.1155 | beyond noise |"));
  EXPECT_THAT(markdown, HasSubstr("| c contact.damping=0.3 | **1.4 ± 0.14 (2) (!)** |"));
  EXPECT_THAT(markdown, HasSubstr("| Q1 | 9 | a \\| b |"));
  EXPECT_THAT(markdown, HasSubstr("0.3083 ± 0 (2) | **reproduced**"));
  EXPECT_THAT(markdown, HasSubstr("![9: v](plots/9_v.svg)"));
  EXPECT_THAT(markdown, HasSubstr("8 members (runs and forks) in 3 cases: 7 done, 0 failed, 1 "));
  EXPECT_THAT(html, HasSubstr("9: A &lt;figure&gt;"));
  EXPECT_THAT(html, HasSubstr("<polygon")) << "a band of the curve's spread";
  EXPECT_EQ(html.find("src="), std::string::npos) << "the page loads nothing";
}

TEST(StudyValues, ListsAndRanges) {
  const auto values = [](const std::string& text) {
    std::vector<std::string> all;
    const std::string wrong = expand_values(text, all);
    return wrong.empty() ? all : std::vector<std::string>{"error: " + wrong};
  };
  EXPECT_THAT(values("3 cm, 6 cm"), ElementsAre("3 cm", "6 cm"));
  EXPECT_THAT(values("0.1:0.3:0.1"), ElementsAre("0.1", "0.2", "0.3"));
  EXPECT_THAT(values("3 cm:10 cm:3 cm, x"), ElementsAre("0.03", "0.06", "0.09", "x"));
  EXPECT_THAT(values("2:1:-0.5"), ElementsAre("2", "1.5", "1"));
  EXPECT_THAT(values("1:2"), ElementsAre(HasSubstr("no range")));
  EXPECT_THAT(values("1:2:0"), ElementsAre(HasSubstr("empty range")));
  EXPECT_THAT(values("1:2:-1"), ElementsAre(HasSubstr("empty range")));
  EXPECT_THAT(values("1:1e9:1"), ElementsAre(HasSubstr("at most")));
  EXPECT_THAT(values("1,,2"), ElementsAre(HasSubstr("empty item")));
  std::vector<std::uint64_t> seeds;
  EXPECT_EQ(read_seeds("3", seeds), "");
  EXPECT_THAT(seeds, ElementsAre(1u, 2u, 3u));
  EXPECT_EQ(read_seeds("7, 2", seeds), "");
  EXPECT_THAT(seeds, ElementsAre(7u, 2u));
  EXPECT_THAT(read_seeds("1, 1", seeds), HasSubstr("twice"));
  EXPECT_THAT(read_seeds("0", seeds), HasSubstr("expected 1"));
  EXPECT_THAT(read_seeds("-1", seeds), HasSubstr("is no seed"));
}

TEST(StudyPlots, AxesHaveRoundNumbers) {
  EXPECT_THAT(axis_ticks(0, 1, 5),
              ElementsAre(0, 0.2, 0.4, testing::DoubleNear(0.6, 1e-12), 0.8, 1));
  EXPECT_THAT(axis_ticks(-3, 7, 4), ElementsAre(0, 5));
  EXPECT_THAT(axis_ticks(2, 2, 4), ElementsAre(2));
  Plot plot;
  plot.title = "a < b";
  plot.series.push_back({"", {0, 1}, {1, none}, {0.5, 0.5}, true, false});
  const std::string svg = svg_of(plot);
  EXPECT_THAT(svg, HasSubstr("a &lt; b"));
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  plot.series[0].y[0] = none;
  EXPECT_TRUE(plot.empty());
}

}  // namespace
}  // namespace varve::tools
