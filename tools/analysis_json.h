// The summary of an analysis as the JSON object that `varve analyze --json` prints; measures of
// studies take its numbers by their path ("settling.terminal_speed_m_s").
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "tools/analysis.h"

namespace varve::tools {

/// `run` is the path that the object names.
nlohmann::ordered_json summary_json(const std::string& run, const AnalysisSummary& summary);

}  // namespace varve::tools
