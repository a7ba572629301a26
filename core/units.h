// Numbers and units as text. Everything is locale-free and uses only correctly rounded operations:
// the same text gives the same bits everywhere.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>

namespace varve::core {

/// Exponents of kg, m, s. Angles are pure numbers (rad).
struct Dimension {
  int mass = 0, length = 0, time = 0;
  bool operator==(const Dimension&) const = default;
};

/// A number in SI with what its suffix said of it.
struct Quantity {
  double value = 0;
  bool has_unit = false;
  bool is_angle = false;  ///< the suffix was an angle (deg, rad, ...)
  Dimension dimension;    ///< of the suffix; pure where there is none
};

/// Why a text is no quantity.
enum class QuantityError {
  not_a_number,
  not_finite,    ///< nan, inf
  too_large,     ///< beyond the range of a double
  unknown_unit,  ///< a number followed by something that is no unit
};

/// Reads "6", "6 cm", "1.2e3 kg/m3", "10 mPa.s", "5 %". A decimal prefix moves the decimal point
/// before the number is rounded, so that "7 cm" is the double nearest to 0.07.
std::variant<Quantity, QuantityError> read_quantity(std::string_view text);

/// Shortest decimal that reads back to the same bits; "auto" for a NaN.
std::string number_text(double value);
/// Six significant digits, never above `value`: for "largest safe value" in messages.
std::string number_below(double value);
/// Six significant digits, never below `value`.
std::string number_above(double value);
/// Six significant digits.
std::string rough_number(double value);

/// "a length", "a time", "a pure number"; exponents in SI where the dimension has no name.
std::string dimension_name(const Dimension& dimension);
/// The usual suffixes of a dimension, for messages: "m, cm, mm, um"; "" for pure numbers.
std::string_view unit_examples(const Dimension& dimension);

}  // namespace varve::core
