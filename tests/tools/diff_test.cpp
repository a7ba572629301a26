// Whole comparisons: logs with planted differences, related logs, digest files.
#include "tools/diff_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/errors.h"
#include "io/memory_file.h"
#include "tests/tools/process.h"
#include "tests/tools/toy_log.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

using test::flip;
using test::Plant;
using test::random_plant;
using test::TemporaryFolder;
using test::toy_frames;
using test::toy_genesis;
using test::toy_schema;
using test::ToyOptions;
using test::write_log;
using testing::HasSubstr;

bool is_long() { return std::getenv("VARVE_LONG") != nullptr; }

// Logs in memory: nothing is synced, so that thousands are written in seconds.
class Logs {
 public:
  io::MemoryFileSystem files;

  void write(const std::string& name, const std::vector<io::Frame>& frames,
             const io::Genesis& genesis = toy_genesis(),
             const std::vector<io::Event>& events = {}) {
    write_log(name, genesis, frames, &files, events);
  }
  std::unique_ptr<io::LogReader> open(const std::string& name) {
    return io::LogReader::open(name, &files);
  }
  DiffReport compare(const std::string& a, const std::string& b, const DiffOptions& options = {}) {
    return compare_logs(*open(a), *open(b), options);
  }
};

std::uint64_t bead_id(std::uint64_t index) { return 3 * index + 1; }

// The id of a particle as the report writes it.
std::string particle_text(const io::Schema& schema, const io::Frame& frame, const Plant& plant) {
  const std::string& population = schema.fields[plant.field].population;
  if (population == "bead") return std::to_string(bead_id(plant.particle));
  if (population == "clock") return "0";
  std::uint64_t key[3];
  std::memcpy(key, frame.fields[7].data() + plant.particle * sizeof key, sizeof key);
  return std::to_string(key[0]) + ":" + std::to_string(key[1]) + ":" + std::to_string(key[2]);
}

std::string component_text(const io::FieldDescriptor& field, std::uint64_t bit) {
  if (field.components == 1) return field.name;
  return field.name + "." + "xyz"[bit / 8 / io::size_of(field.type)];
}

TEST(Diff, EveryPlantedBitIsLocatedExactly) {
  const int plants = is_long() ? 5000 : 200;
  std::mt19937_64 random(20240701);
  const io::Schema schema = toy_schema();
  for (int n = 0; n < plants; ++n) {
    ToyOptions options;
    options.steps = 1 + random() % 90;
    options.beads = 2 + random() % 12;
    options.seed = random();
    std::vector<io::Frame> frames = toy_frames(options);
    Logs logs;
    logs.write("a", frames);
    const Plant plant = random_plant(schema, frames, random);
    flip(frames, schema, plant);
    // Neither keyframe spacing nor anything else of the codec may matter.
    io::Genesis other = toy_genesis();
    other.keyframe_steps = 1 + static_cast<std::uint32_t>(random() % 40);
    logs.write("b", frames, other);
    const DiffReport found = logs.compare("a", "b");
    ASSERT_EQ(found.verdict, Verdict::different) << n;
    EXPECT_EQ(found.first->step, plant.frame) << n;
    EXPECT_EQ(found.first->field, component_text(schema.fields[plant.field], plant.bit)) << n;
    EXPECT_EQ(found.first->particle, particle_text(schema, frames[plant.frame], plant)) << n;
    EXPECT_NE(found.first->a, found.first->b) << n;
    EXPECT_GE(found.first->ulp, 1u) << n;
    const double bound = 2 * std::log2(static_cast<double>(frames.size())) + 8;
    EXPECT_LE(static_cast<double>(found.header_reads_a), bound) << options.steps;
    EXPECT_LE(static_cast<double>(found.header_reads_b), bound) << options.steps;
  }
}

TEST(Diff, EqualPairsRaiseNoAlarm) {
  const int pairs = is_long() ? 1000 : 50;
  std::mt19937_64 random(7);
  for (int n = 0; n < pairs; ++n) {
    ToyOptions options;
    options.steps = random() % 90;
    options.beads = 1 + random() % 12;
    options.seed = random();
    Logs logs;
    const std::vector<io::Frame> frames = toy_frames(options);
    logs.write("a", frames);
    io::Genesis other = toy_genesis();
    other.keyframe_steps = 1 + static_cast<std::uint32_t>(random() % 40);
    logs.write("b", frames, other);
    const DiffReport found = logs.compare("a", "b");
    EXPECT_EQ(found.verdict, Verdict::identical) << n;
    EXPECT_EQ(found.steps_compared, frames.size());
    EXPECT_FALSE(found.first);
  }
}

TEST(Diff, AConstantsChangeIsLocatedAtTheFirstStep) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  const Plant plant{.frame = 0, .field = 3, .particle = 4, .bit = 17};
  for (std::size_t k = 0; k < frames.size(); ++k)
    flip(frames, toy_schema(), {.frame = k, .field = 3, .particle = 4, .bit = 17});
  logs.write("b", frames);
  const DiffReport found = logs.compare("a", "b");
  EXPECT_EQ(found.first->step, plant.frame);
  EXPECT_EQ(found.first->field, "bead.mass");
  EXPECT_EQ(found.first->particle, std::to_string(bead_id(4)));
}

// Writes `steps` steps of two beads without ever holding more than one of them.
void write_long(const std::string& path, std::uint64_t steps, std::uint64_t planted) {
  ToyOptions options;
  options.steps = 0;
  options.beads = 2;
  options.links = false;
  io::Frame frame = toy_frames(options).front();
  double* const velocity = reinterpret_cast<double*>(frame.fields[5].data());
  const auto writer =
      io::LogWriter::create(path, toy_genesis(false), frame.view(), {}, {.overwrite = true});
  for (std::uint64_t step = 1; step <= steps; ++step) {
    frame.step = step;
    frame.time = 1e-3 * static_cast<double>(step);
    frame.dt = 1e-3;
    std::memcpy(frame.fields[0].data(), &step, sizeof step);
    for (int k = 0; k < 4; ++k) velocity[k] *= 0.999;
    if (step == planted) frame.fields[5][9] ^= std::byte{1};
    writer->append(frame.view(), {});
    if (step == planted) frame.fields[5][9] ^= std::byte{1};
  }
  writer->close();
}

TEST(Diff, LongLogsAreBisectedInLittleTime) {
  const std::uint64_t steps = is_long() ? 1'000'000 : 20'000;
  const TemporaryFolder folder;
  const std::string a = folder / "a.varve", b = folder / "b.varve", same = folder / "same.varve";
  const std::uint64_t planted = steps * 7 / 11;
  write_long(a, steps, 0);
  write_long(same, steps, 0);
  write_long(b, steps, planted);
  const auto best_of_five = [](const auto& work) {
    double best_ms = 1e9;
    for (int k = 0; k < 5; ++k) {
      const auto start = std::chrono::steady_clock::now();
      work();
      const std::chrono::duration<double, std::milli> took =
          std::chrono::steady_clock::now() - start;
      best_ms = std::min(best_ms, took.count());
    }
    return best_ms;
  };
  const auto timed = [&](const std::string& other, double& best_ms) {
    DiffReport found;
    best_ms = best_of_five([&] { found = compare_inputs(a, other, {}); });
    return found;
  };
  // The program as a user runs it, its start included.
  const auto binary_ms = [&](const std::string& other, int code) {
    return best_of_five(
        [&] { EXPECT_EQ(test::run_command({"varve-diff", a, other}).code, code); });
  };
  const double bound = 2 * std::log2(static_cast<double>(steps)) + 8;
  double equal_ms = 0, different_ms = 0;
  EXPECT_EQ(timed(same, equal_ms).verdict, Verdict::identical);
  const DiffReport found = timed(b, different_ms);
  EXPECT_EQ(found.first->step, planted);
  EXPECT_LE(static_cast<double>(found.header_reads_a), bound);
  EXPECT_LE(static_cast<double>(found.header_reads_b), bound);
  EXPECT_LT(equal_ms, 50);
  EXPECT_LT(different_ms, 1000);
  std::printf("%llu steps: equal %.2f ms, different %.2f ms, %llu and %llu reads of %.0f\n",
              static_cast<unsigned long long>(steps), equal_ms, different_ms,
              static_cast<unsigned long long>(found.header_reads_a),
              static_cast<unsigned long long>(found.header_reads_b), bound);
  const double program_equal_ms = binary_ms(same, 0), program_different_ms = binary_ms(b, 1);
  EXPECT_LT(program_equal_ms, 50);
  EXPECT_LT(program_different_ms, 1000);
  std::printf("varve-diff as a program: equal %.1f ms, different %.1f ms\n", program_equal_ms,
              program_different_ms);
}

TEST(Diff, GenesisDifferencesAreExplainedAndDecideNothing) {
  const auto frames = toy_frames({});
  io::Genesis other = toy_genesis();
  other.parameters[0].second = "41";
  other.models.emplace_back("walls", "asked for");
  other.build[0].second = "clang++ 14";
  other.engine_revision = 2;
  Logs logs;
  logs.write("a", frames);
  logs.write("b", frames, other);
  const DiffReport found = logs.compare("a", "b");
  EXPECT_EQ(found.verdict, Verdict::identical);
  const std::string text = text_report(found, false);
  EXPECT_THAT(text, HasSubstr("parameter toy.stiffness: a=40 b=41"));
  EXPECT_THAT(text, HasSubstr("model walls: a=(not set) b=asked for"));
  EXPECT_THAT(text, HasSubstr("build compiler: a=by hand b=clang++ 14"));
  EXPECT_THAT(text, HasSubstr("engine revision: a=1 b=2"));
}

TEST(Diff, GrowthAndReconvergenceAreReported) {
  ToyOptions options;
  options.steps = 60;
  std::vector<io::Frame> frames = toy_frames(options);
  Logs logs;
  logs.write("a", frames);
  for (std::size_t k = 10; k < 20; ++k)
    flip(frames, toy_schema(), {.frame = k, .field = 5, .particle = 2, .bit = k - 10});
  flip(frames, toy_schema(), {.frame = 40, .field = 5, .particle = 2, .bit = 0});
  logs.write("b", frames);
  DiffOptions ask;
  ask.reconverge = true;
  const DiffReport found = logs.compare("a", "b", ask);
  ASSERT_EQ(found.growth.size(), 4u);
  EXPECT_EQ(found.growth[0].step, 10u);
  EXPECT_EQ(found.growth[1].step, 11u);
  EXPECT_EQ(found.growth[2].step, 20u);
  EXPECT_EQ(found.growth[3].step, 60u);
  EXPECT_EQ(found.growth[0].fields[5].largest_ulp, 1u);
  EXPECT_EQ(found.growth[1].fields[5].largest_ulp, 2u);
  EXPECT_TRUE(found.growth[2].fields[5].equal());
  ASSERT_TRUE(found.reconvergence);
  EXPECT_EQ(found.reconvergence->first_equal, 20u);
  EXPECT_EQ(found.reconvergence->equal_to_the_end, 41u);
  EXPECT_EQ(found.reconvergence->equal_steps, 40u);
}

TEST(Diff, TolerancesAreAVerdictOfTheirOwn) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  flip(frames, toy_schema(), {.frame = 10, .field = 5, .particle = 2, .bit = 0});
  flip(frames, toy_schema(), {.frame = 30, .field = 5, .particle = 3, .bit = 3});
  logs.write("b", frames);
  DiffOptions options;
  options.tolerances.all.ulp = 8;
  DiffReport found = logs.compare("a", "b", options);
  EXPECT_EQ(found.verdict, Verdict::within_tolerance);
  EXPECT_EQ(found.first->step, 10u);
  options.tolerances.all.ulp = 7;
  found = logs.compare("a", "b", options);
  EXPECT_EQ(found.verdict, Verdict::different);
  EXPECT_EQ(found.first->step, 30u);
  EXPECT_EQ(found.first->particle, std::to_string(bead_id(3)));
  EXPECT_EQ(found.first_bitwise->step, 10u);
  options.tolerances.by_field = {{"bead.velocity", {.absolute = 1, .relative = {}, .ulp = {}}}};
  EXPECT_EQ(logs.compare("a", "b", options).verdict, Verdict::within_tolerance);
  EXPECT_EQ(logs.compare("a", "a", options).verdict, Verdict::identical);
  options.tolerances.by_field[0].first = "bead.colour";
  EXPECT_THROW(logs.compare("a", "b", options), UsageError);
}

TEST(Diff, FieldsAndStepsCanBeChosen) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  flip(frames, toy_schema(), {.frame = 10, .field = 5, .particle = 2, .bit = 0});
  flip(frames, toy_schema(), {.frame = 20, .field = 6, .particle = 1, .bit = 0});
  logs.write("b", frames);
  const auto first_with = [&](DiffOptions options) {
    const DiffReport found = logs.compare("a", "b", options);
    return found.first ? found.first->field + "@" + std::to_string(found.first->step)
                       : std::string(name_of(found.verdict));
  };
  EXPECT_EQ(first_with({}), "bead.velocity.x@10");
  DiffOptions options;
  options.fields = {"bead.heat"};
  EXPECT_EQ(first_with(options), "bead.heat@20");
  options.fields = {"link"};
  EXPECT_EQ(first_with(options), "identical");
  options.fields = {"beat"};
  EXPECT_THROW(first_with(options), UsageError);
  options = {};
  options.from = "11";
  EXPECT_EQ(first_with(options), "bead.heat@20");
  options.to = "19";
  EXPECT_EQ(first_with(options), "identical");
  options = {};
  options.to = "9";
  EXPECT_EQ(first_with(options), "identical");
}

TEST(Diff, LogsOfUnlikeLengthCompareOnWhatBothHold) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  frames.resize(21);
  logs.write("b", frames);
  const DiffReport found = logs.compare("a", "b");
  EXPECT_EQ(found.verdict, Verdict::identical);
  EXPECT_EQ(found.to, 20u);
  EXPECT_THAT(found.notes, testing::Contains(HasSubstr("a goes on to step 40")));
}

TEST(Diff, AForkIsComparedFromItsForkStepOn) {
  const std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("parent", frames);
  const auto child_frames = [&](std::uint64_t step) {
    return std::vector<io::Frame>(frames.begin() + static_cast<std::ptrdiff_t>(step), frames.end());
  };
  const auto same = test::fork_genesis(toy_genesis(), frames, 12, {});
  logs.write("same", child_frames(12), same);
  DiffReport found = logs.compare("parent", "same");
  EXPECT_EQ(found.verdict, Verdict::identical);
  EXPECT_EQ(found.from, 12u);
  EXPECT_THAT(found.relation, HasSubstr("b is a fork of a at step 12 (no change)"));

  const io::Lineage::Change change{"toy.stiffness", "40", "45"};
  std::vector<io::Frame> moved = child_frames(12);
  flip(moved, toy_schema(), {.frame = 7, .field = 5, .particle = 0, .bit = 3});
  logs.write("moved", moved, test::fork_genesis(toy_genesis(), frames, 12, {change}));
  found = logs.compare("moved", "parent");
  EXPECT_EQ(found.first->step, 19u);
  EXPECT_THAT(found.relation, HasSubstr("a is a fork of b at step 12 (toy.stiffness 40 -> 45)"));

  // A change of geometry shows at the fork step itself.
  moved = child_frames(12);
  flip(moved, toy_schema(), {.frame = 0, .field = 4, .particle = 0, .bit = 3});
  logs.write("jump", moved, test::fork_genesis(toy_genesis(), frames, 12, {change}));
  EXPECT_EQ(logs.compare("parent", "jump").first->step, 12u);

  // Two forks of one parent: from the later fork step on.
  logs.write("late", child_frames(30), test::fork_genesis(toy_genesis(), frames, 30, {}));
  found = logs.compare("same", "late");
  EXPECT_EQ(found.verdict, Verdict::identical);
  EXPECT_EQ(found.from, 30u);
  EXPECT_THAT(found.relation, HasSubstr("both descend from run"));
  found = logs.compare("moved", "late");
  EXPECT_EQ(found.verdict, Verdict::identical) << "the states agree again from step 20 on";
  EXPECT_THAT(found.notes, testing::Contains(HasSubstr("the histories before it differ")));

  // A fork of the fork, against the grandparent.
  logs.write("grandchild", child_frames(25), test::fork_genesis(same, child_frames(12), 25, {}));
  found = logs.compare("parent", "grandchild");
  EXPECT_EQ(found.verdict, Verdict::identical);
  EXPECT_THAT(found.relation, HasSubstr("b descends from a by several forks"));
}

TEST(Diff, NoStepInCommonIsNotComparable) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("late", {frames.begin() + 30, frames.end()},
             test::fork_genesis(toy_genesis(), frames, 30, {}));
  frames.resize(20);
  logs.write("a", frames);
  const DiffReport found = logs.compare("a", "late");
  EXPECT_EQ(found.verdict, Verdict::not_comparable);
  EXPECT_THAT(headline(found), HasSubstr("no step in common: a holds 0 to 19, b holds 30 to 40"));
}

TEST(Diff, UnlikeStatesAreNotComparable) {
  Logs logs;
  logs.write("a", toy_frames({}));
  ToyOptions no_links;
  no_links.links = false;
  logs.write("b", toy_frames(no_links), toy_genesis(false));
  DiffReport found = logs.compare("a", "b");
  EXPECT_EQ(found.verdict, Verdict::not_comparable);
  EXPECT_THAT(found.reasons, testing::Contains(HasSubstr("link.spring is only in a")));
  // What both have can be asked for.
  DiffOptions options;
  options.fields = {"bead"};
  EXPECT_EQ(logs.compare("a", "b", options).verdict, Verdict::identical);
}

TEST(Diff, FloatsAgainstDoublesNeedATolerance) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  io::Genesis narrow = toy_genesis();
  narrow.schema.fields[5].type = io::ScalarType::f32;
  narrow.schema.fields[4].follows.clear();
  for (io::Frame& frame : frames) {
    std::vector<std::byte> floats;
    for (std::size_t k = 0; k < frame.fields[5].size(); k += 8) {
      double value = 0;
      std::memcpy(&value, frame.fields[5].data() + k, 8);
      test::append_value(floats, static_cast<float>(value));
    }
    frame.fields[5] = floats;
  }
  logs.write("b", frames, narrow);
  EXPECT_EQ(logs.compare("a", "b").verdict, Verdict::not_comparable);
  DiffOptions options;
  options.tolerances.all.relative = 1e-7;
  EXPECT_EQ(logs.compare("a", "b", options).verdict, Verdict::within_tolerance);
  options.tolerances.all.relative = 1e-12;
  EXPECT_EQ(logs.compare("a", "b", options).verdict, Verdict::different);
}

TEST(Diff, WithoutStoredStatesTheStepIsNamedAndTheNextStateIsLookedAt) {
  ToyOptions options;
  options.steps = 60;
  std::vector<io::Frame> frames = toy_frames(options);
  io::Genesis digests = toy_genesis();
  digests.tier = io::Tier::digests;
  Logs logs;
  logs.write("a", frames);
  logs.write("same", frames, digests);
  EXPECT_EQ(logs.compare("a", "same").verdict, Verdict::identical);
  for (std::size_t k = 22; k <= 60; ++k)
    flip(frames, toy_schema(), {.frame = k, .field = 5, .particle = 2, .bit = 5});
  logs.write("b", frames, digests);
  const DiffReport found = logs.compare("a", "b");
  EXPECT_EQ(found.first->step, 22u);
  EXPECT_THAT(headline(found), HasSubstr("field unknown: b stores no state of this step (tier "
                                         "digests)"));
  ASSERT_FALSE(found.growth.empty());
  EXPECT_GT(found.growth.front().step, 22u);
  EXPECT_EQ(found.growth.back().fields[5].differing, 1u);
}

TEST(Diff, EventTablesAndEventsAreInformation) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  frames[7].tables[0][1][3] ^= std::byte{1};
  logs.write("tables", frames);
  logs.write("events", toy_frames({}), toy_genesis(), {{9, "annotation", {{"text", "look"}}}});
  EXPECT_EQ(logs.compare("a", "tables").verdict, Verdict::identical);
  DiffOptions options;
  options.all_tables = true;
  DiffReport found = logs.compare("a", "tables", options);
  EXPECT_EQ(found.verdict, Verdict::identical);
  EXPECT_THAT(found.notes, testing::Contains(HasSubstr("event table hits at step 7")));
  EXPECT_EQ(logs.compare("a", "events").verdict, Verdict::identical);
}

DigestFile digests_of(Logs& logs, const std::string& name, std::uint64_t every) {
  DigestFile file = make_digest_file(*logs.open(name), every);
  file.path = name + ".digest";
  return file;
}

TEST(DiffWithDigests, TheFirstDifferenceIsBoundedByTheListedSteps) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  const DigestFile file = digests_of(logs, "a", 7);  // 0 7 14 21 28 35 40
  ASSERT_EQ(file.lines.size(), 7u);
  EXPECT_EQ(file.last_step(), 40u);
  EXPECT_EQ(compare_with_digests(*logs.open("a"), file, {}).verdict, Verdict::identical);
  for (std::uint64_t step = 0; step <= 40; ++step) {
    flip(frames, toy_schema(), {.frame = step, .field = 5, .particle = 0, .bit = 0});
    logs.write("b", frames);
    flip(frames, toy_schema(), {.frame = step, .field = 5, .particle = 0, .bit = 0});
    const DiffReport found = compare_with_digests(*logs.open("b"), file, {});
    ASSERT_EQ(found.verdict, Verdict::different);
    EXPECT_GE(found.first->step, step);
    if (step > 0) {
      EXPECT_LT(*found.first->last_equal, step);
      EXPECT_LE(found.first->step - *found.first->last_equal, 7u);
    }
  }
}

TEST(DiffWithDigests, ChangedInputsAreNotComparableAndNamed) {
  const auto frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  const DigestFile file = digests_of(logs, "a", 10);
  const auto reasons = [&](const io::Genesis& genesis) {
    logs.write("b", frames, genesis);
    const DiffReport found = compare_with_digests(*logs.open("b"), file, {});
    return found.verdict == Verdict::not_comparable ? headline(found)
                                                    : std::string(name_of(found.verdict));
  };
  io::Genesis other = toy_genesis();
  other.engine_revision = 2;
  EXPECT_THAT(reasons(other), HasSubstr("a is of engine revision 2, b of revision 1"));
  other = toy_genesis();
  other.scenario = "[toy]\nstiffness = 41\n";
  other.parameters[0].second = "41";
  EXPECT_THAT(reasons(other), HasSubstr("toy.stiffness: a=41 b=40"));
  other = toy_genesis();
  other.scenario = "[toy]\nstiffness = 40\nsomething else\n";
  EXPECT_THAT(reasons(other), HasSubstr("the scenarios differ"));
  // What is recorded of a run is not the run.
  other = toy_genesis();
  other.scenario += "[record]\ntier = digests\n";
  other.parameters[1].second = "digests";
  other.tier = io::Tier::digests;
  EXPECT_EQ(reasons(other), "identical");
}

TEST(DiffWithDigests, ARunThatEndsEarlyDoesNotPass) {
  std::vector<io::Frame> frames = toy_frames({});
  Logs logs;
  logs.write("a", frames);
  const DigestFile file = digests_of(logs, "a", 10);
  frames.resize(31);
  logs.write("b", frames);
  const DiffReport found = compare_with_digests(*logs.open("b"), file, {});
  EXPECT_EQ(found.verdict, Verdict::not_comparable);
  EXPECT_THAT(headline(found), HasSubstr("a ends at step 30, the digest file asks for step 40"));
  DiffOptions options;
  options.to = "30";
  EXPECT_EQ(compare_with_digests(*logs.open("b"), file, options).verdict, Verdict::identical);
}

}  // namespace
}  // namespace varve::tools
