// Where the grains lie and how they move at the start: arrays, random packings, lists.
//
//   square     rows x columns (x layers), pitch d (1 + gap)
//   hexagonal  the densest: every second row is shifted by half a pitch, rows are sqrt(3)/2 of it
//              apart; in 3D planes of such rows, sqrt(2/3) of a pitch above each other, in the
//              hollows of the one below
//   random     `count` grains without overlap between grains.from_y and to_y, gap kept
//   list       as a file says
//
// d is the largest diameter. Arrays are centred at grains.centre_x and centre_z, their lowest row
// is at grains.lowest_y, ids row by row from the bottom, layer by layer within a row.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/scenario.h"

namespace varve::core {

/// All grains of a resolved scenario in ascending id, jittered, not yet wrapped into the domain.
/// Throws ModelError if a packing does not fit.
std::vector<ListedGrain> placed_grains(const Scenario& resolved);

/// [m] Extent of an array along x, y, z between the centres of its outermost grains.
std::array<double, 3> array_extent(const Scenario& scenario);
/// [m] Distance between the centres of neighbouring rows.
double row_pitch(const Scenario& scenario);

/// What is wrong with line `line` of a list.
struct ListProblem {
  int line = 0;
  std::string text;
};
/// Reads a list: comma-separated values, the first line names the columns: x, y, in 3D z, and any
/// of species (name or number), vx, vy, vz, wx, wy, wz (spin). Lines that are empty or start with
/// '#' are skipped. SI. `scenario` has the species and the dimension.
std::variant<std::vector<ListedGrain>, std::vector<ListProblem>> read_grain_list(
    std::string_view text, const Scenario& scenario);

/// Why the grains of a resolved scenario can't lie where they are, "" if they can: the first that
/// reaches more than 1 % of a diameter beyond a wall, or overlaps another by as much.
std::string misplaced_grain(const Scenario& resolved, const std::vector<ListedGrain>& grains);

}  // namespace varve::core
