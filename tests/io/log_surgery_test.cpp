// The surgery does what its users rely on: one value differs at one step, and all checks pass.
#include <gtest/gtest.h>

#include "io/errors.h"
#include "io/memory_file.h"
#include "log_surgery.h"
#include "toy_run.h"

namespace varve::test {

TEST(LogSurgery, AlteredLogVerifiesAndDiffersAtOneStepOnly) {
  io::MemoryFileSystem files;
  ToyOptions options;
  options.steps = 50;
  options.event_every = 9;
  write_toy_log("run", options, untimed(files));
  const Alteration what{21, "bead.v", 3, 1, 0};
  write_altered_log("run", "altered", what, &files);

  const auto before = io::LogReader::open("run", &files);
  const auto after = io::LogReader::open("altered", &files);
  EXPECT_EQ(after->verify().completeness, io::Completeness::complete);
  EXPECT_EQ(after->genesis().run_id(), before->genesis().run_id());
  EXPECT_EQ(after->events(), before->events());
  for (std::uint64_t step = 0; step <= 50; ++step) {
    const auto one = before->header(step);
    const auto other = after->header(step);
    EXPECT_EQ(one->digest == other->digest, step != 21) << step;
    EXPECT_EQ(one->chain == other->chain, step < 21) << step;
    EXPECT_EQ(same_frame(*before->frame(step), *after->frame(step)), step != 21) << step;
  }
  auto bytes = before->frame(21)->fields[3];
  bytes[(3 * 2 + 1) * 8] ^= std::byte{1};
  EXPECT_EQ(after->frame(21)->fields[3], bytes);
}

TEST(LogSurgery, NamesWhatIsNotThere) {
  io::MemoryFileSystem files;
  write_toy_log("run", {}, untimed(files));
  EXPECT_THROW(write_altered_log("run", "out", {99, "bead.v", 0, 0, 0}, &files), io::LogError);
  EXPECT_THROW(write_altered_log("run", "out", {9, "none", 0, 0, 0}, &files), io::LogError);
  EXPECT_THROW(write_altered_log("run", "out", {9, "bead.v", 6, 0, 0}, &files), io::LogError);
}

}  // namespace varve::test
