// What a page shows of a run: some of its states, positions and speeds in few bytes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/scenario.h"
#include "io/log_reader.h"
#include "tools/steps.h"

namespace varve::tools {

/// Particles of one kind in one state. Positions are in 65,535ths of ViewScene's box, speeds in
/// 255ths of its fastest: a pixel needs no more.
struct ViewCloud {
  std::vector<std::uint16_t> place;  ///< particle-major, dimension components
  std::vector<std::uint8_t> speed;
};

struct ViewState {
  std::uint64_t step = 0;
  double time = 0;               ///< [s]
  double left = 0, width = 0;    ///< [m] between the side walls
  double settling_speed = 0;     ///< [m/s] mean velocity of the grains along gravity
  ViewCloud grains, fluid;
  std::vector<std::uint32_t> id;      ///< of the grains, modulo 2^32
  std::vector<std::uint8_t> species;  ///< of the grains: index into `radii`
};

struct ViewScene {
  std::string name, title;
  std::vector<std::pair<std::string, std::string>> facts;  ///< what a caption says
  std::size_t dimension = 2;
  bool pipe = false, open_top = false;
  double height = 0;                           ///< [m] of the domain
  std::array<double, 3> lower{}, upper{};      ///< [m] the box in which places are counted
  double grain_speed = 0, fluid_speed = 0;     ///< [m/s] the fastest of all states
  std::vector<double> radii;                   ///< [m] per species, of the grains
  double spacing = 0;                          ///< [m] of the fluid's particles
  std::vector<ViewState> states;
  std::uint64_t steps_without_state = 0;       ///< of those asked for
  std::size_t fluid_shown_one_in = 1;
};

/// Reads the states of `range` that are stored; of the fluid at most `fluid_max` particles each (in
/// steps of equal ids; 0: none). UsageError where none is stored.
ViewScene view_scene(const io::LogReader& log, const core::Scenario& scenario,
                     const StepRange& range, std::size_t fluid_max);

}  // namespace varve::tools
