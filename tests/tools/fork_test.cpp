// varve fork: a child without a change is its parent; a changed one is a run with that change.
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

class Fork : public ::testing::Test {
 protected:
  void SetUp() override {
    scene_ = folder_.write("crowd.cfg", crowd_scene());
    parent_ = folder_ / "parent.varve";
    verb(0, {"run", scene_, "-o", parent_, "-q"});
  }
  /// Forks the parent; returns the child's path.
  std::string fork_of(const std::string& parent, const std::string& at, const std::string& name,
                      const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"fork", parent, "--at", at, "-o", folder_ / name, "-q"};
    words.insert(words.end(), more.begin(), more.end());
    verb(0, words);
    return folder_ / name;
  }
  /// What every log must stand, whoever its parent was.
  void expect_sound(const std::string& run) {
    verb(0, {"verify", run});
    verb(0, {"replay", run, "-q"});
  }
  TemporaryFolder folder_;
  std::string scene_, parent_;
};

TEST_F(Fork, WithoutAChangeIsItsParent) {
  for (const std::string at : {"0", "1", "32", "61", "120"}) {
    const std::string child = fork_of(parent_, at, "same-" + at);
    const Json diff = json_verb(0, {"diff", parent_, child});
    EXPECT_EQ(diff["verdict"], "identical") << at;
    EXPECT_EQ(chain_at(child, std::stoull(at)), chain_at(parent_, std::stoull(at)));
    EXPECT_EQ(chain_at(child, 120), chain_at(parent_, 120));
    const Json lineage = json_verb(0, {"info", child})["lineage"];
    EXPECT_EQ(whole(lineage["step"]), std::stoull(at));
    EXPECT_EQ(lineage["digest"], digest_at(parent_, std::stoull(at)));
    EXPECT_TRUE(lineage["changes"].empty());
    expect_sound(child);
  }
  EXPECT_LT(fs::file_size(folder_ / "same-120"), fs::file_size(parent_) / 4);
}

TEST_F(Fork, ByDampingDiffersFirstAtTheFirstContact) {
  const std::string scene = folder_.write("disc.cfg", disc_scene());
  const std::string run = folder_ / "disc.varve";
  verb(0, {"run", scene, "-o", run, "-q"});
  const std::uint64_t contact = whole(json_verb(0, {"show", run, "--at", "first-contact"})["step"]);
  ASSERT_GT(contact, 20u);
  const std::string child = fork_of(run, "20", "soft", {"--damping", "0.9"});
  const Json diff = json_verb(1, {"diff", run, child});
  EXPECT_EQ(diff["verdict"], "different");
  EXPECT_EQ(whole(diff["first"]["step"]), contact);
  expect_sound(child);
}

TEST_F(Fork, EqualsARunWithTheSameEvent) {
  const Json at = json_verb(0, {"show", parent_, "--at", "45"});
  const double time = at["time_s"];
  for (const std::string change :
       {"contact.damping = 0.7", "contact.friction = 0", "fluid.viscosity = 0.02",
        "gravity.tilt = 10 deg", "domain.width = 1.6 cm", "time.dt = 0.2 ms"}) {
    const std::string scene = folder_.write(
        "event.cfg", crowd_scene("[event.x]\nat = " + std::to_string(time * 1e6 + 1) + " us\n" +
                                 change + "\n"));
    const std::string run = folder_ / "event";
    verb(0, {"run", scene, "-o", run, "-q", "--overwrite"});
    std::string setting = change;
    setting.replace(setting.find(" = "), 3, "=");
    const std::string child = fork_of(parent_, "45", "fork", {"-s", setting, "--steps", "75",
                                                              "--overwrite"});
    EXPECT_EQ(chain_at(child, 45), chain_at(run, 45)) << change;
    EXPECT_EQ(chain_at(child, 46), chain_at(run, 46)) << change;
    EXPECT_EQ(chain_at(child, 120), chain_at(run, 120)) << change;
    EXPECT_NE(chain_at(child, 120), chain_at(parent_, 120)) << change;
    expect_sound(child);
  }
}

TEST_F(Fork, KeepsWhatTheParentHadScheduled) {
  const std::string scene = folder_.write(
      "events.cfg", crowd_scene("[event.a]\nat_step = 30\ncontact.damping = 0.6\n"
                                "[event.b]\nat_step = 60\ndomain.width = 1.6 cm\n"
                                "[event.c]\nat_step = 90\ndomain.width = 1.2 cm\n"));
  const std::string run = folder_ / "events";
  verb(0, {"run", scene, "-o", run, "-q"});
  for (const std::string at : {"0", "29", "30", "31", "60", "75", "90", "100"}) {
    const std::string child = fork_of(run, at, "child-" + at);
    EXPECT_EQ(json_verb(0, {"diff", run, child})["verdict"], "identical") << at;
    expect_sound(child);
  }
}

TEST_F(Fork, OfAForkOfAFork) {
  const std::string one = fork_of(parent_, "20", "one", {"--damping", "0.5"});
  const std::string two = fork_of(one, "50", "two", {"--width", "1.6 cm"});
  const std::string three = fork_of(two, "80", "three");
  EXPECT_EQ(json_verb(0, {"diff", two, three})["verdict"], "identical");
  EXPECT_EQ(chain_at(three, 120), chain_at(two, 120));
  EXPECT_EQ(json_verb(1, {"diff", one, three})["verdict"], "different");
  // Steps before a child's own are its ancestors'.
  EXPECT_EQ(chain_at(three, 60), chain_at(two, 60));
  EXPECT_EQ(chain_at(three, 30), chain_at(one, 30));
  EXPECT_EQ(chain_at(three, 10), chain_at(parent_, 10));
  const std::string late = fork_of(three, "10", "late");
  EXPECT_EQ(json_verb(0, {"diff", parent_, late})["verdict"], "identical");
  for (const std::string& run : {one, two, three, late}) expect_sound(run);
}

TEST_F(Fork, OutlivesItsParent) {
  const std::string child = fork_of(parent_, "40", "child", {"--width", "1.6 cm", "--steps", "30"});
  const std::string copy = folder_ / "whole-child";
  fs::copy_file(child, copy);
  json_verb(0, {"resume", copy, "--steps", "50"});
  fs::remove(parent_);
  expect_sound(child);
  json_verb(0, {"resume", child, "--steps", "50"});
  EXPECT_EQ(chain_at(child, 120), chain_at(copy, 120));
  const std::string grandchild = fork_of(child, "90", "grandchild");
  EXPECT_EQ(json_verb(0, {"diff", child, grandchild})["verdict"], "identical");
  const CommandResult gone = verb(2, {"fork", child, "--at", "10"});
  EXPECT_NE(gone.errors.find("--parent"), std::string::npos) << gone.errors;
}

TEST_F(Fork, FindsItsParentByIdAndCopiesItOnRequest) {
  fs::create_directory(folder_ / "apart");
  const std::string child = fork_of(parent_, "40", "apart/child");
  verb(2, {"show", child, "--at", "10"});
  EXPECT_EQ(json_verb(0, {"show", child, "--at", "10", "--parent", parent_})["chain"],
            chain_at(parent_, 10));
  EXPECT_EQ(json_verb(0, {"show", child, "--at", "10", "--parent", folder_.path()})["chain"],
            chain_at(parent_, 10));
  verb(2, {"show", child, "--at", "10", "--parent", child});
  fork_of(parent_, "40", "apart/detached", {"--detach"});
  EXPECT_EQ(chain_at(folder_ / "apart/detached", 10), chain_at(parent_, 10));
  fs::rename(folder_ / "apart/parent.varve", folder_ / "apart/renamed");
  EXPECT_EQ(chain_at(child, 10), chain_at(parent_, 10));
  const std::string heir = fork_of(parent_, "50", "heir", {"--damping", "0.3"});
  fs::create_directory(folder_ / "far");
  fork_of(heir, "70", "far/grandchild", {"--detach"});
  EXPECT_EQ(chain_at(folder_ / "far/grandchild", 10), chain_at(parent_, 10));
}

TEST_F(Fork, FromATornParent) {
  const std::string torn = folder_ / "torn";
  fs::copy_file(parent_, torn);
  fs::resize_file(torn, fs::file_size(torn) - 3000);
  const CommandResult result =
      verb(0, {"fork", torn, "--at", "50", "-o", folder_ / "child", "--steps", "70"});
  EXPECT_NE(result.errors.find("torn"), std::string::npos) << result.errors;
  EXPECT_EQ(chain_at(folder_ / "child", 120), chain_at(parent_, 120));
  expect_sound(folder_ / "child");
}

TEST_F(Fork, FromAParentThatIsBeingWritten) {
  const std::string scene = folder_.write("long.cfg", long_scene());
  const std::string whole = folder_ / "whole", growing = folder_ / "growing";
  verb(0, {"run", scene, "-o", whole, "-q", "--steps", "65"});
  Background writer({"run", scene, "-o", growing, "--steps", "1000000"});
  while (!fs::exists(growing) || fs::file_size(growing) < 40000) {
    ASSERT_FALSE(writer.ended());
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const std::string child = fork_of(growing, "5", "child", {"--steps", "60"});
  EXPECT_FALSE(writer.ended());
  writer.signal(SIGTERM);
  EXPECT_EQ(writer.wait(), 75);
  EXPECT_EQ(chain_at(child, 65), chain_at(whole, 65));
  verb(0, {"verify", growing});
}

TEST_F(Fork, WiderAndNarrowerKeepTheBooks) {
  const auto fluid = [&](const std::string& run, std::uint64_t step) {
    const Json masses =
        json_verb(0, {"show", run, "--at", std::to_string(step), "--fields", "fluid.mass"})
            ["fields"]["fluid.mass"];
    double sum = 0;
    for (const Json& mass : masses) sum += mass.get<double>();
    return std::pair<double, std::int64_t>(sum, static_cast<std::int64_t>(masses.size()));
  };
  const auto [before, count_before] = fluid(parent_, 40);
  for (const std::string width : {"1.6 cm", "1 cm"}) {
    const std::string child = folder_ / ("width-" + width);
    const Json result = json_verb(
        0, {"fork", parent_, "--at", "40", "--width", width, "-o", child, "--steps", "40"});
    const auto [after, count_after] = fluid(child, 40);
    const double added = result["added"]["fluid_mass_kg"];
    EXPECT_NEAR(before + added, after, 1e-12 * before) << width;
    EXPECT_EQ(count_before + std::stoll(result["added"]["fluid_count"].get<std::string>()),
              count_after);
    EXPECT_EQ(added > 0, width == "1.6 cm");
    EXPECT_EQ(whole(json_verb(1, {"diff", parent_, child})["first"]["step"]), 40u);
    expect_sound(child);
  }
}

TEST_F(Fork, RampReachesTheWidthInRecordedJumps) {
  const double dt = json_verb(0, {"show", parent_, "--at", "1"})["dt_s"];
  const std::string ramp = std::to_string(30 * dt * 1e6) + " us";
  const std::string child = folder_ / "ramp";
  const Json result = json_verb(0, {"fork", parent_, "--at", "40", "--width", "1.8 cm",
                                    "--ramp-time", ramp, "-o", child});
  EXPECT_GT(result["added"]["fluid_count"].get<std::string>(), "0");
  EXPECT_EQ(chain_at(child, 40), chain_at(parent_, 40));
  EXPECT_EQ(whole(json_verb(1, {"diff", parent_, child})["first"]["step"]), 50u);  // 40 + 30 / 3
  expect_sound(child);
  const std::string again = fork_of(child, "55", "again");
  EXPECT_EQ(json_verb(0, {"diff", child, again})["verdict"], "identical");
  fork_of(parent_, "40", "anchored",
          {"--width", "1.4 cm", "--ramp-time", ramp, "--anchor", "left"});
  expect_sound(folder_ / "anchored");
  verb(2, {"fork", parent_, "--at", "40", "--width", "1.8 cm", "--ramp-time", "1 us", "-o",
           folder_ / "short"});
  verb(2, {"fork", parent_, "--at", "40", "--ramp-time", ramp, "-o", folder_ / "none"});
}

TEST_F(Fork, GrainsLeftOutsideAreAnErrorUnlessToldOtherwise) {
  const CommandResult refused =
      verb(2, {"fork", parent_, "--at", "0", "--width", "6 mm", "-o", folder_ / "x"});
  EXPECT_NE(refused.errors.find("grain"), std::string::npos) << refused.errors;
  EXPECT_FALSE(fs::exists(folder_ / "x"));
  const std::string fewer = fork_of(parent_, "0", "fewer",
                                    {"--width", "6 mm", "--outside", "remove", "--steps", "20"});
  const Json grains = json_verb(0, {"show", fewer, "--at", "0"})["fields"]["grains.id"];
  EXPECT_EQ(grains.size(), 2u);
  expect_sound(fewer);
}

TEST_F(Fork, PerturbationIsAFunctionOfItsSeed) {
  const auto chain = [&](const std::string& name, const std::vector<std::string>& more) {
    return chain_at(fork_of(parent_, "10", name, more), 10);
  };
  const std::string a = chain("a", {"--perturb", "1e-6 d", "--seed", "7"});
  EXPECT_EQ(chain("b", {"--perturb", "1e-6 d", "--seed", "7"}), a);
  EXPECT_EQ(chain("c", {"--seed", "7"}), a);  // the default amplitude
  EXPECT_NE(chain("d", {"--seed", "8"}), a);
  EXPECT_NE(a, chain_at(parent_, 10));
  EXPECT_EQ(chain("e", {"--perturb", "0", "--seed", "7"}), chain_at(parent_, 10));
  const auto positions = [&](const std::string& run) {
    return json_verb(0, {"show", run, "--at", "10"})["fields"]["grains.position"];
  };
  const Json before = positions(parent_), after = positions(folder_ / "a");
  for (std::size_t i = 0; i < before.size(); ++i) {
    const double shift = std::hypot(after[i][0].get<double>() - before[i][0].get<double>(),
                                    after[i][1].get<double>() - before[i][1].get<double>());
    EXPECT_GT(shift, 0);
    EXPECT_LE(shift, 2.5e-9);
  }
  expect_sound(folder_ / "a");
  verb(2, {"fork", parent_, "--at", "10", "--perturb", "1 s", "-o", folder_ / "x"});
  verb(2, {"fork", parent_, "--at", "10", "--perturb", "1 m", "-o", folder_ / "x"});
}

TEST_F(Fork, LengthIsTheParentsUnlessGiven) {
  EXPECT_EQ(whole(json_verb(0, {"fork", parent_, "--at", "50%", "-o", folder_ / "a"})["last_step"]),
            120u);
  EXPECT_EQ(whole(json_verb(0, {"fork", parent_, "--at", "30", "--steps", "7", "-o",
                                folder_ / "b"})["last_step"]),
            37u);
  const Json last = json_verb(0, {"fork", parent_, "--at", "last", "-o", folder_ / "c"});
  EXPECT_EQ(whole(last["last_step"]), 120u);
  EXPECT_EQ(whole(last["steps"]), 0u);
  const std::string stopped = folder_ / "d";
  json_verb(75, {"fork", parent_, "--at", "3", "--stop-after", "1ms", "-o", stopped});
  EXPECT_EQ(whole(json_verb(0, {"resume", stopped})["last_step"]), 120u);
  EXPECT_EQ(chain_at(stopped, 120), chain_at(parent_, 120));
}

TEST_F(Fork, RefusesWithReasons) {
  const auto refused = [&](int code, const std::vector<std::string>& more) {
    std::vector<std::string> words{"fork", parent_, "--at", "40", "-o", folder_ / "x"};
    words.insert(words.end(), more.begin(), more.end());
    const CommandResult result = verb(code, words);
    EXPECT_FALSE(fs::exists(folder_ / "x"));
    return result.errors;
  };
  EXPECT_NE(refused(2, {"-s", "grains.rows=3"}).find("grains.rows"), std::string::npos);
  EXPECT_NE(refused(2, {"-s", "fluid.kernel=cubic"}).find("fluid.kernel"), std::string::npos);
  EXPECT_NE(refused(2, {"--width", "1.25 cm"}).find("nearest"), std::string::npos);
  EXPECT_NE(refused(2, {"-s", "time.dt=1 s"}).find("largest safe value"), std::string::npos);
  EXPECT_NE(refused(3, {"--damping", "lots"}).find("<command line>:1: error:"), std::string::npos);
  EXPECT_NE(refused(3, {"-s", "contact.dampin=1"}).find("did you mean 'contact.damping'"),
            std::string::npos);
  EXPECT_NE(refused(3, {"-s", "nonsense"}).find("KEY=VALUE"), std::string::npos);
  refused(2, {"--outside", "elsewhere"});
  refused(2, {"--anchor", "top"});
  verb(2, {"fork", parent_, "-o", folder_ / "x"});
  verb(2, {"fork", parent_, "--at", "121", "-o", folder_ / "x"});
  verb(2, {"fork", parent_, "--at", "5", "-o", parent_});
  verb(2, {"fork", parent_, "--at", "5", "-o", parent_, "--overwrite"});
  expect_sound(parent_);
}

TEST_F(Fork, MayRecordMoreOrLessThanItsParent) {
  for (const std::string setting :
       {"record.stage_digests=on", "record.tier=digests", "record.every=5"}) {
    const std::string child = fork_of(parent_, "40", "child-" + setting, {"-s", setting});
    EXPECT_EQ(chain_at(child, 120), chain_at(parent_, 120)) << setting;
    EXPECT_EQ(json_verb(0, {"diff", parent_, child})["verdict"], "identical") << setting;
    expect_sound(child);
    const std::string back = fork_of(child, "60", "back-" + setting,
                                     {"-s", "record.stage_digests=off"});
    EXPECT_EQ(chain_at(back, 120), chain_at(parent_, 120)) << setting;
  }
}

TEST_F(Fork, ChangeWithoutEffectIsNoChange) {
  const std::string child = fork_of(parent_, "40", "child", {"--damping", "0.2"});
  EXPECT_TRUE(json_verb(0, {"info", child})["lineage"]["changes"].empty());
  EXPECT_EQ(json_verb(0, {"diff", parent_, child})["verdict"], "identical");
}

}  // namespace
}  // namespace varve::test
