// varve info: what a log holds, how large it is, what made it.
#include <algorithm>
#include <chrono>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/log_reader.h"
#include "tools/cli.h"
#include "tools/embedded_files.h"
#include "tools/progress.h"

namespace {

using namespace varve;
using namespace varve::tools;
using json = nlohmann::ordered_json;

struct Population {
  std::string name;
  std::uint64_t count = 0;
};

struct Summary {
  io::StepHeader last;
  std::vector<Population> particles;  ///< those that are there for good: constant ids
  std::uint64_t file_bytes = 0, raw_bytes = 0;
  double bytes_per_particle_step = 0;  ///< 0 without particles
  std::vector<io::ByteCount> by_kind, by_field;
  std::vector<io::Event> events;
};

// What comes and goes within a run (contacts) has ids that are no constants.
std::vector<Population> count_particles(const io::Schema& schema, const io::Frame& frame) {
  std::vector<Population> out;
  for (std::size_t f = 0; f < schema.fields.size(); ++f)
    if (schema.fields[f].is_id && schema.fields[f].constant)
      out.push_back({schema.fields[f].population, frame.counts[f]});
  return out;
}

Summary summarize(const io::LogReader& log) {
  Summary out;
  const std::uint64_t first = log.first_step(), last = log.last_step();
  if (const auto header = log.header(last)) out.last = *header;
  std::optional<io::Frame> state;
  if (const auto stored = log.stored_step_at_or_before(last)) state = log.frame(*stored);
  if (state) out.particles = count_particles(log.genesis().schema, *state);
  out.by_kind = log.bytes_by_kind();
  out.by_field = log.bytes_by_field();
  for (const io::ByteCount& kind : out.by_kind) out.file_bytes += kind.stored;
  for (const io::ByteCount& field : out.by_field) out.raw_bytes += field.raw;
  std::uint64_t particles = 0;
  for (const Population& population : out.particles) particles += population.count;
  if (particles != 0)
    out.bytes_per_particle_step =
        static_cast<double>(out.file_bytes) /
        (static_cast<double>(last - first + 1) * static_cast<double>(particles));
  out.events = log.events();
  return out;
}

double ratio(std::uint64_t raw, std::uint64_t stored) {
  return stored == 0 ? 0 : static_cast<double>(raw) / static_cast<double>(stored);
}

// ---- text -----------------------------------------------------------------------------------

std::string table_text(const char* title, const std::vector<io::ByteCount>& rows) {
  std::string out = fmt::format("{:<30} {:>10} {:>14} {:>14} {:>7}\n", title, "records", "stored",
                                "raw", "ratio");
  for (const io::ByteCount& row : rows) {
    out += fmt::format("  {:<28} {:>10} {:>14} ", row.name, row.records, row.stored);
    out += row.raw == 0 ? fmt::format("{:>14} {:>7}\n", "-", "-")
                        : fmt::format("{:>14} {:>7.2f}\n", row.raw, ratio(row.raw, row.stored));
  }
  return out;
}

std::string pairs_text(const char* title,
                       const std::vector<std::pair<std::string, std::string>>& pairs) {
  if (pairs.empty()) return "";
  std::string out = std::string(title) + "\n";
  for (const auto& [key, value] : pairs) out += fmt::format("  {:<28} {}\n", key, value);
  return out;
}

std::string lineage_text(const io::Genesis& genesis) {
  if (!genesis.lineage) return "lineage: none, a fresh run\n";
  const io::Lineage& lineage = *genesis.lineage;
  std::string out =
      fmt::format("lineage: fork of {} (run {}) at step {}, digest {}\n", lineage.parent_name,
                  lineage.parent_run_id, lineage.step, lineage.parent_digest.hex());
  if (lineage.changes.empty()) out += "  no change\n";
  for (const io::Lineage::Change& change : lineage.changes)
    out += fmt::format("  {} {} -> {}\n", change.key, change.from, change.to);
  return out;
}

std::string ending_text(const io::LogReader& log) {
  if (log.completeness() == io::Completeness::torn)
    return fmt::format("torn: {} bytes beyond the last whole record", log.torn_bytes());
  return fmt::format("{}, {}", name_of(log.completeness()), log.closed() ? "closed" : "not closed");
}

std::string text(const io::LogReader& log, const Summary& summary) {
  const io::Genesis& genesis = log.genesis();
  std::string out = fmt::format("{}: {} steps ({} to {}), t={} s, {}\n", log.path(),
                                log.last_step() - log.first_step(), log.first_step(),
                                log.last_step(), summary.last.time, ending_text(log));
  std::string particles;
  for (const Population& population : summary.particles)
    particles +=
        fmt::format("{}{} {}", particles.empty() ? "" : ", ", population.count, population.name);
  out += fmt::format("particles: {}\n", particles.empty() ? "none" : particles);
  out += fmt::format("final chain {}\nrun id {}\n", summary.last.chain.hex(), genesis.run_id());
  out += fmt::format("tier {}", name_of(genesis.tier));
  if (genesis.every > 1) out += fmt::format(" every {}", genesis.every);
  out += fmt::format(", keyframe every {} steps\n", genesis.keyframe_steps);
  out += fmt::format("size {} ({} bytes)", human_bytes(summary.file_bytes), summary.file_bytes);
  if (summary.raw_bytes != 0) {
    std::uint64_t stored = 0;
    for (const io::ByteCount& field : summary.by_field) stored += field.stored;
    out += fmt::format(", states {:.2f} times smaller than raw", ratio(summary.raw_bytes, stored));
  }
  if (summary.bytes_per_particle_step != 0)
    out += fmt::format(", {:.3f} bytes per particle-step", summary.bytes_per_particle_step);
  out += "\n\n" + table_text("bytes by record kind", summary.by_kind);
  out += table_text("bytes by field", summary.by_field) + "\n";
  out += lineage_text(genesis);
  out += fmt::format("engine {} revision {}\n", genesis.engine, genesis.engine_revision);
  out += pairs_text("models", genesis.models);
  out += pairs_text("parameters", genesis.parameters);
  for (const auto& [name, content] : genesis.files)
    out += fmt::format("file {}: {} bytes\n", name, content.size());
  if (!summary.events.empty()) out += "events\n";
  for (const io::Event& event : summary.events) {
    out += fmt::format("  step {} {}", event.step, event.kind);
    for (const auto& [key, value] : event.items) out += fmt::format(" {}={}", key, value);
    out += "\n";
  }
  return out + pairs_text("build", genesis.build);
}

// ---- JSON -----------------------------------------------------------------------------------

json pairs_json(const std::vector<std::pair<std::string, std::string>>& pairs) {
  json out = json::object();
  for (const auto& [key, value] : pairs) out[key] = value;
  return out;
}

json counts_json(const std::vector<io::ByteCount>& rows) {
  json out = json::object();
  for (const io::ByteCount& row : rows)
    out[row.name] = {{"records", std::to_string(row.records)},
                     {"stored", std::to_string(row.stored)},
                     {"raw", std::to_string(row.raw)}};
  return out;
}

json lineage_json(const std::optional<io::Lineage>& lineage) {
  if (!lineage) return nullptr;
  json changes = json::array();
  for (const io::Lineage::Change& change : lineage->changes)
    changes.push_back({{"key", change.key}, {"from", change.from}, {"to", change.to}});
  return {{"parent", lineage->parent_run_id},
          {"parent_name", lineage->parent_name},
          {"step", std::to_string(lineage->step)},
          {"digest", lineage->parent_digest.hex()},
          {"changes", changes}};
}

std::string json_text(const io::LogReader& log, const Summary& summary) {
  const io::Genesis& genesis = log.genesis();
  json out{{"schema", "varve.info/1"},
           {"run", log.path()},
           {"steps", std::to_string(log.last_step() - log.first_step())},
           {"first_step", std::to_string(log.first_step())},
           {"last_step", std::to_string(log.last_step())},
           {"time_s", summary.last.time},
           {"final_chain", summary.last.chain.hex()},
           {"tier", name_of(genesis.tier)},
           {"every", genesis.every},
           {"keyframe_steps", genesis.keyframe_steps},
           {"completeness", name_of(log.completeness())},
           {"closed", log.closed()},
           {"torn_bytes", std::to_string(log.torn_bytes())},
           {"run_id", genesis.run_id()},
           {"log_id", genesis.log_id}};
  out["particles"] = json::object();
  for (const Population& population : summary.particles)
    out["particles"][population.name] = std::to_string(population.count);
  out["bytes"] = {{"total", std::to_string(summary.file_bytes)},
                  {"per_particle_step", summary.bytes_per_particle_step},
                  {"raw", std::to_string(summary.raw_bytes)},
                  {"by_kind", counts_json(summary.by_kind)},
                  {"by_field", counts_json(summary.by_field)}};
  out["lineage"] = lineage_json(genesis.lineage);
  out["models"] = pairs_json(genesis.models);
  out["parameters"] = pairs_json(genesis.parameters);
  out["engine"] = genesis.engine;
  out["engine_revision"] = genesis.engine_revision;
  out["events"] = json::array();
  for (const io::Event& event : summary.events)
    out["events"].push_back({{"step", std::to_string(event.step)},
                             {"kind", event.kind},
                             {"items", pairs_json(event.items)}});
  out["build"] = pairs_json(genesis.build);
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

// ---- following ------------------------------------------------------------------------------

void print_position(const io::LogReader& log, bool as_json) {
  const auto header = log.header(log.last_step());
  if (!header) return;
  if (as_json)
    print(json{{"step", std::to_string(header->step)},
               {"time_s", header->time},
               {"chain", header->chain.hex()}}
              .dump() +
          "\n");
  else
    print(
        fmt::format("step {} t={} s chain {}\n", header->step, header->time, header->chain.hex()));
  std::fflush(stdout);
}

// One line whenever there are new steps, until the log is closed or nothing came for a while.
int follow(io::LogReader& log, bool as_json, double patience_s) {
  using clock = std::chrono::steady_clock;
  print_position(log, as_json);
  auto last_news = clock::now();
  while (!log.closed()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    if (log.refresh()) {
      print_position(log, as_json);
      last_news = clock::now();
    } else if (patience_s > 0 &&
               clock::now() - last_news > std::chrono::duration<double>(patience_s)) {
      break;
    }
  }
  return exit_ok;
}

int run(const Invocation& invocation) {
  const auto log = io::LogReader::open(invocation.arguments[0]);
  const Globals& globals = invocation.globals;
  if (log->completeness() == io::Completeness::torn)
    warn(fmt::format("{}: torn: {} bytes beyond the last whole record", log->path(),
                     log->torn_bytes()));
  if (log->completeness() == io::Completeness::damaged)
    warn(fmt::format("{}: damaged; 'varve verify' says where, 'varve recover' saves what is whole",
                     log->path()));
  if (invocation.has("scenario")) {
    print(with_embedded(log->genesis().scenario, log->genesis().files));
    return exit_ok;
  }
  if (invocation.has("follow"))
    return follow(*log, globals.json, invocation.number("patience").value_or(0));
  const Summary summary = summarize(*log);
  print(globals.json ? json_text(*log, summary) : text(*log, summary));
  return log->completeness() == io::Completeness::damaged ? exit_damaged : exit_ok;
}

Verb verb() {
  Verb out;
  out.name = "info";
  out.usage = "RUN";
  out.summary = "says what a log holds: steps, bytes, parameters, models, lineage, build";
  out.description =
      "Exit code: 0, also for a log with a torn tail; 4 if it is damaged.\n"
      "\n"
      "  varve info column.varve\n"
      "  varve info column.varve --scenario > again.cfg\n"
      "  varve info column.varve --follow\n";
  out.options = {
      {"scenario", "", "print the resolved scenario that reproduces the run, with the files it\n"
       "names below it, nothing else", false,
       ""},
      {"follow", "", "print a line whenever a growing log has new steps, until it is closed", false,
       ""},
      {"patience", "SECONDS", "end --follow after so long without news; 0: never", false, "0"},
  };
  out.arguments_min = out.arguments_max = 1;
  out.run = run;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
