// The study's scenes and study files: all of them are sound, and the quick part of the figures runs
// and comes out as it must.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

fs::path study_folder() { return fs::path(VARVE_SCENARIOS) / "study"; }

std::vector<std::string> files_of(const std::string& extension) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(study_folder()))
    if (entry.path().extension() == extension) found.push_back(entry.path().stem().string());
  std::sort(found.begin(), found.end());
  return found;
}

std::string scene_file(const std::string& name) {
  return (study_folder() / (name + ".cfg")).string();
}

TEST(StudyScenes, AllOfThemCheckOutAndStart) {
  const std::vector<std::string> scenes = files_of(".cfg");
  EXPECT_THAT(scenes, testing::ElementsAre("collective", "drag", "pipe", "porosity", "rebound",
                                           "single", "single_as_stated"));
  for (const std::string& scene : scenes) {
    const TemporaryFolder folder;
    verb(0, {"check", scene_file(scene)});
    verb(0, {"run", scene_file(scene), "-o", folder / "a.varve", "--steps", "3"});
    EXPECT_EQ(json_verb(0, {"verify", folder / "a.varve"})["verdict"], "complete") << scene;
  }
}

/// Every array of grains that figures 9 to 27 put into the collective scene.
TEST(StudyScenes, TheCollectiveSceneHoldsEveryArrayAndWidth) {
  struct Array {
    int rows, columns;
    const char* width;
  };
  for (const Array& array : {Array{1, 1, "6 cm"}, {2, 2, "6 cm"}, {2, 4, "6 cm"}, {4, 4, "6 cm"},
                             {8, 4, "6 cm"}, {3, 6, "6 cm"}, {6, 3, "6 cm"}, {2, 12, "6 cm"},
                             {12, 2, "6 cm"}, {5, 8, "6 cm"}, {4, 2, "6 cm"}, {4, 8, "3 cm"},
                             {4, 8, "8 cm"}, {4, 8, "10 cm"}}) {
    const TemporaryFolder folder;
    verb(0, {"run", scene_file("collective"), "-o", folder / "a.varve", "--steps", "1", "-s",
             "grains.rows=" + std::to_string(array.rows), "-s",
             "grains.columns=" + std::to_string(array.columns), "-s",
             std::string("domain.width=") + array.width});
    const Json facts = json_verb(0, {"info", folder / "a.varve"});
    EXPECT_EQ(facts["particles"]["grains"], std::to_string(array.rows * array.columns));
  }
}

/// A refused key must not pass as a scene of the study.
TEST(StudyScenes, AnArrayThatDoesNotFitIsRefused) {
  const TemporaryFolder folder;
  const CommandResult refused =
      verb(3, {"run", scene_file("collective"), "-o", folder / "a.varve", "-s",
               "grains.columns=40"});
  EXPECT_FALSE(refused.errors.empty());
  EXPECT_FALSE(fs::exists(folder / "a.varve"));
}

TEST(StudyFiles, AllOfThemPlan) {
  const std::vector<std::string> studies = files_of(".study");
  EXPECT_THAT(studies, testing::ElementsAre("as_stated", "figures", "forks", "scan"));
  for (const std::string& study : studies) {
    const TemporaryFolder folder;
    verb(0, {"study", "plan", (study_folder() / (study + ".study")).string(), "--folder",
             folder / "results", "--dry-run"});
  }
}

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  return std::string(std::istreambuf_iterator<char>(in), {});
}

/// Quantitative claims of the study are numbered 1 to 51; some are held in several parts.
TEST(StudyFiles, EveryClaimOfTheStudyIsThereAndInTheReport) {
  const std::string study = text_of(study_folder() / "figures.study"),
                    report = text_of(study_folder() / "REPORT.md");
  for (int number = 1; number <= 51; ++number)
    EXPECT_THAT(study, testing::HasSubstr(fmt::format("[claim.Q{}]", number)));
  std::size_t claims = 0;
  for (std::size_t at = study.find("\n[claim."); at != std::string::npos;
       at = study.find("\n[claim.", at + 1)) {
    const std::size_t begin = at + 8;
    std::string id = study.substr(begin, study.find(']', begin) - begin);
    for (std::size_t i = 0; (i = id.find('_', i)) != std::string::npos; i += 2) id.insert(i, "\\");
    EXPECT_THAT(report, testing::HasSubstr(fmt::format("\n| {} |", id)))
        << "the report is older than figures.study";
    ++claims;
  }
  EXPECT_GE(claims, 51u);
  EXPECT_THAT(report, testing::Not(testing::HasSubstr("| **not run** |")));
}

/// Rows of a table without quoted cells, by the names in its first line.
std::vector<std::map<std::string, std::string>> rows_of(const fs::path& file) {
  std::ifstream in(file);
  const auto cells_of = [](const std::string& line) {
    std::vector<std::string> cells;
    std::stringstream stream(line + ",");
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    return cells;
  };
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> names = cells_of(line);
  std::vector<std::map<std::string, std::string>> rows;
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = cells_of(line);
    EXPECT_EQ(cells.size(), names.size()) << line;
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(cells.size(), names.size()); ++i) row[names[i]] = cells[i];
  }
  return rows;
}

/// One measure of every finished member of a case.
std::vector<double> measured(const std::vector<std::map<std::string, std::string>>& rows,
                             const std::string& name, const std::string& measure) {
  std::vector<double> values;
  for (const auto& row : rows)
    if (row.at("case") == name && row.at("status") == "ok")
      values.push_back(std::stod(row.at(measure)));
  return values;
}

/// Values that follow from geometry, from the closed form of a contact or from a published
/// benchmark; the rest is what the report is for.
TEST(StudyFiles, TheQuickPartOfTheFiguresRuns) {
  using testing::DoubleNear;
  using testing::ElementsAre;
  const TemporaryFolder folder;
  const std::vector<std::string> study = {(study_folder() / "figures.study").string(), "--folder",
                                          folder / "results", "--quick"};
  const auto run = [&](const char* action) {
    std::vector<std::string> words{"study", action};
    words.insert(words.end(), study.begin(), study.end());
    return verb(0, words);
  };
  run("run");
  const auto rows = rows_of(fs::path(folder / "results") / "results.csv");
  EXPECT_THAT(measured(rows, "porosity_regular", "porosity_disc"),
              ElementsAre(DoubleNear(0.185, 0.002)));
  EXPECT_THAT(measured(rows, "porosity_regular", "porosity_hole"),
              ElementsAre(DoubleNear(0.234, 0.002)));
  EXPECT_THAT(measured(rows, "porosity_staggered", "porosity_disc"),
              ElementsAre(DoubleNear(0.067, 0.002)));
  EXPECT_THAT(measured(rows, "single", "contact_time"), ElementsAre(DoubleNear(0.74, 0.022)));
  EXPECT_THAT(measured(rows, "single", "plateau"), ElementsAre(DoubleNear(0.0557, 0.0028)));
  const std::vector<double> rebounds = measured(rows, "rebound", "restitution");
  ASSERT_EQ(rebounds.size(), 15u);
  for (std::size_t i = 0; i < rebounds.size(); i += 3) {
    EXPECT_GT(rebounds[i], rebounds[i + 1]);      // damping 0.15, 0.20, 0.25 at one speed
    EXPECT_GT(rebounds[i + 1], rebounds[i + 2]);
    EXPECT_THAT(rebounds[i + 1], DoubleNear(0.71, 0.06));
  }
  const std::vector<double> lone = measured(rows, "number_1", "speed"),
                            sixteen = measured(rows, "number_16", "speed");
  ASSERT_EQ(lone.size(), 1u);
  ASSERT_EQ(sixteen.size(), 1u);
  EXPECT_LT(sixteen[0], lone[0]);
  EXPECT_EQ(measured(rows, "packing_4x8", "speed").size(), 1u);
  EXPECT_EQ(measured(rows, "packing_8x4", "speed").size(), 1u);

  // What is done is not done again, and the table is the same to the byte.
  const fs::path table = fs::path(folder / "results") / "results.csv";
  const std::string first = text_of(table);
  run("run");
  EXPECT_EQ(text_of(table), first);
}

}  // namespace
}  // namespace varve::test
