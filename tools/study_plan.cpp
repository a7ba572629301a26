#include "tools/study_plan.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "core/parameters.h"
#include "core/simulation.h"
#include "io/digest.h"
#include "io/errors.h"
#include "io/log_reader.h"
#include "tools/cli.h"
#include "tools/simulation_engine.h"
#include "tools/study_reader.h"
#include "tools/study_values.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t members_max = 100000;
constexpr std::string_view scenario_key = "scenario";

/// A point of a case: one value for every varied key.
using Point = std::vector<StudySetting>;

std::vector<Point> points_of(const StudyCase& each) {
  std::vector<Point> points{{}};
  for (const StudyVaried& varied : each.varied) {
    std::vector<Point> more;
    for (const Point& point : points)
      for (const std::vector<std::string>& values : varied.points) {
        Point longer = point;
        for (std::size_t k = 0; k < values.size(); ++k)
          longer.push_back({varied.keys[k], values[k], varied.place});
        more.push_back(std::move(longer));
      }
    points = std::move(more);
    if (points.size() > members_max) break;
  }
  return points;
}

/// "case.n16[domain.width=0.06]"
struct ParentName {
  std::string name;
  std::vector<Filter> filters;
};

class Planner {
 public:
  Planner(StudyPlan& plan, std::vector<Diagnostic>& found) : plan_(plan), found_(found) {}

  void run() {
    const std::size_t count = plan_.file.cases.size();
    members_.resize(count);
    state_.assign(count, State::untouched);
    for (std::size_t c = 0; c < count; ++c) plan_case(c);
    flatten();
    for (const StudyCase& each : plan_.file.cases)
      for (const StudyVaried& varied : each.varied)
        for (const std::string& key : varied.keys)
          if (std::find(plan_.keys.begin(), plan_.keys.end(), key) == plan_.keys.end())
            plan_.keys.push_back(key);
  }

 private:
  enum class State { untouched, begun, done };
  struct Draft {
    StudyMember member;
    std::size_t parent_case = 0, parent_index = 0;  ///< of a fork of a case
  };

  void error(Diagnostic diagnostic) {
    const auto same = [&](const Diagnostic& each) {
      return each.message() == diagnostic.message();
    };
    if (std::none_of(found_.begin(), found_.end(), same)) found_.push_back(std::move(diagnostic));
  }

  void plan_case(std::size_t index) {
    if (state_[index] != State::untouched) return;
    state_[index] = State::begun;
    const StudyCase& each = plan_.file.cases[index];
    if (!check_keys(each)) {
      state_[index] = State::done;
      return;
    }
    const std::vector<Point> points = points_of(each);
    if (points.size() * std::max<std::size_t>(1, each.seeds.size()) > members_max) {
      error(at_key(each.place, fmt::format("case '{}' has more than {} members", each.name,
                                           members_max)));
    } else if (each.parent.empty()) {
      for (const Point& point : points) plan_runs(index, point);
    } else {
      plan_forks(index, points);
    }
    state_[index] = State::done;
  }

  /// No key twice in one case.
  bool check_keys(const StudyCase& each) {
    std::map<std::string, int> lines;
    bool good = true;
    const auto take = [&](const std::string& key, const StudyPlace& place) {
      const auto [earlier, first] = lines.emplace(key, place.line);
      if (first) return;
      good = false;
      error(at_key(place, fmt::format("'{}' was already given on line {}", key, earlier->second)));
    };
    for (const StudySetting& setting : each.settings) take(setting.key, setting.place);
    for (const StudyVaried& varied : each.varied)
      for (const std::string& key : varied.keys) take(key, varied.place);
    return good;
  }

  // ---- runs -------------------------------------------------------------------------------------

  void plan_runs(std::size_t index, const Point& point) {
    const StudyCase& each = plan_.file.cases[index];
    const std::vector<std::uint64_t> own{0};
    const bool seeded = !each.seeds.empty();
    std::size_t place = 0;
    for (const std::uint64_t seed : seeded ? each.seeds : own) {
      Draft draft;
      StudyMember& member = draft.member;
      member.case_index = index;
      if (!resolve_run(each, point, seeded ? std::optional(seed) : std::nullopt, member)) return;
      member.seed = seeded ? seed : static_cast<std::uint64_t>(member.scenario.grains.seed);
      const core::Grains& grains = member.scenario.grains;
      if (each.seeds.size() > 1 && !(grains.jitter > 0) &&
          grains.arrangement != core::Arrangement::random)
        error(at_key(each.place, fmt::format("case '{}': {} seeds, but grains.jitter is 0: every "
                                             "one would be the same run", each.name,
                                             each.seeds.size())));
      finish(each, member, place++);
      member.id = id_of_text(fmt::format("run\n{}", member.text), each, member);
      members_[index].push_back(std::move(draft));
    }
  }

  /// The scenario of a member; false where it is none (said in `found_`).
  bool resolve_run(const StudyCase& each, const Point& point, std::optional<std::uint64_t> seed,
                   StudyMember& member) {
    std::string name = each.scenario;
    StudyPlace name_place = each.scenario_place;
    std::vector<StudySetting> settings = each.settings;
    for (const StudySetting& setting : point) {
      if (setting.key == scenario_key) {
        name = setting.value;
        name_place = setting.place;
      } else {
        settings.push_back(setting);
      }
    }
    if (each.until) settings.push_back({"time.until", *each.until, each.length_place});
    if (each.steps) settings.push_back({"time.steps", *each.steps, each.length_place});
    const bool own_seed = std::any_of(settings.begin(), settings.end(), [](const auto& setting) {
      return setting.key == "grains.seed";
    });
    if (seed && !own_seed)
      settings.push_back({"grains.seed", std::to_string(*seed), each.place});

    ScenarioOptions options;
    for (const StudySetting& setting : settings)
      options.settings.push_back(setting.key + "=" + setting.value);
    std::string text, path;
    if (!find_scenario(each, name, name_place, text, path, options.folder)) return false;
    try {
      ScenarioSource source = read_scenario_text(text, path, options);
      member.scenario = std::move(source.scenario);
      member.files = std::move(source.files);
    } catch (const ScenarioError& wrong) {
      for (Diagnostic diagnostic : wrong.diagnostics()) {
        const auto number = static_cast<std::size_t>(diagnostic.line);
        if (diagnostic.source == "<command line>" && number >= 1 && number <= settings.size())
          diagnostic = diagnostic.text.starts_with("unknown key")
                           ? at_key(settings[number - 1].place, diagnostic.text)
                           : at_value(settings[number - 1].place, diagnostic.text);
        error(std::move(diagnostic));
      }
      return false;
    }
    for (const auto& [file, content] : member.files)
      if (fs::path(file).is_absolute() ||
          fs::path(file).lexically_normal().string().starts_with(".."))
        error(at_value(name_place, fmt::format("{}: names the file '{}'; a study needs such files "
                                               "beside the scenario or below it", name, file)));
    member.text = core::canonical_text(member.scenario);
    for (const StudySetting& setting : point)
      member.varied.emplace_back(setting.key, setting.key == scenario_key
                                                  ? setting.value
                                                  : canonical_value(setting.key, setting.value));
    return true;
  }

  bool find_scenario(const StudyCase& each, const std::string& name, const StudyPlace& place,
                     std::string& text, std::string& path, std::string& folder) {
    path = (fs::path(each.folder) / name).string();
    if (const auto known = texts_.find(path); known != texts_.end()) {
      text = known->second;
    } else if (fs::is_regular_file(path)) {
      std::ifstream file(path, std::ios::binary);
      text.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
      texts_[path] = text;
    } else if (const Preset* preset = find_preset(name)) {
      text = preset->text;
      path = fmt::format("preset {}", preset->name);
      return true;
    } else {
      std::vector<std::string_view> names;
      for (const Preset& known_preset : presets()) names.push_back(known_preset.name);
      error(at_value(place, fmt::format("scenario: '{}' is neither a file nor one of the presets "
                                        "{}", path, fmt::join(names, ", "))));
      return false;
    }
    folder = fs::path(path).parent_path().string();
    return true;
  }

  // ---- forks ------------------------------------------------------------------------------------

  void plan_forks(std::size_t index, const std::vector<Point>& points) {
    const StudyCase& each = plan_.file.cases[index];
    if (!each.parent.starts_with("case.")) return plan_forks_of_log(index, points);
    std::size_t parent_index = 0;
    const auto parents = parents_of(each, parent_index);
    if (!parents) return;
    const auto fork_of = [&](const Point& point, std::uint64_t seed, const Draft& parent,
                             const std::string& perturb, std::size_t place) {
      Draft draft;
      draft.parent_case = parent_index;
      draft.parent_index = static_cast<std::size_t>(&parent - members_[parent_index].data());
      draft.member.seed = seed;
      draft.member.perturb = perturb;
      add_fork(index, std::move(draft), point, parent.member.scenario,
               "member " + parent.member.id, place);
    };
    const bool from_one = parents->size() == 1 && (each.seeds.size() > 1 || each.perturb);
    for (const Point& point : points) {
      std::size_t place = 0;
      if (from_one) {
        for (const std::uint64_t seed : seeds_or(each, parents->front()->member.seed))
          fork_of(point, seed, *parents->front(), each.perturb.value_or("1e-6 d"), place++);
        continue;
      }
      for (const Draft* parent : *parents) {
        const std::vector<std::uint64_t> seeds = seeds_or(each, parent->member.seed);
        if (parents->size() == 1 ||
            std::find(seeds.begin(), seeds.end(), parent->member.seed) != seeds.end())
          fork_of(point, parents->size() == 1 ? seeds[0] : parent->member.seed, *parent,
                  each.perturb.value_or(""), place++);
      }
    }
    if (parents->size() > 1)
      for (const std::uint64_t seed : each.seeds)
        if (std::none_of(parents->begin(), parents->end(),
                         [&](const Draft* parent) { return parent->member.seed == seed; }))
          error(at_value(each.parent_place,
                         fmt::format("parent: {} has no member with seed {}", each.parent, seed)));
  }

  static std::vector<std::uint64_t> seeds_or(const StudyCase& each, std::uint64_t seed) {
    return each.seeds.empty() ? std::vector<std::uint64_t>{seed} : each.seeds;
  }

  /// The members of the parent's case that are forked: one point of it, all seeds.
  std::optional<std::vector<const Draft*>> parents_of(const StudyCase& each,
                                                      std::size_t& parent_index) {
    const auto refuse = [&](const std::string& text) {
      error(at_value(each.parent_place, "parent: " + text));
      return std::nullopt;
    };
    ParentName wanted;
    try {
      const std::size_t bracket = each.parent.find('[');
      wanted.name = trim_blanks(std::string_view(each.parent).substr(5, bracket - 5));
      if (bracket != std::string::npos)
        wanted.filters = parse_expression("x" + each.parent.substr(bracket)).filters;
    } catch (const ExpressionError& wrong) {
      return refuse(wrong.what());
    }
    const StudyCase* parent = plan_.file.find_case(wanted.name);
    if (!parent) {
      std::vector<std::string_view> names;
      for (const StudyCase& known : plan_.file.cases) names.push_back(known.name);
      const std::string_view near = nearest_name(wanted.name, names);
      return refuse(fmt::format("there is no case '{}'{}", wanted.name,
                                near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
    }
    parent_index = static_cast<std::size_t>(parent - plan_.file.cases.data());
    if (state_[parent_index] == State::begun)
      return refuse(fmt::format("'{}' comes from itself", wanted.name));
    plan_case(parent_index);
    std::vector<const Draft*> parents;
    for (const Draft& draft : members_[parent_index]) {
      const bool fits = std::all_of(
          wanted.filters.begin(), wanted.filters.end(), [&](const Filter& filter) {
            const std::string* value = draft.member.value_of(filter.key);
            return value && *value == canonical_value(filter.key, filter.value);
          });
      if (fits) parents.push_back(&draft);
    }
    if (parents.empty())
      return members_[parent_index].empty()
                 ? std::nullopt  // its own errors have been said
                 : refuse(fmt::format("'{}' has no such member", each.parent));
    for (const Draft* draft : parents)
      if (draft->member.varied != parents.front()->member.varied)
        return refuse(fmt::format("'{}' has several points; choose one as in "
                                  "case.{}[KEY=VALUE]", each.parent, wanted.name));
    return parents;
  }

  void plan_forks_of_log(std::size_t index, const std::vector<Point>& points) {
    const StudyCase& each = plan_.file.cases[index];
    const std::string path = (fs::path(each.folder) / each.parent).string();
    try {
      const auto log = io::LogReader::open(path);
      const core::Scenario scenario = scenario_of(log->genesis(), path);
      const std::string name = "log " + log->genesis().run_id();
      for (const Point& point : points) {
        std::size_t place = 0;
        for (const std::uint64_t seed : seeds_or(each, 0)) {
          Draft draft;
          draft.member.seed = seed;
          draft.member.parent_path = path;
          if (each.perturb || each.seeds.size() > 1)
            draft.member.perturb = each.perturb.value_or("1e-6 d");
          add_fork(index, std::move(draft), point, scenario, name, place++);
        }
      }
    } catch (const io::LogError& wrong) {
      error(at_value(each.parent_place, fmt::format("parent: {}", wrong.what())));
    }
  }

  void add_fork(std::size_t index, Draft draft, const Point& point,
                const core::Scenario& parent_scenario, const std::string& parent_name,
                std::size_t place) {
    const StudyCase& each = plan_.file.cases[index];
    StudyMember& member = draft.member;
    member.case_index = index;
    member.is_fork = true;
    member.scenario = parent_scenario;
    std::vector<StudySetting> settings = each.settings;
    settings.insert(settings.end(), point.begin(), point.end());
    for (const StudySetting& setting : settings) {
      if (!check_change(setting, parent_scenario)) return;
      member.changes.emplace_back(setting.key, setting.value);
    }
    if (!member.perturb.empty() && each.seeds.size() > 1 && member.perturb.starts_with("0"))
      if (double amount = 1; read_number(member.perturb, {0, 1, 0}, amount).empty() && amount == 0)
        error(at_key(each.place, fmt::format("case '{}': {} seeds with perturb = 0 are one fork",
                                             each.name, each.seeds.size())));
    const int anchor = each.anchor == "left" ? -1 : each.anchor == "right" ? 1 : 0;
    for (const core::Problem& problem :
         core::apply_settings(member.scenario, member.changes, anchor)) {
      const auto culprit = std::find_if(settings.begin(), settings.end(), [&](const auto& setting) {
        return setting.key == problem.key;
      });
      error(at_value(culprit == settings.end() ? each.at_place : culprit->place,
                     fmt::format("{}: {}", problem.key, problem.text)));
    }
    set_fork_length(each, member);
    for (const StudySetting& setting : point)
      member.varied.emplace_back(setting.key, canonical_value(setting.key, setting.value));
    finish(each, member, place);
    std::string text = fmt::format("fork of {}\nat {}\n", parent_name, each.at);
    for (const auto& [key, value] : member.changes)
      text += fmt::format("{} = {}\n", key, canonical_value(key, value));
    text += fmt::format("perturb {} seed {}\nramp {} outside {} anchor {}\nuntil {} steps {}\n",
                        member.perturb, member.perturb.empty() ? 0 : member.seed,
                        each.ramp_time ? core::number_text(*each.ramp_time) : "none",
                        each.outside, each.anchor, each.until.value_or(""),
                        each.steps.value_or(""));
    member.id = id_of_text(text, each, member);
    members_[index].push_back(std::move(draft));
  }

  bool check_change(const StudySetting& setting, const core::Scenario& before) {
    const core::Parameter* parameter = core::find_parameter(setting.key);
    if (!parameter) {
      const std::string_view near = core::nearest_key(setting.key);
      error(at_key(setting.place,
                   fmt::format("unknown key '{}'{}", setting.key,
                               near.empty() ? "" : fmt::format("; did you mean '{}'?", near))));
      return false;
    }
    if (parameter->change == core::Change::never) {
      error(at_key(setting.place, fmt::format("{}: cannot change in a fork: {}", setting.key,
                                              core::fixed_reason(*parameter))));
      return false;
    }
    core::Scenario scratch = before;
    const auto wrong = core::set_parameter(scratch, *parameter, setting.value);
    if (wrong) error(at_value(setting.place, fmt::format("{}: {}", setting.key, wrong->text)));
    return !wrong;
  }

  /// Of a fork, as far as it is known before it is made: for estimates.
  static void set_fork_length(const StudyCase& each, StudyMember& member) {
    double until = 0;
    if (each.until && read_number(*each.until, {0, 0, 1}, until).empty()) {
      member.scenario.time.steps = 0;
      member.scenario.time.until = until;
    }
    if (each.steps) member.scenario.time.steps = std::stoll(*each.steps);
  }

  // ---- all --------------------------------------------------------------------------------------

  void finish(const StudyCase& each, StudyMember& member, std::size_t place) {
    member.keep = each.keep;
    member.quick = each.quick && (each.quick_seeds == 0 || place < each.quick_seeds);
  }

  static std::string id_of_text(const std::string& definition, const StudyCase& each,
                                const StudyMember& member) {
    std::string text = fmt::format("varve study member 1, engine revision {}\n{}",
                                   core::engine_revision, definition);
    for (const auto& [name, content] : member.files)
      text += fmt::format("file {} {}\n", name, io::digest_text(content).hex());
    if (each.stop_when)
      text += fmt::format("stop when {} every {} at most {}\n",
                          text_of(each.stop_when->expression), each.check_every, each.until_max);
    return io::digest_text(text).hex().substr(0, 24);
  }

  void flatten() {
    std::vector<std::size_t> first;
    for (const std::vector<Draft>& drafts : members_) {
      first.push_back(plan_.members.size());
      for (const Draft& draft : drafts) plan_.members.push_back(draft.member);
    }
    std::map<std::string, Keep> keep;
    for (std::size_t c = 0; c < members_.size(); ++c)
      for (std::size_t i = 0; i < members_[c].size(); ++i) {
        StudyMember& member = plan_.members[first[c] + i];
        const Draft& draft = members_[c][i];
        if (member.is_fork && member.parent_path.empty())
          member.parent = first[draft.parent_case] + draft.parent_index;
        Keep& most = keep.emplace(member.id, member.keep).first->second;
        most = std::max(most, member.keep);
      }
    // One member may stand in several cases: what any of them wants to keep is kept.
    for (StudyMember& member : plan_.members) member.keep = keep.at(member.id);
  }

  StudyPlan& plan_;
  std::vector<Diagnostic>& found_;
  std::vector<std::vector<Draft>> members_;  ///< by case
  std::vector<State> state_;
  std::map<std::string, std::string> texts_;
};

}  // namespace

const std::string* StudyMember::value_of(const std::string& key) const {
  for (const auto& [name, value] : varied)
    if (name == key) return &value;
  return nullptr;
}

StudyPlan make_plan(StudyFile file, std::vector<Diagnostic>& found) {
  StudyPlan plan;
  plan.file = std::move(file);
  Planner(plan, found).run();
  return plan;
}

StudyPlan load_plan(const std::string& path) {
  std::vector<Diagnostic> found;
  StudyPlan plan = make_plan(read_study(path, found), found);
  refuse_if_any(std::move(found));
  return plan;
}

std::set<std::size_t> selected_members(const StudyPlan& plan, bool quick,
                                       const std::vector<std::string>& only) {
  for (const std::string& pattern : only) {
    const auto fits = [&](const StudyCase& each) { return fits_pattern(each.name, pattern); };
    if (std::any_of(plan.file.cases.begin(), plan.file.cases.end(), fits)) continue;
    std::vector<std::string_view> names;
    for (const StudyCase& each : plan.file.cases) names.push_back(each.name);
    const std::string_view near = nearest_name(pattern, names);
    throw UsageError(fmt::format("--only: {} has no case '{}'{}", plan.file.path, pattern,
                                 near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
  }
  std::set<std::size_t> selected;
  for (std::size_t i = 0; i < plan.members.size(); ++i) {
    const StudyMember& member = plan.members[i];
    const auto fits = [&](const std::string& pattern) {
      return fits_pattern(plan.case_of(member).name, pattern);
    };
    if (quick && !member.quick) continue;
    if (!only.empty() && std::none_of(only.begin(), only.end(), fits)) continue;
    for (std::optional<std::size_t> m = i; m; m = plan.members[*m].parent) selected.insert(*m);
  }
  return selected;
}

std::string label_of(const StudyPlan& plan, const StudyMember& member) {
  std::string label = plan.case_of(member).name;
  for (const auto& [key, value] : member.varied) label += fmt::format(" {}={}", key, value);
  return label + fmt::format(" seed {}", member.seed);
}

std::string origin_of(const StudyPlan& plan, const StudyMember& member) {
  if (!member.is_fork) return "run";
  return fmt::format("fork of {} at {}",
                     member.parent ? label_of(plan, plan.members[*member.parent])
                                   : fs::path(member.parent_path).filename().string(),
                     plan.case_of(member).at);
}

std::string canonical_value(const std::string& key, const std::string& text) {
  const core::Parameter* parameter = core::find_parameter(key);
  core::Scenario scratch;
  if (!parameter || core::set_parameter(scratch, *parameter, text)) return text;
  return core::get_parameter(scratch, *parameter);
}

}  // namespace varve::tools
