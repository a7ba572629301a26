#include "tools/recording.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "io/errors.h"
#include "io/frame_diff.h"

namespace varve::tools {

namespace {

/// Reals as hex floats, whole numbers (ids, counts) as decimals.
std::string value_text(const io::Scalar& value) {
  return value.is_real() ? value.hex() : value.decimal();
}

io::Scalar cell(const io::ColumnDescriptor& column, std::span<const std::byte> bytes,
                std::uint64_t row) {
  io::FieldDescriptor field;
  field.type = column.type;
  return io::scalar_at(field, {bytes.size() / io::size_of(column.type), bytes}, row);
}

std::string event_text(const io::Event& event) {
  std::string text = event.kind;
  for (const auto& [key, value] : event.items) text += fmt::format(" {}={}", key, value);
  return text;
}

std::string step_not_held(const io::LogReader& log, std::uint64_t step) {
  return fmt::format("holds no step {}; its steps are {} to {}", step, log.first_step(),
                     log.last_step());
}

io::StepHeader header_of(const io::LogReader& log, std::uint64_t step) {
  const auto header = log.header(step);
  if (!header)
    throw io::LogError(io::ErrorKind::not_found, log.path(), step_not_held(log, step));
  return *header;
}

Mismatch digest_mismatch(const io::LogReader& log, const io::Engine& engine,
                         const io::StepHeader& header, const io::Digest& computed,
                         const io::Frame* recorded) {
  Mismatch found;
  if (recorded != nullptr)
    if (const auto named = first_difference(engine.schema(), recorded->view(), engine.frame()))
      found = *named;
  if (recorded == nullptr && header.has_state)
    if (const auto stored = log.frame(header.step))
      if (const auto named = first_difference(engine.schema(), stored->view(), engine.frame()))
        found = *named;
  found.step = header.step;
  found.time = header.time;
  found.recorded_digest = header.digest;
  found.computed_digest = computed;
  return found;
}

/// Restores the nearest stored state at or before `step` and checks that it arrived whole.
std::uint64_t restore_nearest(const io::LogReader& log, std::uint64_t step, io::Engine& engine) {
  const auto stored = log.stored_step_at_or_before(step);
  const auto frame = stored ? log.frame(*stored) : std::nullopt;
  if (!frame)
    throw io::LogError(io::ErrorKind::not_found, log.path(),
                       fmt::format("no stored state from which step {} can be reached", step));
  engine.restore(frame->view());
  const io::StepHeader header = header_of(log, *stored);
  const io::Digest restored = io::digest_frame(engine.schema(), engine.frame());
  if (restored != header.digest)
    throw Divergence(log.path(), digest_mismatch(log, engine, header, restored, &*frame));
  return *stored;
}

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

std::string describe(const Mismatch& mismatch) {
  std::string text = fmt::format("step {} (t = {} s)", mismatch.step, mismatch.time);
  if (mismatch.field.empty()) {
    text += fmt::format(": digest {} recorded, {} computed", mismatch.recorded_digest.hex(),
                        mismatch.computed_digest.hex());
  } else {
    text += ", " + mismatch.component.value_or(mismatch.field);
    if (mismatch.particle) text += fmt::format(", particle {}", *mismatch.particle);
    if (mismatch.row) text += fmt::format(", row {}", *mismatch.row);
    text += fmt::format(": {} recorded, {} computed", mismatch.recorded, mismatch.computed);
  }
  return text;
}

Divergence::Divergence(const std::string& path, Mismatch found)
    : ToolError(exit_differ,
                path + ": re-execution differs from the record first at " +
                    describe(found)),
      mismatch(std::move(found)) {}

std::optional<Mismatch> first_difference(const io::Schema& schema, const io::FrameView& recorded,
                                         const io::FrameView& computed) {
  const io::SchemaMatch match = io::match_schemas(schema, schema);
  const io::FrameDifference difference =
      io::compare_frames(schema, recorded, schema, computed, match);
  const io::FieldDifference* field = difference.first();
  if (field == nullptr) return std::nullopt;
  Mismatch found;
  found.step = computed.step;
  found.time = computed.time;
  found.field = field->name;
  if (field->first) {
    if (field->components > 1)
      found.component = io::component_name(*field, field->first->component);
    found.particle = io::particle_name(field->first->particle);
    found.recorded = value_text(field->first->a);
    found.computed = value_text(field->first->b);
    found.ulp = field->first->ulp;
  } else {
    const bool missing = field->first_only_a.has_value();
    found.particle = io::particle_name(missing ? *field->first_only_a : *field->first_only_b);
    found.recorded = missing ? "present" : "absent";
    found.computed = missing ? "absent" : "present";
  }
  return found;
}

std::optional<Mismatch> first_table_difference(const io::Schema& schema,
                                               const io::FrameView& recorded,
                                               const io::FrameView& computed) {
  for (std::size_t t = 0; t < schema.tables.size(); ++t) {
    const io::TableDescriptor& table = schema.tables[t];
    const io::TableView empty{0, std::vector<std::span<const std::byte>>(table.columns.size())};
    const io::TableView& a = t < recorded.tables.size() ? recorded.tables[t] : empty;
    const io::TableView& b = t < computed.tables.size() ? computed.tables[t] : empty;
    Mismatch found;
    found.step = computed.step;
    found.time = computed.time;
    found.field = table.name;
    for (std::uint64_t row = 0; row < std::min(a.rows, b.rows); ++row) {
      for (std::size_t c = 0; c < table.columns.size(); ++c) {
        const io::Scalar x = cell(table.columns[c], a.columns[c], row);
        const io::Scalar y = cell(table.columns[c], b.columns[c], row);
        if (x == y) continue;
        found.field += "." + table.columns[c].name;
        found.row = row;
        found.recorded = value_text(x);
        found.computed = value_text(y);
        return found;
      }
    }
    if (a.rows == b.rows) continue;
    found.recorded = fmt::format("{} rows", a.rows);
    found.computed = fmt::format("{} rows", b.rows);
    return found;
  }
  return std::nullopt;
}

std::uint64_t seek(const io::LogReader& log, std::uint64_t step, io::Engine& engine) {
  header_of(log, step);
  const std::uint64_t start = restore_nearest(log, step, engine);
  for (std::uint64_t at = start + 1; at <= step; ++at) {
    engine.advance();
    const auto header = log.header(at);
    if (!header) continue;  // a gap left by recovery: nothing to compare with
    const io::Digest computed = io::digest_frame(engine.schema(), engine.frame());
    if (computed != header->digest)
      throw Divergence(log.path(), digest_mismatch(log, engine, *header, computed, nullptr));
  }
  return step - start;
}

io::Frame state_at(const io::LogReader& log, std::uint64_t step,
                   const std::function<std::unique_ptr<io::Engine>()>& make_engine) {
  if (header_of(log, step).has_state)
    if (auto frame = log.frame(step)) return std::move(*frame);
  const auto engine = make_engine();
  seek(log, step, *engine);
  return io::Frame::copy_of(engine->frame());
}

bool Target::reached(std::uint64_t step, double time) const {
  return (last_step && step >= *last_step) || (until && time >= *until);
}

namespace {

/// The loop of record(), without the closing of the log.
void record_steps(io::Engine& engine, io::LogWriter& writer, const Target& target,
                  const std::function<bool(const io::FrameView&)>& go_on,
                  RecordingResult& result) {
  while (!target.reached(result.last_step, result.time)) {
    try {
      engine.advance();
    } catch (const EngineFailure& failure) {
      result.failure = failure;
      result.reason = StopReason::failed;
      return;
    }
    const io::FrameView frame = engine.frame();
    const std::vector<io::Event>& events = engine.events();
    writer.append(frame, events);
    result.last_step = frame.step;
    result.time = frame.time;
    result.events.insert(result.events.end(), events.begin(), events.end());
    if (!go_on(frame) && !target.reached(frame.step, frame.time)) {
      result.reason = StopReason::asked;
      return;
    }
  }
}

}  // namespace

RecordingResult record(io::Engine& engine, io::LogWriter& writer, const Target& target,
                       const std::function<bool(const io::FrameView&)>& go_on) {
  const Stopwatch watch;
  RecordingResult result;
  const io::FrameView start = engine.frame();
  result.first_step = result.last_step = start.step;
  result.time = start.time;
  try {
    record_steps(engine, writer, target, go_on, result);
    writer.close();
  } catch (const io::LogError& error) {
    if (error.kind() != io::ErrorKind::write_failed) throw;
    const std::string path = error.path() + ": ";
    std::string text = error.what();
    if (text.starts_with(path)) text.erase(0, path.size());
    throw io::LogError(error.kind(), error.path(),
                       fmt::format("{}; the last step known to be on disk is {}", text,
                                   writer.status().durable_step));
  }
  result.wall_s = watch.seconds();
  result.status = writer.status();
  return result;
}

namespace {

/// Annotations are remarks, made by tools and people too: nothing that has to come again.
std::vector<io::Event> without_remarks(std::vector<io::Event> events) {
  std::erase_if(events, [](const io::Event& event) { return event.kind == "annotation"; });
  return events;
}

/// Compares the engine's last step with its record.
std::optional<Mismatch> compare_step(const io::LogReader& log, const io::Engine& engine,
                                     const io::StepHeader& header, const io::Frame* recorded,
                                     const std::vector<io::Event>& recorded_events) {
  const io::FrameView computed = engine.frame();
  const io::Digest digest = io::digest_frame(engine.schema(), computed);
  if (digest != header.digest) return digest_mismatch(log, engine, header, digest, recorded);
  const auto complete = [&](Mismatch found) {
    found.step = header.step;
    found.time = header.time;
    found.recorded_digest = found.computed_digest = digest;
    return found;
  };
  if (!engine.schema().tables.empty() && log.genesis().tier == io::Tier::deltas &&
      header.has_state) {
    const auto tables = log.tables(header.step);
    if (tables)
      if (const auto found = first_table_difference(engine.schema(), tables->view(), computed))
        return complete(*found);
  }
  const std::vector<io::Event> computed_events = without_remarks(engine.events());
  if (recorded_events != computed_events) {
    Mismatch found;
    found.field = "events";
    for (const io::Event& event : recorded_events) found.recorded += event_text(event) + "; ";
    for (const io::Event& event : computed_events) found.computed += event_text(event) + "; ";
    for (std::string* text : {&found.recorded, &found.computed})
      *text = text->empty() ? "none" : text->substr(0, text->size() - 2);
    return complete(found);
  }
  return std::nullopt;
}

/// Events of one step that an engine would produce again.
std::vector<io::Event> events_of(const std::vector<io::Event>& all, std::uint64_t step) {
  std::vector<io::Event> chosen;
  for (const io::Event& event : all)
    if (event.step == step) chosen.push_back(event);
  return without_remarks(chosen);
}

}  // namespace

ReplayResult replay(const io::LogReader& log, io::Engine& engine, std::uint64_t from,
                    std::uint64_t to, const std::function<bool(const io::FrameView&)>& go_on) {
  header_of(log, from);
  header_of(log, to);
  ReplayResult result;
  result.started_at = result.last_step = restore_nearest(log, from, engine);
  result.steps_checked = 1;
  if (!go_on(engine.frame())) {
    result.stopped = true;
    return result;
  }
  const std::vector<io::Event> events = log.events();
  if (result.started_at == to) return result;
  std::uint64_t at = result.started_at;
  log.for_each(at + 1, to, [&](const io::StepHeader& header, const io::Frame* recorded) {
    try {
      for (; at < header.step; ++at) engine.advance();
    } catch (const EngineFailure& failure) {
      Mismatch found;
      found.step = header.step;
      found.time = header.time;
      found.field = "step";
      found.recorded = "a completed step";
      found.computed = failure.what();
      found.recorded_digest = header.digest;
      result.first = found;
      return false;
    }
    result.first = compare_step(log, engine, header, recorded, events_of(events, header.step));
    ++result.steps_checked;
    result.last_step = header.step;
    if (result.first) return false;
    result.stopped = !go_on(engine.frame());
    return !result.stopped;
  });
  return result;
}

io::Digest fork_chain_base(const io::LogReader& log, std::uint64_t step) {
  if (step != log.first_step()) return header_of(log, step - 1).chain;
  const io::Genesis& genesis = log.genesis();
  return genesis.lineage ? genesis.lineage->chain_base : io::chain_base(genesis.schema);
}

io::Lineage make_lineage(const io::LogReader& log, std::uint64_t step,
                         std::vector<io::Lineage::Change> changes) {
  const io::StepHeader header = header_of(log, step);
  const io::Genesis& genesis = log.genesis();
  io::Lineage lineage;
  lineage.parent_run_id = genesis.run_id();
  lineage.parent_name = log.path().substr(log.path().find_last_of('/') + 1);
  lineage.step = step;
  lineage.parent_digest = header.digest;
  lineage.parent_chain = header.chain;
  lineage.chain_base = fork_chain_base(log, step);
  lineage.changes = std::move(changes);
  lineage.ancestors = {lineage.parent_run_id};
  if (genesis.lineage)
    lineage.ancestors.insert(lineage.ancestors.end(), genesis.lineage->ancestors.begin(),
                             genesis.lineage->ancestors.end());
  return lineage;
}

void require_same_engine(const io::LogReader& log, const std::string& engine,
                         std::uint32_t revision, const std::string& what_else_to_do) {
  const io::Genesis& genesis = log.genesis();
  if (genesis.engine != engine)
    throw UsageError(fmt::format("{}: recorded by the engine '{}', this is '{}'", log.path(),
                                 genesis.engine, engine));
  if (genesis.engine_revision != revision)
    throw UsageError(fmt::format("{}: recorded by engine revision {}, this is {}{}", log.path(),
                                 genesis.engine_revision, revision, what_else_to_do));
}

}  // namespace varve::tools
