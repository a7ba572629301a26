// The options of diff: tolerances, fields, where the reports go.
#pragma once

#include <string>
#include <vector>

#include "tools/cli.h"
#include "tools/diff_run.h"

namespace varve::tools {

/// Options that choose what is compared, for the verb's table.
std::vector<OptionSpec> comparison_options();

/// Reads them. UsageError for a bad number, a tolerance below zero, an unknown option value.
DiffOptions read_comparison_options(const Invocation& invocation);

/// Writes `text` to `path`, or throws LogError(write_failed).
void write_text_file(const std::string& path, const std::string& text);

}  // namespace varve::tools
