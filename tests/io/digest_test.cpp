// What digests are of, bit for bit: these values are in logs and digest files.
#include <gtest/gtest.h>

#include <cstring>

#include "io/bytes.h"
#include "io/digest.h"
#include "io/genesis.h"
#include "toy_run.h"

namespace varve::test {

using io::Digest;

namespace {

std::vector<std::byte> raw(std::initializer_list<int> values) {
  std::vector<std::byte> out;
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

}  // namespace

TEST(DigestTest, HexIsSixteenBytesMostSignificantFirst) {
  // XXH3-128 of no bytes, as published with the algorithm.
  EXPECT_EQ(io::digest_text("").hex(), "99aa06d3014798d86001c324468d497f");
  const auto digest = io::digest_text("varve");
  EXPECT_EQ(Digest::from_hex(digest.hex()), digest);
  EXPECT_FALSE(Digest::from_hex("99aa"));
  EXPECT_FALSE(Digest::from_hex("99aa06d3014798d86001c324468d497g"));
}

TEST(DigestTest, StateDigestIsOfNameCountAndLittleEndianValues) {
  io::Schema schema;
  schema.fields = {{"a", "p", io::ScalarType::u32, 2, "m", false, false, ""},
                   {"bc", "q", io::ScalarType::u8, 1, "", false, false, ""}};
  const std::uint32_t values[] = {1, 0x01020304};
  const std::uint8_t flags[] = {7, 8};
  io::FrameView frame;
  frame.fields = {{1, std::as_bytes(std::span(values))}, {2, std::as_bytes(std::span(flags))}};
  const auto canonical = raw({1, 0, 0, 0, 'a', 1, 0, 0, 0, 0, 0, 0, 0,  //
                              1, 0, 0, 0, 4, 3, 2, 1,                   //
                              2, 0, 0, 0, 'b', 'c', 2, 0, 0, 0, 0, 0, 0, 0, 7, 8});
  EXPECT_EQ(io::digest_frame(schema, frame), io::digest_bytes(canonical));
}

TEST(DigestTest, ChainIsOverTheTwoDigestsBytes) {
  const Digest one = io::digest_text("one");
  const Digest two = io::digest_text("two");
  std::vector<std::byte> both(32);
  std::memcpy(both.data(), one.bytes.data(), 16);
  std::memcpy(both.data() + 16, two.bytes.data(), 16);
  EXPECT_EQ(io::chain_next(one, two), io::digest_bytes(both));
  EXPECT_NE(io::chain_next(one, two), io::chain_next(two, one));
}

TEST(DigestTest, ChainBaseIsTheFieldSchemaWithoutHintsAndTables) {
  const io::Schema schema = toy_schema();
  const Digest base = io::chain_base(schema);
  io::Schema other = schema;
  other.tables.clear();
  other.fields[2].follows.clear();
  other.fields[1].constant = false;
  EXPECT_EQ(io::chain_base(other), base) << "hints cost bytes, never identity";
  other.fields[2].unit = "mm";
  EXPECT_NE(io::chain_base(other), base);
}

TEST(DigestTest, EveryByteOfEveryFieldCounts) {
  const ToyRun run({});
  const io::Schema schema = toy_schema();
  const Digest before = io::digest_frame(schema, run.frame().view());
  io::Frame frame = run.frame();
  for (auto& field : frame.fields) {
    for (auto& byte : field) {
      byte ^= std::byte{4};
      EXPECT_NE(io::digest_frame(schema, frame.view()), before);
      byte ^= std::byte{4};
    }
  }
  frame.time += 1;
  frame.step += 1;
  frame.rows = {3};
  EXPECT_EQ(io::digest_frame(schema, frame.view()), before) << "only fields are digested";
}

TEST(DigestTest, SwappingBytesTwiceGivesThemBack) {
  const auto bytes = raw({1, 2, 3, 4, 5, 6, 7, 8});
  EXPECT_EQ(io::byte_swapped(std::uint32_t{0x01020304}), 0x04030201U);
  std::vector<std::byte> copy(8);
  io::copy_le(copy.data(), bytes, 4);
  std::vector<std::byte> back(8);
  io::copy_le(back.data(), copy, 4);
  EXPECT_EQ(back, bytes);
}

TEST(RunId, CoversContentAndNothingElse) {
  const io::Genesis genesis = toy_genesis({});
  const std::string id = genesis.run_id();
  EXPECT_EQ(id.size(), 32U);
  io::Genesis other = genesis;
  other.log_id = std::string(32, '1');
  other.build = {{"compiler", "another"}};
  EXPECT_EQ(other.run_id(), id);
  const auto changes = [&](auto&& edit) {
    io::Genesis edited = genesis;
    edit(edited);
    EXPECT_NE(edited.run_id(), id);
  };
  changes([](io::Genesis& g) { g.engine += "x"; });
  changes([](io::Genesis& g) { ++g.engine_revision; });
  changes([](io::Genesis& g) { g.schema.fields[2].follows.clear(); });
  changes([](io::Genesis& g) { g.scenario += " "; });
  changes([](io::Genesis& g) { g.parameters[0].second += "1"; });
  changes([](io::Genesis& g) { g.models.clear(); });
  changes([](io::Genesis& g) { g.files[0].second += "1"; });
  changes([](io::Genesis& g) { g.tier = io::Tier::digests; });
  changes([](io::Genesis& g) { g.every = 2; });
  changes([](io::Genesis& g) { g.keyframe_steps = 7; });
  changes([](io::Genesis& g) { g.lineage = io::Lineage{}; });
}

TEST(RunId, OfAForkCoversParentStepAndChanges) {
  io::Genesis genesis = toy_genesis({});
  genesis.lineage = io::Lineage{};
  genesis.lineage->parent_run_id = std::string(32, 'a');
  const std::string id = genesis.run_id();
  io::Genesis other = genesis;
  other.lineage->parent_name = "elsewhere.varve";
  EXPECT_EQ(other.run_id(), id) << "the parent's name is a hint";
  other.lineage->step = 1;
  EXPECT_NE(other.run_id(), id);
  other = genesis;
  other.lineage->changes = {{"key", "1", "2"}};
  EXPECT_NE(other.run_id(), id);
  other = genesis;
  other.lineage->parent_run_id = std::string(32, 'b');
  EXPECT_NE(other.run_id(), id);
}

}  // namespace varve::test
