// The scene of a tradeoff and the rungs around it.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "core/criteria.h"
#include "core/parameters.h"
#include "tools/scenario_levels.h"
#include "tools/scenario_scan.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  const std::string padded = text + separator;
  for (std::size_t begin = 0, end; (end = padded.find(separator, begin)) != std::string::npos;
       begin = end + 1)
    parts.push_back(padded.substr(begin, end - begin));
  return parts;
}

std::string set(std::string_view key, double value) { return fmt::format("{}={}", key, value); }

/// What a level says, as a scenario with everything else at its default.
core::Scenario values_of(std::string_view level) {
  core::Scenario values;
  const ScenarioLevel* found = find_level("scenario.fidelity", level);
  if (!found) return values;
  for (const ScannedEntry& entry : scan_scenario(found->text, "").entries)
    if (const core::Parameter* parameter = core::find_parameter(entry.key))
      core::set_parameter(values, *parameter, entry.value);
  return values;
}

/// A scene may write spacing and sound speed itself, and what it writes wins over a level. Rungs
/// are therefore told as ratios to what `standard` came to.
class Ladder {
 public:
  Ladder(const TradeScene& scene, const LadderOptions& options)
      : scene_(scene), base_(scene.base), options_(options) {}

  std::vector<Rung> make() {
    add("standard", "level", {});
    for (const std::string& level : options_.levels) add_level(level);
    for (const std::string& knob : options_.knobs) add_knob(knob);
    for (const std::string& vary : options_.vary) add_varied(vary);
    for (const std::string& rung : options_.rungs)
      add(rung, "rung", split(rung, ','));
    return std::move(rungs_);
  }

 private:
  void add(const std::string& name, const std::string& knob, std::vector<std::string> settings) {
    // A scene that fixes its step for one spacing would be refused for another.
    bool finer = false;
    for (const std::string& each : settings)
      finer = finer || each.starts_with("fluid.spacing=") || each.starts_with("fluid.sound") ||
              each.starts_with("fluid.smoothing") || each.starts_with("time.cfl=") ||
              each.starts_with("time.substeps=");
    for (const std::string& each : settings) finer = finer && !each.starts_with("time.dt=");
    if (finer) settings.push_back("time.dt=auto");
    Resolved resolved = resolve_with(scene_, settings);
    const std::string text = core::canonical_text(resolved.scenario);
    if (resolved.refused.empty()) {
      if (std::find(texts_.begin(), texts_.end(), text) != texts_.end()) return;
      texts_.push_back(text);
    }
    rungs_.push_back({name, knob, std::move(settings), std::move(resolved.scenario),
                      std::move(resolved.refused)});
  }

  /// A spacing about `ratio` times finer: a whole number of them to the width, and to whatever else
  /// the lattice fills.
  std::vector<std::string> spacing_by(double ratio) const {
    if (!base_.has_fluid()) return {};
    const double now = std::round(base_.domain.width / base_.fluid.spacing);
    const double across = std::round(now * ratio);
    const auto setting = [&](double count) {
      return set("fluid.spacing", base_.domain.width / std::max(1.0, count));
    };
    for (const double off : {0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5}) {
      const double count = across + off;
      // Never to the other side of what the scene has, nor back to it.
      if (count >= 1 && (count - now) * (ratio - 1) > 0 &&
          resolve_with(scene_, {setting(count), "time.dt=auto"}).refused.empty())
        return {setting(count)};
    }
    return {setting(across)};
  }

  void add_level(const std::string& level) {
    if (level == "standard") return;
    const core::Scenario values = values_of(level), standard = values_of("standard");
    std::vector<std::string> settings;
    const auto& precisions = core::find_parameter("scenario.precision")->choices;
    if (values.precision != standard.precision)
      settings.push_back(fmt::format("scenario.precision={}",
                                     precisions[static_cast<std::size_t>(values.precision)]));
    if (base_.has_fluid()) {
      for (std::string& each : spacing_by(values.fluid.resolution / standard.fluid.resolution))
        settings.push_back(std::move(each));
      settings.push_back(set("fluid.sound_speed",
                             base_.fluid.sound_speed * values.fluid.sound_speed_factor));
      settings.push_back(set("time.cfl", base_.time.cfl * values.time.cfl / standard.time.cfl));
    } else {
      settings.push_back(set("time.dt", base_.time.dt * values.time.cfl / standard.time.cfl));
    }
    add(level, "level", settings);
  }

  void add_knob(const std::string& knob) {
    const bool fluid = base_.has_fluid();
    const bool grains = base_.has_grains() && base_.grains.motion != core::GrainMotion::frozen;
    if (knob == "spacing" && fluid) {
      for (const double ratio : {0.8, 1.2, 1.6, 2.0})
        add(fmt::format("spacing / {:g}", ratio), knob, spacing_by(ratio));
    } else if (knob == "h/dx" && fluid) {
      for (const double ratio : {1.1, 1.25, 1.5, 1.75, 2.0})
        add(fmt::format("h/dx {:g}", ratio), knob, {set("fluid.smoothing_ratio", ratio)});
    } else if (knob == "c0" && fluid) {
      for (const double factor : {0.5, 0.7, 1.5, 2.0})
        add(fmt::format("c0 x {:g}", factor), knob,
            {set("fluid.sound_speed", base_.fluid.sound_speed * factor)});
    } else if (knob == "cfl" && fluid) {
      for (const double cfl : {0.0625, 0.125, 0.25, 0.35, 0.5})
        add(fmt::format("cfl {:g}", cfl), knob, {set("time.cfl", cfl)});
    } else if (knob == "cfl" && grains) {
      for (const double part : {0.25, 0.5, 2.0})
        add(fmt::format("dt x {:g}", part), knob, {set("time.dt", base_.time.dt * part)});
    } else if (knob == "substeps" && grains && fluid) {
      const auto n = static_cast<double>(core::substeps(base_));
      add("substeps 1", knob, {"time.substeps=1"});
      for (const double factor : {0.5, 2.0, 4.0})
        add(fmt::format("substeps {}", std::ceil(n * factor)), knob,
            {fmt::format("time.substeps={}", std::ceil(n * factor))});
    } else if (knob == "precision") {
      for (const char* precision : {"float", "mixed"})
        add(precision, knob, {fmt::format("scenario.precision={}", precision)});
    } else if (knob == "kernel" && fluid) {
      for (const std::string_view name : core::find_parameter("fluid.kernel")->choices)
        add(fmt::format("kernel {}", name), knob, {fmt::format("fluid.kernel={}", name)});
    } else if (knob == "record") {
      add_recording(knob);
    }
  }

  void add_recording(const std::string& knob) {
    for (const char* tier : {"deltas", "digests"})
      add(tier, knob, {fmt::format("record.tier={}", tier)});
    for (const int every : {8, 64})
      add(fmt::format("every {}", every), knob,
          {"record.tier=deltas", fmt::format("record.every={}", every)});
    for (const int steps : {64, 1024})
      add(fmt::format("keyframes {}", steps), knob,
          {fmt::format("record.keyframe_steps={}", steps)});
  }

  void add_varied(const std::string& vary) {
    const std::size_t equals = vary.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == vary.size())
      throw UsageError(fmt::format("--vary: expected KEY=VALUE,VALUE..., got '{}'", vary));
    const std::string key = vary.substr(0, equals);
    if (!core::find_parameter(key))
      throw UsageError(fmt::format("--vary: unknown key '{}'; did you mean '{}'?", key,
                                   core::nearest_key(key)));
    for (const std::string& value : split(vary.substr(equals + 1), ','))
      add(fmt::format("{} {}", key, value), key, {fmt::format("{}={}", key, value)});
  }

  const TradeScene& scene_;
  const core::Scenario& base_;
  const LadderOptions& options_;
  std::vector<Rung> rungs_;
  std::vector<std::string> texts_;
};

}  // namespace

std::vector<std::string> settings_on_top(const std::vector<std::string>& base,
                                         const std::vector<std::string>& settings) {
  const auto key_of = [](const std::string& setting) {
    const std::string key = setting.substr(0, setting.find('='));
    return key.substr(0, key.find_last_not_of(' ') + 1);
  };
  std::vector<std::string> all;
  for (const std::string& each : base) {
    const bool replaced = std::any_of(settings.begin(), settings.end(), [&](const auto& other) {
      return key_of(other) == key_of(each);
    });
    if (!replaced) all.push_back(each);
  }
  all.insert(all.end(), settings.begin(), settings.end());
  return all;
}

TradeScene load_trade_scene(const std::string& file, std::vector<std::string> settings,
                            std::optional<double> until) {
  TradeScene scene;
  scene.file = file;
  scene.given = settings;
  // The ladder is built around `standard`, whatever level the file was written for.
  settings = settings_on_top({"scenario.fidelity=standard"}, settings);
  const auto end_at = [&](double seconds) {
    settings = settings_on_top(settings, {"time.steps=", set("time.until", seconds)});
    std::erase(settings, "time.steps=");
  };
  if (until) end_at(*until);
  ScenarioOptions options;
  options.settings = settings;
  const ScenarioSource source = load_scenario(file, options);
  scene.text = source.text;
  scene.folder = std::filesystem::path(file).parent_path().string();
  scene.base = source.scenario;
  scene.until = source.scenario.time.until;
  if (source.scenario.time.steps > 0) {
    // Rungs of other steps shall end at the same time.
    scene.until = static_cast<double>(source.scenario.time.steps) * source.scenario.time.dt;
    end_at(scene.until);
    scene.base.time.until = scene.until;
    scene.base.time.steps = 0;
  }
  scene.settings = std::move(settings);
  return scene;
}

Resolved resolve_with(const TradeScene& scene, const std::vector<std::string>& settings) {
  ScenarioOptions options;
  options.needs_length = true;
  options.folder = scene.folder;
  options.settings = settings_on_top(scene.settings, settings);
  try {
    return {read_scenario_text(scene.text, scene.file, options).scenario, ""};
  } catch (const ScenarioError& error) {
    return {scene.base, error.diagnostics().front().text};
  }
}

const std::vector<std::pair<std::string, std::string>>& ladder_knobs() {
  static const std::vector<std::pair<std::string, std::string>> all{
      {"spacing", "fluid.spacing, coarser and finer"},
      {"h/dx", "fluid.smoothing_ratio"},
      {"c0", "the sound speed, by factors"},
      {"cfl", "time.cfl; the step of grains without fluid"},
      {"substeps", "of the grains: one common step, fewer, more"},
      {"precision", "float and mixed"},
      {"kernel", "the other kernels"},
      {"record", "tier and cadence; no number changes, only cost"}};
  return all;
}

std::vector<Rung> make_ladder(const TradeScene& scene, const LadderOptions& options) {
  for (const std::string& level : options.levels)
    if (!find_level("scenario.fidelity", level))
      throw UsageError(fmt::format(
          "--levels: no level '{}'; expected draft, standard, fine or reference", level));
  std::vector<std::string_view> names;
  for (const auto& [name, meaning] : ladder_knobs()) names.push_back(name);
  for (const std::string& knob : options.knobs)
    if (std::find(names.begin(), names.end(), knob) == names.end())
      throw UsageError(fmt::format("--knobs: no knob '{}'; expected {}", knob,
                                   fmt::join(names, ", ")));
  return Ladder(scene, options).make();
}

}  // namespace varve::tools
