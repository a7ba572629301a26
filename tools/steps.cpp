#include "tools/steps.h"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

std::string_view trim(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

std::optional<std::uint64_t> whole(std::string_view text) {
  std::uint64_t number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || read.ec != std::errc{} || read.ptr != text.data() + text.size())
    return std::nullopt;
  return number;
}

std::optional<double> decimal(std::string_view text) {
  double number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || read.ec != std::errc{} || read.ptr != text.data() + text.size() ||
      !std::isfinite(number))
    return std::nullopt;
  return number;
}

[[noreturn]] void refuse(std::string_view text, const io::LogReader& log) {
  throw UsageError(fmt::format("{}: step: expected {}, got '{}'", log.path(), step_forms, text));
}

[[noreturn]] void refuse_range(std::string_view text, const io::LogReader& log) {
  throw UsageError(fmt::format("{}: step: expected {}..{}, got {}", log.path(), log.first_step(),
                               log.last_step(), text));
}

/// The first step with a row of table "contacts" whose column "begin" is 1.
std::uint64_t first_contact(const io::LogReader& log) {
  const std::vector<io::TableDescriptor>& tables = log.genesis().schema.tables;
  std::optional<std::pair<std::size_t, std::size_t>> place;
  for (std::size_t t = 0; t < tables.size(); ++t) {
    if (tables[t].name != "contacts") continue;
    for (std::size_t c = 0; c < tables[t].columns.size(); ++c)
      if (tables[t].columns[c].name == "begin" &&
          tables[t].columns[c].type == io::ScalarType::u8)
        place = {t, c};
  }
  if (!place)
    throw UsageError(fmt::format(
        "{}: first-contact: expected a log with a table of contacts, got one without", log.path()));
  for (std::uint64_t step = log.first_step(); step <= log.last_step(); ++step) {
    const std::optional<io::Frame> frame = log.tables(step);
    if (!frame || frame->tables.size() <= place->first) continue;
    for (std::byte begins : frame->tables[place->first][place->second])
      if (begins == std::byte{1}) return step;
  }
  throw UsageError(fmt::format("{}: first-contact: expected a contact, got none in steps {}..{}",
                               log.path(), log.first_step(), log.last_step()));
}

std::uint64_t at_time(std::string_view text, const io::LogReader& log, bool may_precede) {
  const double seconds = parse_seconds(text.substr(2), fmt::format("{}: step", log.path()));
  const std::uint64_t step = log.step_at_time(seconds);
  // A time before the log's first state belongs to a parent, which alone can tell the step.
  const auto first = log.header(log.first_step());
  const bool before = first && seconds < first->time - 1e-6 * first->dt;
  const auto last = log.header(log.last_step());
  const bool behind = last && seconds > last->time + (last->dt > 0 ? last->dt : 0);
  if ((before && !may_precede) || behind)
    throw UsageError(fmt::format("{}: step: expected a time {}..{} s, got {} s", log.path(),
                                 first ? first->time : 0, last ? last->time : 0, seconds));
  return step;
}

}  // namespace

double parse_seconds(std::string_view text, std::string_view what) {
  struct Suffix {
    std::string_view name;
    double seconds;
    bool divides;
  };
  constexpr std::array suffixes{Suffix{"ms", 1e3, true},    Suffix{"us", 1e6, true},
                                Suffix{"ns", 1e9, true},    Suffix{"min", 60, false},
                                Suffix{"h", 3600, false},   Suffix{"s", 1, false}};
  const std::string_view given = text;
  text = trim(text);
  double factor = 1;
  bool divides = false;
  for (const Suffix& suffix : suffixes) {
    if (!text.ends_with(suffix.name)) continue;
    text = trim(text.substr(0, text.size() - suffix.name.size()));
    factor = suffix.seconds;
    divides = suffix.divides;
    break;
  }
  const std::optional<double> number = decimal(text);
  if (!number)
    throw UsageError(
        fmt::format("{}: expected a time, such as 1.2s or 300ms, got '{}'", what, given));
  return divides ? *number / factor : *number * factor;
}

std::uint64_t parse_step(std::string_view text, const io::LogReader& log, bool may_precede) {
  text = trim(text);
  const std::uint64_t first = log.first_step(), last = log.last_step();
  if (text.starts_with("t=")) return at_time(text, log, may_precede);
  if (text == "first") return first;
  if (text == "last" || text == "last-good") return last;
  if (text == "first-contact") return first_contact(log);
  if (text.starts_with("last-")) {
    const auto back = whole(text.substr(5));
    if (!back) refuse(text, log);
    if (*back > last || (last - *back < first && !may_precede)) refuse_range(text, log);
    return last - *back;
  }
  if (text.starts_with("first+")) {
    const auto ahead = whole(text.substr(6));
    if (!ahead) refuse(text, log);
    if (*ahead > last - first) refuse_range(text, log);
    return first + *ahead;
  }
  if (text.ends_with("%")) {
    const auto percent = decimal(trim(text.substr(0, text.size() - 1)));
    if (!percent) refuse(text, log);
    if (*percent < 0 || *percent > 100)
      throw UsageError(
          fmt::format("{}: step: expected 0%..100%, got '{}'", log.path(), text));
    return first + static_cast<std::uint64_t>(
                       std::floor(static_cast<double>(last - first) * *percent / 100 + 1e-9));
  }
  const auto step = whole(text);
  if (!step) refuse(text, log);
  if (*step > last || (*step < first && !may_precede)) refuse_range(text, log);
  return *step;
}

StepRange parse_range(std::string_view text, const io::LogReader& log, bool may_precede) {
  StepRange range{log.first_step(), log.last_step(), 1};
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) {
    range.first = range.last = parse_step(text, log, may_precede);
    return range;
  }
  const std::string_view from = trim(text.substr(0, colon));
  std::string_view to = text.substr(colon + 1);
  if (const std::size_t second = to.find(':'); second != std::string_view::npos) {
    const auto stride = whole(trim(to.substr(second + 1)));
    if (!stride || *stride == 0)
      throw UsageError(fmt::format("{}: range: expected A:B:S with a whole S > 0, got '{}'",
                                   log.path(), text));
    range.stride = *stride;
    to = to.substr(0, second);
  }
  to = trim(to);
  if (!from.empty()) range.first = parse_step(from, log, may_precede);
  if (!to.empty()) range.last = parse_step(to, log, may_precede);
  if (range.first > range.last)
    throw UsageError(fmt::format("{}: range: expected A not behind B, got {}:{}", log.path(),
                                 range.first, range.last));
  return range;
}

}  // namespace varve::tools
