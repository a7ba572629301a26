// varve recover: salvages everything whole of a torn or damaged log into a new one.
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/log_reader.h"
#include "tools/cli.h"

namespace {

using namespace varve;
using namespace varve::tools;
using json = nlohmann::ordered_json;

std::string range_text(std::uint64_t from, std::uint64_t to) {
  return from == to ? fmt::format("step {}", from) : fmt::format("steps {} to {}", from, to);
}

std::string text(const std::string& input, const std::string& output, const io::Recovery& found) {
  std::string out = fmt::format("{}: {} steps kept, written to {} and verified\n", input,
                                found.steps_kept, output);
  for (const io::Damage& damage : found.damage)
    out += fmt::format("  offset {}: {}\n", damage.offset, damage.what);
  for (const auto& [from, to] : found.lost) out += "  lost: " + range_text(from, to) + "\n";
  if (!found.lossy) out += "  nothing was lost\n";
  return out;
}

std::string json_text(const std::string& input, const std::string& output,
                      const io::Recovery& found) {
  json out{{"schema", "varve.recover/1"},
           {"run", input},
           {"output", output},
           {"steps_kept", std::to_string(found.steps_kept)},
           {"lossy", found.lossy},
           {"lost", json::array()},
           {"damage", json::array()}};
  for (const auto& [from, to] : found.lost)
    out["lost"].push_back({{"from", std::to_string(from)}, {"to", std::to_string(to)}});
  for (const io::Damage& damage : found.damage)
    out["damage"].push_back({{"offset", std::to_string(damage.offset)}, {"what", damage.what}});
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

int run(const Invocation& invocation) {
  const std::string& input = invocation.arguments[0];
  const std::string output = invocation.value("output");
  std::error_code error;
  if (std::filesystem::equivalent(input, output, error))
    throw UsageError(fmt::format("{}: is the input; recover never writes to it", output));
  const io::Recovery found = io::recover(input, output, invocation.has("overwrite"));
  print(invocation.globals.json ? json_text(input, output, found) : text(input, output, found));
  return found.lossy ? exit_damaged : exit_ok;
}

Verb verb() {
  Verb out;
  out.name = "recover";
  out.usage = "RUN";
  out.summary = "salvages all that is whole of a torn or damaged log into a new file";
  out.description =
      "The input is never touched. The output is verified before it is called done.\n"
      "\n"
      "Exit code: 0 nothing was lost, 4 some steps were.\n"
      "\n"
      "  varve recover broken.varve -o saved.varve\n";
  out.options = {{"output,o", "FILE", "the new log", false, ""},
                 {"overwrite", "", "replace FILE if it exists", false, ""}};
  out.arguments_min = out.arguments_max = 1;
  out.run = run;
  return out;
}

}  // namespace

int main(int argc, char** argv) { return verb_main(argc, argv, verb()); }
