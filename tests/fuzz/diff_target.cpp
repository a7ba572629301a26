// Two files compared. The first byte says what is repaired beforehand (repair.h); then the length
// of the first file as u32; then both.
#include "io/errors.h"
#include "io/memory_file.h"
#include "repair.h"
#include "target.h"
#include "tools/cli.h"
#include "tools/diff_run.h"

namespace {

using namespace varve;

// States that are not stored would be made by another program.
bool stores_every_state(const io::LogReader& log) {
  return log.genesis().tier == io::Tier::deltas && log.genesis().every == 1;
}

tools::DiffReport compare(const io::LogReader& a, const io::LogReader& b, unsigned how) {
  tools::DiffOptions options;
  if ((how & 1) != 0) options.tolerances.all.relative = 1e-9;
  options.reconverge = (how & 2) != 0;
  options.all_tables = (how & 4) != 0;
  options.fine_growth = (how & 8) != 0;
  tools::DiffReport report = tools::compare_logs(a, b, options);
  fuzz::require(!tools::text_report(report, false).empty(), "a report has a text");
  fuzz::require(!tools::json_report(report).empty(), "a report is JSON");
  fuzz::require(!tools::junit_report(report, 0).empty(), "a report is JUnit");
  tools::github_report(report);
  return report;
}

void run(io::MemoryFileSystem& files, unsigned how) {
  const auto a = io::LogReader::open("a", &files);
  const auto b = io::LogReader::open("b", &files);
  if (!stores_every_state(*a) || !stores_every_state(*b)) return;
  const tools::DiffReport one = compare(*a, *b, how);
  // Readers of their own, as the verb has: one that has met damage inside a record counts the step
  // as lost from then on.
  const auto a_again = io::LogReader::open("a", &files), b_again = io::LogReader::open("b", &files);
  const tools::DiffReport other = compare(*b_again, *a_again, how);
  fuzz::require(one.verdict == other.verdict, "a verdict does not hang on the order of the files");
  if (one.verdict == tools::Verdict::different && how == 0) {
    fuzz::require(one.first && other.first && one.first->step == other.first->step,
                  "the first difference is at the same step both ways");
  }
  const auto same = io::LogReader::open("a", &files);
  const tools::DiffReport self = compare(*a, *same, how);
  fuzz::require(self.verdict == tools::Verdict::identical ||
                    self.verdict == tools::Verdict::not_comparable,
                "a file does not differ from itself");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto mode = input.number<std::uint8_t>();
  std::vector<std::byte> a = input.bytes(input.number<std::uint32_t>());
  std::vector<std::byte> b = input.rest();
  fuzz::repair(a, mode);
  fuzz::repair(b, mode);
  io::MemoryFileSystem files;
  files.set_content("a", std::move(a));
  files.set_content("b", std::move(b));
  try {
    run(files, mode & 15);
  } catch (const io::LogError& error) {
    fuzz::require(error.path() == "a" || error.path() == "b",
                  std::string("an error names the file: ") + error.what());
  } catch (const tools::UsageError& error) {
    fuzz::require(*error.what() != '\0', "what cannot be compared is told why");
  }
  return 0;
}
