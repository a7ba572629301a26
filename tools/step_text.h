// Steps as users write them, alike in every verb: 12000, t=1.2s, 50%, first, last, last-100.
#pragma once

#include <cstdint>
#include <string>

#include "io/log_reader.h"

namespace varve::tools {

/// The step of `log` that `text` names: a number; "t=X" with an optional unit s, ms or us (the last
/// step with time <= X + 1e-6 dt); "X%" of the way from the first to the last step present, rounded
/// down; "first", "last", "last-N". Throws UsageError that starts with `option` where the text can't
/// be read or the step lies outside the log.
std::uint64_t parse_step(const io::LogReader& log, const std::string& text,
                         const std::string& option);

}  // namespace varve::tools
