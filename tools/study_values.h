// Lists and ranges as values of a study file's keys.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/units.h"

namespace varve::tools {

std::string_view trim_blanks(std::string_view text);

/// Items between `separator`s, trimmed.
std::vector<std::string> split_list(std::string_view text, char separator = ',');

/// Values of "1 cm, 3 cm, 4 cm:10 cm:2 cm": ranges A:B:S become their elements (SI, shortest
/// decimals; B is one of them where it is a whole number of steps from A). What is no range stays
/// as it is written. Returns what is wrong, "" if nothing.
std::string expand_values(std::string_view text, std::vector<std::string>& values);

/// Seeds of "3" (1, 2, 3) or "1, 5, 9". Returns what is wrong, "" if nothing.
std::string read_seeds(std::string_view text, std::vector<std::uint64_t>& seeds);

/// A number with a unit of this dimension, or without one. Returns what is wrong, "" if nothing.
std::string read_number(std::string_view text, const core::Dimension& dimension, double& value);

}  // namespace varve::tools
