#include "tools/digest_file.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/errors.h"
#include "tests/tools/process.h"

namespace varve::tools {
namespace {

using testing::HasSubstr;

DigestFile sample() {
  DigestFile file;
  file.engine = "heat rod";
  file.engine_revision = 3;
  file.scenario = io::digest_text("scenario");
  file.schema = io::digest_text("schema");
  file.every = 100;
  file.reason = "new drag law\nsecond line \\ with a backslash";
  file.parameters = {{"contact.damping", "0.2"}, {"scenario.title", ""}, {"note", "two words"}};
  for (const std::uint64_t step : {0u, 100u, 200u, 257u})
    file.lines.push_back(
        {step, 1e-5 * static_cast<double>(step), io::digest_text(std::to_string(step))});
  return file;
}

TEST(DigestFile, ReadsBackWhatItWrote) {
  const DigestFile a = sample(), b = parse_digest_file(digest_file_text(a), "x.digest");
  EXPECT_EQ(b.engine, a.engine);
  EXPECT_EQ(b.engine_revision, a.engine_revision);
  EXPECT_EQ(b.scenario, a.scenario);
  EXPECT_EQ(b.schema, a.schema);
  EXPECT_EQ(b.every, a.every);
  EXPECT_EQ(b.reason, a.reason);
  EXPECT_EQ(b.parameters, a.parameters);
  ASSERT_EQ(b.lines.size(), a.lines.size());
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_EQ(b.lines[i].step, a.lines[i].step);
    EXPECT_EQ(b.lines[i].time, a.lines[i].time);
    EXPECT_EQ(b.lines[i].chain, a.lines[i].chain);
  }
  EXPECT_EQ(digest_file_text(b), digest_file_text(a));
  EXPECT_EQ(b.find(200)->step, 200u);
  EXPECT_EQ(b.find(201), nullptr);
}

TEST(DigestFile, LineEndsOfWindowsAreNoDamage) {
  std::string text;
  for (const char c : digest_file_text(sample())) text += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_EQ(parse_digest_file(text, "x").lines.size(), 4u);
}

TEST(DigestFile, EveryTruncationAndEveryChangedByteIsDamage) {
  const std::string text = digest_file_text(sample());
  for (std::size_t length = 0; length < text.size(); ++length)
    EXPECT_THROW(parse_digest_file(text.substr(0, length), "x"), io::LogError) << length;
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_THROW(parse_digest_file(changed, "x"), io::LogError) << i;
  }
}

std::string complaint(const std::string& body) {
  const std::string text = body + "end " + io::digest_text(body).hex() + "\n";
  try {
    parse_digest_file(text, "x.digest");
  } catch (const io::LogError& error) {
    EXPECT_EQ(error.kind(), io::ErrorKind::damaged);
    return error.what();
  }
  return "";
}

TEST(DigestFile, ComplaintsNameFileAndLine) {
  const std::string digest = io::digest_text("").hex();
  const std::string head =
      "varve-digest 1\nengine varve 1\nscenario " + digest + "\nschema " + digest + "\n";
  EXPECT_EQ(complaint(head + "step 0 0 " + digest + "\n"), "");
  EXPECT_THAT(complaint("varve-digest 2\n"),
              HasSubstr("x.digest: line 1: expected 'varve-digest 1'"));
  EXPECT_THAT(complaint(head), HasSubstr("no step is listed"));
  EXPECT_THAT(complaint("varve-digest 1\nengine varve 1\nstep 0 0 " + digest + "\n"),
              HasSubstr("'scenario' is missing"));
  EXPECT_THAT(complaint(head + "step 0 0 xyz\n"), HasSubstr("line 5: 'xyz' is not a digest"));
  EXPECT_THAT(complaint(head + "step 0 soon " + digest + "\n"), HasSubstr("'soon' is not a time"));
  EXPECT_THAT(complaint(head + "step -1 0 " + digest + "\n"),
              HasSubstr("'-1' is not a whole number"));
  EXPECT_THAT(complaint(head + "step 2 0 " + digest + "\nstep 2 0 " + digest + "\n"),
              HasSubstr("line 6: step 2 does not follow step 2"));
  EXPECT_THAT(complaint(head + "colour blue\n"), HasSubstr("line 5: unknown line 'colour'"));
}

TEST(DigestFile, IsWrittenWholeAndNeverReplacedUnasked) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "a.digest";
  write_digest_file(sample(), path, false);
  EXPECT_TRUE(is_digest_file(path));
  EXPECT_EQ(read_digest_file(path).lines.size(), 4u);
  EXPECT_THROW(write_digest_file(sample(), path, false), io::LogError);
  write_digest_file(sample(), path, true);
  EXPECT_THROW(read_digest_file(folder / "missing"), io::LogError);
  EXPECT_THROW(read_digest_file(folder.path()), io::LogError);
  EXPECT_THROW(write_digest_file(sample(), folder / "no/such/folder", false), io::LogError);
  EXPECT_FALSE(is_digest_file(folder.write("empty", "")));
  EXPECT_FALSE(is_digest_file(folder.write("other", "something else entirely")));
}

TEST(DigestFile, KeysAreComparedBothWays) {
  const auto found = compare_keys({{"x", "1"}, {"y", "2"}}, {{"y", "3"}, {"z", "4"}});
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].b, "(not set)");
  EXPECT_EQ(found[1].a + found[1].b, "23");
  EXPECT_EQ(found[2].key, "z");
  EXPECT_TRUE(is_output_key("record.tier"));
  EXPECT_FALSE(is_output_key("contact.damping"));
}

}  // namespace
}  // namespace varve::tools
