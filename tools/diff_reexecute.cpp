#include "tools/diff_reexecute.h"

#include <fmt/format.h>

#include "io/errors.h"
#include "tools/cli.h"
#include "tools/subprocess.h"

namespace varve::tools {

Reexecution reexecute(const io::LogReader& log, std::uint64_t from, std::uint64_t to,
                      const ScratchFolder& scratch, const std::string& name) {
  const std::string output = scratch.file(name + ".varve");
  const ProgramResult result = run_program(
      {executable_folder() + "/varve-replay", log.path(), "--emit", fmt::format("{}:{}", from, to),
       "-o", output, "--overwrite", "--quiet", "--progress", "none"},
      scratch.file(name + ".messages"));
  Reexecution out;
  if (result.code != exit_ok) {
    out.problem =
        fmt::format("re-execution ended with exit code {}: {}", result.code, result.last_line);
    return out;
  }
  try {
    out.log = io::LogReader::open(output);
  } catch (const io::LogError& error) {
    out.problem = fmt::format("re-execution left no readable log: {}", error.what());
  }
  return out;
}

}  // namespace varve::tools
