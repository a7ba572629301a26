// The study's scenes: each checks out and starts, and what they have in common they do have.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

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

}  // namespace
}  // namespace varve::test
