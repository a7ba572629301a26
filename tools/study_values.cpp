#include "tools/study_values.h"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace varve::tools {
namespace {

constexpr std::size_t values_max = 10000;

/// A quantity, or what is wrong with it.
std::string read(std::string_view text, core::Quantity& quantity) {
  const auto result = core::read_quantity(text);
  if (const auto* found = std::get_if<core::Quantity>(&result)) {
    quantity = *found;
    return "";
  }
  return fmt::format("'{}' is not a number", text);
}

/// Twelve digits: sums of steps without the dust of their rounding.
std::string rounded(double value) {
  const std::string digits = fmt::format("{:.12g}", value);
  double back = value;
  std::from_chars(digits.data(), digits.data() + digits.size(), back);
  return core::number_text(back);
}

std::string expand_range(std::string_view text, std::vector<std::string>& values) {
  const std::vector<std::string> parts = split_list(text, ':');
  if (parts.size() != 3) return fmt::format("'{}' is no range; expected FROM:TO:STEP", text);
  core::Quantity from, to, step;
  for (const auto& [part, quantity] :
       {std::pair{&parts[0], &from}, {&parts[1], &to}, {&parts[2], &step}})
    if (const std::string wrong = read(*part, *quantity); !wrong.empty()) return wrong;
  const double count = (to.value - from.value) / step.value;
  if (!(step.value != 0) || !(count >= 0))
    return fmt::format("'{}' is an empty range; expected FROM, TO and a STEP towards it", text);
  if (count > static_cast<double>(values_max))
    return fmt::format("'{}' has {:.3g} values; at most {} are possible", text, count, values_max);
  const auto last = static_cast<std::size_t>(std::floor(count + 1e-9));
  for (std::size_t i = 0; i <= last; ++i)
    values.push_back(rounded(from.value + static_cast<double>(i) * step.value));
  return "";
}

}  // namespace

std::string_view trim_blanks(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string> split_list(std::string_view text, char separator) {
  std::vector<std::string> items;
  for (;;) {
    const std::size_t end = text.find(separator);
    items.emplace_back(trim_blanks(text.substr(0, end)));
    if (end == std::string_view::npos) return items;
    text.remove_prefix(end + 1);
  }
}

std::string expand_values(std::string_view text, std::vector<std::string>& values) {
  for (const std::string& item : split_list(text)) {
    if (item.empty()) return "an empty item; expected values with commas between them";
    if (item.find(':') == std::string::npos) {
      values.push_back(item);
    } else if (const std::string wrong = expand_range(item, values); !wrong.empty()) {
      return wrong;
    }
  }
  return "";
}

std::string read_seeds(std::string_view text, std::vector<std::uint64_t>& seeds) {
  seeds.clear();
  const std::vector<std::string> items = split_list(text);
  for (const std::string& item : items) {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (item.empty() || error != std::errc{} || end != item.data() + item.size())
      return fmt::format("'{}' is no seed; expected a number of seeds, or a list such as 1, 5, 9",
                         item);
    seeds.push_back(value);
  }
  if (items.size() > 1) {
    for (std::size_t i = 0; i < seeds.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (seeds[i] == seeds[k]) return fmt::format("seed {} stands there twice", seeds[i]);
    return "";
  }
  const std::uint64_t count = seeds[0];
  if (count < 1 || count > values_max)
    return fmt::format("{} seeds; expected 1 to {}", count, values_max);
  seeds.clear();
  for (std::uint64_t seed = 1; seed <= count; ++seed) seeds.push_back(seed);
  return "";
}

std::string read_number(std::string_view text, const core::Dimension& dimension, double& value) {
  core::Quantity quantity;
  if (const std::string wrong = read(text, quantity); !wrong.empty()) return wrong;
  if (quantity.has_unit && quantity.dimension != dimension)
    return fmt::format("'{}' is {}; {} is needed", text, core::dimension_name(quantity.dimension),
                       core::dimension_name(dimension));
  value = quantity.value;
  return "";
}

}  // namespace varve::tools
