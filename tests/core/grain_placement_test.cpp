// Where grains lie at the start: arrays, packings, lists; and what is refused, with what is said.
#include "core/grain_placement.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/contact_law.h"
#include "core/criteria.h"
#include "core/math.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

using ::testing::HasSubstr;

Scenario box(int dimension = 2) {
  Scenario s;
  s.domain.dimension = dimension;
  s.domain.width = 0.04;
  s.domain.height = 0.06;
  if (dimension == 3) s.domain.depth = 0.04;
  s.fluid.present = false;
  s.time.steps = 10;
  return s;
}

std::string problems_of(Scenario s) {
  std::string text;
  for (const Problem& each : resolve(s)) text += each.key + ": " + each.text + "\n";
  return text;
}

Scenario resolved(Scenario s) {
  EXPECT_EQ(problems_of(s), "");
  resolve(s);
  return s;
}

/// The least distance of two centres over the sum of their radii.
double tightest(const Scenario& s, const std::vector<ListedGrain>& grains) {
  const std::vector<GrainSpecies> species = species_of(s);
  double least = 1e300;
  for (std::size_t i = 0; i < grains.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      double r2 = 0;
      for (int k = 0; k < 3; ++k) {
        double d = grains[i].position[k] - grains[j].position[k];
        if (k == 0 && s.domain.sides == Boundary::periodic)
          d -= s.domain.width * std::round(d / s.domain.width);
        r2 += d * d;
      }
      const double touch =
          0.5 * (species[grains[i].species].diameter + species[grains[j].species].diameter);
      least = std::min(least, std::sqrt(r2) / touch);
    }
  return least;
}

TEST(GrainArrays, HexagonalRowsAreShiftedByHalfAPitch) {
  Scenario s = box();
  s.grains.rows = 3;
  s.grains.columns = 4;
  s.grains.arrangement = Arrangement::hexagonal;
  s = resolved(s);
  const auto grains = placed_grains(s);
  ASSERT_EQ(grains.size(), 12u);
  const double d = s.grains.diameter;
  EXPECT_NEAR(grains[4].position[0] - grains[0].position[0], 0.5 * d, 1e-15);
  EXPECT_NEAR(grains[4].position[1] - grains[0].position[1], std::sqrt(0.75) * d, 1e-15);
  EXPECT_NEAR(grains[8].position[0] - grains[0].position[0], 0, 1e-15);
  EXPECT_NEAR(tightest(s, grains), 1, 1e-12);
  // The array, half a pitch wider than its rows, is centred.
  EXPECT_NEAR(grains[0].position[0] + grains[7].position[0], s.domain.width, 1e-15);
}

TEST(GrainArrays, HexagonalLayersLieInTheHollows) {
  Scenario s = box(3);
  s.grains.rows = s.grains.layers = 4;
  s.grains.columns = 5;
  s.grains.arrangement = Arrangement::hexagonal;
  s = resolved(s);
  const auto grains = placed_grains(s);
  EXPECT_EQ(grains.size(), 80u);
  EXPECT_NEAR(tightest(s, grains), 1, 1e-12);
  EXPECT_EQ(misplaced_grain(s, grains), "");
  s.grains.gap = 0.1;
  EXPECT_NEAR(tightest(s, placed_grains(s)), 1.1, 1e-12);
}

TEST(GrainArrays, JitterNeverMakesNeighboursOverlap) {
  for (const Arrangement arrangement : {Arrangement::square, Arrangement::hexagonal}) {
    Scenario s = box();
    s.grains.rows = 8;
    s.grains.columns = 8;
    s.grains.gap = 0.3;
    s.grains.arrangement = arrangement;
    s.grains.jitter = arrangement == Arrangement::square ? 0.15 : 0.075;
    s = resolved(s);
    EXPECT_GE(tightest(s, placed_grains(s)), 1);
    Scenario more = s;
    more.grains.jitter *= 1.01;
    EXPECT_THAT(problems_of(more), HasSubstr("grains.jitter"));
  }
}

TEST(GrainArrays, SpeciesAreDrawnByTheirSharesAndThePitchIsOfTheLargest) {
  Scenario s = box();
  s.grains.rows = s.grains.columns = 15;
  s.grains.diameter = 1e-3;
  s.grains.share = 3;
  s.species = {{"coarse", 2e-3, automatic, 1}, {"none", automatic, 7000, 0}};
  s = resolved(s);
  EXPECT_EQ(s.species[0].density, s.grains.density);
  EXPECT_EQ(s.species[1].diameter, 1e-3);
  const auto grains = placed_grains(s);
  int counts[3] = {};
  for (const ListedGrain& grain : grains) ++counts[grain.species];
  EXPECT_NEAR(counts[1], 225 / 4.0, 20);
  EXPECT_EQ(counts[2], 0);
  EXPECT_EQ(counts[0] + counts[1], 225);
  EXPECT_NEAR(grains[1].position[0] - grains[0].position[0], 2e-3, 1e-15);
  // Who is what depends on the seed and the id alone.
  EXPECT_EQ(placed_grains(s)[17].species, species_at_start(s, 17));
  const GrainTotals totals = grain_totals(s);
  EXPECT_NEAR(totals.volume, pi / 4 * 1e-6 * (counts[0] + 4 * counts[1]), 1e-12);
}

TEST(Packings, OfDiscsAndSpheresHaveNoOverlapAndStayInside) {
  for (const int dimension : {2, 3}) {
    Scenario s = box(dimension);
    s.grains.arrangement = Arrangement::random;
    s.grains.count = dimension == 2 ? 300 : 400;
    s.grains.diameter = 1.5e-3;
    s.species = {{"coarse", 3e-3, automatic, 0.2}};
    s.grains.to_y = 0.035;
    s = resolved(s);
    const auto grains = placed_grains(s);
    ASSERT_EQ(grains.size(), static_cast<std::size_t>(s.grains.count));
    EXPECT_GE(tightest(s, grains), 1);
    EXPECT_EQ(misplaced_grain(s, grains), "");
    for (const ListedGrain& grain : grains) EXPECT_LT(grain.position[1], 0.035);
    EXPECT_EQ(placed_grains(s), grains);
    s.grains.seed = 2;
    EXPECT_NE(placed_grains(s), grains);
  }
}

TEST(Packings, MayBeDenseAndPeriodic) {
  Scenario s = box();
  s.domain.sides = Boundary::periodic;
  s.grains.arrangement = Arrangement::random;
  s.grains.diameter = 2e-3;
  s.grains.to_y = 0.04;
  s.grains.count = static_cast<std::int64_t>(0.72 * 0.04 * 0.04 / (pi / 4 * 4e-6));
  s = resolved(s);
  EXPECT_GE(tightest(s, placed_grains(s)), 1);
}

TEST(Packings, ThatCannotFitSaySoWithTheLargestNumber) {
  Scenario s = box();
  s.grains.arrangement = Arrangement::random;
  s.grains.diameter = 2e-3;
  s.grains.count = 1000;
  const std::string text = problems_of(s);
  EXPECT_THAT(text, HasSubstr("grains.count: 1000 grains (with their gaps) fill 1.3"));
  EXPECT_THAT(text, HasSubstr("largest safe value 611"));
  s.grains.count = 0;
  EXPECT_THAT(problems_of(s), HasSubstr("nothing to simulate"));
}

// ---- lists ----

TEST(GrainLists, HoldPlacesSpeciesVelocitiesAndSpins) {
  Scenario s = box();
  s.species = {{"fine", 1e-3, automatic, 1}};
  s.grains.file = "grains.csv";
  const auto read = read_grain_list(
      "\xef\xbb\xbf# two grains\r\nx, y, species ,vx,wz\r\n\r\n0.01,2e-2,grains,0.5,-3\n"
      "0.02,0.01,fine,0,0\n0.03,0.03,1,0,1\n",
      s);
  const auto* grains = std::get_if<std::vector<ListedGrain>>(&read);
  ASSERT_TRUE(grains);
  ASSERT_EQ(grains->size(), 3u);
  EXPECT_EQ((*grains)[0].position[1], 0.02);
  EXPECT_EQ((*grains)[0].velocity[0], 0.5);
  EXPECT_EQ((*grains)[0].spin[2], -3);
  EXPECT_EQ((*grains)[1].species, 1u);
  EXPECT_EQ((*grains)[2].species, 1u);
  s.grains.list = *grains;
  s.grains.arrangement = Arrangement::list;
  EXPECT_EQ(problems_of(s), "");
  EXPECT_EQ(s.grain_count(), 3);
}

TEST(GrainLists, NameTheLineAndTheValueOfEveryError) {
  const auto first = [](std::string_view text, int dimension = 2) {
    const auto read = read_grain_list(text, box(dimension));
    const auto* problems = std::get_if<std::vector<ListProblem>>(&read);
    if (!problems) return std::string("read");
    return std::to_string(problems->front().line) + ": " + problems->front().text;
  };
  EXPECT_EQ(first("x,y\n1,2\n1,two\n"), "3: y: 'two' is not a finite number");
  EXPECT_EQ(first("x,y\n1,nan\n"), "2: y: 'nan' is not a finite number");
  EXPECT_EQ(first("x,y\n1\n"), "2: 1 values; expected 2");
  EXPECT_EQ(first("x,vx\n1,1\n"), "1: no column 'y'");
  EXPECT_EQ(first("x,y,mass\n"),
            "1: 'mass' is no column; expected any of x, y, z, species, vx, vy, vz, wx, wy, wz");
  EXPECT_EQ(first("x,y,x\n"), "1: column 'x' twice");
  EXPECT_EQ(first("x,y,z\n"), "1: column 'z' needs domain.dimension = 3");
  EXPECT_EQ(first("x,y\n", 3), "1: no column 'z'");
  EXPECT_EQ(first("x,y,species\n0,0,sand\n"),
            "2: species: 'sand' is not known; expected one of grains or its number");
  EXPECT_EQ(first(""), "0: empty; expected a line of column names, such as x,y,species");
  EXPECT_EQ(first("x,y\n# none\n"), "2: no grain; expected one a line");
}

TEST(GrainLists, GrainsOutsideOrInsideEachOtherAreRefused) {
  Scenario s = box();
  s.grains.file = "grains.csv";
  s.grains.arrangement = Arrangement::list;
  s.grains.list = {{0, {0.001, 0.01, 0}, {}, {}}};
  EXPECT_THAT(problems_of(s),
              HasSubstr("grains.file: grains.csv: grain 0 reaches 0.00025 m beyond wall 0"));
  s.grains.list = {{0, {0.01, 0.01, 0}, {}, {}}, {0, {0.012, 0.01, 0}, {}, {}}};
  EXPECT_THAT(problems_of(s), HasSubstr("grains 0 and 1 overlap by 0.0005 m"));
  s.grains.list.clear();
  EXPECT_NE(problems_of(s), "");
}

// ---- what makes no sense ----

TEST(GrainKeys, ThatContradictEachOtherAreRefused) {
  const auto with = [](auto change, int dimension = 2) {
    Scenario s = box(dimension);
    s.grains.rows = s.grains.columns = 2;
    change(s);
    return problems_of(s);
  };
  EXPECT_THAT(with([](Scenario& s) { s.contact.law = ContactLaw::hertz; }),
              HasSubstr("contact.law: 'hertz' is a law of spheres; expected linear in 2D"));
  EXPECT_THAT(with([](Scenario& s) { s.contact.law = ContactLaw::hertz; }, 3),
              HasSubstr("contact.youngs_modulus: missing"));
  EXPECT_THAT(with([](Scenario& s) { s.contact.lubrication = true; }),
              HasSubstr("contact.lubrication: without a fluid"));
  EXPECT_THAT(with([](Scenario& s) { s.grains.spin_x = 1; }),
              HasSubstr("grains.spin_x: discs spin about z alone"));
  EXPECT_THAT(with([](Scenario& s) {
                s.contact.rotation = false;
                s.grains.spin_z = 1;
              }),
              HasSubstr("grains.spin_z: contact.rotation is off"));
  EXPECT_THAT(with([](Scenario& s) {
                s.contact.rotation = false;
                s.contact.rolling_friction = 0.1;
              }),
              HasSubstr("contact.rolling_friction: contact.rotation is off"));
  EXPECT_THAT(with([](Scenario& s) { s.species = {{"a", 1e-3, 1, 1}, {"a", 1e-3, 1, 1}}; }),
              HasSubstr("species.a: there are two species of this name"));
  EXPECT_THAT(with([](Scenario& s) { s.grains.count = 3; }), HasSubstr("grains.count"));
  EXPECT_THAT(with([](Scenario& s) { s.grains.file = "a.csv"; }), HasSubstr("grains.file"));
}

TEST(GrainKeys, RestitutionSetsTheDampingAndTheLightestGrainTheSubsteps) {
  Scenario s = box();
  s.grains.rows = s.grains.columns = 2;
  s.contact.restitution = 0.7;
  const Scenario one = resolved(s);
  EXPECT_TRUE(std::isnan(one.contact.restitution));
  EXPECT_NEAR(restitution_of(0.5 * one.contact.damping), 0.7, 1e-12);
  s.species = {{"fine", 0.5e-3, automatic, 1}};
  const Scenario two = resolved(s);
  // The stiffness is for the heaviest, the step for the lightest: a fifth of the diameter in 2D.
  EXPECT_EQ(two.contact.stiffness, one.contact.stiffness);
  EXPECT_NEAR(two.time.dt / one.time.dt, 0.2, 1e-12);
}

TEST(GrainKeys, ASpeciesIsPartOfTheCanonicalText) {
  Scenario s = box();
  s.grains.rows = s.grains.columns = 2;
  s.species = {{"fine", 0.5e-3, automatic, 2}};
  EXPECT_THAT(canonical_text(resolved(s)),
              HasSubstr("[species.fine]\ndiameter = 5e-04\ndensity = 2500\nshare = 2\n"));
  Scenario fork = resolved(s);
  const auto problems = apply_settings(fork, {{"species.fine.density", "3000"}});
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0].text, HasSubstr("cannot change in a fork"));
}

}  // namespace
}  // namespace varve::core
