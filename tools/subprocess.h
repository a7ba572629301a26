// Running another verb of varve from within one.
#pragma once

#include <string>
#include <vector>

namespace varve::tools {

/// Starts the program `words[0]` with no input and its outputs in two files, or in one where both
/// names are equal. Returns its process id, or minus the error number.
int start_program(const std::vector<std::string>& words, const std::string& output,
                  const std::string& errors);

struct ProgramResult {
  int code = 0;  ///< exit code, 128 + signal, or 127 where it could not be started
  std::string last_line;  ///< last line that it printed, or why it could not be started
};

/// Runs the program `words[0]` with no input and both outputs in the file `output`; waits for it.
ProgramResult run_program(const std::vector<std::string>& words, const std::string& output);

}  // namespace varve::tools
