// varve replay: really executes the steps again, and says where a record is not what they give.
#include <filesystem>

#include <gtest/gtest.h>

#include "io/log_reader.h"
#include "io/log_writer.h"
#include "tests/tools/verbs.h"

namespace varve::test {
namespace {

namespace fs = std::filesystem;

class Replay : public ::testing::Test {
 protected:
  void SetUp() override {
    scene_ = folder_.write("crowd.cfg", crowd_scene());
    run_ = folder_ / "crowd.varve";
    verb(0, {"run", scene_, "-o", run_, "-q"});
  }
  TemporaryFolder folder_;
  std::string scene_, run_;
};

TEST_F(Replay, ChecksEveryDigestWithAnyNumberOfThreads) {
  for (const int threads : {1, 2, 5}) {
    const Json result = json_verb(0, {"replay", run_, "--threads", std::to_string(threads)});
    EXPECT_EQ(result["verdict"], "identical");
    EXPECT_EQ(whole(result["steps_checked"]), 121u);
    EXPECT_EQ(result["threads"], threads);
    EXPECT_TRUE(result["first"].is_null());
  }
}

TEST_F(Replay, StartsFromAStoredState) {
  const Json part = json_verb(0, {"replay", run_, "--from", "50", "--to", "last-20"});
  EXPECT_EQ(whole(part["first_step"]), 50u);
  EXPECT_EQ(whole(part["last_step"]), 100u);
  EXPECT_EQ(whole(part["steps_checked"]), 51u);
  verb(0, {"run", scene_, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  const Json far = json_verb(0, {"replay", folder_ / "digests", "--from", "50", "--to", "60"});
  EXPECT_EQ(whole(far["first_step"]), 32u);  // the keyframe before it
  verb(2, {"replay", run_, "--from", "60", "--to", "50"});
  verb(2, {"replay", run_, "--from", "121"});
}

TEST_F(Replay, CrossesScheduledChanges) {
  const std::string scene = folder_.write(
      "events.cfg", crowd_scene("[event.soft]\nat_step = 40\ncontact.damping = 0.6\n"
                                "[event.wide]\nat_step = 70\ndomain.width = 1.6 cm\n"));
  const std::string run = folder_ / "events.varve";
  verb(0, {"run", scene, "-o", run, "-q"});
  verb(0, {"replay", run});
  verb(0, {"replay", run, "--from", "35"});
  verb(0, {"replay", run, "--from", "41"});
  verb(0, {"replay", run, "--from", "75"});
  EXPECT_NE(chain_at(run, 69), chain_at(run_, 69));
  const Json info = json_verb(0, {"info", run});
  verb(0, {"run", scene, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  EXPECT_EQ(chain_at(run, 120), chain_at(folder_ / "digests", 120));
  EXPECT_EQ(json_verb(0, {"show", run, "--at", "90"})["fields"],
            json_verb(0, {"show", folder_ / "digests", "--at", "90"})["fields"]);
  for (const std::string stop : {"39", "40", "41", "70", "80"}) {
    const std::string part = folder_ / ("part-" + stop);
    verb(0, {"run", scene, "-o", part, "-q", "--steps", stop});
    json_verb(0, {"resume", part, "--steps", std::to_string(120 - std::stoi(stop))});
    EXPECT_EQ(chain_at(part, 120), chain_at(run, 120)) << stop;
  }
}

TEST_F(Replay, EmitsStatesThatWereNotStored) {
  verb(0, {"run", scene_, "-o", folder_ / "digests", "--tier", "digests", "-q"});
  const std::string states = folder_ / "states";
  verb(0, {"replay", folder_ / "digests", "--emit", "40:60", "-o", states});
  EXPECT_EQ(chain_at(states, 40), chain_at(run_, 40));
  EXPECT_EQ(chain_at(states, 60), chain_at(run_, 60));
  EXPECT_EQ(json_verb(0, {"diff", run_, states})["verdict"], "identical");
  verb(0, {"replay", states});
}

/// Writes `source` again with one bit of one field flipped at one step. Digests, chain and
/// checksums are those of the forged states: nothing in the file gives it away.
void forge(const std::string& source, const std::string& target, std::uint64_t step,
           const std::string& field, std::size_t byte) {
  const auto log = io::LogReader::open(source);
  const std::vector<io::Event> events = log->events();
  std::unique_ptr<io::LogWriter> writer;
  for (std::uint64_t at = log->first_step(); at <= log->last_step(); ++at) {
    io::Frame frame = *log->frame(at);
    const io::Frame tables = *log->tables(at);
    frame.rows = tables.rows;
    frame.tables = tables.tables;
    if (at == step) {
      const int index = log->genesis().schema.find(field);
      frame.fields[static_cast<std::size_t>(index)][byte] ^= std::byte{1};
    }
    std::vector<io::Event> now;
    for (const io::Event& event : events)
      if (event.step == at) now.push_back(event);
    if (writer) {
      writer->append(frame.view(), now);
    } else {
      writer = io::LogWriter::create(target, log->genesis(), frame.view(), now);
    }
  }
  writer->close();
}

TEST_F(Replay, FindsAForgedStateThatVerifyMustBelieve) {
  const std::string forged = folder_ / "forged.varve";
  forge(run_, forged, 77, "fluid.velocity", 16 * 31 + 8);  // the y component of the 32nd particle
  verb(0, {"verify", forged});
  const Json id = json_verb(0, {"show", run_, "--at", "77", "--fields", "fluid.id"})["fields"]
                           ["fluid.id"][31];

  const Json result = json_verb(1, {"replay", forged});
  EXPECT_EQ(result["verdict"], "different");
  EXPECT_EQ(whole(result["first"]["step"]), 77u);
  EXPECT_EQ(result["first"]["field"], "fluid.velocity.y");
  EXPECT_EQ(result["first"]["particle"], id);
  EXPECT_EQ(result["first"]["ulp"], "1");
  EXPECT_NE(result["first"]["a"].get<std::string>().find("0x"), std::string::npos);
  EXPECT_NE(result["first"]["a"], result["first"]["b"]);

  verb(0, {"fork", forged, "--at", "60", "-o", folder_ / "child", "-q"});
  const Json diff = json_verb(1, {"diff", forged, folder_ / "child"});
  EXPECT_EQ(whole(diff["first"]["step"]), 77u);
  EXPECT_EQ(diff["first"]["field"], "fluid.velocity.y");
}

TEST_F(Replay, FindsAForgedFirstState) {
  const std::string forged = folder_ / "forged.varve";
  forge(run_, forged, 0, "grains.position", 0);
  verb(0, {"verify", forged});
  const Json result = json_verb(1, {"replay", forged});
  EXPECT_EQ(whole(result["first"]["step"]), 0u);
  EXPECT_EQ(result["first"]["field"], "grains.position.x");
}

TEST_F(Replay, FindsAForgedContactRecord) {
  const Json shown = json_verb(0, {"show", run_, "--at", "first-contact"});
  const std::uint64_t contact = whole(shown["step"]);
  const auto log = io::LogReader::open(run_);
  const std::string forged = folder_ / "forged.varve";
  std::unique_ptr<io::LogWriter> writer;
  for (std::uint64_t at = 0; at <= log->last_step(); ++at) {
    io::Frame frame = *log->frame(at);
    const io::Frame tables = *log->tables(at);
    frame.rows = tables.rows;
    frame.tables = tables.tables;
    if (at == contact) frame.tables[0][5][0] ^= std::byte{1};
    if (writer) {
      writer->append(frame.view(), {});
    } else {
      writer = io::LogWriter::create(forged, log->genesis(), frame.view(), {});
    }
  }
  writer->close();
  verb(0, {"verify", forged});
  const Json result = json_verb(1, {"replay", forged});
  EXPECT_EQ(whole(result["first"]["step"]), contact);
  EXPECT_EQ(result["first"]["field"], "contacts.peak_force");
}

TEST_F(Replay, RefusesWhatIsNoRun) {
  verb(2, {"replay", folder_ / "missing"});
  verb(4, {"replay", scene_});
  verb(2, {"replay", run_, "--to", "nonsense"});
}

}  // namespace
}  // namespace varve::test
