// The logs of format version 1 that are committed open, verify, decode and diff for ever; the
// writer still writes them byte for byte.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <algorithm>
#include <set>

#include "golden_file.h"
#include "io/log_reader.h"
#include "io/memory_file.h"
#include "io/messages.h"
#include "log_damage.h"
#include "tools/diff_run.h"

namespace varve::golden {
namespace {

const std::string folder = VARVE_GOLDEN;

const CommittedFile& committed_file() {
  static const CommittedFile file = read_committed(folder + "/logs.digests");
  return file;
}

std::vector<std::byte> read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::vector<std::string> committed_names() {
  std::vector<std::string> out;
  for (const auto& [name, log] : committed_file().logs) out.push_back(name);
  return out;
}

std::string path_of(const std::string& name) { return folder + "/" + name + ".varve"; }

// Every log that was ever committed.
class Golden : public testing::TestWithParam<std::string> {
 protected:
  std::string path() const { return path_of(GetParam()); }
  const Committed& committed() const { return committed_file().logs.at(GetParam()); }
};

// The logs that the writer still writes.
class GoldenWriter : public testing::TestWithParam<GoldenRun> {
 protected:
  const GoldenRun& run() const { return GetParam(); }
  std::string path() const { return path_of(run().name); }
};

TEST_P(Golden, IsTheFileThatWasCommitted) {
  const auto bytes = read_file(path());
  EXPECT_EQ(bytes.size(), committed().bytes);
  EXPECT_EQ(io::digest_bytes(bytes).hex(), committed().file);
}

TEST_P(Golden, VerifiesToTheLastByte) {
  const auto verification = io::LogReader::open(path())->verify();
  EXPECT_EQ(verification.completeness, io::Completeness::complete);
  EXPECT_TRUE(verification.closed);
  EXPECT_THAT(verification.damage, testing::IsEmpty());
  EXPECT_EQ(verification.bytes_checked, committed().bytes);
  EXPECT_EQ(verification.steps, committed().steps.size());
}

TEST_P(Golden, DecodesEveryStepToItsCommittedDigests) {
  const auto log = io::LogReader::open(path());
  std::map<std::uint64_t, std::vector<io::Event>> events;
  for (const io::Event& event : log->events()) events[event.step].push_back(event);
  std::map<std::uint64_t, Committed::Step> found;
  std::uint64_t states = 0;
  log->for_each(0, UINT64_MAX, [&](const io::StepHeader& header, const io::Frame* frame) {
    if (frame != nullptr) {
      ++states;
      EXPECT_EQ(io::digest_frame(log->genesis().schema, frame->view()), header.digest);
    }
    EXPECT_EQ(header.has_state, frame != nullptr) << header.step;
    const auto tables = log->tables(header.step);
    EXPECT_TRUE(tables) << header.step;
    const bool any = tables && log->genesis().tier == io::Tier::deltas;
    found[header.step] = {header.digest.hex(),
                          outputs_digest(any ? *tables : io::Frame{}, events[header.step]).hex()};
    return true;
  });
  EXPECT_EQ(found, committed().steps);
  EXPECT_GE(states, log->genesis().tier == io::Tier::digests ? 5U : 13U);
}

TEST_P(GoldenWriter, HoldsWhatTheEngineComputes) {
  const auto log = io::LogReader::open(path());
  EXPECT_EQ(log->genesis().run_id(), run().genesis.run_id());
  for (const io::Frame& expected : run().frames) {
    const auto frame = log->frame(expected.step);
    if (!frame) continue;
    EXPECT_EQ(frame->counts, expected.counts) << expected.step;
    EXPECT_EQ(frame->fields, expected.fields) << expected.step;
  }
}

TEST_P(GoldenWriter, IsWrittenAgainByteForByte) {
  if (committed_file().zstd != ZSTD_versionString())
    GTEST_SKIP() << "made with zstd " << committed_file().zstd << ", this is "
                 << ZSTD_versionString() << ": packed bytes may differ";
  EXPECT_TRUE(written(run()) == read_file(path()))
      << "the writer's bytes have changed; if that is meant: io/FORMAT.md, \"Golden logs\"";
}

std::string as_test_name(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Logs, Golden, testing::ValuesIn(committed_names()),
                         [](const auto& parameter) { return as_test_name(parameter.param); });
INSTANTIATE_TEST_SUITE_P(Logs, GoldenWriter, testing::ValuesIn(golden_runs()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST(GoldenLogs, HaveEveryKindOfRecordAndEveryMethodOfTheCodec) {
  std::set<int> kinds, methods, packings;
  std::uint64_t index_records = 0, bytes_in_all = 0;
  for (const GoldenRun& run : golden_runs()) {
    const test::LogBytes log(read_file(path_of(run.name)));
    bytes_in_all += log.size();
    for (const test::PlacedRecord& record : log.records()) {
      kinds.insert(static_cast<int>(record.header.kind));
      packings.insert(static_cast<int>(record.header.packing));
      if (record.header.kind == io::RecordKind::index) ++index_records;
      if (!io::is_step(record.header.kind)) continue;
      const auto from = record.offset + io::header_bytes;
      const auto message = log.slice(from, from + record.header.message_stored);
      for (const io::FieldBlob& blob : io::decode_step(message, {}).fields)
        methods.insert(blob.method);
    }
  }
  EXPECT_THAT(kinds, testing::UnorderedElementsAre(1, 2, 3, 4, 5, 6, 0x81, 0xc5));
  EXPECT_THAT(packings, testing::UnorderedElementsAre(0, 1));
  EXPECT_THAT(methods, testing::UnorderedElementsAre(1, 2, 3, 4, 16, 17, 18, 19, 20, 21));
  EXPECT_GT(index_records, golden_runs().size()) << "none has a pointer to an earlier one";
  EXPECT_LT(bytes_in_all, 200U << 10);
}

TEST(GoldenLogs, Differ) {
  const auto open = [](const char* name) {
    return io::LogReader::open(path_of(name));
  };
  const auto compare = [&](const char* one, const char* other) {
    return tools::compare_logs(*open(one), *open(other), {}).verdict;
  };
  EXPECT_EQ(compare("doubles", "doubles"), tools::Verdict::identical);
  EXPECT_EQ(compare("every3", "fork"), tools::Verdict::identical) << "a fork without a change";
  EXPECT_EQ(compare("doubles", "floats"), tools::Verdict::not_comparable);
  EXPECT_EQ(compare("doubles", "every3"), tools::Verdict::different);
}

}  // namespace
}  // namespace varve::golden
