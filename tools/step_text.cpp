#include "tools/step_text.h"

#include <charconv>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

template <class T>
bool read_all(std::string_view text, T& value) {
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && end.ec == std::errc{} && end.ptr == text.data() + text.size();
}

bool read_time(std::string_view text, double& seconds) {
  double scale = 1;
  for (const auto& [unit, factor] : {std::pair<std::string_view, double>{"ms", 1e-3},
                                     {"us", 1e-6},
                                     {"s", 1.0}}) {
    if (!text.ends_with(unit)) continue;
    text.remove_suffix(unit.size());
    while (text.ends_with(' ')) text.remove_suffix(1);
    scale = factor;
    break;
  }
  if (!read_all(text, seconds) || !std::isfinite(seconds)) return false;
  seconds *= scale;
  return true;
}

}  // namespace

std::uint64_t parse_step(const io::LogReader& log, const std::string& text,
                         const std::string& option) {
  const std::uint64_t first = log.first_step(), last = log.last_step();
  const std::string_view view = text;
  std::uint64_t step = 0;
  double number = 0;
  if (view == "first") return first;
  if (view == "last") return last;
  if (view.starts_with("last-") && read_all(view.substr(5), step)) {
    if (step > last - first)
      throw UsageError(fmt::format("{}: '{}' lies before the first step, {}", option, text, first));
    return last - step;
  }
  if (view.starts_with("t=") && read_time(view.substr(2), number)) return log.step_at_time(number);
  if (view.ends_with('%') && read_all(view.substr(0, view.size() - 1), number) && number >= 0 &&
      number <= 100) {
    return first + static_cast<std::uint64_t>(static_cast<double>(last - first) * (number / 100));
  }
  if (!read_all(view, step))
    throw UsageError(fmt::format(
        "{}: '{}' is not a step; write 12000, t=1.2s, 50%, first, last or last-100", option, text));
  if (step < first || step > last)
    throw UsageError(fmt::format("{}: step {} is not in {}, which holds {} to {}", option, step,
                                 log.path(), first, last));
  return step;
}

}  // namespace varve::tools
