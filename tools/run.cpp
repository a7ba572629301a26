// varve run: simulates a scenario and records every step.
#include <filesystem>

#include <fmt/format.h>

#include "io/log_writer.h"
#include "tools/cli.h"
#include "tools/scenario_file.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

constexpr const char* default_scenario = "single_disc";

/// -s settings in their order, then the options that abbreviate one: the later wins.
std::vector<std::string> settings_of(const Invocation& invocation) {
  std::vector<std::string> settings = invocation.values("set");
  target_option(invocation, 0);  // --steps and --until exclude each other
  const auto add = [&](const char* option, const char* key) {
    if (invocation.has(option))
      settings.push_back(fmt::format("{}={}", key, invocation.value(option)));
  };
  add("steps", "time.steps");
  add("until", "time.until");
  add("tier", "record.tier");
  add("every", "record.every");
  add("keyframe-steps", "record.keyframe_steps");
  return settings;
}

int run(const Invocation& invocation) {
  const std::string name =
      invocation.arguments.empty() ? default_scenario : invocation.arguments.front();
  const bool no_step = invocation.has("steps") && invocation.count("steps") == 0;
  const ScenarioSource source = load_scenario(name, {settings_of(invocation), !no_step});
  const core::RunOptions run_options{threads_option(invocation), 0};

  Session session;
  session.globals = invocation.globals;
  session.verb = "run";
  session.path = invocation.has("output")
                     ? invocation.value("output")
                     : std::filesystem::path(name).stem().string() + ".varve";
  std::error_code unrelated;
  if (std::filesystem::equivalent(name, session.path, unrelated))
    throw UsageError(fmt::format("{}: the scenario itself can't be the output", session.path));
  session.target = no_step ? Target{0, {}} : target_of(source.scenario);
  session.stop_after_s = stop_after_option(invocation);

  const auto engine = SimulationEngine::fresh(source.scenario, run_options);
  io::Genesis genesis = make_genesis(source.scenario, engine->schema(), run_options.threads);
  genesis.files = source.files;
  io::WriterOptions options;
  options.overwrite = invocation.has("overwrite");
  auto writer = io::LogWriter::create(session.path, genesis, engine->frame(), engine->events(),
                                      options);
  note(session.globals, fmt::format("{}: recording {} ({} tier)", session.path, source.name,
                                    io::name_of(genesis.tier)));
  session.first_events = engine->events();
  return run_session(*engine, std::move(writer), session);
}

Verb verb() {
  Verb verb;
  verb.name = "run";
  verb.usage = "[FILE|PRESET]";
  verb.summary = "Simulates a scenario and records every step in a log.";
  verb.description =
      "Without FILE it runs the preset single_disc. The first Ctrl-C (or SIGTERM) finishes\n"
      "the step, closes the log and exits with 75; varve resume goes on to the same bits as a\n"
      "run that was never stopped.\n\n"
      "  varve run column.cfg -o column.varve\n"
      "  varve run column.cfg -s contact.damping=0.25 -s 'domain.width=8 cm' --until '0.5 s'\n";
  verb.options = {
      {"output,o", "RUN", "log to write [FILE.varve, in this folder]", false, ""},
      {"set,s", "KEY=VALUE", "set a key of the scenario; wins over the file", true, ""},
      steps_spec("length of the run in steps"),
      until_spec(),
      threads_spec(),
      {"overwrite", "", "replace an existing log", false, ""},
      stop_after_spec(),
      {"tier", "T", "what is stored of a step: deltas or digests", false, ""},
      {"every", "K", "store the state of every K-th step only; digests of all", false, ""},
      {"keyframe-steps", "N", "a complete state at least this often", false, ""},
  };
  verb.arguments_min = 0;
  verb.arguments_max = 1;
  verb.run = run;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
