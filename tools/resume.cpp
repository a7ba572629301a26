// varve resume: continues a stopped, killed or finished run from its last whole record.
#include <fmt/format.h>

#include "io/errors.h"
#include "io/log_reader.h"
#include "io/log_writer.h"
#include "tools/cli.h"
#include "tools/recording.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

/// Where a log that is already long enough stands, in the form of a session that did nothing.
std::string end_text(const io::LogReader& log, const io::StepHeader& last) {
  return fmt::format("{}: already at its end (step {}, t = {:.6g} s); --steps or --until goes on\n",
                     log.path(), last.step, last.time);
}

int resume(const Invocation& invocation) {
  const std::string path = invocation.arguments.at(0);
  const unsigned threads = threads_option(invocation);
  auto log = io::LogReader::open(path);
  require_this_engine(*log, "; it can be forked and read, not continued");
  const auto last = log->header(log->last_step());
  if (!last)
    throw io::LogError(io::ErrorKind::damaged, path, "the record of its last step can't be read");

  const auto engine =
      SimulationEngine::of_genesis(log->genesis(), path, core::RunOptions{threads, 0});
  Session session;
  session.globals = invocation.globals;
  session.verb = "resume";
  session.path = path;
  session.stop_after_s = stop_after_option(invocation);
  session.target = target_option(invocation, last->step)
                       .value_or(target_of(scenario_of(log->genesis(), path)));
  if (!session.target.last_step && !session.target.until)
    throw UsageError(path + ": its scenario names no end; give --steps or --until");
  const bool at_end = session.target.reached(last->step, last->time);
  if (at_end && log->completeness() == io::Completeness::complete && log->closed() &&
      !invocation.globals.json) {
    if (!invocation.globals.quiet) print(end_text(*log, *last));
    return exit_ok;
  }

  const std::uint64_t executed = seek(*log, last->step, *engine);
  if (executed > 0)
    note(session.globals, fmt::format("the last state is not stored: {} steps executed again from "
                                      "step {}", executed, last->step - executed));
  auto writer = io::LogWriter::reopen(path, engine->frame());
  if (writer->cut_bytes() > 0)
    note(session.globals, fmt::format("{}: cut a torn tail of {} bytes behind step {}", path,
                                      writer->cut_bytes(), last->step));
  log.reset();
  if (at_end) note(session.globals, fmt::format("already at its end (step {})", last->step));
  return run_session(*engine, std::move(writer), session);
}

Verb verb() {
  Verb verb;
  verb.name = "resume";
  verb.usage = "RUN";
  verb.summary = "Continues a run from its last whole record, as if it had never stopped.";
  verb.description =
      "Goes on to the end that the run was started with; --steps and --until go further.\n"
      "Bytes behind the last whole record (a torn tail, after a crash) are cut, and this is\n"
      "said. The bits are those of a run that was never stopped.\n\n"
      "  varve resume column.varve\n"
      "  varve resume column.varve --steps 1000\n";
  verb.options = {steps_spec("so many more steps"), until_spec(), threads_spec(),
                  stop_after_spec()};
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = resume;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
