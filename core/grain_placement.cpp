#include "core/grain_placement.h"

#include <algorithm>
#include <cmath>

#include "core/criteria.h"
#include "core/math.h"
#include "core/neighbors.h"
#include "core/random.h"
#include "core/simulation.h"
#include "core/state.h"
#include "core/units.h"
#include "core/walls.h"
#include "core/workers.h"

namespace varve::core {
namespace {

// Draws of one id are told apart by number; the fluid's are below these.
constexpr std::uint64_t jitter_draw = 16, packing_draw = 48;
constexpr double tolerated_overlap = 0.01;  // of a diameter

struct Site {
  double x, y, z;
};

bool is_flat(const Scenario& s) { return s.domain.dimension == 2; }

/// Site of an array relative to its lower left front corner.
Site array_site(const Scenario& s, std::int64_t row, std::int64_t layer, std::int64_t column) {
  const double pitch = grain_pitch(s);
  const auto r = static_cast<double>(row), l = static_cast<double>(layer),
             c = static_cast<double>(column);
  if (s.grains.arrangement == Arrangement::square) return {pitch * c, pitch * r, pitch * l};
  const double odd_row = static_cast<double>(row % 2), odd_layer = static_cast<double>(layer % 2);
  const double height = row_pitch(s);
  if (is_flat(s)) return {pitch * (c + 0.5 * odd_row), height * r, 0};
  const double side = std::sqrt(3.0) * pitch;
  return {pitch * (c + 0.5 * (odd_layer + odd_row)), height * r,
          0.5 * side * l + side / 6 * odd_row};
}

std::vector<ListedGrain> placed_array(const Scenario& s) {
  const Grains& g = s.grains;
  const std::array<double, 3> extent = array_extent(s);
  const double first_x = g.centre_x - 0.5 * extent[0];
  const double first_z = is_flat(s) ? 0.0 : g.centre_z - 0.5 * extent[2];
  std::vector<ListedGrain> grains;
  for (std::int64_t row = 0; row < g.rows; ++row)
    for (std::int64_t layer = 0; layer < g.layers; ++layer)
      for (std::int64_t column = 0; column < g.columns; ++column) {
        const Site site = array_site(s, row, layer, column);
        ListedGrain grain;
        grain.position[0] = first_x + site.x;
        grain.position[1] = g.lowest_y + site.y;
        grain.position[2] = first_z + site.z;
        grains.push_back(grain);
      }
  const double amplitude = g.jitter * largest_diameter(s);
  if (amplitude == 0) return grains;
  for (std::uint64_t id = 0; id < grains.size(); ++id)
    for (int k = 0; k < (is_flat(s) ? 2 : 3); ++k)
      grains[id].position[k] +=
          amplitude * symmetric(static_cast<std::uint64_t>(g.seed), id,
                                jitter_draw + static_cast<std::uint64_t>(k));
  return grains;
}

/// Places grains at random, small at first, and lets them grow while overlaps are pushed apart,
/// pair by pair in the order of ids. Ends in a state without overlap, or gives up.
template <int D>
class Packing {
 public:
  explicit Packing(const Scenario& s) : s_(s), walls_(domain_walls(s)) {
    const Box<D> box = domain_box<D>(s);
    low_ = box.lower;
    high_ = box.upper;
    low_[1] = std::max(low_[1], s.grains.from_y);
    high_[1] = std::min(high_[1], s.grains.to_y);
    for (int k = 0; k < D; ++k) {
      if (!box.periodic[static_cast<std::size_t>(k)]) continue;
      if (k == 1 && (low_[1] > box.lower[1] || high_[1] < box.upper[1])) continue;
      period_.origin[k] = box.lower[k];
      period_.length[k] = box.length(k);
    }
    const std::vector<GrainSpecies> species = species_of(s);
    for (std::int64_t i = 0; i < s.grains.count; ++i)
      radius_.push_back(
          0.5 * species[species_at_start(s, static_cast<std::uint64_t>(i))].diameter *
          (1 + s.grains.gap));
  }

  /// Positions; throws ModelError if the grains do not fit.
  std::vector<Vec<double, D>> run() {
    scatter();
    // The rounds in which they grow to a size a little above their own, which leaves no overlap,
    // and those in which what is left may still find room.
    constexpr int growing = 200, settling = 4000;
    constexpr double margin = 1 + 1e-5;
    double worst = 0;
    for (int round = 0; round < growing + settling; ++round) {
      const double size = std::min(1.0, 0.3 + 0.7 * (round + 1) / growing) * margin;
      if (round % 8 == 0) list(size);
      worst = relax(size);
      if (round < growing || worst > 1e-5 / 4) continue;
      list(margin);
      if (relax(margin) <= 1e-5 / 2) return x_;
    }
    throw ModelError("grains.count: " + std::to_string(s_.grains.count) +
                     " grains do not fit at random between grains.from_y and grains.to_y: after " +
                     std::to_string(growing + settling) + " rounds some still overlap by " +
                     rough_number(100 * worst) +
                     " % of a diameter; fewer grains, a larger space or a smaller gap will do");
  }

 private:
  void scatter() {
    const auto seed = static_cast<std::uint64_t>(s_.grains.seed);
    for (std::uint64_t i = 0; i < radius_.size(); ++i) {
      Vec<double, D> x;
      for (int k = 0; k < D; ++k)
        x[k] = low_[k] + (high_[k] - low_[k]) *
                             uniform(seed, i, packing_draw + static_cast<std::uint64_t>(k));
      x_.push_back(x);
    }
  }

  void list(double size) {
    double most = 0;
    for (const double r : radius_) most = std::max(most, r);
    const double reach = 2 * most * size * 1.25;
    Workers alone(1);
    CellGrid<D, double> cells;
    cells.build(x_, reach, period_, alone);
    rows_ = candidates<D, double>(std::span<const Vec<double, D>>(x_), cells, reach, period_, true,
                                  alone);
  }

  Vec<double, D> apart(std::size_t i, std::size_t j) const {
    Vec<double, D> d = x_[i] - x_[j];
    for (int k = 0; k < D; ++k) {
      if (d[k] > 0.5 * period_.length[k]) d[k] -= period_.length[k];
      if (d[k] < -0.5 * period_.length[k]) d[k] += period_.length[k];
    }
    return d;
  }

  /// One round; returns the largest overlap found, over a diameter.
  double relax(double size) {
    double worst = 0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      for (const std::int32_t each : rows_.of(i)) {
        const auto j = static_cast<std::size_t>(each);
        if (j <= i) continue;
        const Vec<double, D> d = apart(i, j);
        double r2 = 0;
        for (int k = 0; k < D; ++k) r2 += d[k] * d[k];
        const double touch = size * (radius_[i] + radius_[j]);
        if (r2 >= touch * touch) continue;
        const double r = std::sqrt(r2), overlap = touch - r;
        worst = std::max(worst, overlap / (2 * std::min(radius_[i], radius_[j])));
        const Vec<double, D> n =
            r > 0 ? Vec<double, D>(d / r) : Vec<double, D>(Vec<double, D>::Unit(0));
        x_[i] += 0.5 * overlap * n;
        x_[j] -= 0.5 * overlap * n;
      }
      worst = std::max(worst, keep_inside(i, size));
    }
    return worst;
  }

  double keep_inside(std::size_t i, double size) {
    Vec<double, D>& x = x_[i];
    const double r = size * radius_[i];
    double worst = 0;
    for (int k = 0; k < D; ++k) {
      if (period_.length[k] > 0) {
        if (x[k] < low_[k]) x[k] += period_.length[k];
        if (x[k] >= high_[k]) x[k] -= period_.length[k];
        continue;
      }
      worst = std::max({worst, (low_[k] + r - x[k]) / (2 * r), (x[k] - high_[k] + r) / (2 * r)});
      x[k] = std::max(low_[k] + r, std::min(x[k], high_[k] - r));
    }
    for (const Wall& wall : walls_) {
      const double beyond = r - distance_inside<D>(wall, x);
      if (!wall.is_pipe() || beyond <= 0) continue;
      worst = std::max(worst, beyond / (2 * r));
      x += beyond * inward_normal<D>(wall, x);
    }
    return worst;
  }

  const Scenario& s_;
  std::vector<Wall> walls_;
  Vec<double, D> low_, high_;
  Periodicity<D> period_;
  std::vector<double> radius_;
  std::vector<Vec<double, D>> x_;
  Rows rows_;
};

template <int D>
std::vector<ListedGrain> packed(const Scenario& s) {
  std::vector<ListedGrain> grains;
  for (const Vec<double, D>& x : Packing<D>(s).run()) {
    grains.emplace_back();
    for (int k = 0; k < D; ++k) grains.back().position[k] = x[k];
  }
  return grains;
}

template <int D>
std::string misplaced(const Scenario& s, const std::vector<ListedGrain>& grains) {
  const std::vector<Wall> walls = domain_walls(s);
  const Box<D> box = domain_box<D>(s);
  const std::vector<GrainSpecies> species = species_of(s);
  std::vector<Vec<double, D>> points;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    Vec<double, D> x;
    for (int k = 0; k < D; ++k) x[k] = grains[i].position[k];
    x = box.wrapped(x);
    points.push_back(x);
    const double d = species[grains[i].species].diameter;
    bool far = false;
    for (int k = 0; k < D; ++k) far = far || x[k] < box.lower[k] || x[k] > box.upper[k];
    for (const Wall& wall : walls) {
      const double beyond = 0.5 * d - distance_inside<D>(wall, x);
      if (beyond > tolerated_overlap * d)
        return "grain " + std::to_string(i) + " reaches " + rough_number(beyond) +
               " m beyond wall " + std::to_string(wall.number);
    }
    if (far && s.domain.top != Boundary::free)
      return "grain " + std::to_string(i) + " lies outside the domain";
  }
  Periodicity<D> period;
  for (int k = 0; k < D; ++k)
    if (box.periodic[static_cast<std::size_t>(k)]) {
      period.origin[k] = box.lower[k];
      period.length[k] = box.length(k);
    }
  const double reach = largest_diameter(s);
  Workers alone(1);
  CellGrid<D, double> cells;
  cells.build(points, reach, period, alone);
  const Rows rows = candidates<D, double>(std::span<const Vec<double, D>>(points), cells, reach,
                                          period, true, alone);
  for (std::size_t i = 0; i < points.size(); ++i)
    for (const std::int32_t each : rows.of(i)) {
      const auto j = static_cast<std::size_t>(each);
      if (j <= i) continue;
      const Vec<double, D> apart = box.separation(points[i], points[j]);
      double r2 = 0;
      for (int k = 0; k < D; ++k) r2 += apart[k] * apart[k];
      const double a = species[grains[i].species].diameter, b = species[grains[j].species].diameter;
      const double overlap = 0.5 * (a + b) - std::sqrt(r2);
      if (overlap > tolerated_overlap * std::min(a, b))
        return "grains " + std::to_string(i) + " and " + std::to_string(j) + " overlap by " +
               rough_number(overlap) + " m";
    }
  return "";
}

}  // namespace

double row_pitch(const Scenario& s) {
  const double pitch = grain_pitch(s);
  if (s.grains.arrangement == Arrangement::square) return pitch;
  return pitch * std::sqrt(is_flat(s) ? 0.75 : 2.0 / 3.0);
}

std::array<double, 3> array_extent(const Scenario& s) {
  const Grains& g = s.grains;
  std::array<double, 3> extent{};
  // The last site of every line lies outermost, or that of the line beside it.
  for (std::int64_t row = std::max<std::int64_t>(0, g.rows - 2); row < g.rows; ++row)
    for (std::int64_t layer = std::max<std::int64_t>(0, g.layers - 2); layer < g.layers; ++layer) {
      const Site last = array_site(s, row, layer, g.columns - 1);
      extent[0] = std::max(extent[0], last.x);
      extent[1] = std::max(extent[1], last.y);
      extent[2] = std::max(extent[2], last.z);
    }
  return extent;
}

std::vector<ListedGrain> placed_grains(const Scenario& s) {
  if (s.grains.arrangement == Arrangement::list) return s.grains.list;
  const bool random = s.grains.arrangement == Arrangement::random;
  std::vector<ListedGrain> grains =
      !random ? placed_array(s) : is_flat(s) ? packed<2>(s) : packed<3>(s);
  for (std::uint64_t id = 0; id < grains.size(); ++id) {
    ListedGrain& grain = grains[id];
    grain.species = species_at_start(s, id);
    grain.velocity[0] = s.grains.velocity_x;
    grain.velocity[1] = s.grains.velocity_y;
    grain.velocity[2] = s.grains.velocity_z;
    grain.spin[0] = s.grains.spin_x;
    grain.spin[1] = s.grains.spin_y;
    grain.spin[2] = s.grains.spin_z;
  }
  return grains;
}

std::string misplaced_grain(const Scenario& s, const std::vector<ListedGrain>& grains) {
  return is_flat(s) ? misplaced<2>(s, grains) : misplaced<3>(s, grains);
}

}  // namespace varve::core
