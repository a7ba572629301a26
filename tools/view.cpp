// varve view: one page of HTML that shows runs, with a time slider.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "tools/cli.h"
#include "tools/family.h"
#include "tools/simulation_engine.h"
#include "tools/view_page.h"

namespace varve::tools {
namespace {

/// The range with a stride that gives at most `most` states, the last step among them if it can be.
StepRange thinned(StepRange range, std::uint64_t most) {
  const std::uint64_t steps = (range.last - range.first) / range.stride + 1;
  if (steps > most) range.stride *= (steps + most - 1) / most;
  return range;
}

/// Written beside its place, then moved there: a page is whole or not there. What is no regular
/// file (a pipe, a device) is written to and stays what it is.
void write_page(const std::string& path, const std::string& page) {
  const bool special =
      std::filesystem::exists(path) && !std::filesystem::is_regular_file(path);
  const std::string part = special ? path : path + ".part";
  const auto fail = [&] {
    const std::string why = std::strerror(errno);
    if (!special) std::remove(part.c_str());
    throw ToolError(exit_output, fmt::format("{}: could not be written: {}", path, why));
  };
  std::FILE* file = std::fopen(part.c_str(), "wb");
  if (!file) throw UsageError(fmt::format("-o: {}: {}", path, std::strerror(errno)));
  bool written = std::fwrite(page.data(), 1, page.size(), file) == page.size();
  written = std::fflush(file) == 0 && written;
  if (!written) {
    const int error = errno;
    std::fclose(file);
    errno = error;
    fail();
  }
  if (std::fclose(file) != 0) fail();
  if (!special && std::rename(part.c_str(), path.c_str()) != 0) fail();
}

int view(const Invocation& invocation) {
  const std::string path = invocation.value("output");
  if (path != "-" && std::filesystem::exists(path) && !invocation.has("overwrite"))
    throw UsageError(fmt::format("{}: expected a new file, got one that exists (--overwrite "
                                 "replaces it)", path));
  const std::uint64_t most = invocation.count("frames").value_or(0);
  if (most == 0) throw UsageError("--frames: expected 1 or more, got 0");
  const std::size_t fluid = invocation.count("fluid").value_or(0);
  std::vector<ViewScene> scenes;
  for (const std::string& run : invocation.arguments) {
    const auto log = io::LogReader::open(run);
    warn_if_incomplete(*log);
    const StepRange range = thinned(parse_range(invocation.value("range"), *log), most);
    scenes.push_back(
        view_scene(*log, scenario_of(log->genesis(), log->path()), range, fluid));
    const ViewScene& scene = scenes.back();
    if (scene.steps_without_state > 0)
      warn(fmt::format("{}: {} of {} steps are left out: their states are not stored", run,
                       scene.steps_without_state,
                       scene.steps_without_state + scene.states.size()));
  }
  const std::string page = view_page(scenes);
  if (path == "-") {
    print(page);
    return exit_ok;
  }
  write_page(path, page);
  note(invocation.globals, fmt::format("{}: {} run{}, {:.1f} MB", path, scenes.size(),
                                       scenes.size() == 1 ? "" : "s",
                                       1e-6 * static_cast<double>(page.size())));
  return exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "view";
  verb.usage = "RUN ...";
  verb.summary = "Writes one page of HTML that shows runs side by side, with a time slider.";
  verb.description =
      "The page holds all it needs: no network, no other file. Grains are coloured by speed, id\n"
      "or species, fluid by speed; the curve below is the grains' mean settling speed. Positions\n"
      "are rounded to a 65,535th of the box: for numbers, see analyze and export.\n\n"
      "  varve view column.varve -o column.html\n"
      "  varve view parent.varve wider.varve --range t=0.3s: -o both.html\n";
  verb.options = {
      {"output,o", "FILE", "the page; - is standard output", false, "view.html"},
      {"range", "A:B:S", "which steps, A and B as --at of show", false, ":"},
      {"frames", "N", "at most so many states per run, evenly spaced", false, "150"},
      {"fluid", "N", "at most so many fluid particles per state, every n-th; 0: none", false,
       "8000"},
      {"overwrite", "", "replace the page if it exists", false, ""},
  };
  verb.arguments_min = 1;
  verb.arguments_max = 16;
  verb.run = view;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
