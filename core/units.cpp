#include "core/units.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <system_error>

namespace varve::core {
namespace {

/// One unit: value in SI = number x 10^tens x factor.
struct Unit {
  std::string_view name;
  Dimension dimension;
  int tens;
  double factor = 1;
  bool is_angle = false;
};

constexpr Dimension pure{}, length{0, 1, 0}, time_{0, 0, 1}, mass{1, 0, 0}, force{1, 1, -2},
    pressure{1, -1, -2}, viscosity{1, -1, -1}, frequency{0, 0, -1};

constexpr std::array units{
    Unit{"m", length, 0},        Unit{"cm", length, -2},      Unit{"mm", length, -3},
    Unit{"um", length, -6},      Unit{"\xc2\xb5m", length, -6}, Unit{"nm", length, -9},
    Unit{"km", length, 3},       Unit{"in", length, -4, 254}, Unit{"s", time_, 0},
    Unit{"ms", time_, -3},       Unit{"us", time_, -6},       Unit{"\xc2\xb5s", time_, -6},
    Unit{"ns", time_, -9},       Unit{"min", time_, 0, 60},   Unit{"h", time_, 0, 3600},
    Unit{"kg", mass, 0},         Unit{"g", mass, -3},         Unit{"mg", mass, -6},
    Unit{"N", force, 0},         Unit{"mN", force, -3},       Unit{"kN", force, 3},
    Unit{"MN", force, 6},        Unit{"Pa", pressure, 0},     Unit{"mPa", pressure, -3},
    Unit{"kPa", pressure, 3},    Unit{"MPa", pressure, 6},    Unit{"P", viscosity, -1},
    Unit{"cP", viscosity, -3},   Unit{"Hz", frequency, 0},    Unit{"kHz", frequency, 3},
    Unit{"MHz", frequency, 6},   Unit{"rad", pure, 0, 1, true},
    Unit{"mrad", pure, -3, 1, true},
    Unit{"deg", pure, 0, std::numbers::pi / 180, true},
    Unit{"%", pure, -2},
};

const Unit* find_unit(std::string_view name) {
  for (const Unit& unit : units)
    if (unit.name == name) return &unit;
  return nullptr;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_space(char c) { return c == ' ' || c == '\t'; }

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// Reads a product such as "kg/m3", "mPa.s", "Pa s", "m/s^2", "1/s"; false if it is none.
bool read_unit(std::string_view text, Quantity& quantity, int& tens, double& factor) {
  constexpr int power_max = 9;
  int sign = 1;
  std::size_t atoms = 0;
  if (text.starts_with("1/")) text.remove_prefix(1);
  while (!text.empty()) {
    if (atoms > 0 || text.front() == '/') {
      bool separated = false;
      while (!text.empty() && (is_space(text.front()) || text.front() == '.' ||
                               text.front() == '*' || text.front() == '/')) {
        if (text.front() == '/') sign = -1;
        if (!is_space(text.front()) && separated) return false;
        separated = separated || !is_space(text.front());
        text.remove_prefix(1);
      }
    }
    std::size_t n = 0;
    while (n < text.size() && !is_digit(text[n]) && !is_space(text[n]) && text[n] != '.' &&
           text[n] != '*' && text[n] != '/' && text[n] != '^' && text[n] != '-')
      ++n;
    const Unit* unit = find_unit(text.substr(0, n));
    if (!unit || ++atoms > 6) return false;
    text.remove_prefix(n);
    int power = 1;
    const bool raised = !text.empty() && text.front() == '^';
    if (raised) text.remove_prefix(1);
    if (raised || (!text.empty() && (is_digit(text.front()) || text.front() == '-'))) {
      const auto read = std::from_chars(text.data(), text.data() + text.size(), power);
      if (read.ec != std::errc{} || power < -power_max || power > power_max || power == 0)
        return false;
      text.remove_prefix(static_cast<std::size_t>(read.ptr - text.data()));
    }
    power *= sign;
    quantity.dimension.mass += power * unit->dimension.mass;
    quantity.dimension.length += power * unit->dimension.length;
    quantity.dimension.time += power * unit->dimension.time;
    quantity.is_angle = quantity.is_angle || unit->is_angle;
    tens += power * unit->tens;
    for (int i = 0; i < power; ++i) factor *= unit->factor;
    for (int i = 0; i > power; --i) factor /= unit->factor;
  }
  return atoms > 0;
}

/// Length of the decimal number that `text` starts with; 0 if it starts with none.
std::size_t number_length(std::string_view text) {
  std::size_t n = 0;
  if (n < text.size() && (text[n] == '-' || text[n] == '+')) ++n;
  std::size_t digits = 0;
  for (; n < text.size() && is_digit(text[n]); ++n) ++digits;
  if (n < text.size() && text[n] == '.')
    for (++n; n < text.size() && is_digit(text[n]); ++n) ++digits;
  if (digits == 0) return 0;
  if (n < text.size() && (text[n] == 'e' || text[n] == 'E')) {
    std::size_t e = n + 1;
    if (e < text.size() && (text[e] == '-' || text[e] == '+')) ++e;
    if (e < text.size() && is_digit(text[e])) {
      while (e < text.size() && is_digit(text[e])) ++e;
      n = e;
    }
  }
  return n;
}

/// The number with its exponent raised by `tens`: one rounding, of the decimal the user meant.
std::variant<double, QuantityError> read_shifted(std::string_view number, int tens) {
  if (number.front() == '+') number.remove_prefix(1);
  const std::size_t mark = number.find_first_of("eE");
  std::int64_t exponent = tens;
  if (mark != std::string_view::npos) {
    std::string_view digits = number.substr(mark + 1);
    if (digits.front() == '+') digits.remove_prefix(1);
    std::int64_t given = 0;
    const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), given);
    if (read.ec != std::errc{} || given > 100000 || given < -100000)
      return QuantityError::too_large;
    exponent += given;
  }
  const std::string text = std::string(number.substr(0, mark)) + "e" + std::to_string(exponent);
  double value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (read.ec == std::errc::result_out_of_range) return QuantityError::too_large;
  if (read.ec != std::errc{}) return QuantityError::not_a_number;
  return value;
}

std::string six_digits(double value) {
  std::array<char, 40> buffer;
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                     std::chars_format::general, 6);
  return {buffer.data(), written.ptr};
}

double read_back(const std::string& text) {
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// One unit of the sixth significant digit.
double last_digit(double value) {
  std::array<char, 40> buffer;
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                     std::chars_format::scientific, 5);
  const std::string text(buffer.data(), written.ptr);
  const std::size_t mark = text.find('e');
  return mark == std::string::npos ? 0.0 : read_back("1" + text.substr(mark)) / 1e5;
}

}  // namespace

std::variant<Quantity, QuantityError> read_quantity(std::string_view text) {
  text = trim(text);
  const std::size_t n = number_length(text);
  if (n == 0) {
    std::string word;
    for (char c : text) word += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.erase(0, 1);
    const std::string_view first = std::string_view(word).substr(0, word.find(' '));
    if (first == "nan" || first == "inf" || first == "infinity") return QuantityError::not_finite;
    return QuantityError::not_a_number;
  }
  Quantity quantity;
  int tens = 0;
  double factor = 1;
  const std::string_view suffix = trim(text.substr(n));
  if (!suffix.empty()) {
    quantity.has_unit = true;
    if (!read_unit(suffix, quantity, tens, factor)) return QuantityError::unknown_unit;
  }
  const auto number = read_shifted(text.substr(0, n), tens);
  if (const auto* error = std::get_if<QuantityError>(&number)) return *error;
  quantity.value = std::get<double>(number) * factor;
  if (!std::isfinite(quantity.value)) return QuantityError::too_large;
  return quantity;
}

std::string number_text(double value) {
  if (std::isnan(value)) return "auto";
  std::array<char, 40> buffer;
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), written.ptr};
}

std::string rough_number(double value) { return six_digits(value); }

std::string number_below(double value) {
  const std::string nearest = six_digits(value);
  const double read = read_back(nearest);
  return read <= value ? nearest : six_digits(read - last_digit(value));
}

std::string number_above(double value) {
  const std::string nearest = six_digits(value);
  const double read = read_back(nearest);
  return read >= value ? nearest : six_digits(read + last_digit(value));
}

namespace {
struct Named {
  Dimension dimension;
  std::string_view name, examples;
};
constexpr std::array named{
    Named{pure, "a pure number", ""},
    Named{length, "a length", "m, cm, mm, um"},
    Named{time_, "a time", "s, ms, us, min"},
    Named{mass, "a mass", "kg, g"},
    Named{force, "a force", "N, mN"},
    Named{pressure, "a pressure", "Pa, kPa"},
    Named{viscosity, "a viscosity", "Pa s, mPa.s, cP"},
    Named{frequency, "a frequency", "Hz, kHz, 1/s"},
    Named{{0, 1, -1}, "a speed", "m/s, mm/s"},
    Named{{0, 1, -2}, "an acceleration", "m/s2"},
    Named{{1, -3, 0}, "a density", "kg/m3, g/cm3"},
    Named{{1, 0, -2}, "a stiffness", "N/m, kN/m"},
    Named{{0, 2, 0}, "an area", "m2, cm2"},
    Named{{0, 3, 0}, "a volume", "m3, cm3"},
    Named{{0, 2, -1}, "a kinematic viscosity", "m2/s"},
};
}  // namespace

std::string dimension_name(const Dimension& dimension) {
  for (const Named& entry : named)
    if (entry.dimension == dimension) return std::string(entry.name);
  std::string text = "a quantity in";
  const auto add = [&text](std::string_view symbol, int power) {
    if (power == 0) return;
    text += ' ';
    text += symbol;
    if (power != 1) text += '^' + std::to_string(power);
  };
  add("kg", dimension.mass);
  add("m", dimension.length);
  add("s", dimension.time);
  return text;
}

std::string_view unit_examples(const Dimension& dimension) {
  for (const Named& entry : named)
    if (entry.dimension == dimension) return entry.examples;
  return "";
}

}  // namespace varve::core
