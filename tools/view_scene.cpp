#include "tools/view_scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

/// A field's values as doubles, empty where the log has no such field.
std::vector<double> reals(const io::Schema& schema, const io::Frame& frame, const char* name) {
  std::vector<double> values;
  const int found = schema.find(name);
  if (found < 0) return values;
  const auto index = static_cast<std::size_t>(found);
  const std::vector<std::byte>& bytes = frame.fields[index];
  const auto read = [&](auto scalar) {
    using T = decltype(scalar);
    values.resize(bytes.size() / sizeof(T));
    for (std::size_t k = 0; k < values.size(); ++k) {
      std::memcpy(&scalar, bytes.data() + k * sizeof(T), sizeof(T));
      values[k] = static_cast<double>(scalar);
    }
  };
  switch (schema.fields[index].type) {
    case io::ScalarType::f64: read(double{}); break;
    case io::ScalarType::f32: read(float{}); break;
    case io::ScalarType::u64: read(std::uint64_t{}); break;
    case io::ScalarType::u32: read(std::uint32_t{}); break;
    case io::ScalarType::u8: read(std::uint8_t{}); break;
  }
  return values;
}

/// Where the side walls stand, step by step: they move with recorded events.
class Walls {
 public:
  Walls(const io::LogReader& log, const core::Scenario& scenario)
      : left_(scenario.domain.left), width_(scenario.domain.width) {
    for (const io::Event& event : log.events())
      if (event.kind == "walls") moves_.push_back(event);
  }
  /// Steps must ascend.
  void at(std::uint64_t step, double& left, double& width) {
    for (; next_ < moves_.size() && moves_[next_].step <= step; ++next_)
      for (const auto& [key, value] : moves_[next_].items) {
        if (key == "left") left_ = std::stod(value);
        if (key == "width") width_ = std::stod(value);
      }
    left = left_;
    width = width_;
  }
  /// Grows [low, high] to hold all positions that there ever are.
  void widen(double& low, double& high) const {
    low = std::min(low, left_);
    high = std::max(high, left_ + width_);
    for (const io::Event& event : moves_) {
      double left = left_, width = width_;
      for (const auto& [key, value] : event.items) {
        if (key == "left") left = std::stod(value);
        if (key == "width") width = std::stod(value);
      }
      low = std::min(low, left);
      high = std::max(high, left + width);
    }
  }

 private:
  double left_, width_;
  std::vector<io::Event> moves_;
  std::size_t next_ = 0;
};

/// Particles of a state before they are counted in units of the whole run's box and speed.
struct Raw {
  std::vector<double> position, speed;
};

Raw thinned(const std::vector<double>& position, const std::vector<double>& velocity,
            std::size_t dimension, std::size_t one_in) {
  Raw raw;
  for (std::size_t i = 0; i * dimension < position.size(); i += one_in) {
    double square = 0;
    for (std::size_t c = 0; c < dimension; ++c) {
      raw.position.push_back(position[i * dimension + c]);
      square += velocity[i * dimension + c] * velocity[i * dimension + c];
    }
    raw.speed.push_back(std::sqrt(square));
  }
  return raw;
}

ViewCloud counted(const Raw& raw, const ViewScene& scene, double fastest) {
  ViewCloud cloud;
  for (std::size_t k = 0; k < raw.position.size(); ++k) {
    const std::size_t c = k % scene.dimension;
    const double share = (raw.position[k] - scene.lower[c]) / (scene.upper[c] - scene.lower[c]);
    cloud.place.push_back(
        static_cast<std::uint16_t>(std::lround(65535 * std::clamp(share, 0.0, 1.0))));
  }
  for (const double speed : raw.speed) {
    const double share = fastest > 0 ? speed / fastest : 0;
    cloud.speed.push_back(static_cast<std::uint8_t>(std::lround(255 * std::min(share, 1.0))));
  }
  return cloud;
}

double fastest_of(const std::vector<Raw>& states) {
  double fastest = 0;
  for (const Raw& state : states)
    for (const double speed : state.speed) fastest = std::max(fastest, speed);
  return fastest;
}

/// The box holds the domain and every particle: some may have left it.
void grow(ViewScene& scene, const Raw& raw) {
  for (std::size_t k = 0; k < raw.position.size(); ++k) {
    const std::size_t c = k % scene.dimension;
    if (!std::isfinite(raw.position[k])) continue;
    scene.lower[c] = std::min(scene.lower[c], raw.position[k]);
    scene.upper[c] = std::max(scene.upper[c], raw.position[k]);
  }
}

void describe(ViewScene& scene, const io::LogReader& log, const core::Scenario& s) {
  scene.name = std::filesystem::path(log.path()).filename().string();
  scene.title = s.title;
  scene.dimension = static_cast<std::size_t>(s.domain.dimension);
  scene.pipe = s.domain.shape == core::Shape::pipe;
  scene.open_top = s.domain.top == core::Boundary::free;
  scene.height = s.domain.height;
  scene.spacing = s.fluid.present ? s.fluid.spacing : 0;
  scene.radii.push_back(0.5 * s.grains.diameter);
  for (const core::GrainSpecies& species : s.species)
    scene.radii.push_back(0.5 * species.diameter);
  scene.upper = {0, s.domain.height, scene.dimension == 3 ? s.domain.depth : 0};
  Walls(log, s).widen(scene.lower[0], scene.upper[0]);
  scene.facts = {{"steps", fmt::format("{} to {}", log.first_step(), log.last_step())}};
  if (const auto& lineage = log.genesis().lineage) {
    scene.facts.emplace_back("fork of", fmt::format("{} at step {}", lineage->parent_name,
                                                    lineage->step));
    for (const auto& change : lineage->changes)
      scene.facts.emplace_back(change.key, fmt::format("{} -> {}", change.from, change.to));
  }
}

}  // namespace

ViewScene view_scene(const io::LogReader& log, const core::Scenario& scenario,
                     const StepRange& range, std::size_t fluid_max) {
  ViewScene scene;
  describe(scene, log, scenario);
  const io::Schema& schema = log.genesis().schema;
  const double down[3] = {std::sin(scenario.gravity.tilt), -std::cos(scenario.gravity.tilt), 0};
  Walls walls(log, scenario);
  std::vector<Raw> grains, fluids;
  for (std::uint64_t step = range.first; step <= range.last; step += range.stride) {
    const auto frame = log.frame(step);
    if (!frame) {
      ++scene.steps_without_state;
      continue;
    }
    ViewState state;
    state.step = step;
    state.time = frame->time;
    walls.at(step, state.left, state.width);
    const std::vector<double> velocity = reals(schema, *frame, "grains.velocity");
    grains.push_back(
        thinned(reals(schema, *frame, "grains.position"), velocity, scene.dimension, 1));
    for (std::size_t k = 0; k < velocity.size(); ++k)
      state.settling_speed += velocity[k] * down[k % scene.dimension];
    if (!velocity.empty())
      state.settling_speed /= static_cast<double>(velocity.size() / scene.dimension);
    for (const double id : reals(schema, *frame, "grains.id"))
      state.id.push_back(static_cast<std::uint32_t>(static_cast<std::uint64_t>(id)));
    for (const double species : reals(schema, *frame, "grains.species"))
      state.species.push_back(static_cast<std::uint8_t>(species));
    const std::vector<double> fluid = reals(schema, *frame, "fluid.position");
    const std::size_t count = fluid.size() / scene.dimension;
    if (fluid_max > 0 && count > 0) {
      scene.fluid_shown_one_in =
          std::max(scene.fluid_shown_one_in, (count + fluid_max - 1) / fluid_max);
      fluids.push_back(thinned(fluid, reals(schema, *frame, "fluid.velocity"), scene.dimension,
                               scene.fluid_shown_one_in));
    } else {
      fluids.emplace_back();
    }
    grow(scene, grains.back());
    grow(scene, fluids.back());
    scene.states.push_back(std::move(state));
  }
  if (scene.states.empty())
    throw UsageError(fmt::format("{}: no state is stored in steps {} to {}; expected a range that "
                                 "holds some", log.path(), range.first, range.last));
  scene.grain_speed = fastest_of(grains);
  scene.fluid_speed = fastest_of(fluids);
  for (std::size_t k = 0; k < scene.states.size(); ++k) {
    scene.states[k].grains = counted(grains[k], scene, scene.grain_speed);
    scene.states[k].fluid = counted(fluids[k], scene, scene.fluid_speed);
  }
  return scene;
}

}  // namespace varve::tools
