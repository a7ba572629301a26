// Moving the side walls of a running scene: the rules of a changed width. Both walls move by half
// the change unless one is anchored; coordinates never shift.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scenario.h"
#include "core/simulation.h"
#include "core/state.h"

namespace varve::core {

struct SideWalls {
  double left = 0;   ///< [m] domain.left
  double width = 0;  ///< [m] domain.width
};

/// Where the side walls stand after a change of width; these are the values for the new scenario.
/// `anchor` -1: the left wall stays, +1: the right one, 0: both move by half the change. With
/// fluid, each wall moves by a whole number of spacings. Throws ModelError, naming the nearest
/// legal widths, if it would not, if the sides are periodic, or if nothing would be left.
SideWalls moved_side_walls(const Scenario& before, double new_width, int anchor);

/// What a change of width did. Masses in kg (kg per m depth in 2D), summed in ascending id.
struct GeometryReport {
  SideWalls walls;
  std::uint64_t fluid_added = 0, fluid_removed = 0;  ///< particles
  double mass_before = 0, mass_after = 0;            ///< of all fluid
  /// Mass that came or went, with `mass_adjusted` in it: before + added - removed = after.
  double mass_added = 0, mass_removed = 0;
  /// Change of the mass of fluid that stayed: where a wall comes near a grain or leaves it, more or
  /// less of the grain's volume falls to that fluid.
  double mass_adjusted = 0;
  std::uint64_t fluid_pulled = 0;  ///< particles drawn back inside a wall
  std::vector<std::uint64_t> grains_pushed, grains_removed;  ///< ids, ascending
  std::uint64_t contacts_removed = 0;
};

/// Changes the width of `state`, which belongs to `before`.
///
/// Wider: columns of new fluid at old wall +- (k + 1/2) dx, at rest, from the bottom to the top
/// (under a free surface: to the surface beside the wall), m = eps rho0 dx^D with eps from the
/// grains; excess pressure = the fluid's mean, with full pressure on top of the hydrostatic one,
/// and just hydrostatic below a free surface. Ids start at the step's number times 2^24 (or after
/// the highest present one), so that none is ever given twice, row by row from the bottom, each row
/// from the left.
///
/// Narrower: a grain that reaches more than 1 % d beyond a new wall is outside. `error` throws;
/// `push` sets it against the wall, its velocity kept, and throws if it then overlaps another grain
/// by more than 1 % d; `remove` deletes it. The fluid's mass becomes old - rho0 (swept volume -
/// volume of grains swept) to half a particle, the grains' volume as the porosity counts it:
/// outermost particles go first, ties by id; what is left outside is drawn to dx/2 inside. Under a
/// free surface all fluid outside goes, and none is drawn.
///
/// Both: fluid that stays keeps velocity, volume and pressure; where the change gives it another
/// porosity, m and rhob follow it. Contacts with a moved wall and those of pushed or removed grains
/// are deleted.
///
/// Throws ModelError; `state` is then unchanged.
template <int D, class P>
GeometryReport change_width(const Scenario& before, double new_width, const ChangeOptions& options,
                            State<D, P>& state);

}  // namespace varve::core
