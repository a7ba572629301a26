// Measures: the grammar, what reductions make of a column (computed by hand), and that a measure of
// a log is what its tables and its summary say.
#include <cmath>
#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/log_reader.h"
#include "tests/tools/verbs.h"
#include "tools/measure.h"
#include "tools/measure_reduce.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

using test::disc_scene;
using test::Json;
using testing::HasSubstr;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

double number(const std::string& text) {
  return evaluate(parse_expression(text), [](const Expression& node) -> std::optional<double> {
    if (node.name == "nothing") return none;
    return std::nullopt;
  });
}

/// "column: text" of the error that `text` makes, "" if none.
template <class Make>
std::string error_of(Make make) {
  try {
    make();
  } catch (const ExpressionError& error) {
    return std::to_string(error.column()) + ": " + error.what();
  }
  return "";
}

TEST(Expressions, AreArithmeticWithTheUsualRanks) {
  EXPECT_EQ(number("1 + 2 * 3 - 4 / 8"), 6.5);
  EXPECT_EQ(number("(1 + 2) * -3"), -9);
  EXPECT_EQ(number("8 / 4 / 2"), 1);
  EXPECT_EQ(number("2 - 3 - 4"), -5);
  EXPECT_EQ(number("1 < 2 and not 3 <= 2 or 1 == 0"), 1);
  EXPECT_EQ(number("not not 3 > 2"), 1);
  EXPECT_EQ(number("power(2, 10)"), 1024);
  EXPECT_TRUE(std::isnan(number("power(0 - 2, 0.5)")));
  EXPECT_EQ(number("greatest(1, sqrt(9), abs(-2)) - least(4, 5)"), -1);
}

TEST(Expressions, NumbersTakeUnits) {
  EXPECT_EQ(number("0.2 s"), 0.2);
  EXPECT_EQ(number("3 mm/2"), 0.0015);
  EXPECT_EQ(number("50 % + 1"), 1.5);
  EXPECT_EQ(number("1e3 kg/m3"), 1000);
  EXPECT_EQ(number("2 and 3"), 1);
  EXPECT_EQ(number("7 cm"), 0.07);
}

TEST(Expressions, WhatHasNoValueStaysSo) {
  EXPECT_TRUE(std::isnan(number("nothing + 1")));
  EXPECT_TRUE(std::isnan(number("nothing > 1")));
  EXPECT_TRUE(std::isnan(number("1 / 0")));
  EXPECT_EQ(number("exists(nothing)"), 0);
  EXPECT_EQ(number("exists(3)"), 1);
  EXPECT_EQ(number("default(nothing, 4)"), 4);
}

TEST(Expressions, ErrorsNameTheirColumn) {
  const auto error = [](const std::string& text) {
    return error_of([&] { parse_expression(text); });
  };
  EXPECT_THAT(error("1 + "), HasSubstr("5: expected a number"));
  EXPECT_THAT(error("mean(a.b"), HasSubstr("9: expected ')' at the end"));
  EXPECT_THAT(error("a.b[row=1"), HasSubstr("expected ']'"));
  EXPECT_THAT(error("a.b[row=1, 3]"), HasSubstr("expected KEY=VALUE, got '3'"));
  EXPECT_THAT(error("3 furlong"), HasSubstr("3: 'furlong' is no unit"));
  EXPECT_THAT(error("1 2"), HasSubstr("3: expected an operator, got '2'"));
  EXPECT_THAT(error("$"), HasSubstr("1: expected a number, a name or '('"));
  EXPECT_THAT(error(std::string(500, '(')), HasSubstr("nested too deeply"));
}

TEST(Expressions, HaveOneSpelling) {
  EXPECT_EQ(text_of(parse_expression("mean( a.b[ row = 1,column=2 ],0.2s )*-2")),
            "(mean(a.b[row=1, column=2], 0.2) * (-2))");
}

/// Reduction of the rows t = 0, 1, 2, 3, 4 with values 1, 4, 2, 8, 5.
double reduced(const std::string& name, std::vector<double> arguments = {}) {
  return reduce_rows(name, {{0, 1, 2, 3, 4}, {1, 4, 2, 8, 5}}, arguments);
}

TEST(Reductions, OfFiveRowsByHand) {
  EXPECT_EQ(reduced("mean"), 4);
  EXPECT_EQ(reduced("mean", {1, 3}), 14.0 / 3);
  EXPECT_EQ(reduced("mean", {2}), 5);
  EXPECT_EQ(reduced("min"), 1);
  EXPECT_EQ(reduced("max", {0, 2}), 4);
  EXPECT_EQ(reduced("sum"), 20);
  EXPECT_EQ(reduced("count", {0.5, 3.5}), 3);
  EXPECT_EQ(reduced("median"), 4);
  EXPECT_EQ(reduced("first"), 1);
  EXPECT_EQ(reduced("last", {0, 2.5}), 2);
  EXPECT_DOUBLE_EQ(reduced("sd"), std::sqrt(30.0 / 4));
  EXPECT_EQ(reduced("quantile", {0.25}), 2);
  EXPECT_EQ(reduced("quantile", {0.5, 0, 1}), 2.5);
  EXPECT_DOUBLE_EQ(reduced("slope"), 12.0 / 10);
  EXPECT_EQ(reduced("integral"), 2.5 + 3 + 5 + 6.5);
  EXPECT_EQ(reduced("at", {2.5}), 5);
  EXPECT_EQ(reduced("at", {4}), 5);
  EXPECT_TRUE(std::isnan(reduced("at", {4.1})));
  EXPECT_TRUE(std::isnan(reduced("at", {-0.1})));
  EXPECT_EQ(reduced("time_of_max"), 3);
  EXPECT_EQ(reduced("time_of_min", {1}), 2);
}

TEST(Reductions, OfConditionsAndOfNothing) {
  const Rows held{{0, 1, 2, 3}, {0, 1, 1, 0}};
  EXPECT_EQ(reduce_rows("first_time", held, {}), 1);
  EXPECT_EQ(reduce_rows("last_time", held, {}), 2);
  EXPECT_EQ(reduce_rows("fraction", held, {}), 0.5);
  for (const FunctionRule& rule : reductions()) {
    const std::vector<double> needed(rule.arguments_min - 1, 0.5);
    const double value = reduce_rows(rule.name, {}, needed);
    if (rule.name == "sum" || rule.name == "count")
      EXPECT_EQ(value, 0) << rule.name;
    else
      EXPECT_TRUE(std::isnan(value)) << rule.name;
  }
  EXPECT_EQ(reduce_rows("mean", {{0, 1, 2}, {1, none, 3}}, {}), 2);
  const std::vector<double> unknown{none};
  EXPECT_TRUE(std::isnan(reduce_rows("mean", held, unknown)));
}

TEST(Measures, NamesAreCheckedBeforeAnythingRuns) {
  const auto error = [](const std::string& text) {
    return error_of([&] { make_measure("m", text); });
  };
  EXPECT_EQ(error("mean(settling.settling_speed_m_s, 0.1 s, 0.2 s) / key(grains.diameter)"), "");
  EXPECT_EQ(error("settling.terminal_speed_m_s"), "");
  EXPECT_EQ(error("max(rows.settling_speed_m_s[row=1] - settling.mean_vz_m_s)"),
            "38: rows of 'rows' and of 'settling' in one expression");
  EXPECT_THAT(error("mean(settling.setling_speed_m_s)"),
              HasSubstr("6: table 'settling' has no column 'setling_speed_m_s'; did you mean "
                        "'settling_speed_m_s'?"));
  EXPECT_THAT(error("1 + settling.terminal_sped_m_s"),
              HasSubstr("5: unknown name 'settling.terminal_sped_m_s'; did you mean "
                        "'settling.terminal_speed_m_s'?"));
  EXPECT_THAT(error("settling.settling_speed_m_s"), HasSubstr("is a column; expected it in mean"));
  EXPECT_THAT(error("meen(settling.settling_speed_m_s)"), HasSubstr("did you mean 'mean'?"));
  EXPECT_THAT(error("mean(3)"), HasSubstr("6: expected TABLE.COLUMN"));
  EXPECT_THAT(error("at(settling.centroid_y_m)"), HasSubstr("at: expected 2 arguments, got 1"));
  EXPECT_THAT(error("mean(1, 2, 3, 4)"), HasSubstr("mean: expected 1 to 3 arguments, got 4"));
  EXPECT_THAT(error("mean(max(settling.centroid_y_m))"), HasSubstr("inside another reduction"));
  EXPECT_THAT(error("key(grains.diametr)"), HasSubstr("5: unknown key 'grains.diametr'; did you "
                                                      "mean 'grains.diameter'?"));
  EXPECT_THAT(error("mean(rows.mean_y_m[rwo=1])"), HasSubstr("did you mean 'row'?"));
}

class MeasuresOfALog : public testing::Test {
 protected:
  void SetUp() override {
    run_ = folder_ / "disc.varve";
    test::verb(0, {"run", folder_.write("disc.cfg", disc_scene()), "-o", run_, "-q"});
  }
  double value(const std::string& text, std::uint64_t every = 1) {
    const auto log = io::LogReader::open(run_);
    Measure measure = make_measure("m", text);
    measure.every = every;
    return evaluate_measures(*log, scenario_of(log->genesis(), run_), {{measure}}).values.at(0);
  }
  /// A column of a table as varve analyze writes it.
  std::vector<double> column(const std::string& table, const std::string& name) {
    std::istringstream lines(test::verb(0, {"analyze", run_, "--observable", table}).output);
    std::string line, cell;
    std::getline(lines, line);
    std::size_t place = 0;
    std::istringstream header(line);
    while (std::getline(header, cell, ',') && cell != name) ++place;
    std::vector<double> values;
    while (std::getline(lines, line)) {
      std::istringstream cells(line);
      for (std::size_t k = 0; k <= place; ++k) std::getline(cells, cell, ',');
      values.push_back(std::stod(cell));
    }
    return values;
  }
  test::TemporaryFolder folder_;
  std::string run_;
};

TEST_F(MeasuresOfALog, AreWhatItsTablesAndSummarySay) {
  const std::vector<double> speed = column("settling", "settling_speed_m_s");
  const std::vector<double> time = column("settling", "time_s");
  ASSERT_EQ(speed.size(), 161u);
  EXPECT_EQ(value("last(settling.settling_speed_m_s)"), speed.back());
  EXPECT_EQ(value("max(settling.settling_speed_m_s)"),
            *std::max_element(speed.begin(), speed.end()));
  EXPECT_EQ(value("count(settling.settling_speed_m_s)"), 161);
  EXPECT_EQ(value("count(settling.settling_speed_m_s)", 20), 9);
  double first = none;
  for (std::size_t i = speed.size(); i-- > 0;)
    if (speed[i] < 0) first = time[i];
  EXPECT_EQ(value("first_time(settling.settling_speed_m_s < 0)"), first);
  const Json summary = test::json_verb(0, {"analyze", run_});
  EXPECT_EQ(value("contacts.restitution"), summary["contacts"]["restitution"].get<double>());
  EXPECT_EQ(value("contacts.first_s"), summary["contacts"]["first_s"].get<double>());
  EXPECT_EQ(value("steps.last"), 160);
  EXPECT_EQ(value("key(grains.diameter) * 1000"), 2.5);
  EXPECT_EQ(value("key(contact.rotation)"), 1);
}

TEST_F(MeasuresOfALog, WindowsMayBeMeasuredThemselves) {
  EXPECT_EQ(value("count(settling.mean_speed_m_s, 0, contacts.first_floor_s)") +
                value("count(settling.mean_speed_m_s, contacts.first_floor_s)"),
            162);
  EXPECT_EQ(value("at(settling.centroid_y_m, time_of_max(settling.settling_speed_m_s))"),
            value("max(settling.centroid_y_m * (settling.settling_speed_m_s >= "
                  "settling.peak_speed_m_s))"));
}

TEST_F(MeasuresOfALog, FiltersChooseRows) {
  EXPECT_EQ(value("mean(wall_hits.restitution[wall=bottom])"), value("contacts.restitution"));
  EXPECT_TRUE(std::isnan(value("mean(wall_hits.restitution[wall=top])")));
  EXPECT_EQ(value("count(trajectories.y_m[row=0, column=0])"), 161);
  EXPECT_EQ(value("count(trajectories.y_m[row=1])"), 0);
}

TEST_F(MeasuresOfALog, CurvesAreSampledBetweenRows) {
  const auto log = io::LogReader::open(run_);
  Curve curve = make_curve("v", "settling.settling_speed_m_s");
  curve.points = 5;
  const Measured measured =
      evaluate_measures(*log, scenario_of(log->genesis(), run_), {}, {{curve}});
  const std::vector<double> speed = column("settling", "settling_speed_m_s");
  ASSERT_EQ(measured.curves.at(0).value.size(), 5u);
  EXPECT_EQ(measured.curves[0].value.front(), speed.front());
  EXPECT_EQ(measured.curves[0].value.back(), speed.back());
  EXPECT_NEAR(measured.curves[0].value[1], speed[40], 1e-9);
}

TEST_F(MeasuresOfALog, AWordIsNoNumber) {
  EXPECT_THAT(error_of([&] { value("mean(wall_hits.wall)"); }),
              HasSubstr("holds 'bottom', which is no number"));
  EXPECT_THAT(error_of([&] { value("mean(settling.mean_vz_m_s)"); }),
              HasSubstr("this run's table 'settling' has no column 'mean_vz_m_s'"));
}

}  // namespace
}  // namespace varve::tools
