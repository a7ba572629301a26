// A whole file: opened, verified, read, recovered, continued. The first byte says what is repaired
// beforehand (repair.h); the rest is the file.
#include <algorithm>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/log_writer.h"
#include "io/memory_file.h"
#include "repair.h"
#include "target.h"

namespace {

using namespace varve;
using Verification = io::LogReader::Verification;

constexpr std::uint64_t steps_looked_at = 64;

void expect_input_error(const io::LogError& error, const char* path) {
  const io::ErrorKind kind = error.kind();
  fuzz::require(kind == io::ErrorKind::damaged || kind == io::ErrorKind::limit ||
                    kind == io::ErrorKind::unsupported || kind == io::ErrorKind::not_a_log,
                error.what());
  fuzz::require(error.path() == path, std::string("an error names the file: ") + error.what());
  fuzz::require(std::string(error.what()).find("what was saved does not verify") ==
                    std::string::npos,
                error.what());
}

std::string first_damage(const Verification& found) {
  if (found.damage.empty()) return "";
  return ": " + std::to_string(found.damage[0].offset) + ": " + found.damage[0].what;
}

// Reads everything that there is to read; only LogError may come of it.
void read_all(const io::LogReader& log, bool whole) {
  const std::uint64_t first = log.first_step();
  std::uint64_t held = 0;
  log.for_each(first, log.last_step(), [&](const io::StepHeader& header, const io::Frame* frame) {
    fuzz::require(!whole || header.has_state == (frame != nullptr),
                  "what a whole log stores can be decoded");
    return ++held < steps_looked_at;
  });
  for (std::uint64_t i = 0; i < steps_looked_at && i <= log.last_step() - first; ++i) {
    log.header(first + i);
    log.frame(log.last_step() - i);
    log.tables(first + i);
    log.stored_step_at_or_before(first + i);
  }
  log.events();
  log.step_at_time(0.01);
  log.bytes_by_kind();
  log.bytes_by_field();
}

// Recovers "log" to "saved"; what is saved must hold, and recovering it again must change nothing.
void check_recovery(io::MemoryFileSystem& files, const Verification& verified) {
  const io::Recovery recovery = io::recover("log", "saved", true, &files);
  const bool complete = verified.completeness == io::Completeness::complete;
  fuzz::require(!complete || recovery.damage.empty(), "verify sees what recover finds damaged");
  fuzz::require(!complete || recovery.steps_kept == verified.steps,
                "nothing of a log that verifies is lost");
  const auto saved = io::LogReader::open("saved", &files);
  const Verification again = saved->verify();
  fuzz::require(again.completeness == io::Completeness::complete && again.closed,
                "what was saved verifies" + first_damage(again));
  fuzz::require(again.steps == recovery.steps_kept, "as many steps are saved as is said");
  fuzz::require(again.bytes_checked == files.content("saved").size(), "every byte is checked");
  read_all(*saved, true);
  const io::Recovery twice = io::recover("saved", "twice", true, &files);
  auto lost = recovery.lost;  // what was lost behind the last step is told, not recorded
  std::erase_if(lost, [&](const auto& range) { return range.first > saved->last_step(); });
  fuzz::require(twice.steps_kept == recovery.steps_kept && twice.lost == lost &&
                    twice.damage.empty(),
                "recovering what was recovered changes nothing");
}

// Goes on behind the last step where its state is at hand, as `resume` does.
void check_continuation(io::MemoryFileSystem& files, const io::LogReader& log) {
  const std::uint64_t last = log.last_step();
  auto frame = log.frame(last);
  if (!frame || last == UINT64_MAX) return;
  io::WriterOptions options;
  options.files = &files;
  options.sync_seconds = 1e6;
  const auto writer = io::LogWriter::reopen("log", frame->view(), options);
  ++frame->step;
  writer->append(frame->view(), {});
  writer->close();
  const Verification verified = io::LogReader::open("log", &files)->verify();
  fuzz::require(verified.completeness == io::Completeness::complete && verified.closed,
                "a log that was continued verifies" + first_damage(verified));
}

void run(io::MemoryFileSystem& files) {
  const auto log = io::LogReader::open("log", &files);
  const Verification verified = log->verify();
  fuzz::require(verified.bytes_checked <= verified.file_bytes, "no byte is checked twice");
  const bool complete = verified.completeness == io::Completeness::complete;
  fuzz::require(!complete || verified.bytes_checked == verified.file_bytes,
                "a log is complete only where every byte was checked");
  fuzz::require(complete == verified.damage.empty(), "what does not hold is listed");
  fuzz::require(!complete || log->completeness() == io::Completeness::complete,
                "opening finds nothing that verify does not");
  try {
    read_all(*log, complete);
  } catch (const io::LogError& error) {
    fuzz::require(!complete, std::string("a log that verifies can be read: ") + error.what());
    expect_input_error(error, "log");
  }
  try {
    check_recovery(files, verified);
  } catch (const io::LogError& error) {
    fuzz::require(!complete, std::string("a log that verifies can be saved: ") + error.what());
    expect_input_error(error, "log");
  }
  if (verified.completeness != io::Completeness::damaged) check_continuation(files, *log);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const auto mode = input.number<std::uint8_t>();
  std::vector<std::byte> bytes = input.rest();
  fuzz::repair(bytes, mode);
  io::MemoryFileSystem files;
  files.set_content("log", std::move(bytes));
  try {
    run(files);
  } catch (const io::LogError& error) {
    expect_input_error(error, "log");
  }
  return 0;
}
