// Steps and times as users write them, the same in every verb.
#pragma once

#include <cstdint>
#include <string_view>

#include "io/log_reader.h"

namespace varve::tools {

/// What parse_step() accepts, for help texts.
inline constexpr const char* step_forms =
    "12000, t=1.2s, 50%, first, last, last-100, first-contact or last-good";

/// The step of `log` that `text` names: "12000", "t=1.2s" (the last step not after it), "50%" (from
/// the first to the last step), "first", "last", "first+10", "last-100", "first-contact" (the first
/// step in which a contact begins), "last-good" (the last whole state). UsageError if it is none of
/// these, or a step that the log does not hold; with `may_precede`, steps before the log's first
/// are let through (they are in a parent's log).
std::uint64_t parse_step(std::string_view text, const io::LogReader& log, bool may_precede = false);

/// Steps first, first + stride, ... not beyond last.
struct StepRange {
  std::uint64_t first = 0, last = 0, stride = 1;
};
/// "A:B:S", "A:B", "A:", ":B", "::S" or a single step, with A and B as in parse_step().
StepRange parse_range(std::string_view text, const io::LogReader& log, bool may_precede = false);

/// Seconds in "1.2", "1.2 s", "300 ms", "20us", "2 min", "1h"; UsageError (with `what` in front)
/// else.
double parse_seconds(std::string_view text, std::string_view what);

}  // namespace varve::tools
