// The summary of an analysis as the JSON object that `varve analyze --json` prints; measures of
// studies take its numbers by their path ("settling.terminal_speed_m_s").
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "tools/analysis.h"

namespace varve::tools {

nlohmann::ordered_json summary_json(const io::LogReader& log, const AnalysisSummary& summary);

}  // namespace varve::tools
