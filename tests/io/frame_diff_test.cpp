#include "io/frame_diff.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/errors.h"

namespace varve::io {
namespace {

using testing::ElementsAre;

FieldDescriptor field(std::string name, std::string population, ScalarType type,
                      std::uint32_t components, std::string unit = "") {
  FieldDescriptor out;
  out.name = std::move(name);
  out.population = std::move(population);
  out.type = type;
  out.components = components;
  out.unit = std::move(unit);
  out.is_id = out.name.ends_with(".id");
  return out;
}

Schema toy_schema(ScalarType real = ScalarType::f64) {
  Schema schema;
  schema.fields = {field("clock.time", "clock", real, 1, "s"),
                   field("bead.id", "bead", ScalarType::u64, 1),
                   field("bead.species", "bead", ScalarType::u32, 1),
                   field("bead.velocity", "bead", real, 2, "m/s")};
  return schema;
}

template <class T>
void put(std::vector<std::byte>& out, T value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof value);
}

template <class Real = double>
Frame toy_frame(std::vector<std::uint64_t> ids) {
  Frame frame;
  frame.step = 7;
  frame.fields.resize(4);
  frame.counts = {1, ids.size(), ids.size(), ids.size()};
  put(frame.fields[0], Real(0.5));
  for (const std::uint64_t id : ids) {
    put(frame.fields[1], id);
    put(frame.fields[2], static_cast<std::uint32_t>(id % 3));
    put(frame.fields[3], Real(0.25) * static_cast<Real>(id));
    put(frame.fields[3], Real(-0.125) * static_cast<Real>(id));
  }
  return frame;
}

template <class T>
void poke(Frame& frame, std::size_t field_index, std::size_t index, T value) {
  std::memcpy(frame.fields[field_index].data() + index * sizeof value, &value, sizeof value);
}

FrameDifference compare(const Schema& sa, const Frame& a, const Schema& sb, const Frame& b,
                        const Tolerances& tolerances = {}) {
  return compare_frames(sa, a.view(), sb, b.view(), match_schemas(sa, sb), tolerances);
}
FrameDifference compare(const Frame& a, const Frame& b, const Tolerances& tolerances = {}) {
  return compare(toy_schema(), a, toy_schema(), b, tolerances);
}

TEST(FrameDiff, EqualStatesAreEqual) {
  const FrameDifference found = compare(toy_frame({1, 4, 9}), toy_frame({1, 4, 9}));
  EXPECT_TRUE(found.equal());
  EXPECT_TRUE(found.within());
  EXPECT_EQ(found.first(), nullptr);
  EXPECT_EQ(found.fields[3].compared, 6u);
}

TEST(FrameDiff, NamesFieldComponentParticleBothValuesAndUlps) {
  const Frame a = toy_frame({1, 4, 9});
  Frame b = a;
  poke(b, 3, 5, std::nextafter(-0.125 * 9, 0.0));
  const FrameDifference found = compare(a, b);
  ASSERT_NE(found.first(), nullptr);
  const FieldDifference& first = *found.first();
  EXPECT_EQ(component_name(first, first.first->component), "bead.velocity.y");
  EXPECT_EQ(particle_name(first.first->particle), "9");
  EXPECT_EQ(first.first->ulp, 1u);
  EXPECT_EQ(first.first->a.hex(), "-0x1.2p+0");
  EXPECT_EQ(first.first->b.hex(), "-0x1.1ffffffffffffp+0");
  EXPECT_EQ(first.first->a.decimal(), "-1.125");
  EXPECT_EQ(first.differing, 1u);
  EXPECT_EQ(first.particles, 1u);
  EXPECT_EQ(found.differing(), 1u);
  EXPECT_EQ(first.largest->absolute, std::ldexp(1.0, -52));
}

TEST(FrameDiff, EverySingleBitIsFoundAndNothingElse) {
  const Frame a = toy_frame({1, 4, 9});
  for (std::size_t f = 0; f < a.fields.size(); ++f)
    for (std::size_t bit = 0; bit < a.fields[f].size() * 8; ++bit) {
      Frame b = a;
      b.fields[f][bit / 8] ^= std::byte{1} << (bit % 8);
      const FrameDifference found = compare(a, b);
      ASSERT_NE(found.first(), nullptr);
      EXPECT_EQ(found.first()->name, toy_schema().fields[f].name) << "bit " << bit;
      if (f == 1) continue;  // a changed id is another particle
      EXPECT_EQ(found.differing(), 1u);
      const std::size_t scalar = bit / 8 / size_of(toy_schema().fields[f].type);
      EXPECT_EQ(found.first()->first->component, scalar % toy_schema().fields[f].components);
    }
}

TEST(FrameDiff, FirstIsInTheSchemasOrderThenById) {
  const Frame a = toy_frame({1, 4, 9});
  Frame b = a;
  poke(b, 3, 2, 100.0);
  poke(b, 3, 0, 7.0);
  poke(b, 3, 1, 8.0);
  poke(b, 2, 2, std::uint32_t{77});
  const FrameDifference found = compare(a, b);
  EXPECT_EQ(found.first()->name, "bead.species");
  EXPECT_EQ(found.first()->first->particle, std::vector<std::uint64_t>{9});
  EXPECT_EQ(found.fields[3].first->particle, std::vector<std::uint64_t>{1});
  EXPECT_EQ(found.fields[3].first->component, 0u);
  EXPECT_EQ(found.fields[3].differing, 3u);
  EXPECT_EQ(found.fields[3].particles, 2u);
  EXPECT_EQ(found.fields[3].largest->particle, std::vector<std::uint64_t>{4});
}

TEST(FrameDiff, ParticlesAreMatchedById) {
  Frame b = toy_frame({1, 5, 9, 12});
  poke(b, 3, 5, 3.5);  // particle 9
  const FrameDifference found = compare(toy_frame({1, 4, 9}), b);
  const FieldDifference& ids = found.fields[1];
  EXPECT_EQ(ids.only_a, 1u);
  EXPECT_EQ(ids.only_b, 2u);
  EXPECT_EQ(*ids.first_only_a, std::vector<std::uint64_t>{4});
  EXPECT_EQ(*ids.first_only_b, std::vector<std::uint64_t>{5});
  EXPECT_EQ(found.fields[3].compared, 4u);
  EXPECT_EQ(found.fields[3].differing, 1u);
  EXPECT_EQ(found.fields[3].first->particle, std::vector<std::uint64_t>{9});
  EXPECT_FALSE(found.within());
}

TEST(FrameDiff, IdsOutOfOrderAreReportedNotTrusted) {
  Frame b = toy_frame({1, 4, 9});
  poke(b, 1, 0, std::uint64_t{40});
  const FrameDifference found = compare(toy_frame({1, 4, 9}), b);
  EXPECT_EQ(found.first()->name, "bead.id");
  EXPECT_EQ(found.first()->first->b.bits, 40u);
  EXPECT_EQ(found.fields[3].differing, 0u);
}

TEST(FrameDiff, LeavingOutTheIdsStillReportsMissingParticles) {
  const Schema schema = toy_schema();
  SchemaMatch match = match_schemas(schema, schema);
  match.pairs = {{3, 3}};
  const Frame a = toy_frame({1, 4}), b = toy_frame({1});
  const FrameDifference found = compare_frames(schema, a.view(), schema, b.view(), match);
  ASSERT_EQ(found.fields.size(), 1u);
  EXPECT_EQ(found.fields[0].only_a, 1u);
}

TEST(FrameDiff, IdsOfSeveralPartsAreMatchedAsAWhole) {
  Schema schema;
  schema.fields = {field("contact.id", "contact", ScalarType::u64, 3),
                   field("contact.spring", "contact", ScalarType::f64, 1)};
  const auto make = [](std::vector<std::array<std::uint64_t, 3>> keys) {
    Frame frame;
    frame.fields.resize(2);
    frame.counts = {keys.size(), keys.size()};
    for (const auto& key : keys) {
      for (const std::uint64_t part : key) put(frame.fields[0], part);
      put(frame.fields[1], static_cast<double>(key[0] + key[2]));
    }
    return frame;
  };
  const FrameDifference found = compare(schema, make({{1, 0, 2}, {1, 1, 0}, {3, 0, 7}}), schema,
                                        make({{1, 1, 0}, {3, 0, 7}}));
  EXPECT_EQ(found.fields[0].only_a, 1u);
  EXPECT_EQ(particle_name(*found.fields[0].first_only_a), "1:0:2");
  EXPECT_EQ(found.fields[1].differing, 0u);
}

TEST(FrameDiff, SpecialValuesAreCountedApart) {
  const Frame a = toy_frame({0, 4, 9});
  Frame b = a;
  poke(b, 3, 0, -0.0);
  poke(b, 3, 2, std::numeric_limits<double>::quiet_NaN());
  poke(b, 3, 4, std::numeric_limits<double>::infinity());
  const FieldDifference found = compare(a, b).fields[3];
  EXPECT_EQ(found.differing, 3u);
  EXPECT_EQ(found.zero_signs, 1u);
  EXPECT_EQ(found.not_finite, 2u);
  EXPECT_EQ(found.first->ulp, 1u);
  EXPECT_TRUE(std::isinf(found.largest->absolute));
}

Tolerances general(Tolerance tolerance) {
  Tolerances out;
  out.all = tolerance;
  return out;
}

TEST(FrameDiff, EachToleranceAcceptsUpToItsLimit) {
  const Frame a = toy_frame({4});
  Frame b = a;
  poke(b, 3, 0, 1.0 + 4 * std::numeric_limits<double>::epsilon());
  const double gap = 4 * std::numeric_limits<double>::epsilon();
  EXPECT_TRUE(compare(a, b, general({.absolute = gap, .relative = {}, .ulp = {}})).within());
  EXPECT_FALSE(compare(a, b, general({.absolute = gap / 2, .relative = {}, .ulp = {}})).within());
  EXPECT_TRUE(compare(a, b, general({.absolute = {}, .relative = gap, .ulp = {}})).within());
  EXPECT_FALSE(compare(a, b, general({.absolute = {}, .relative = gap / 2, .ulp = {}})).within());
  EXPECT_TRUE(compare(a, b, general({.absolute = {}, .relative = {}, .ulp = 4})).within());
  EXPECT_FALSE(compare(a, b, general({.absolute = {}, .relative = {}, .ulp = 3})).within());
  EXPECT_FALSE(compare(a, b, general({.absolute = {}, .relative = {}, .ulp = 4})).equal());
}

TEST(FrameDiff, AFieldsOwnToleranceReplacesTheGeneralOneOfItsKind) {
  const Frame a = toy_frame({4});
  Frame b = a;
  poke(b, 3, 0, 1.5);
  poke(b, 0, 0, 0.75);
  Tolerances tolerances = general({.absolute = 1.0, .relative = {}, .ulp = {}});
  EXPECT_TRUE(compare(a, b, tolerances).within());
  tolerances.by_field = {{"bead.velocity", {.absolute = 0.25, .relative = {}, .ulp = {}}}};
  const FrameDifference found = compare(a, b, tolerances);
  EXPECT_EQ(found.first()->name, "clock.time");
  EXPECT_EQ(found.first_beyond()->name, "bead.velocity");
  EXPECT_EQ(found.fields[0].beyond, 0u);
}

TEST(FrameDiff, IntegersAreExactUnlessNamed) {
  const Frame a = toy_frame({4});
  Frame b = a;
  poke(b, 2, 0, std::uint32_t{2});
  Tolerances tolerances = general({.absolute = 10, .relative = 10, .ulp = 10});
  EXPECT_FALSE(compare(a, b, tolerances).within());
  tolerances.by_field = {{"bead.species", {.absolute = 1, .relative = {}, .ulp = {}}}};
  EXPECT_TRUE(compare(a, b, tolerances).within());
}

TEST(FrameDiff, NothingToleratesANanOrAnInfinity) {
  const Tolerances all = general({.absolute = std::numeric_limits<double>::infinity(),
                                  .relative = std::numeric_limits<double>::infinity(),
                                  .ulp = ~std::uint64_t{0}});
  const Frame a = toy_frame({4});
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Frame b = a;
    poke(b, 3, 0, bad);
    EXPECT_FALSE(compare(a, b, all).within()) << bad;
    EXPECT_TRUE(compare(b, b, {}).equal()) << bad;
  }
  Frame positive = a, negative = a;
  poke(positive, 3, 0, 0.0);
  poke(negative, 3, 0, -0.0);
  EXPECT_TRUE(
      compare(positive, negative, general({.absolute = {}, .relative = {}, .ulp = 0})).within());
  EXPECT_FALSE(compare(positive, negative).equal());
}

TEST(FrameDiff, HugeAndTinyNumbersHaveARelativeDifference) {
  const Frame a = toy_frame({4});
  Frame x = a, y = a;
  poke(x, 3, 0, std::numeric_limits<double>::max());
  poke(y, 3, 0, -std::numeric_limits<double>::max());
  EXPECT_DOUBLE_EQ(compare(x, y).fields[3].largest_relative, 2);
  poke(x, 3, 0, 5e-324);
  poke(y, 3, 0, 1e-323);
  EXPECT_GT(compare(x, y).fields[3].largest_relative, 0);
}

TEST(FrameDiff, FloatsCompareWithDoublesAfterWidening) {
  const Schema wide = toy_schema(), narrow = toy_schema(ScalarType::f32);
  const SchemaMatch match = match_schemas(wide, narrow);
  EXPECT_EQ(match.widened.size(), 2u);
  EXPECT_TRUE(match.obstacles.empty());
  const Frame a = toy_frame({1, 2}), b = toy_frame<float>({1, 2});
  EXPECT_TRUE(compare(wide, a, narrow, b).equal());
  Frame c = a;
  poke(c, 3, 0, 0.1);
  Frame d = b;
  poke(d, 3, 0, 0.1f);
  const FrameDifference found =
      compare(wide, c, narrow, d, general({.absolute = {}, .relative = 1e-7, .ulp = {}}));
  EXPECT_FALSE(found.equal());
  EXPECT_TRUE(found.within());
}

TEST(FrameDiff, SchemasThatDoNotFitSayWhy) {
  const Schema a = toy_schema();
  Schema b = a;
  b.fields[2].type = ScalarType::f64;
  b.fields[3].components = 3;
  b.fields[0].name = "clock.hour";
  EXPECT_THAT(
      match_schemas(a, b).obstacles,
      ElementsAre("field clock.time is only in a", testing::HasSubstr("bead.species is u32 in a"),
                  testing::HasSubstr("bead.velocity has 2 components"),
                  "field clock.hour is only in b"));
}

TEST(FrameDiff, AFrameThatDoesNotFitIsRefused) {
  Frame bad = toy_frame({1, 2});
  bad.fields[3].pop_back();
  EXPECT_THROW(compare(toy_frame({1, 2}), bad), LogError);
  bad = toy_frame({1, 2});
  bad.counts[2] = 1;
  bad.fields[2].resize(4);
  EXPECT_THROW(compare(toy_frame({1, 2}), bad), LogError);
}

TEST(FrameDiff, TextOfScalars) {
  const auto text = [](double x) {
    return Scalar{ScalarType::f64, std::bit_cast<std::uint64_t>(x)};
  };
  EXPECT_EQ(text(0.1).decimal(), "0.1");
  EXPECT_EQ(text(0.1).hex(), "0x1.999999999999ap-4");
  EXPECT_EQ(text(-0.0).decimal(), "-0");
  EXPECT_EQ(text(-0.0).hex(), "-0x0p+0");
  EXPECT_EQ(text(-std::numeric_limits<double>::infinity()).hex(), "-inf");
  EXPECT_EQ((Scalar{ScalarType::f64, 0x7ff8000000000001}).decimal(), "nan(0x7ff8000000000001)");
  EXPECT_EQ((Scalar{ScalarType::u64, ~std::uint64_t{0}}).decimal(), "18446744073709551615");
  EXPECT_EQ((Scalar{ScalarType::f32, std::bit_cast<std::uint32_t>(0.1f)}).decimal(), "0.1");
  std::mt19937_64 random(5);
  for (int i = 0; i < 20000; ++i) {
    const double x = std::bit_cast<double>(random());
    if (std::isnan(x)) continue;
    EXPECT_EQ(std::strtod(text(x).hex().c_str(), nullptr), x);
    EXPECT_EQ(std::strtod(text(x).decimal().c_str(), nullptr), x);
  }
}

}  // namespace
}  // namespace varve::io
