#include "tools/study_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "core/units.h"
#include "tools/cli.h"
#include "tools/scenario_scan.h"
#include "tools/study_claims.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

const SectionRules& study_sections() {
  static const SectionRules rules{
      "study", {"study"}, {"case.", "measure.", "curve.", "figure.", "claim.", "compare."}, {}};
  return rules;
}

bool is_name(std::string_view name, bool hyphen) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           c == '_' || (hyphen && c == '-');
  });
}

std::optional<double> plain_number(std::string_view text) {
  const auto read = core::read_quantity(text);
  const auto* quantity = std::get_if<core::Quantity>(&read);
  return quantity ? std::optional(quantity->value) : std::nullopt;
}

constexpr core::Dimension time_dimension{0, 0, 1};
constexpr core::Dimension length_dimension{0, 1, 0};

}  // namespace

// ---- what all sections share --------------------------------------------------------------------

void StudyReader::error_at_value(const Entry& entry, const std::string& text) {
  found_.push_back(at_value(entry.place, entry.key + ": " + text));
}
void StudyReader::error_at_key(const Entry& entry, const std::string& text) {
  found_.push_back(at_key(entry.place, text));
}

void StudyReader::unknown(const Section& section, const Entry& entry,
                          const std::vector<std::string_view>& known) {
  const std::string_view near = nearest_name(entry.key, known);
  error_at_key(entry, fmt::format("unknown key '{}' in [{}{}{}]; {}", entry.key, section.family,
                                  section.name.empty() ? "" : ".", section.name,
                                  near.empty() ? fmt::format("expected {}", fmt::join(known, ", "))
                                               : fmt::format("did you mean '{}'?", near)));
}

bool StudyReader::flag(const Entry& entry) {
  for (const char* word : {"yes", "on", "true"})
    if (entry.value == word) return true;
  for (const char* word : {"no", "off", "false"})
    if (entry.value == word) return false;
  error_at_value(entry, fmt::format("'{}' is not known; expected yes or no", entry.value));
  return false;
}

double StudyReader::seconds(const Entry& entry) {
  double value = 0;
  const std::string wrong = read_number(entry.value, time_dimension, value);
  if (!wrong.empty())
    error_at_value(entry, wrong);
  else if (!(value >= 0))
    error_at_value(entry, fmt::format("'{}'; expected a time >= 0", entry.value));
  return value;
}

std::uint64_t StudyReader::count(const Entry& entry, std::uint64_t lowest, std::uint64_t highest) {
  std::uint64_t value = 0;
  const char* end = entry.value.data() + entry.value.size();
  const auto read = std::from_chars(entry.value.data(), end, value);
  if (read.ec != std::errc{} || read.ptr != end || value < lowest || value > highest) {
    error_at_value(entry, fmt::format("'{}'; expected a whole number {} to {}", entry.value, lowest,
                                      highest));
    return lowest;
  }
  return value;
}

std::vector<std::string> StudyReader::list(const Entry& entry) {
  std::vector<std::string> items = split_list(entry.value);
  for (const std::string& item : items)
    if (item.empty()) error_at_value(entry, "an empty item; expected names with commas between");
  return items;
}

std::vector<double> StudyReader::point(const Entry& entry) {
  std::vector<double> values;
  for (const std::string& item : split_list(entry.value)) {
    double value = 0;
    if (const std::string wrong = read_number(item, length_dimension, value); !wrong.empty())
      error_at_value(entry, wrong);
    values.push_back(value);
  }
  if (values.size() < 2 || values.size() > 3)
    error_at_value(entry, fmt::format("'{}'; expected two or three coordinates", entry.value));
  return values;
}

std::optional<StudyLimit> StudyReader::limit(const Entry& entry, const std::string& text) {
  const std::string_view trimmed = trim_blanks(text);
  const bool known = trimmed.starts_with('>') || trimmed.starts_with('<');
  const auto number = known ? plain_number(trim_blanks(trimmed.substr(1))) : std::nullopt;
  if (number) return StudyLimit{trimmed.front() == '>', *number};
  error_at_value(entry, fmt::format("'{}'; expected '> NUMBER' or '< NUMBER'", text));
  return std::nullopt;
}

std::string StudyReader::one_of(const Entry& entry, const std::vector<std::string_view>& names) {
  if (std::find(names.begin(), names.end(), entry.value) == names.end())
    error_at_value(entry, fmt::format("'{}' is not known; expected one of {}", entry.value,
                                      fmt::join(names, ", ")));
  return entry.value;
}

// ---- sections -----------------------------------------------------------------------------------

void StudyReader::add_section(std::vector<Section>& sections, const std::string& full, int line) {
  const std::size_t dot = full.find('.');
  Section section;
  section.family = full.substr(0, dot);
  if (dot != std::string::npos) section.name = full.substr(dot + 1);
  section.place = {path_, line, 1, 1};
  sections.push_back(std::move(section));
}

std::vector<StudyReader::Section> StudyReader::sections_of(std::string_view text) {
  const Scan scan = scan_ini(text, path_, study_sections());
  found_.insert(found_.end(), scan.errors.begin(), scan.errors.end());
  std::vector<Section> sections;
  std::map<std::string, std::size_t> by_name;
  std::map<std::string, int> lines;  // of keys
  for (const ScannedSection& each : scan.sections) {
    if (!by_name.emplace(each.name, sections.size()).second) continue;
    add_section(sections, each.name, each.line);
  }
  for (const ScannedEntry& each : scan.entries) {
    const auto found = by_name.find(each.section);
    const StudyPlace place{path_, each.line, each.key_column, each.value_column};
    if (found == by_name.end()) {
      found_.push_back(at_key(place, fmt::format("'{}' stands before any [section]", each.key)));
      continue;
    }
    Entry entry{each.key.substr(each.section.size() + 1), each.value, place};
    if (const auto [earlier, first] = lines.emplace(each.key, each.line); !first)
      error_at_key(entry, fmt::format("'{}' was already set on line {}", entry.key,
                                      earlier->second));
    else
      sections[found->second].entries.push_back(std::move(entry));
  }
  return sections;
}

std::vector<std::pair<std::string, StudyPlace>> StudyReader::take(std::string_view text) {
  const std::vector<Section> sections = sections_of(text);
  // [study] rules the cases wherever it stands.
  for (const Section& section : sections)
    if (section.family == "study") take_study(section);
  for (const Section& section : sections) {
    check_section(section);
    if (section.family == "case") take_case(section);
    if (section.family == "measure") take_measure(section);
    if (section.family == "curve") take_curve(section);
    if (section.family == "figure") take_figure(section);
    if (section.family == "claim") take_claim(section);
    if (section.family == "compare") take_compare(section);
  }
  return included_;
}

void StudyReader::check_section(const Section& section) {
  const auto already = [&](const auto& items, const auto& name_of_item) {
    for (const auto& item : items)
      if (name_of_item(item) == section.name)
        found_.push_back(at_key(section.place,
                                fmt::format("{} '{}' was already described at {}:{}",
                                            section.family, section.name, item.place.source,
                                            item.place.line)));
  };
  if (section.family == "study") return;
  if (!is_name(section.name, section.family != "measure" && section.family != "curve"))
    found_.push_back(at_key(section.place,
                            fmt::format("'{}' is no name of a {}; expected letters, digits and '_'",
                                        section.name, section.family)));
  if (section.family == "case") already(study_.cases, [](const auto& c) { return c.name; });
  if (section.family == "measure")
    already(study_.measures, [](const auto& m) { return m.measure.name; });
  if (section.family == "curve") already(study_.curves, [](const auto& c) { return c.curve.name; });
  if (section.family == "figure") already(study_.figures, [](const auto& f) { return f.id; });
  if (section.family == "claim") already(study_.claims, [](const auto& c) { return c.id; });
  if (section.family == "compare") already(study_.compares, [](const auto& c) { return c.name; });
}

void StudyReader::take_study(const Section& section) {
  for (const Entry& entry : section.entries) {
    if (entry.key == "title") {
      if (study_.title.empty()) study_.title = entry.value;
    } else if (entry.key == "seeds") {
      if (const std::string wrong = read_seeds(entry.value, seeds_); !wrong.empty())
        error_at_value(entry, wrong);
    } else if (entry.key == "quick_seeds") {
      quick_seeds_ = count(entry, 1, 10000);
    } else if (entry.key == "keep") {
      const std::string word = one_of(entry, {"log", "digests", "none"});
      keep_ = word == "none" ? Keep::none : word == "digests" ? Keep::digests : Keep::log;
    } else if (entry.key == "include") {
      for (const std::string& name : list(entry)) included_.emplace_back(name, entry.place);
    } else {
      unknown(section, entry, {"title", "seeds", "quick_seeds", "keep", "include"});
    }
  }
}

void StudyReader::take_case(const Section& section) {
  StudyCase each;
  each.name = section.name;
  each.folder = std::filesystem::path(path_).parent_path().string();
  each.place = section.place;
  each.seeds = seeds_;
  each.quick_seeds = quick_seeds_;
  each.keep = keep_;
  for (const Entry& entry : section.entries)
    if (!take_case_key(each, entry) && !take_fork_key(each, entry))
      unknown(section, entry,
              {"title", "scenario", "parent", "at", "seeds", "quick_seeds", "keep", "perturb",
               "ramp_time", "outside", "anchor", "until", "steps", "stop_when", "check_every",
               "until_max", "quick", "set.KEY", "vary.KEY"});
  finish_case(each);
  study_.cases.push_back(std::move(each));
}

bool StudyReader::take_case_key(StudyCase& each, const Entry& entry) {
  const std::string& key = entry.key;
  if (key == "title") {
    each.title = entry.value;
  } else if (key == "scenario") {
    each.scenario = entry.value;
    each.scenario_place = entry.place;
  } else if (key.starts_with("set.")) {
    each.settings.push_back({key.substr(4), entry.value, entry.place});
  } else if (key.starts_with("vary.")) {
    take_varied(each, entry);
  } else if (key == "seeds") {
    if (const std::string wrong = read_seeds(entry.value, each.seeds); !wrong.empty())
      error_at_value(entry, wrong);
  } else if (key == "quick_seeds") {
    each.quick_seeds = count(entry, 1, 10000);
  } else if (key == "keep") {
    const std::string word = one_of(entry, {"log", "digests", "none"});
    each.keep = word == "none" ? Keep::none : word == "digests" ? Keep::digests : Keep::log;
  } else if (key == "until" || key == "steps") {
    (key == "until" ? each.until : each.steps) = entry.value;
    each.length_place = entry.place;
    if (key == "until") seconds(entry);
    if (key == "steps") count(entry, 0, 1'000'000'000'000'000);
  } else if (key == "stop_when") {
    try {
      each.stop_when = make_measure("stop_when", entry.value);
    } catch (const ExpressionError& error) {
      Diagnostic diagnostic = at_value(entry.place, fmt::format("stop_when: {}", error.what()));
      diagnostic.column += static_cast<int>(error.column()) - 1;
      found_.push_back(std::move(diagnostic));
    }
  } else if (key == "check_every") {
    each.check_every = seconds(entry);
  } else if (key == "until_max") {
    each.until_max = seconds(entry);
  } else if (key == "quick") {
    each.quick = flag(entry);
  } else {
    return false;
  }
  return true;
}

bool StudyReader::take_fork_key(StudyCase& each, const Entry& entry) {
  const std::string& key = entry.key;
  if (key == "parent") {
    each.parent = entry.value;
    each.parent_place = entry.place;
  } else if (key == "at") {
    each.at = entry.value;
    each.at_place = entry.place;
  } else if (key == "perturb") {
    each.perturb = entry.value;
  } else if (key == "ramp_time") {
    each.ramp_time = seconds(entry);
  } else if (key == "outside") {
    each.outside = one_of(entry, {"error", "push", "remove"});
  } else if (key == "anchor") {
    each.anchor = one_of(entry, {"left", "right", "none"});
  } else {
    return false;
  }
  return true;
}

void StudyReader::take_varied(StudyCase& each, const Entry& entry) {
  StudyVaried varied;
  varied.place = entry.place;
  varied.keys = split_list(entry.key.substr(5), '&');
  std::vector<std::string> values;
  if (const std::string wrong = expand_values(entry.value, values); !wrong.empty())
    return error_at_value(entry, wrong);
  for (const std::string& value : values) {
    varied.points.push_back(split_list(value, '&'));
    if (varied.points.back().size() != varied.keys.size())
      return error_at_value(entry, fmt::format("'{}'; expected {} with '&' between", value,
                                               varied.keys.size() == 1
                                                   ? "one value"
                                                   : fmt::format("{} values",
                                                                 varied.keys.size())));
  }
  each.varied.push_back(std::move(varied));
}

void StudyReader::finish_case(StudyCase& each) {
  const auto wrong = [&](const StudyPlace& place, const std::string& text) {
    found_.push_back(at_key(place, fmt::format("case '{}': {}", each.name, text)));
  };
  const bool varies_scenario =
      std::any_of(each.varied.begin(), each.varied.end(),
                  [](const StudyVaried& varied) { return varied.keys[0] == "scenario"; });
  const bool runs = !each.scenario.empty() || varies_scenario;
  if (runs == !each.parent.empty())
    wrong(each.place, runs ? "both a scenario and a parent; expected one of them"
                           : "neither 'scenario' nor 'parent'; expected one of them");
  if (!each.parent.empty() && each.at.empty())
    wrong(each.parent_place, "a fork needs 'at', the step to fork at");
  if (runs && !each.at.empty()) wrong(each.at_place, "'at' is for forks; there is no parent");
  if (runs && (each.perturb || each.ramp_time || !each.outside.empty() || !each.anchor.empty()))
    wrong(each.place, "perturb, ramp_time, outside and anchor are for forks; there is no parent");
  if (each.until && each.steps)
    wrong(each.length_place, "'until' and 'steps' exclude each other");
  if (!each.stop_when && (each.check_every > 0 || each.until_max > 0))
    wrong(each.place, "check_every and until_max need stop_when");
  if (each.stop_when && !(each.until && each.check_every > 0 && each.until_max > 0))
    wrong(each.place, "stop_when needs until, check_every and until_max");
}

namespace {

/// An expression's error at its place in the file.
Diagnostic misplaced(const StudyPlace& place, const std::string& key,
                     const ExpressionError& error) {
  Diagnostic diagnostic = at_value(place, fmt::format("{}: {}", key, error.what()));
  diagnostic.column += static_cast<int>(error.column()) - 1;
  return diagnostic;
}

}  // namespace

void StudyReader::take_measure(const Section& section) {
  StudyMeasure each;
  each.place = section.place;
  const Entry* value = nullptr;
  for (const Entry& entry : section.entries) {
    if (entry.key == "value") {
      value = &entry;
      try {
        each.measure = make_measure(section.name, entry.value);
      } catch (const ExpressionError& error) {
        found_.push_back(misplaced(entry.place, "value", error));
      }
    } else if (entry.key == "unit") {
      each.unit = entry.value;
    } else if (entry.key == "title") {
      each.title = entry.value;
    } else if (entry.key == "cases") {
      each.cases = {list(entry), entry.place};
    } else if (entry.key == "every") {
      each.measure.every = count(entry, 1, 1'000'000'000);
    } else if (entry.key == "at_point") {
      each.measure.at_point = point(entry);
    } else if (entry.key == "quality") {
      each.quality = flag(entry);
    } else if (entry.key == "flag") {
      each.flag = limit(entry, entry.value);
    } else {
      unknown(section, entry,
              {"value", "unit", "title", "cases", "every", "at_point", "quality", "flag"});
    }
  }
  each.measure.name = section.name;
  check_value(section, "measure", value, each.measure.expression, each.measure.at_point);
  study_.measures.push_back(std::move(each));
}

/// That there is an expression, and a point where its table needs one.
void StudyReader::check_value(const Section& section, std::string_view kind, const Entry* value,
                              const Expression& expression, std::span<const double> at_point) {
  if (!value) {
    found_.push_back(
        at_key(section.place, fmt::format("{} '{}' has no value", kind, section.name)));
    return;
  }
  try {
    check_point(expression, at_point);
  } catch (const ExpressionError& error) {
    found_.push_back(misplaced(value->place, "value", error));
  }
}

void StudyReader::take_curve(const Section& section) {
  StudyCurve each;
  each.place = section.place;
  each.curve.from = each.curve.to = std::numeric_limits<double>::quiet_NaN();
  const Entry* value = nullptr;
  for (const Entry& entry : section.entries) {
    if (entry.key == "value") {
      value = &entry;
      try {
        each.curve.expression = make_curve(section.name, entry.value).expression;
      } catch (const ExpressionError& error) {
        found_.push_back(misplaced(entry.place, "value", error));
      }
    } else if (entry.key == "from") {
      each.curve.from = seconds(entry);
    } else if (entry.key == "to") {
      each.curve.to = seconds(entry);
    } else if (entry.key == "points") {
      each.curve.points = count(entry, 2, 10000);
    } else if (entry.key == "unit") {
      each.unit = entry.value;
    } else if (entry.key == "title") {
      each.title = entry.value;
    } else if (entry.key == "cases") {
      each.cases = {list(entry), entry.place};
    } else if (entry.key == "every") {
      each.curve.every = count(entry, 1, 1'000'000'000);
    } else if (entry.key == "at_point") {
      each.curve.at_point = point(entry);
    } else {
      unknown(section, entry, {"value", "from", "to", "points", "unit", "title", "cases", "every",
                               "at_point"});
    }
  }
  each.curve.name = section.name;
  check_value(section, "curve", value, each.curve.expression, each.curve.at_point);
  study_.curves.push_back(std::move(each));
}

void StudyReader::take_figure(const Section& section) {
  StudyFigure each;
  each.id = section.name;
  each.place = section.place;
  for (const Entry& entry : section.entries) {
    if (entry.key == "title") {
      each.title = entry.value;
    } else if (entry.key == "cases") {
      each.cases = {list(entry), entry.place};
    } else if (entry.key == "measures") {
      each.measures = list(entry);
      each.measures_place = entry.place;
    } else if (entry.key == "curves") {
      each.curves = list(entry);
      each.curves_place = entry.place;
    } else if (entry.key == "x") {
      each.x = entry.value;
      each.x_place = entry.place;
    } else if (entry.key == "note") {
      each.note = entry.value;
    } else {
      unknown(section, entry, {"title", "cases", "measures", "curves", "x", "note"});
    }
  }
  study_.figures.push_back(std::move(each));
}

void StudyReader::expected(StudyClaim& claim, const Entry& entry) {
  claim.expected_text = entry.value;
  claim.expected_place = entry.place;
  const std::string& text = entry.value;
  if (text == "true") {
    claim.expects_true = true;
    return;
  }
  for (const char* symbol : {"+-", ".."}) {
    const std::size_t at = text.find(symbol);
    if (at == std::string::npos) continue;
    const auto a = plain_number(trim_blanks(std::string_view(text).substr(0, at)));
    const auto b = plain_number(trim_blanks(std::string_view(text).substr(at + 2)));
    if (a && b && std::string_view(symbol) == "+-")
      claim.range = std::pair(*a - std::abs(*b), *a + std::abs(*b));
    else if (a && b && *a <= *b)
      claim.range = std::pair(*a, *b);
    else
      error_at_value(entry, fmt::format("'{}'; expected A .. B with A <= B, or A +- B", text));
    return;
  }
  if (text.starts_with('>') || text.starts_with('<'))
    claim.limit = limit(entry, text);
  else
    error_at_value(entry,
                   fmt::format("'{}'; expected A .. B, A +- B, > A, < A or true", entry.value));
}

void StudyReader::take_claim(const Section& section) {
  StudyClaim each;
  each.id = section.name;
  each.place = section.place;
  for (const Entry& entry : section.entries) {
    if (entry.key == "figure") {
      each.figure = entry.value;
      each.figure_place = entry.place;
    } else if (entry.key == "text") {
      each.text = entry.value;
    } else if (entry.key == "study_value") {
      each.study_value = entry.value;
    } else if (entry.key == "kind") {
      const std::string word =
          one_of(entry, {"value", "direction", "self-contradictory", "not-testable"});
      each.kind_given = true;
      for (const ClaimKind kind : {ClaimKind::direction, ClaimKind::self_contradictory,
                                   ClaimKind::not_testable})
        if (word == name_of(kind)) each.kind = kind;
    } else if (entry.key == "value") {
      each.value_text = entry.value;
      each.value_place = entry.place;
      try {
        Expression expression = parse_expression(entry.value);
        check_claim(expression);
        each.value = std::move(expression);
      } catch (const ExpressionError& error) {
        found_.push_back(misplaced(entry.place, "value", error));
      }
    } else if (entry.key == "expected") {
      expected(each, entry);
    } else if (entry.key == "direction") {
      each.direction = limit(entry, entry.value);
    } else if (entry.key == "contradicts") {
      each.contradicts = entry.value;
    } else if (entry.key == "note") {
      each.note = entry.value;
    } else {
      unknown(section, entry, {"figure", "text", "study_value", "kind", "value", "expected",
                               "direction", "contradicts", "note"});
    }
  }
  finish_claim(each);
  study_.claims.push_back(std::move(each));
}

void StudyReader::finish_claim(StudyClaim& claim) {
  const auto wrong = [&](const std::string& text) {
    found_.push_back(at_key(claim.place, fmt::format("claim '{}': {}", claim.id, text)));
  };
  const bool has_expected = claim.range || claim.limit || claim.expects_true;
  const bool testable = claim.kind == ClaimKind::value || claim.kind == ClaimKind::direction;
  if (!claim.kind_given)
    wrong("no kind; expected value, direction, self-contradictory or not-testable");
  if (testable && (claim.value_text.empty() || claim.expected_text.empty()))
    wrong("'value' and 'expected' are needed, or kind = not-testable");
  if (claim.kind == ClaimKind::value && has_expected && !claim.range)
    wrong(fmt::format("expected = {}: a value needs a range A .. B or A +- B",
                      claim.expected_text));
  if (claim.kind == ClaimKind::direction && claim.range)
    wrong(fmt::format("expected = {}: a direction needs > A, < A or true", claim.expected_text));
  if (claim.kind == ClaimKind::not_testable && claim.note.empty())
    wrong("not testable: 'note' must say why");
  if (claim.kind == ClaimKind::self_contradictory && claim.contradicts.empty())
    wrong("self-contradictory: 'contradicts' must name the contradiction");
}

void StudyReader::take_compare(const Section& section) {
  StudyCompare each;
  each.name = section.name;
  each.place = section.place;
  for (const Entry& entry : section.entries) {
    if (entry.key == "of") {
      each.of = entry.value;
      each.of_place = entry.place;
    } else if (entry.key == "with") {
      each.with = entry.value;
      each.with_place = entry.place;
    } else if (entry.key == "measures") {
      each.measures = list(entry);
      each.measures_place = entry.place;
    } else if (entry.key == "curves") {
      each.curves = list(entry);
      each.curves_place = entry.place;
    } else if (entry.key == "title") {
      each.title = entry.value;
    } else {
      unknown(section, entry, {"of", "with", "measures", "curves", "title"});
    }
  }
  for (const auto& [name, value] : {std::pair{"of", &each.of}, {"with", &each.with}})
    if (value->empty())
      found_.push_back(at_key(section.place, fmt::format("compare '{}': '{}' is needed, a case",
                                                         section.name, name)));
  study_.compares.push_back(std::move(each));
}

}  // namespace varve::tools
