// Values as text and back, by the parameter table.
#include <algorithm>
#include <charconv>
#include <system_error>

#include "core/parameters.h"

namespace varve::core {
namespace {

std::string quoted(std::string_view value) {
  constexpr std::size_t shown_max = 60;
  std::string text = "'";
  for (char c : value.substr(0, shown_max))
    text += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  if (value.size() > shown_max) text += "...";
  return text + "'";
}

std::string_view trim(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

bool is_angle(const Parameter& parameter) { return parameter.unit == "rad"; }

std::string needed_dimension(const Parameter& parameter) {
  return is_angle(parameter) ? "an angle" : dimension_name(parameter.dimension);
}

std::string range_text(const Parameter& p) {
  constexpr double unbounded = 1e12;
  const bool below = p.lowest > -unbounded, above = p.highest < unbounded;
  if (below && p.lowest_open) {
    std::string text = "> " + number_text(p.lowest);
    if (above) text += " and <= " + number_text(p.highest);
    return text;
  }
  if (below && above) return number_text(p.lowest) + ".." + number_text(p.highest);
  if (below) return ">= " + number_text(p.lowest);
  return above ? "<= " + number_text(p.highest) : "";
}

bool in_range(const Parameter& p, double value) {
  return value <= p.highest && (p.lowest_open ? value > p.lowest : value >= p.lowest);
}

std::optional<ValueError> out_of_range(const Parameter& parameter, std::string_view value) {
  return ValueError{quoted(value) + " is out of range; expected " + expected_text(parameter)};
}

std::optional<ValueError> set_real(Scenario& scenario, const Parameter& parameter,
                                   std::string_view value) {
  double& target = std::get<Parameter::Real>(parameter.access)(scenario);
  if (parameter.may_be_automatic && value == "auto") {
    target = automatic;
    return std::nullopt;
  }
  const auto read = read_quantity(value);
  if (const auto* error = std::get_if<QuantityError>(&read)) {
    const std::string expected = "; expected " + expected_text(parameter);
    switch (*error) {
      case QuantityError::not_a_number:
        return ValueError{quoted(value) + " is not a number" + expected};
      case QuantityError::not_finite:
        return ValueError{quoted(value) + " is not a finite number" + expected};
      case QuantityError::too_large:
        return ValueError{quoted(value) + " is too large for a number" + expected};
      case QuantityError::unknown_unit: {
        std::string text = quoted(value) + " has an unknown unit" + expected;
        if (value.find(';') != std::string_view::npos) text += " (comments start with '#')";
        return ValueError{text};
      }
    }
  }
  const auto& quantity = std::get<Quantity>(read);
  const bool fits = !quantity.has_unit || (quantity.dimension == parameter.dimension &&
                                           (!quantity.is_angle || is_angle(parameter)));
  if (!fits) {
    return ValueError{quoted(value) + " is " +
                      (quantity.is_angle ? "an angle" : dimension_name(quantity.dimension)) + "; " +
                      needed_dimension(parameter) + " is needed"};
  }
  if (!in_range(parameter, quantity.value)) return out_of_range(parameter, value);
  target = quantity.value;
  return std::nullopt;
}

std::optional<ValueError> set_whole(Scenario& scenario, const Parameter& parameter,
                                    std::string_view value) {
  std::string_view digits = value;
  if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
  std::int64_t number = 0;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (read.ec == std::errc::result_out_of_range) return out_of_range(parameter, value);
  if (read.ec != std::errc{} || read.ptr != digits.data() + digits.size())
    return ValueError{quoted(value) + " is not a whole number; expected " +
                      expected_text(parameter)};
  if (!in_range(parameter, static_cast<double>(number))) return out_of_range(parameter, value);
  std::get<Parameter::Integer>(parameter.access)(scenario) = number;
  return std::nullopt;
}

std::optional<ValueError> set_flag(Scenario& scenario, const Parameter& parameter,
                                   std::string_view value) {
  bool& target = std::get<Parameter::Flag>(parameter.access)(scenario);
  if (value == "on" || value == "true" || value == "yes") {
    target = true;
  } else if (value == "off" || value == "false" || value == "no") {
    target = false;
  } else {
    return ValueError{quoted(value) + " is neither on nor off; expected on or off"};
  }
  return std::nullopt;
}

std::optional<ValueError> set_text(Scenario& scenario, const Parameter& parameter,
                                   std::string_view value) {
  constexpr std::size_t length_max = 200;
  if (value.size() > length_max)
    return ValueError{quoted(value) + " is too long; expected at most " +
                      std::to_string(length_max) + " bytes"};
  for (char c : value)
    if (static_cast<unsigned char>(c) < 0x20 || c == '#' || c == 0x7f)
      return ValueError{quoted(value) + " holds '#' or a control character; expected plain text"};
  std::get<Parameter::Text>(parameter.access)(scenario) = value;
  return std::nullopt;
}

std::optional<ValueError> set_choice(Scenario& scenario, const Parameter& parameter,
                                     std::string_view value) {
  for (std::size_t i = 0; i < parameter.choices.size(); ++i) {
    if (parameter.choices[i] != value) continue;
    std::get<Parameter::Choice>(parameter.access).set(scenario, static_cast<int>(i));
    return std::nullopt;
  }
  std::string text = quoted(value) + " is not known; expected " + expected_text(parameter);
  std::size_t least = 3;
  std::string_view nearest;
  for (std::string_view name : parameter.choices) {
    const std::size_t distance = value.size() > 64 ? least : edit_distance(value, name);
    if (distance < least) {
      least = distance;
      nearest = name;
    }
  }
  if (!nearest.empty()) text += "; did you mean '" + std::string(nearest) + "'?";
  return ValueError{text};
}

}  // namespace

std::string expected_text(const Parameter& parameter) {
  struct {
    const Parameter& p;
    std::string operator()(Parameter::Real) const {
      std::string text = is_angle(p)              ? "an angle"
                         : p.dimension == Dimension{} ? "a ratio"
                                                      : dimension_name(p.dimension);
      const std::string range = range_text(p);
      if (!range.empty()) text += " " + range;
      if (is_angle(p)) text += " rad (or deg)";
      const std::string_view examples = unit_examples(p.dimension);
      if (!examples.empty()) text += " (" + std::string(examples) + ")";
      if (p.may_be_automatic) text += ", or auto";
      return text;
    }
    std::string operator()(Parameter::Integer) const {
      const auto plain = [](double value) {
        return std::to_string(static_cast<std::int64_t>(value));
      };
      return "a whole number " + plain(p.lowest) + ".." + plain(p.highest);
    }
    std::string operator()(Parameter::Flag) const { return "on or off"; }
    std::string operator()(Parameter::Text) const { return "text"; }
    std::string operator()(const Parameter::Choice&) const {
      std::string text;
      for (std::string_view name : p.choices)
        text += (text.empty() ? "" : name == p.choices.back() ? " or " : ", ") + std::string(name);
      return text;
    }
  } const describe{parameter};
  return std::visit(describe, parameter.access);
}

std::optional<ValueError> set_parameter(Scenario& scenario, const Parameter& parameter,
                                        std::string_view value) {
  value = trim(value);
  struct {
    Scenario& s;
    const Parameter& p;
    std::string_view v;
    std::optional<ValueError> operator()(Parameter::Real) const { return set_real(s, p, v); }
    std::optional<ValueError> operator()(Parameter::Integer) const { return set_whole(s, p, v); }
    std::optional<ValueError> operator()(Parameter::Flag) const { return set_flag(s, p, v); }
    std::optional<ValueError> operator()(Parameter::Text) const { return set_text(s, p, v); }
    std::optional<ValueError> operator()(const Parameter::Choice&) const {
      return set_choice(s, p, v);
    }
  } const set{scenario, parameter, value};
  return std::visit(set, parameter.access);
}

const Parameter* species_parameter(std::string_view leaf) {
  if (leaf != "diameter" && leaf != "density" && leaf != "share") return nullptr;
  return find_parameter("grains." + std::string(leaf));
}

std::optional<ValueError> set_species(Scenario& scenario, std::string_view name,
                                      std::string_view leaf, std::string_view value) {
  const auto found = std::find_if(scenario.species.begin(), scenario.species.end(),
                                  [&](const GrainSpecies& each) { return each.name == name; });
  GrainSpecies& species = found != scenario.species.end()
                              ? *found
                              : scenario.species.emplace_back(GrainSpecies{std::string(name)});
  // Read as the key of the same name in [grains] is.
  Scenario scratch;
  const auto error = set_parameter(scratch, *species_parameter(leaf), value);
  if (error) return error;
  if (leaf == "diameter") species.diameter = scratch.grains.diameter;
  if (leaf == "density") species.density = scratch.grains.density;
  if (leaf == "share") species.share = scratch.grains.share;
  return std::nullopt;
}

std::string get_parameter(const Scenario& scenario, const Parameter& parameter) {
  struct {
    Scenario& s;
    const Parameter& p;
    std::string operator()(Parameter::Real get) const { return number_text(get(s)); }
    std::string operator()(Parameter::Integer get) const { return std::to_string(get(s)); }
    std::string operator()(Parameter::Flag get) const { return get(s) ? "on" : "off"; }
    std::string operator()(Parameter::Text get) const { return get(s); }
    std::string operator()(const Parameter::Choice& choice) const {
      return std::string(p.choices[static_cast<std::size_t>(choice.get(s))]);
    }
    // The table's accessors give references; nothing is written through them here.
  } const get{const_cast<Scenario&>(scenario), parameter};
  return std::visit(get, parameter.access);
}

std::string default_text(const Parameter& parameter) {
  static const Scenario defaults;
  return get_parameter(defaults, parameter);
}

std::vector<std::pair<std::string, std::string>> all_settings(const Scenario& scenario) {
  std::vector<std::pair<std::string, std::string>> all;
  for (const Parameter& parameter : parameters())
    all.emplace_back(parameter.key, get_parameter(scenario, parameter));
  for (const GrainSpecies& each : scenario.species) {
    const std::string section = "species." + each.name + ".";
    all.emplace_back(section + "diameter", number_text(each.diameter));
    all.emplace_back(section + "density", number_text(each.density));
    all.emplace_back(section + "share", number_text(each.share));
  }
  for (const ScheduledChange& change : scenario.changes) {
    const std::string section = "event." + change.name + ".";
    if (change.at_step >= 0) {
      all.emplace_back(section + "at_step", std::to_string(change.at_step));
    } else {
      all.emplace_back(section + "at", number_text(change.at));
    }
    if (change.anchor != 0)
      all.emplace_back(section + "anchor", change.anchor < 0 ? "left" : "right");
    if (change.outside != OutsideMode::error)
      all.emplace_back(section + "outside",
                       change.outside == OutsideMode::push ? "push" : "remove");
    for (const auto& [key, value] : change.settings) all.emplace_back(section + key, value);
  }
  return all;
}

std::string canonical_text(const Scenario& scenario) {
  std::string text;
  std::string section;
  for (const auto& [key, value] : all_settings(scenario)) {
    // "domain.width" lies in [domain], "event.NAME.contact.damping" in [event.NAME],
    // "species.NAME.density" in [species.NAME].
    std::size_t dot = key.find('.');
    if (key.starts_with("event.") || key.starts_with("species.")) dot = key.find('.', dot + 1);
    if (key.substr(0, dot) != section) {
      if (!section.empty()) text += '\n';
      section = key.substr(0, dot);
      text += '[' + section + "]\n";
    }
    text += key.substr(dot + 1) + " = " + value + '\n';
  }
  return text;
}

}  // namespace varve::core
