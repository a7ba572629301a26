#include "core/geometry_change.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/criteria.h"
#include "core/initial.h"
#include "core/math.h"
#include "core/units.h"
#include "core/walls.h"

namespace varve::core {
namespace {

template <int D>
using DoubleState = State<D, DoublePrecision>;

constexpr double tolerated_overlap = 0.01;  // of a diameter

/// A change under way: the scene before and after, and how far each wall moves outward [m].
template <int D>
struct Move {
  const Scenario& before;
  Scenario after;
  double left_outward, right_outward;
  std::vector<GrainSpecies> species = species_of(before);

  double diameter(std::uint32_t of_species) const { return species[of_species].diameter; }
  Box<D> old_box() const { return domain_box<D>(before); }
  Box<D> new_box() const { return domain_box<D>(after); }
  bool closed() const { return !has_free_surface(before); }
  bool full_pressure() const { return before.fluid.pressure == PressureForm::full; }
  bool moves(std::uint64_t wall) const {
    return (wall == wall_left && left_outward != 0) || (wall == wall_right && right_outward != 0);
  }
  /// [m] How far x lies beyond a new wall; negative inside, -infinity if neither wall moves.
  double beyond(double x) const {
    double most = -std::numeric_limits<double>::infinity();
    if (left_outward != 0) most = std::max(most, new_box().lower[0] - x);
    if (right_outward != 0) most = std::max(most, x - new_box().upper[0]);
    return most;
  }
  bool is_left_half(double x) const {
    if (left_outward == 0) return false;
    if (right_outward == 0) return true;
    return x < 0.5 * (new_box().lower[0] + new_box().upper[0]);
  }
  /// x on the inner side of the nearer moved wall, `depth` from it.
  double inside(double x, double depth) const {
    return is_left_half(x) ? new_box().lower[0] + depth : new_box().upper[0] - depth;
  }
};

std::string id_list(const std::vector<std::uint64_t>& ids) {
  constexpr std::size_t shown_max = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(ids.size(), shown_max); ++i)
    text += (i ? ", " : "") + std::to_string(ids[i]);
  if (ids.size() > shown_max) text += " and " + std::to_string(ids.size() - shown_max) + " more";
  return text;
}

/// Written out, since the order of a sum is part of the contract.
template <int D>
double squared(const Vec<double, D>& v) {
  double sum = 0;
  for (int k = 0; k < D; ++k) sum += v[k] * v[k];
  return sum;
}

/// A point of D coordinates from three.
template <int D>
Vec<double, D> point(double x, double y, double z) {
  if constexpr (D == 2) return {x, y};
  if constexpr (D == 3) return {x, y, z};
}

/// Lines of the fluid's lattice along z: one in 2D.
template <int D>
std::int64_t lattice_layers(const Scenario& scenario) {
  return D == 2 ? 1 : nearest_integer(scenario.domain.depth / scenario.fluid.spacing);
}

bool contains(const std::vector<std::uint64_t>& sorted, std::uint64_t id) {
  return std::binary_search(sorted.begin(), sorted.end(), id);
}

// ---- grains ----

/// Indices of grains that reach more than the tolerated overlap beyond a moved wall.
template <int D>
std::vector<std::size_t> grains_outside(const Move<D>& move, const DoubleState<D>& state) {
  std::vector<std::size_t> outside;
  for (std::size_t i = 0; i < state.grains.size(); ++i) {
    const double d = move.diameter(state.grains.species[i]);
    if (move.beyond(state.grains.position[i][0]) + 0.5 * d > tolerated_overlap * d)
      outside.push_back(i);
  }
  return outside;
}

/// "...; the narrowest width that holds all grains is W m", where there is one between new and old.
template <int D>
std::string narrowest_advice(const Move<D>& move, const DoubleState<D>& state) {
  double reach = 0;  // [m] that the walls have to stay further out
  for (std::size_t i = 0; i < state.grains.size(); ++i)
    reach = std::max(reach, move.beyond(state.grains.position[i][0]) +
                                (0.5 - tolerated_overlap) * move.diameter(state.grains.species[i]));
  const double dx = move.before.has_fluid() ? move.before.fluid.spacing : reach;
  const double back = std::ceil(reach / dx - 1e-9) * dx;
  const double walls = move.left_outward != 0 && move.right_outward != 0 ? 2 : 1;
  const double width = move.after.domain.width + walls * back;
  if (width >= move.before.domain.width - 1e-9 * dx) return "";
  return "; the narrowest width that holds all grains is " + rough_number(width) + " m";
}

template <int D>
void check_pushed(const Move<D>& move, const DoubleState<D>& state,
                  const std::vector<std::size_t>& pushed) {
  const Box<D> box = move.new_box();
  for (const std::size_t i : pushed)
    for (std::size_t j = 0; j < state.grains.size(); ++j) {
      if (j == i) continue;
      const Vec<double, D> apart =
          box.separation(state.grains.position[i], state.grains.position[j]);
      const double d_i = move.diameter(state.grains.species[i]);
      const double d_j = move.diameter(state.grains.species[j]), d = std::min(d_i, d_j);
      const double overlap = 0.5 * (d_i + d_j) - std::sqrt(squared<D>(apart));
      if (overlap > tolerated_overlap * d)
        throw ModelError("domain.width: pushed inside the new wall, grain " +
                         std::to_string(state.grains.id[i]) + " would overlap grain " +
                         std::to_string(state.grains.id[j]) + " by " +
                         rough_number(100 * overlap / d) +
                         " % of a diameter; expected at most 1 %" +
                         narrowest_advice(move, state));
    }
}

template <class T>
void erase_marked(std::vector<T>& values, const std::vector<bool>& marked) {
  if (values.empty()) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!marked[i]) values[kept++] = values[i];
  values.resize(kept);
}

template <int D>
void settle_grains(const Move<D>& move, OutsideMode mode, DoubleState<D>& state,
                   GeometryReport& report) {
  const std::vector<std::size_t> outside = grains_outside(move, state);
  if (outside.empty()) return;
  std::vector<std::uint64_t> ids;
  for (const std::size_t i : outside) ids.push_back(state.grains.id[i]);
  if (mode == OutsideMode::error)
    throw ModelError("domain.width: " + number_text(move.after.domain.width) + " m leaves " +
                     std::to_string(ids.size()) + (ids.size() == 1 ? " grain" : " grains") +
                     " outside the new walls (id " + id_list(ids) +
                     "); push or remove what is outside" + narrowest_advice(move, state));
  auto& grains = state.grains;
  if (mode == OutsideMode::push) {
    for (const std::size_t i : outside)
      grains.position[i][0] =
          move.inside(grains.position[i][0], 0.5 * move.diameter(grains.species[i]));
    check_pushed(move, state, outside);
    report.grains_pushed = std::move(ids);
    return;
  }
  std::vector<bool> marked(grains.size(), false);
  for (const std::size_t i : outside) marked[i] = true;
  erase_marked(grains.species, marked);
  erase_marked(grains.position, marked);
  erase_marked(grains.velocity, marked);
  erase_marked(grains.spin, marked);
  erase_marked(grains.driven, marked);
  erase_marked(grains.id, marked);
  report.grains_removed = std::move(ids);
}

template <int D>
void prune_contacts(const Move<D>& move, DoubleState<D>& state, GeometryReport& report) {
  auto& contacts = state.contacts;
  std::vector<bool> marked(contacts.size(), false);
  const auto touched = [&](std::uint64_t id) {
    return contains(report.grains_pushed, id) || contains(report.grains_removed, id);
  };
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const ContactKey& key = contacts.key[c];
    const bool gone = key.kind == 0 ? touched(key.partner) : move.moves(key.partner);
    marked[c] = gone || touched(key.grain);
    report.contacts_removed += marked[c] ? 1 : 0;
  }
  erase_marked(contacts.spring, marked);
  erase_marked(contacts.rolling, marked);
  erase_marked(contacts.key, marked);
}

// ---- fluid ----

template <int D>
double total_mass(const DoubleState<D>& state) {
  double sum = 0;
  for (const double m : state.fluid.mass) sum += m;
  return sum;
}

/// Fluid that stays keeps volume m / rhob and pressure, a function of rhob / eps: both follow eps.
template <int D>
void follow_porosity(DoubleState<D>& state, const std::vector<double>& eps_before,
                     const std::vector<double>& eps_after) {
  for (std::size_t a = 0; a < eps_before.size(); ++a) {
    if (eps_after[a] == eps_before[a]) continue;
    const double ratio = eps_after[a] / eps_before[a];
    state.fluid.mass[a] *= ratio;
    state.fluid.superficial_density[a] *= ratio;
  }
}

/// [m3, m2 in 2D] Room for fluid in a full box: the sum of eps dx^D over a lattice of fluid at
/// rest. Of each grain it counts as much as the fluid there will feel of it.
template <int D>
double room_for_fluid(const Scenario& scenario, const DoubleState<D>& with_grains) {
  const double dx = scenario.fluid.spacing;
  const Box<D> box = domain_box<D>(scenario);
  DoubleState<D> lattice;
  lattice.grains = with_grains.grains;
  const std::int64_t columns = nearest_integer(box.length(0) / dx);
  const std::int64_t rows = nearest_integer(box.length(1) / dx);
  const auto at = [dx](std::int64_t k) { return (static_cast<double>(k) + 0.5) * dx; };
  for (std::int64_t j = 0; j < rows; ++j)
    for (std::int64_t k = 0; k < lattice_layers<D>(scenario); ++k)
      for (std::int64_t i = 0; i < columns; ++i)
        lattice.fluid.position.push_back(box.lower + point<D>(at(i), at(j), at(k)));
  const std::size_t count = lattice.fluid.position.size();
  lattice.fluid.id.resize(count);
  lattice.fluid.velocity.assign(count, Vec<double, D>::Zero());
  lattice.fluid.mass.assign(count, integer_power<D>(dx));
  lattice.fluid.superficial_density.assign(count, 1.0);
  double sum = 0;
  for (const double eps : floored_porosity<D>(scenario, lattice)) sum += eps;
  for (int k = 0; k < D; ++k) sum *= dx;
  return sum;
}

/// [m] Height of the fluid beside a side wall: the volume in a strip of four spacings, per width.
template <int D>
double surface_beside(const Move<D>& move, const DoubleState<D>& state, bool left) {
  const Box<D> box = move.old_box();
  const double strip = std::min(4 * move.before.fluid.spacing, box.length(0));
  double volume = 0;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const double x = state.fluid.position[a][0];
    if (left ? x < box.lower[0] + strip : x >= box.upper[0] - strip)
      volume += state.fluid.mass[a] / state.fluid.superficial_density[a];
  }
  const double area = D == 2 ? strip : strip * box.length(D - 1);
  return std::min(volume / area, box.length(1));
}

/// [kg/m3] Mean of rho - rho0 (- the hydrostatic part) over the fluid's volume.
template <int D>
double mean_excess_density(const Move<D>& move, const DoubleState<D>& state,
                           const std::vector<double>& eps, double surface) {
  double sum = 0, volume = 0;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const double rhob = state.fluid.superficial_density[a];
    double excess = rhob / eps[a] - move.before.fluid.density;
    if (move.full_pressure())
      excess -= hydrostatic_excess_density<D>(move.before, state.fluid.position[a], surface);
    const double v = state.fluid.mass[a] / rhob;
    sum += v * excess;
    volume += v;
  }
  return volume > 0 ? sum / volume : 0;
}

/// New columns on one side.
struct Columns {
  bool left;
  std::int64_t columns, rows;
  double surface;  // [m]
};

template <int D>
void append_particle(const Move<D>& move, const Vec<double, D>& x, double excess_density,
                     std::uint64_t id, DoubleState<D>& state) {
  const Fluid& f = move.before.fluid;
  state.fluid.id.push_back(id);
  state.fluid.position.push_back(x);
  state.fluid.velocity.push_back(Vec<double, D>::Zero());
  // Without eps yet, which does not enter m / rhob.
  state.fluid.mass.push_back(f.density * integer_power<D>(f.spacing));
  state.fluid.superficial_density.push_back(f.density + excess_density);
}

/// Ids are never given twice, also not that of a particle which was removed: those of one step
/// start at its number times 2^24, beyond what any step before it gave out.
template <int D>
std::uint64_t first_new_id(const DoubleState<D>& state) {
  const std::uint64_t next = state.fluid.size() > 0 ? state.fluid.id.back() + 1 : 0;
  constexpr std::uint64_t ids_per_step = std::uint64_t{1} << 24, steps_max = std::uint64_t{1} << 39;
  const std::uint64_t step = state.clock.step;
  return step < steps_max ? std::max(next, step * ids_per_step) : next;
}

template <int D>
void append_columns(const Move<D>& move, const std::vector<Columns>& sides, double mean_excess,
                    DoubleState<D>& state) {
  const double dx = move.before.fluid.spacing;
  const Box<D> box = move.old_box();
  std::uint64_t id = first_new_id<D>(state);
  std::int64_t rows = 0;
  const auto at = [dx](std::int64_t k) { return (static_cast<double>(k) + 0.5) * dx; };
  for (const Columns& side : sides) rows = std::max(rows, side.rows);
  for (std::int64_t j = 0; j < rows; ++j)
    for (const Columns& side : sides) {
      if (j >= side.rows) continue;
      // From left to right: on the left side the outermost column first.
      for (std::int64_t n = 0; n < side.columns * lattice_layers<D>(move.before); ++n) {
        const std::int64_t k = n % side.columns, layer = n / side.columns;
        const double away = at(side.left ? side.columns - 1 - k : k);
        const auto x = point<D>(side.left ? box.lower[0] - away : box.upper[0] + away,
                                box.lower[1] + at(j), at(layer));
        double excess = mean_excess;
        if (move.full_pressure())
          excess += hydrostatic_excess_density<D>(move.before, x, side.surface);
        append_particle(move, x, excess, id++, state);
      }
    }
}

template <int D>
void widen_fluid(const Move<D>& move, DoubleState<D>& state, GeometryReport& report) {
  const double dx = move.before.fluid.spacing;
  const std::size_t old_count = state.fluid.size();
  const std::vector<double> eps_before = floored_porosity<D>(move.before, state);
  const double height = move.before.domain.height;
  std::vector<Columns> sides;
  for (const bool left : {true, false}) {
    const double outward = left ? move.left_outward : move.right_outward;
    if (outward <= 0) continue;
    const double surface = move.closed() ? height : surface_beside(move, state, left);
    sides.push_back({left, nearest_integer(outward / dx), nearest_integer(surface / dx), surface});
  }
  const double mean =
      move.closed() ? mean_excess_density(move, state, eps_before, height) : 0.0;
  append_columns(move, sides, mean, state);
  const std::vector<double> eps_after = floored_porosity<D>(move.after, state);
  follow_porosity(state, eps_before, eps_after);
  for (std::size_t a = old_count; a < state.fluid.size(); ++a) {
    state.fluid.mass[a] *= eps_after[a];
    state.fluid.superficial_density[a] *= eps_after[a];
  }
  report.fluid_added = state.fluid.size() - old_count;
}

/// Distance [m] to the nearest other fluid particle if `a` lay at x.
template <int D>
double clearance(const DoubleState<D>& state, std::size_t a, const Vec<double, D>& x,
                 const Box<D>& box) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < state.fluid.size(); ++b) {
    if (b == a) continue;
    const Vec<double, D> apart = box.separation(x, state.fluid.position[b]);
    nearest = std::min(nearest, squared<D>(apart));
  }
  return std::sqrt(nearest);
}

/// Draws fluid that is still outside to dx/2 inside. It may fall onto a particle of the outermost
/// column, and two at one point would never part: it then goes half a spacing up or down, in 3D
/// also forward or back, and where
/// that is taken too half a spacing further in.
template <int D>
std::uint64_t pull_inside(const Move<D>& move, DoubleState<D>& state) {
  struct Site {
    double depth, up, along;  // in spacings
  };
  constexpr Site sites[] = {{0.5, 0, 0},  {0.5, 0.5, 0}, {0.5, -0.5, 0}, {0.5, 0, 0.5},
                            {0.5, 0, -0.5}, {1, 0, 0},   {1, 0.5, 0},    {1, -0.5, 0},
                            {1, 0, 0.5},  {1, 0, -0.5}};
  constexpr double enough = 0.49;
  const double dx = move.before.fluid.spacing;
  const Box<D> box = move.new_box();
  std::uint64_t pulled = 0;
  for (std::size_t a = 0; a < state.fluid.size(); ++a) {
    const Vec<double, D> x = state.fluid.position[a];
    if (move.beyond(x[0]) <= 0) continue;
    ++pulled;
    double widest = -1;
    for (const Site& site : sites) {
      if (D == 2 && site.along != 0) continue;
      Vec<double, D> place = x;
      place[0] = move.inside(x[0], site.depth * dx);
      place[1] += site.up * dx;
      if constexpr (D == 3) place[2] += site.along * dx;
      bool leaves = false;
      for (int k = 1; k < D; ++k)
        leaves = leaves || place[k] < box.lower[k] || place[k] >= box.upper[k];
      if ((site.up != 0 || site.along != 0) && leaves) continue;
      const double free = clearance(state, a, place, box);
      if (free <= widest) continue;
      state.fluid.position[a] = place;
      widest = free;
      if (free >= enough * dx) break;
    }
  }
  return pulled;
}

/// The fluid without the first `count` of `order`, the rest drawn inside and its masses adjusted.
template <int D>
struct Narrowed {
  DoubleState<D> state;
  std::uint64_t removed = 0, pulled = 0;
  double mass = 0;
};
template <int D>
Narrowed<D> narrowed(const Move<D>& move, const DoubleState<D>& state,
                     const std::vector<double>& eps_before,
                     const std::vector<std::size_t>& order, std::size_t count) {
  Narrowed<D> result{state, count, 0, 0};
  std::vector<bool> marked(state.fluid.size(), false);
  for (std::size_t k = 0; k < count; ++k) marked[order[k]] = true;
  auto& fluid = result.state.fluid;
  erase_marked(fluid.mass, marked);
  erase_marked(fluid.position, marked);
  erase_marked(fluid.velocity, marked);
  erase_marked(fluid.superficial_density, marked);
  erase_marked(fluid.id, marked);
  std::vector<double> eps = eps_before;
  erase_marked(eps, marked);
  result.pulled = pull_inside(move, result.state);
  follow_porosity(result.state, eps, floored_porosity<D>(move.after, result.state));
  result.mass = total_mass(result.state);
  return result;
}

/// `room_lost` [m3, m2 in 2D]: swept volume less the volume of grains in it, by which the fluid
/// gets less.
template <int D>
void narrow_fluid(const Move<D>& move, const std::vector<double>& eps_before, double room_lost,
                  DoubleState<D>& state, GeometryReport& report) {
  const Fluid& f = move.before.fluid;
  double particle = f.density;
  for (int k = 0; k < D; ++k) particle *= f.spacing;
  std::vector<double> beyond(state.fluid.size());
  std::vector<std::size_t> order(state.fluid.size());
  std::size_t outside = 0;
  for (std::size_t a = 0; a < order.size(); ++a) {
    order[a] = a;
    beyond[a] = move.beyond(state.fluid.position[a][0]);
    outside += beyond[a] > 0 ? 1 : 0;
  }
  // Ids ascend with the index, so a stable sort leaves ties in the order of ids.
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return beyond[a] > beyond[b]; });
  std::size_t count = outside;
  Narrowed<D> best = narrowed(move, state, eps_before, order, count);
  if (move.closed()) {
    const double target = total_mass(state) - f.density * room_lost;
    // Masses adjust to what is removed, so the number is found by correction; a few rounds do.
    for (int round = 0; round < 20; ++round) {
      const double off = best.mass - target;
      if (std::abs(off) <= 0.5 * particle) break;
      const std::int64_t step =
          std::max<std::int64_t>(1, nearest_integer(std::abs(off) / particle));
      const std::int64_t next = static_cast<std::int64_t>(best.removed) + (off > 0 ? step : -step);
      if (next < 0 || next > static_cast<std::int64_t>(order.size())) break;
      Narrowed<D> tried =
          narrowed(move, state, eps_before, order, static_cast<std::size_t>(next));
      if (std::abs(tried.mass - target) >= std::abs(off)) break;
      best = std::move(tried);
    }
  }
  if (best.state.fluid.size() == 0)
    throw ModelError("domain.width: " + number_text(move.after.domain.width) +
                     " m leaves no fluid particle");
  report.fluid_removed = best.removed;
  report.fluid_pulled = best.pulled;
  state.fluid = std::move(best.state.fluid);
}

/// Masses before and after as stored, by ascending id.
template <int D, class P>
void balance(const State<D, P>& before, const State<D, P>& after, GeometryReport& report) {
  std::size_t b = 0;
  double gone = 0, come = 0;
  for (std::size_t a = 0; a < before.fluid.size(); ++a) {
    const double mass = static_cast<double>(before.fluid.mass[a]);
    report.mass_before += mass;
    if (b < after.fluid.size() && after.fluid.id[b] == before.fluid.id[a])
      report.mass_adjusted += static_cast<double>(after.fluid.mass[b++]) - mass;
    else
      gone += mass;
  }
  for (; b < after.fluid.size(); ++b) come += static_cast<double>(after.fluid.mass[b]);
  for (const auto m : after.fluid.mass) report.mass_after += static_cast<double>(m);
  const bool wider = report.fluid_added > 0;
  report.mass_added = come + (wider ? report.mass_adjusted : 0);
  report.mass_removed = gone - (wider ? 0 : report.mass_adjusted);
}

}  // namespace

SideWalls moved_side_walls(const Scenario& before, double new_width, int anchor) {
  const double old_width = before.domain.width, change = new_width - old_width;
  const double shares = anchor == 0 ? 2 : 1;
  if (change == 0) return {before.domain.left, old_width};
  if (!is_wall(before.domain.sides))
    throw ModelError("domain.width: the sides are periodic; only walls can move");
  if (!(new_width > 0) || !std::isfinite(new_width))
    throw ModelError("domain.width: " + number_text(new_width) + " m; expected a length > 0");
  if (before.has_grains() && new_width < largest_diameter(before))
    throw ModelError("domain.width: " + number_text(new_width) +
                     " m is narrower than a grain; expected at least " +
                     number_text(largest_diameter(before)) + " m");
  double outward = change / shares;
  if (before.has_fluid()) {
    const double dx = before.fluid.spacing, jumps = outward / dx;
    const std::int64_t whole = nearest_integer(jumps);
    if (std::abs(jumps - static_cast<double>(whole)) > 1e-6) {
      const double low = std::floor(jumps);
      throw ModelError("domain.width: " + number_text(new_width) + " m moves each wall by " +
                       rough_number(outward) + " m, not a multiple of fluid.spacing " +
                       number_text(dx) + " m; nearest: " +
                       rough_number(old_width + shares * low * dx) + " m or " +
                       rough_number(old_width + shares * (low + 1) * dx) + " m");
    }
    outward = static_cast<double>(whole) * dx;
  }
  return {anchor < 0 ? before.domain.left : before.domain.left - outward, new_width};
}

template <int D, class P>
GeometryReport change_width(const Scenario& before, double new_width, const ChangeOptions& options,
                            State<D, P>& state) {
  GeometryReport report;
  report.walls = moved_side_walls(before, new_width, options.anchor);
  Move<D> move{before, before, 0, 0};
  move.after.domain.left = report.walls.left;
  move.after.domain.width = report.walls.width;
  const double outward = (new_width - before.domain.width) / (options.anchor == 0 ? 2 : 1);
  if (options.anchor >= 0) move.left_outward = outward;
  if (options.anchor <= 0) move.right_outward = outward;

  DoubleState<D> changed = converted<D, DoublePrecision>(state);
  std::vector<double> eps_before;
  double room_before = 0;
  if (outward < 0) {
    if (before.has_fluid()) {
      eps_before = floored_porosity<D>(before, changed);
      room_before = room_for_fluid(before, changed);
    }
    settle_grains(move, options.outside, changed, report);
  }
  if (outward != 0) prune_contacts(move, changed, report);
  if (before.has_fluid() && outward > 0) widen_fluid(move, changed, report);
  if (before.has_fluid() && outward < 0)
    narrow_fluid(move, eps_before, room_before - room_for_fluid(move.after, changed), changed,
                 report);

  State<D, P> result = converted<D, P>(changed);
  balance(state, result, report);
  state = std::move(result);
  return report;
}

#define VARVE_INSTANTIATE(D, P)                                                  \
  template GeometryReport change_width<D, P>(const Scenario&, double, const ChangeOptions&, \
                                             State<D, P>&);
VARVE_INSTANTIATE(2, DoublePrecision)
VARVE_INSTANTIATE(2, FloatPrecision)
VARVE_INSTANTIATE(2, MixedPrecision)
VARVE_INSTANTIATE(3, DoublePrecision)
VARVE_INSTANTIATE(3, FloatPrecision)
VARVE_INSTANTIATE(3, MixedPrecision)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
