// varve replay: executes recorded steps again and compares every one with its record.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include <nlohmann/json.hpp>

#include "core/stage_digests.h"
#include "io/log_reader.h"
#include "tools/branch.h"
#include "tools/cli.h"
#include "tools/family.h"
#include "tools/progress.h"
#include "tools/recording.h"
#include "tools/session.h"
#include "tools/signals.h"
#include "tools/simulation_engine.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

/// The first state is made again from the scenario where a log begins with it; a fork's came from
/// its parent.
std::optional<Mismatch> check_first_state(const io::LogReader& log,
                                          const core::RunOptions& options) {
  const auto header = log.header(log.first_step());
  const auto recorded = log.frame(log.first_step());
  if (log.genesis().lineage || !header || !recorded) return std::nullopt;
  const auto engine = SimulationEngine::fresh(scenario_of(log.genesis(), log.path()), options);
  const io::Digest computed = io::digest_frame(engine->schema(), engine->frame());
  if (computed == header->digest) return std::nullopt;
  Mismatch found;
  if (engine->schema() == log.genesis().schema)
    if (const auto named = first_difference(engine->schema(), recorded->view(), engine->frame()))
      found = *named;
  found.step = header->step;
  found.time = header->time;
  found.recorded_digest = header->digest;
  found.computed_digest = computed;
  return found;
}

/// Index of the table of stage digests, or nothing where the scene does not record them.
std::optional<std::size_t> stage_table(const io::Schema& schema) {
  for (std::size_t t = 0; t < schema.tables.size(); ++t)
    if (schema.tables[t].name == "stages" && schema.tables[t].columns.size() == 3) return t;
  return std::nullopt;
}

/// The first stage of a step whose recorded digest is not the computed one; empty if all are equal
/// or none is recorded.
std::string first_differing_stage(const io::LogReader& log, const io::FrameView& computed) {
  const auto table = stage_table(log.genesis().schema);
  const auto recorded = log.tables(computed.step);
  if (!table || !recorded) return "";
  const io::FrameView view = recorded->view();
  const io::TableView &a = view.tables[*table], &b = computed.tables[*table];
  for (std::uint64_t row = 0; row < std::min(a.rows, b.rows); ++row) {
    const auto differs = [&](std::size_t column, std::size_t size) {
      return std::memcmp(a.columns[column].data() + row * size,
                         b.columns[column].data() + row * size, size) != 0;
    };
    if (!differs(0, 1) && !differs(1, 8) && !differs(2, 8)) continue;
    const auto stage = std::to_integer<std::size_t>(b.columns[0][row]);
    return stage < core::stage_names.size() ? std::string(core::stage_names[stage])
                                            : fmt::format("number {}", stage);
  }
  return "";
}

Json first_json(const Mismatch& first) {
  Json object{{"step", std::to_string(first.step)}, {"time_s", first.time}};
  object["field"] = first.field.empty() ? Json() : Json(first.component.value_or(first.field));
  object["particle"] = first.particle ? Json(*first.particle) : Json();
  if (first.row) object["row"] = std::to_string(*first.row);
  object["a"] = first.recorded;
  object["b"] = first.computed;
  object["ulp"] = first.ulp ? Json(std::to_string(*first.ulp)) : Json();
  object["digest"] = {{"recorded", first.recorded_digest.hex()},
                      {"computed", first.computed_digest.hex()}};
  return object;
}

void report(const Invocation& invocation, const io::LogReader& log, const ReplayResult& result,
            unsigned threads, const std::string& stage) {
  const bool same = !result.first;
  if (invocation.globals.json) {
    Json object{{"schema", "varve.replay/1"},
                {"run", log.path()},
                {"verdict", !same ? "different" : result.stopped ? "stopped" : "identical"},
                {"steps_checked", std::to_string(result.steps_checked)},
                {"first_step", std::to_string(result.started_at)},
                {"last_step", std::to_string(result.last_step)},
                {"threads", threads},
                {"first", same ? Json() : first_json(*result.first)}};
    if (!same && !stage.empty()) object["first"]["stage"] = stage;
    print(object.dump(2) + "\n");
  } else if (!same) {
    print(fmt::format("different: {}: {}\n", log.path(), describe(*result.first)));
    if (result.first->field.empty())
      print("the log stores no state of this step, only its digest: no field can be named\n");
    if (!stage.empty()) print(fmt::format("first differing stage of the step: {}\n", stage));
  } else if (!invocation.globals.quiet) {
    print(fmt::format("{}: {}: steps {} to {} executed again with {} thread{}, {} digests equal\n",
                      result.stopped ? "stopped" : "identical", log.path(), result.started_at,
                      result.last_step, threads, threads == 1 ? "" : "s", result.steps_checked));
  }
}

/// Writes the states of re-executed steps A..B into a log of their own: every step decodes there.
class Emitter {
 public:
  Emitter(const io::LogReader& log, const Invocation& invocation, const core::RunOptions& options)
      : log_(log), options_(options), path_(invocation.value("output")),
        overwrite_(invocation.has("overwrite")) {
    const StepRange range = parse_range(invocation.value("emit"), log);
    if (range.stride != 1)
      throw UsageError("--emit: expected a range A:B of consecutive steps, got one with a stride");
    first_ = range.first;
    last_ = range.last;
  }
  std::uint64_t first() const { return first_; }
  std::uint64_t last() const { return last_; }

  void take(const io::FrameView& frame, const std::vector<io::Event>& events) {
    if (frame.step < first_ || frame.step > last_) return;
    if (writer_) {
      writer_->append(frame, events);
    } else {
      BranchRequest request;
      request.step = first_;
      request.settings = {{"record.tier", "deltas"}, {"record.every", "1"}};
      request.target = Target{last_, {}};
      const Branch branch = make_branch(log_, request, options_);
      io::WriterOptions writer_options;
      writer_options.overwrite = overwrite_;
      writer_ = io::LogWriter::create(path_, branch.genesis, frame, events, writer_options);
    }
    if (frame.step == last_) writer_->close();
  }

 private:
  const io::LogReader& log_;
  core::RunOptions options_;
  std::string path_;
  bool overwrite_;
  std::uint64_t first_ = 0, last_ = 0;
  std::unique_ptr<io::LogWriter> writer_;
};

int replay_verb(const Invocation& invocation) {
  const auto log = io::LogReader::open(invocation.arguments.at(0));
  require_this_engine(*log, "; --force compares all the same", invocation.has("force"));
  warn_if_incomplete(*log);
  if (invocation.has("locate") && !stage_table(log->genesis().schema))
    throw UsageError(fmt::format(
        "--locate: {} holds no stage digests; record with -s record.stage_digests=on",
        log->path()));
  const core::RunOptions options{threads_option(invocation), 0};
  std::optional<Emitter> emitter;
  if (invocation.has("emit")) emitter.emplace(*log, invocation, options);
  std::uint64_t from = emitter ? emitter->first() : log->first_step();
  std::uint64_t to = emitter ? emitter->last() : log->last_step();
  if (invocation.has("from")) from = parse_step(invocation.value("from"), *log);
  if (invocation.has("to")) to = parse_step(invocation.value("to"), *log);
  if (from > to)
    throw UsageError(
        fmt::format("--from: step {} lies behind the last step to replay, {}", from, to));

  ReplayResult result;
  std::string stage;
  const StopSignals signals;
  if (from == log->first_step()) {
    result.first = check_first_state(*log, options);
    result.started_at = result.last_step = from;
    result.steps_checked = 1;
  }
  if (!result.first) {
    const auto engine = SimulationEngine::of_genesis(log->genesis(), log->path(), options);
    const auto start = log->header(from);
    Progress progress(invocation.globals, "replay", {to, {}},
                      {from, start ? start->time : 0, start ? start->dt : 0, 0});
    result = replay(*log, *engine, from, to, [&](const io::FrameView& frame) {
      if (progress.due()) progress.update({frame.step, frame.time, frame.dt, 0});
      if (emitter) emitter->take(frame, engine->events());
      return signals.received() == 0;
    });
    if (result.first) stage = first_differing_stage(*log, engine->frame());
  }
  report(invocation, *log, result, options.threads, stage);
  if (result.first) return exit_differ;
  return result.stopped ? exit_stopped : exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "replay";
  verb.usage = "RUN";
  verb.summary = "Executes recorded steps again and checks every state, event table and event.";
  verb.description =
      "Starts from the nearest stored state at or before --from (by default the first step of\n"
      "the log, whose state is made anew from the scenario and checked as well). Ends at the\n"
      "first difference with exit 1, naming step, field and particle where the log stores the\n"
      "state.\n\n"
      "  varve replay column.varve --threads 4\n"
      "  varve replay column.varve --from t=0.2s --to 50%\n"
      "  varve replay column.varve --locate\n";
  verb.options = {
      {"from", "STEP", "first step to check: 12000, t=1.2s, 50%, first, last-100", false, ""},
      {"to", "STEP", "last step to check", false, ""},
      threads_spec(),
      {"force", "", "also where the log is of another engine revision", false, ""},
      {"locate", "", "name the stage of the step as well; needs recorded stage digests", false, ""},
      {"emit", "A:B", "write the re-executed states of these steps to -o, all stored", false, ""},
      {"output,o", "RUN", "log that --emit writes", false, ""},
      {"overwrite", "", "replace what -o names", false, ""},
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = replay_verb;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
