// A scenario file. What is accepted says the same when its canonical text is read again.
#include "core/parameters.h"
#include "target.h"
#include "tools/scenario_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace varve;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const tools::ScenarioSource source = tools::read_scenario_text(text, "fuzz.cfg");
    const std::string canonical = core::canonical_text(source.scenario);
    tools::ScenarioOptions resolved;
    resolved.needs_length = false;
    resolved.resolved = true;
    const tools::ScenarioSource again =
        tools::read_scenario_text(canonical, "canonical.cfg", resolved);
    fuzz::require(core::canonical_text(again.scenario) == canonical,
                  "canonical text is read as it was written");
  } catch (const tools::ScenarioError& error) {
    fuzz::require(!error.diagnostics().empty(), "a scenario is refused with a reason");
    for (const tools::Diagnostic& found : error.diagnostics())
      fuzz::require(found.source == "fuzz.cfg", error.what());
  }
  return 0;
}
