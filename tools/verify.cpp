// varve verify: checks every byte of a log.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/errors.h"
#include "io/log_reader.h"
#include "tools/cli.h"

namespace {

using namespace varve;
using namespace varve::tools;
using json = nlohmann::ordered_json;
using Verification = io::LogReader::Verification;

std::string damage_text(const io::Damage& damage) {
  std::string out = fmt::format("offset {}: {}", damage.offset, damage.what);
  if (damage.step_to > damage.step_from)
    out += fmt::format("; steps {} to {} can't be read", damage.step_from, damage.step_to);
  else if (damage.step_to == damage.step_from)
    out += fmt::format("; step {} can't be read", damage.step_from);
  return out;
}

std::string text(const std::string& path, const Verification& found) {
  std::string out = fmt::format("{}: {}: {} of {} bytes checked, {} steps, {}\n", path,
                                name_of(found.completeness), found.bytes_checked, found.file_bytes,
                                found.steps, found.closed ? "closed" : "not closed");
  for (const io::Damage& damage : found.damage) out += "  " + damage_text(damage) + "\n";
  return out;
}

std::string json_text(const std::string& path, const Verification& found) {
  json out{{"schema", "varve.verify/1"},
           {"run", path},
           {"verdict", name_of(found.completeness)},
           {"closed", found.closed},
           {"bytes_checked", std::to_string(found.bytes_checked)},
           {"file_bytes", std::to_string(found.file_bytes)},
           {"steps", std::to_string(found.steps)},
           {"damage", json::array()}};
  for (const io::Damage& damage : found.damage)
    out["damage"].push_back({{"offset", std::to_string(damage.offset)},
                             {"what", damage.what},
                             {"step_from", std::to_string(damage.step_from)},
                             {"step_to", std::to_string(damage.step_to)}});
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

// Where not even the first record holds there is no reader to ask; the verdict is told all the
// same.
Verification unreadable(const io::LogError& error) {
  Verification out;
  out.completeness = io::Completeness::damaged;
  out.damage.push_back({error.offset() < 0 ? 0 : error.offset(), error.what()});
  return out;
}

int run(const Invocation& invocation) {
  const std::string& path = invocation.arguments[0];
  const bool as_json = invocation.globals.json;
  Verification found;
  try {
    found = io::LogReader::open(path)->verify();
  } catch (const io::LogError& error) {
    if (!as_json ||
        (error.kind() != io::ErrorKind::damaged && error.kind() != io::ErrorKind::not_a_log &&
         error.kind() != io::ErrorKind::limit))
      throw;
    found = unreadable(error);
  }
  print(as_json ? json_text(path, found) : text(path, found));
  return found.completeness == io::Completeness::complete ? exit_ok : exit_damaged;
}

Verb verb() {
  Verb out;
  out.name = "verify";
  out.usage = "RUN";
  out.summary = "checks every byte of a log: checksums, lengths, order, digests and the chain";
  out.description =
      "Tells a torn tail (bytes behind the last durable record, as a crash leaves them) from "
      "damage\n"
      "(a record that was safely on disk and does not hold any more). Reads only.\n"
      "\n"
      "Exit code: 0 complete, 4 torn, damaged or no varve log.\n"
      "\n"
      "  varve verify column.varve\n";
  out.arguments_min = out.arguments_max = 1;
  out.run = run;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
