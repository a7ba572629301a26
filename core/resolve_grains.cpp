#include "core/resolve_grains.h"

#include <algorithm>
#include <cmath>

#include "core/contact_law.h"
#include "core/criteria.h"
#include "core/grain_placement.h"
#include "core/math.h"
#include "core/simulation.h"

namespace varve::core {
namespace {

constexpr double grains_max = 1e7;
constexpr double rounding = 1e-9;

class GrainResolver {
 public:
  GrainResolver(Scenario& scenario, std::vector<Problem>& problems)
      : s_(scenario), g_(scenario.grains), problems_(problems) {}

  void run() {
    const std::size_t before = problems_.size();
    resolve_species();
    resolve_arrangement();
    if (!s_.has_grains() || problems_.size() > before) return;
    if (static_cast<double>(s_.grain_count()) > grains_max || too_many()) return;
    resolve_contact();
    if (g_.arrangement == Arrangement::list) return check_list();
    check_motion();
    if (g_.arrangement == Arrangement::random) return resolve_packing();
    resolve_array();
  }

 private:
  void problem(std::string key, std::string text) {
    problems_.push_back({std::move(key), std::move(text)});
  }
  bool flat() const { return s_.domain.dimension == 2; }

  void resolve_species() {
    for (std::size_t i = 0; i < s_.species.size(); ++i) {
      GrainSpecies& each = s_.species[i];
      const std::string section = "species." + each.name;
      if (each.name.empty() || each.name == "grains")
        problem(section, "a species needs a name other than 'grains', which is that of [grains]");
      for (const char c : each.name)
        if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
              c == '_' || c == '-')) {
          problem(section, "the name of a species may hold letters, digits, '_' and '-'");
          break;
        }
      for (std::size_t k = 0; k < i; ++k)
        if (s_.species[k].name == each.name) problem(section, "there are two species of this name");
    }
    const std::vector<GrainSpecies> all = species_of(s_);
    double shares = 0;
    for (const GrainSpecies& each : all) shares += each.share;
    if (!(shares > 0)) problem("grains.share", "the shares of all species are 0");
    std::copy(all.begin() + 1, all.end(), s_.species.begin());
  }

  void resolve_arrangement() {
    if (!g_.file.empty() && g_.arrangement == Arrangement::square && g_.rows == 0)
      g_.arrangement = Arrangement::list;
    const bool list = g_.arrangement == Arrangement::list;
    if (!list && !g_.file.empty())
      problem("grains.file",
              "a list excludes an array (rows, columns) and a random packing; expected one");
    if (list && g_.list.empty())
      problem("grains.file", g_.file.empty() ? "missing; expected a file of grains"
                                             : "'" + g_.file + "' has not been read");
    if (g_.arrangement == Arrangement::random && g_.count == 0)
      problem("grains.count", "missing; expected the number of grains of the packing");
    if (g_.arrangement != Arrangement::random && g_.count != 0)
      problem("grains.count", "is for grains.arrangement = random");
  }

  bool too_many() {
    const double count = static_cast<double>(g_.rows) * static_cast<double>(g_.columns) *
                         static_cast<double>(g_.layers);
    if (count <= grains_max) return false;
    problem("grains.rows", rough_number(count) + " grains; at most " + rough_number(grains_max) +
                               " are possible");
    return true;
  }

  void check_motion() {
    if (flat() && (g_.spin_x != 0 || g_.spin_y != 0))
      problem(g_.spin_x != 0 ? "grains.spin_x" : "grains.spin_y",
              "discs spin about z alone; expected 0 in 2D");
    check_spin(g_.spin_x != 0 || g_.spin_y != 0 || g_.spin_z != 0, "grains.spin_z");
  }
  void check_spin(bool spins, const std::string& key) {
    if (spins && !s_.contact.rotation)
      problem(key, "contact.rotation is off: grains have no spin; expected 0");
  }

  void resolve_contact() {
    Contact& c = s_.contact;
    if (!std::isnan(c.restitution)) {
      c.damping = 2 * damping_for(c.restitution);
      // Given by the damping from here on, which a fork may change.
      c.restitution = automatic;
    }
    if (std::isnan(c.tangential_ratio)) c.tangential_ratio = flat() ? 1.0 / 3.0 : 2.0 / 7.0;
    if (c.law == ContactLaw::hertz) {
      if (flat())
        problem("contact.law", "'hertz' is a law of spheres; expected linear in 2D");
      if (std::isnan(c.youngs_modulus))
        problem("contact.youngs_modulus",
                "missing; Hertz's law needs the grains' modulus, such as '1e7 Pa'");
    }
    if (std::isnan(c.stiffness)) {
      // The heaviest grain would overlap most; lighter ones have shorter contacts.
      double heaviest = 0;
      for (const GrainSpecies& each : species_of(s_))
        heaviest = std::max(heaviest, grain_mass(s_, each));
      const double frequency = pi / c.time;
      c.stiffness = heaviest * (frequency * frequency);
    }
    if (c.rolling_friction > 0 && !c.rotation)
      problem("contact.rolling_friction", "contact.rotation is off: nothing rolls; expected 0");
    if (c.lubrication && !s_.is_coupled())
      problem("contact.lubrication", "without a fluid that acts on grains there is no film; "
                                     "expected off");
    if (c.lubrication && !(c.lubrication_gap < c.lubrication_range))
      problem("contact.lubrication_gap",
              number_text(c.lubrication_gap) + " is not below contact.lubrication_range " +
                  number_text(c.lubrication_range));
  }

  void check_list() {
    for (const ListedGrain& grain : g_.list) {
      bool spins = false;
      for (const double each : grain.spin) spins = spins || each != 0;
      check_spin(spins, "grains.file");
      if (spins && !s_.contact.rotation) break;
    }
    const std::string wrong = misplaced_grain(s_, g_.list);
    if (!wrong.empty())
      problem("grains.file", g_.file + ": " + wrong + "; expected at most 1 % of a diameter");
  }

  void resolve_packing() {
    if (std::isnan(g_.from_y)) g_.from_y = 0;
    if (std::isnan(g_.to_y)) g_.to_y = s_.domain.height;
    if (!(g_.from_y >= 0 && g_.to_y <= s_.domain.height * (1 + rounding) && g_.from_y < g_.to_y))
      return problem("grains.to_y", "the packing lies between " + number_text(g_.from_y) + " and " +
                                        number_text(g_.to_y) +
                                        " m; expected 0 <= from_y < to_y <= domain.height");
    if (g_.jitter > 0) problem("grains.jitter", "a random packing has none; expected 0");
    const double stretch = (1 + g_.gap) * (1 + g_.gap) * (flat() ? 1 : 1 + g_.gap);
    double space = s_.domain.width * (g_.to_y - g_.from_y) * (flat() ? 1 : s_.domain.depth);
    if (s_.domain.shape == Shape::pipe) space *= pi / 4;
    const double filled = grain_totals(s_).volume * stretch / space;
    // Close packing of discs of one size at random is 0.84, of spheres 0.64.
    const double most = flat() ? 0.80 : 0.58;
    if (filled > most)
      return problem("grains.count",
                     std::to_string(g_.count) + " grains (with their gaps) fill " +
                         rough_number(filled) + " of the space between grains.from_y and to_y; at "
                         "most " + rough_number(most) + " is possible, largest safe value " +
                         std::to_string(static_cast<std::int64_t>(
                             std::floor(static_cast<double>(g_.count) * most / filled))));
    try {
      placed_grains(s_);
    } catch (const ModelError& error) {
      const std::string text = error.what();
      problem("grains.count", text.substr(text.find(": ") + 2));
    }
  }

  void resolve_array() {
    const std::array<double, 3> extent = array_extent(s_);
    if (std::isnan(g_.centre_x)) g_.centre_x = s_.domain.left + 0.5 * s_.domain.width;
    if (std::isnan(g_.lowest_y)) g_.lowest_y = 0.5 * (s_.domain.height - extent[1]);
    check_inside("grains.centre_x", s_.domain.left, s_.domain.width,
                 g_.centre_x - 0.5 * extent[0], extent[0],
                 s_.domain.sides == Boundary::periodic, "wide", "columns", grain_pitch(s_));
    check_inside("grains.lowest_y", 0, s_.domain.height, g_.lowest_y, extent[1],
                 s_.domain.bottom == Boundary::periodic, "high", "rows", row_pitch(s_));
    if (!flat()) check_depth(extent);
    check_jitter();
  }

  void check_depth(const std::array<double, 3>& extent) {
    if (std::isnan(g_.centre_z)) g_.centre_z = 0.5 * s_.domain.depth;
    check_inside("grains.centre_z", 0, s_.domain.depth, g_.centre_z - 0.5 * extent[2], extent[2],
                 s_.domain.faces == Boundary::periodic, "deep", "layers", grain_pitch(s_));
    if (s_.domain.shape != Shape::pipe) return;
    const double radius = 0.5 * s_.domain.width;
    const double x = std::abs(g_.centre_x - s_.domain.left - radius) + 0.5 * extent[0];
    const double z = std::abs(g_.centre_z - radius) + 0.5 * extent[2];
    const double reach = largest_diameter(s_) * (0.5 + 1.5 * g_.jitter);
    const double corner = std::sqrt(x * x + z * z) + reach;
    if (corner > radius * (1 + rounding))
      problem("grains.columns", "a corner of the array reaches " + rough_number(corner) +
                                    " m from the pipe's axis; its radius is " +
                                    number_text(radius) + " m");
  }

  void check_jitter() {
    // Along the axes two neighbours come nearer by twice the jitter; obliquely by up to sqrt(D)
    // times as much.
    const bool square = g_.arrangement == Arrangement::square;
    const double most = (square ? 0.5 : 0.25) * g_.gap;
    if (s_.grain_count() <= 1 || g_.jitter <= most * (1 + rounding)) return;
    problem("grains.jitter", number_text(g_.jitter) +
                                 " can make neighbours overlap; largest safe value " +
                                 number_below(most) +
                                 (square ? " (half of grains.gap)" : " (a quarter of grains.gap)"));
  }

  /// Grains whose first centre lies at `first` and whose last lies `span` further must fit between
  /// `from` and `from + extent`.
  void check_inside(const std::string& key, double from, double extent, double first, double span,
                    bool periodic, std::string_view word, std::string_view lines, double pitch) {
    const double reach = largest_diameter(s_) * (0.5 + g_.jitter);
    const double slack = rounding * extent;
    const double room = extent - span - 2 * reach;
    if (room < -slack) {
      problem("grains." + std::string(lines),
              "the array is " + rough_number(span + 2 * reach) + " m " + std::string(word) +
                  ", the domain " + number_text(extent) + " m; largest number that fits " +
                  std::to_string(static_cast<std::int64_t>(std::max(
                      0.0, std::floor((extent - 2 * reach) / pitch + 1 + rounding)))));
      return;
    }
    if (periodic) return;
    const double low = from + reach, high = from + extent - reach - span;
    if (first >= low - slack && first <= high + slack) return;
    // The key names the middle of the columns but the first of the rows.
    const double shift = key == "grains.lowest_y" ? 0.0 : 0.5 * span;
    problem(key, number_text(first + shift) + " m puts grains outside the domain; expected " +
                     rough_number(low + shift) + ".." + rough_number(high + shift) + " m");
  }

  Scenario& s_;
  Grains& g_;
  std::vector<Problem>& problems_;
};

}  // namespace

void resolve_grains(Scenario& scenario, std::vector<Problem>& problems) {
  GrainResolver(scenario, problems).run();
}

}  // namespace varve::core
