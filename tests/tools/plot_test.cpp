// varve plot: curves of recorded runs, as a user draws them.
#include <algorithm>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/verbs.h"
#include "tests/tools/xml.h"

namespace varve::test {
namespace {

using ::testing::HasSubstr;

std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++count;
  return count;
}

/// Two runs of the same scene, with another damping.
class Plot : public testing::Test {
 protected:
  void SetUp() override {
    folder_.write("disc.cfg", disc_scene());
    verb(0, {"run", "disc.cfg", "-o", "a.varve", "-q"}, folder_.path());
    verb(0, {"run", "disc.cfg", "-o", "b.varve", "-q", "-s", "contact.damping=0.5"},
         folder_.path());
  }
  std::string drawn(std::vector<std::string> words) {
    words.insert(words.begin(), "plot");
    words.insert(words.end(), {"-o", "-"});
    const std::string svg = verb(0, words, folder_.path()).output;
    EXPECT_EQ(broken_xml(svg), "");
    return svg;
  }
  TemporaryFolder folder_;
};

TEST_F(Plot, DrawsOneCurvePerRun) {
  const CommandResult result = verb(0, {"plot", "a.varve", "b.varve"}, folder_.path());
  EXPECT_THAT(result.errors, HasSubstr("a.svg"));
  std::ostringstream text;
  text << std::ifstream(folder_ / "a.svg").rdbuf();
  EXPECT_EQ(broken_xml(text.str()), "");
  EXPECT_EQ(count_of(text.str(), "<polyline"), 2u);
  EXPECT_THAT(text.str(), HasSubstr(">a</text>"));
  EXPECT_THAT(text.str(), HasSubstr(">b</text>"));
  EXPECT_THAT(text.str(), HasSubstr("settling.settling_speed_m_s"));
  EXPECT_EQ(verb(2, {"plot", "a.varve", "b.varve"}, folder_.path()).code, 2);
  verb(0, {"plot", "a.varve", "b.varve", "--overwrite"}, folder_.path());
}

TEST_F(Plot, ACurveFollowsTheRun) {
  // Until the disc touches the floor its height falls in every sample: y of the pixels grows.
  const std::string svg = drawn({"a.varve", "--curve", "y=trajectories.y_m", "--points", "12",
                                 "--to", "2 ms"});
  const std::string start = "<polyline points=\"";
  const std::size_t begin = svg.find(start) + start.size();
  std::istringstream path(svg.substr(begin, svg.find('"', begin) - begin));
  double x = 0, y = 0, x_before = -1, y_before = -1;
  char comma = 0;
  std::size_t points = 0;
  while (path >> x >> comma >> y) {
    EXPECT_GT(x, x_before);
    EXPECT_GT(y, y_before);
    x_before = x;
    y_before = y;
    ++points;
  }
  EXPECT_EQ(points, 12u);
}

TEST_F(Plot, CurvesMayBeNamedFilteredAndDrawnOverEachOther) {
  const std::string two = drawn({"a.varve", "--curve", "speed=settling.settling_speed_m_s",
                                 "--curve", "energy.fluid_kinetic_J"});
  EXPECT_EQ(count_of(two, "<polyline"), 2u);
  EXPECT_THAT(two, HasSubstr(">speed</text>"));
  const std::string over = drawn({"a.varve", "--curve", "trajectories.y_m[grain=0]", "--x",
                                  "t2=trajectories.x_m[grain=0]"});
  EXPECT_THAT(over, HasSubstr(">t2</text>"));
  EXPECT_THAT(drawn({"a.varve", "--curve", "energy.fluid_kinetic_J", "--log-y"}),
              HasSubstr("<polyline"));
}

TEST_F(Plot, RefusesWhatMeansNothing) {
  const auto errors = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"plot", "a.varve", "-o", "-"});
    return verb(2, words, folder_.path()).errors;
  };
  EXPECT_THAT(errors({"--curve", "trajectories.yy"}), HasSubstr("did you mean 'y_m'"));
  EXPECT_THAT(errors({"--points", "1"}), HasSubstr("--points"));
  EXPECT_THAT(errors({"--every", "0"}), HasSubstr("--every"));
  EXPECT_EQ(verb(2, {"plot", "none.varve"}, folder_.path()).code, 2);
  folder_.write("bad.varve", "not a log");
  EXPECT_EQ(verb(4, {"plot", "bad.varve"}, folder_.path()).code, 4);
}

}  // namespace
}  // namespace varve::test
