// The parameter table: every key of a scenario, declared once. The scenario reader, check, --help,
// init, genesis and the fork rules all read it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/scenario.h"
#include "core/units.h"

namespace varve::core {

enum class Change {
  never,       ///< fixed for a family of runs
  parameter,   ///< a fork or an event may change it; nothing else moves
  geometry,    ///< a fork or an event may change it; particles are added or removed
  outputs,     ///< recording and length of run: no bit of the state depends on it
};

struct Parameter {
  std::string_view key;      ///< "contact.damping"
  std::string_view unit;     ///< SI unit as text, "" for pure numbers
  Dimension dimension;
  std::string_view meaning;  ///< one line; says "per metre of depth in 2D" where that holds
  double lowest, highest;    ///< range of reals and integers, inclusive
  bool lowest_open;          ///< the lower bound itself is not allowed
  bool may_be_automatic;     ///< "auto" is accepted: resolve() derives the value
  Change change;
  std::span<const std::string_view> choices;  ///< for choices, in the enum's order
  using Real = double& (*)(Scenario&);
  using Integer = std::int64_t& (*)(Scenario&);
  using Flag = bool& (*)(Scenario&);
  using Text = std::string& (*)(Scenario&);
  struct Choice {
    int (*get)(const Scenario&);
    void (*set)(Scenario&, int);
  };
  std::variant<Real, Integer, Flag, Text, Choice> access;
};

/// All keys, in the order of a written scenario, grouped by section (the part before the dot).
std::span<const Parameter> parameters();
/// The entry called `key`, or nullptr.
const Parameter* find_parameter(std::string_view key);
/// The key nearest to a misspelt one, or "" if none is near.
std::string_view nearest_key(std::string_view key);
/// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// A value that could not be taken: `text` says what was found and what is expected.
struct ValueError {
  std::string text;
};
/// Reads `value` (a number with an optional unit suffix, a choice, on/off, text, "auto") into the
/// scenario. Returns an error text such as "'2 s' is a time; a length is needed", or nothing.
std::optional<ValueError> set_parameter(Scenario& scenario, const Parameter& parameter,
                                        std::string_view value);
/// The value as canonical text: shortest decimal that reads back to the same bits, SI, no unit.
std::string get_parameter(const Scenario& scenario, const Parameter& parameter);
std::string default_text(const Parameter& parameter);
/// What values a key takes, for messages and help: "a ratio 0..2", "a length > 0 (m, cm, mm, um)".
std::string expected_text(const Parameter& parameter);
/// Why a fork cannot change a key: "" if it can.
std::string_view fixed_reason(const Parameter& parameter);

/// Sets "diameter", "density" or "share" of the species called `name`, which is added if it is not
/// there yet. Returns an error text as set_parameter() does; `leaf` must be one of the three.
std::optional<ValueError> set_species(Scenario& scenario, std::string_view name,
                                      std::string_view leaf, std::string_view value);
/// The key of [grains] that says what a species' `leaf` takes, or nullptr.
const Parameter* species_parameter(std::string_view leaf);

/// One thing wrong with a scenario as a whole, at a key.
struct Problem {
  std::string key;   ///< key whose line should be shown
  std::string text;  ///< with the offending number and the largest safe one
};

/// Replaces everything automatic by its derived value, and the times of scheduled changes by steps.
/// Returns what makes no sense (all of it); the scenario is usable only if that is empty.
std::vector<Problem> resolve(Scenario& scenario);

/// Changes keys of a resolved scenario by the fork rules: only keys that the table lets change,
/// within the limits of the resolved values; derived numbers keep theirs. `anchor` as in
/// ChangeOptions: -1 keeps the left wall, +1 the right one, 0 moves both by half; domain.left
/// follows. The scenario is unchanged if there is a problem.
std::vector<Problem> apply_settings(
    Scenario& scenario, const std::vector<std::pair<std::string, std::string>>& settings,
    int anchor = 0);

/// Canonical text of a resolved scenario: sections, "key = value" lines, [event.NAME] sections.
/// Reading it gives the same scenario to the bit.
std::string canonical_text(const Scenario& scenario);

/// "fluid.viscosity=0.01" pairs of everything, resolved, in table order (events last).
std::vector<std::pair<std::string, std::string>> all_settings(const Scenario& scenario);

}  // namespace varve::core
