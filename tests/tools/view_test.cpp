// varve view: what the page holds is what the log holds, and it needs nothing from elsewhere.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

std::string file_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The page's data: what stands between the script element's tags, which nothing in it may end.
Json data_of(const std::string& page) {
  const std::string begin = "<script id=\"data\" type=\"application/json\">", end = "</script>";
  const std::size_t from = page.find(begin) + begin.size();
  return Json::parse(page.substr(from, page.find(end, from) - from));
}

std::vector<std::uint8_t> decoded(const std::string& base64) {
  const std::string letters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(letters.find(c));
    if ((held += 6) >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (held -= 8)));
  }
  return bytes;
}

/// Places in metres, particle-major.
std::vector<double> places(const Json& run, const Json& cloud) {
  const std::vector<std::uint8_t> bytes = decoded(cloud["place"]);
  const std::size_t dimension = run["dimension"];
  std::vector<double> values;
  for (std::size_t k = 0; 2 * k < bytes.size(); ++k) {
    const double low = run["lower_m"][k % dimension], high = run["upper_m"][k % dimension];
    values.push_back(low + (bytes[2 * k] + 256 * bytes[2 * k + 1]) / 65535.0 * (high - low));
  }
  return values;
}

class View : public ::testing::Test {
 protected:
  std::string record(const std::string& name, const std::string& scene) {
    const std::string log = folder_ / (name + ".varve");
    verb(0, {"run", folder_.write(name + ".cfg", scene), "-o", log, "--steps", "60"});
    return log;
  }
  Json page_of(const std::vector<std::string>& words) {
    std::vector<std::string> all = {"view"};
    all.insert(all.end(), words.begin(), words.end());
    all.insert(all.end(), {"-o", folder_ / "page.html", "--overwrite"});
    verb(0, all);
    return data_of(file_text(folder_ / "page.html"));
  }
  TemporaryFolder folder_;
};

TEST_F(View, ShowsTheStatesOfTheLog) {
  const std::string log = record("crowd", crowd_scene());
  const Json run = page_of({log, "--frames", "7", "--fluid", "1000000"}).at(0);
  ASSERT_EQ(run["states"].size(), 7u);  // 61 steps: every ninth
  double fastest = 0;
  for (const Json& state : run["states"]) {
    const Json shown = json_verb(0, {"show", log, "--at", state["step"]});
    EXPECT_EQ(state["time_s"], shown["time_s"]);
    for (const char* kind : {"grains", "fluid"}) {
      const Json& positions = shown["fields"][std::string(kind) + ".position"];
      const std::vector<double> seen = places(run, state[kind]);
      ASSERT_EQ(seen.size(), 2 * positions.size()) << kind;
      for (std::size_t k = 0; k < seen.size(); ++k)
        ASSERT_NEAR(seen[k], positions[k / 2][k % 2].get<double>(), 2e-7) << kind << " " << k;
    }
    double settling = 0;
    for (const Json& v : shown["fields"]["grains.velocity"]) {
      settling -= v[1].get<double>();
      fastest = std::max(fastest, std::hypot(v[0].get<double>(), v[1].get<double>()));
    }
    EXPECT_NEAR(state["settling_speed_m_s"], settling / 6, 1e-12);
  }
  EXPECT_NEAR(run["grain_speed_m_s"], fastest, 1e-12);
}

TEST_F(View, ThinsTheFluidAndSaysSo) {
  const std::string log = record("crowd", crowd_scene());
  const Json run = page_of({log, "--frames", "1", "--fluid", "50"}).at(0);
  const std::size_t all =
      json_verb(0, {"show", log, "--at", "0", "--fields", "fluid.id"})["fields"]["fluid.id"].size();
  const std::size_t one_in = run["fluid_shown_one_in"];
  EXPECT_EQ(one_in, (all + 49) / 50);
  EXPECT_EQ(places(run, run["states"][0]["fluid"]).size() / 2, (all + one_in - 1) / one_in);
  const Json none = page_of({log, "--frames", "1", "--fluid", "0"}).at(0);
  EXPECT_TRUE(decoded(none["states"][0]["fluid"]["place"]).empty());
}

TEST_F(View, FollowsTheWallsAndNamesWhatAForkChanged) {
  const std::string log =
      record("wider", crowd_scene("[event.wider]\nat_step = 40\ndomain.width = 1.6 cm\n"));
  const Json run = page_of({log, "--range", "39:40"}).at(0);
  EXPECT_NEAR(run["states"][0]["width_m"], 0.012, 1e-15);
  EXPECT_NEAR(run["states"][1]["width_m"], 0.016, 1e-15);
  EXPECT_NEAR(run["states"][1]["left_m"], -0.002, 1e-15);
  EXPECT_LE(run["lower_m"][0], -0.002);

  const std::string fork = folder_ / "fork.varve";
  verb(0, {"fork", log, "--at", "20", "--damping", "0.25", "--steps", "5", "-o", fork});
  const Json both = page_of({log, fork});
  ASSERT_EQ(both.size(), 2u);
  EXPECT_NE(both[1]["facts"].dump().find("contact.damping"), std::string::npos);
}

TEST_F(View, NeedsNothingElseAndLetsNoTextBecomeMarkup) {
  const std::string log = record(
      "sly", "[scenario]\ntitle = </script><script>alert(1)</script>\n" + crowd_scene());
  EXPECT_EQ(page_of({log})[0]["title"], "</script><script>alert(1)</script>");
  const std::string page = file_text(folder_ / "page.html");
  for (const char* word : {"http:", "https:", "src=", "href=", "@import", "<script>alert"})
    EXPECT_EQ(page.find(word), std::string::npos) << word;
}

TEST_F(View, LeavesOutStatesThatAreNotStored) {
  const std::string log = record("digests", crowd_scene("tier = digests\n"));
  const CommandResult result =
      verb(0, {"view", log, "-o", folder_ / "keys.html", "--range", "0:60:16"});
  EXPECT_NE(result.errors.find("2 of 4 steps are left out"), std::string::npos) << result.errors;
  EXPECT_EQ(data_of(file_text(folder_ / "keys.html"))[0]["states"].size(), 2u);
  EXPECT_NE(verb(2, {"view", log, "-o", folder_ / "no.html", "--range", "1:5"}).errors.find(
                "no state is stored in steps 1 to 5"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "no.html"));
}

TEST_F(View, KeepsWhatIsThere) {
  const std::string log = record("disc", disc_scene());
  const std::string page = folder_.write("mine.html", "mine");
  EXPECT_NE(verb(2, {"view", log, "-o", page}).errors.find("got one that exists"),
            std::string::npos);
  EXPECT_EQ(file_text(page), "mine");
  verb(2, {"view", log, "-o", folder_ / "new.html", "--frames", "0"});
  verb(2, {"view", log, "-o", folder_ / "no/such/folder.html"});
  verb(74, {"view", log, "-o", "/dev/full", "--overwrite"});
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

}  // namespace
}  // namespace varve::test
