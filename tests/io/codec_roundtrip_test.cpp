// Claims about the codec: every bit comes back, whatever the data and whatever the hints say.
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <limits>
#include <random>

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#include "io/codec_method.h"
#include "io/errors.h"
#include "tests/io/codec_support.h"

namespace varve::io::test {
namespace {

using codec::Method;

/// Particles on smooth orbits, advanced as an integrator would: v += dt a, x += dt v.
class Orbits {
 public:
  Orbits(std::size_t count, std::uint32_t components) : components_(components) {
    for (std::size_t i = 0; i < count * components; ++i) {
      phase_.push_back(0.37 * static_cast<double>(i));
      x_.push_back(0.01 * static_cast<double>(i));
      v_.push_back(0.1);
    }
  }

  static Schema schema(std::uint32_t components) {
    Schema schema;
    schema.fields = {
        id_field("fluid.id", "fluid"), constant_field("fluid.mass", "fluid", ScalarType::f64),
        field("fluid.position", "fluid", ScalarType::f64, components, "fluid.velocity"),
        field("fluid.velocity", "fluid", ScalarType::f64, components)};
    return schema;
  }

  Frame next(double dt) {
    dt_ = dt;
    ++step_;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const double a = std::sin(phase_[i] + 3 * time_);
      const double dv = dt * a;
      v_[i] = v_[i] + dv;
      const double dx = dt * v_[i];
      x_[i] = x_[i] + dx;
      if (x_[i] > wrap_) {
        x_[i] = x_[i] - wrap_;
      }
    }
    time_ += dt;
    return frame();
  }

  Frame frame() const {
    const std::size_t count = x_.size() / components_;
    Frame frame = empty_frame(schema(components_));
    frame.step = step_;
    frame.time = time_;
    frame.dt = dt_;
    std::vector<std::uint64_t> id(count);
    for (std::size_t i = 0; i < count; ++i) {
      id[i] = i + 1;
    }
    set_values(frame, 0, 1, id);
    set_values(frame, 1, 1, std::vector<double>(count, 0.025));
    set_values(frame, 2, components_, x_);
    set_values(frame, 3, components_, v_);
    return frame;
  }

  void wrap_at(double length) { wrap_ = length; }

 private:
  std::uint32_t components_;
  std::uint64_t step_ = 0;
  double time_ = 0;
  double dt_ = 0;
  double wrap_ = 1e300;
  std::vector<double> phase_, x_, v_;
};

TEST(Codec, SmoothMotionIsExactAndSmall) {
  for (const std::uint32_t components : {1u, 2u, 3u}) {
    Orbits orbits(3000, components);
    Link link(Orbits::schema(components));
    std::size_t bytes = 0;
    for (int n = 0; n < 60; ++n) {
      ASSERT_TRUE(link.same(orbits.next(1e-4))) << "step " << n;
      EXPECT_EQ(link.keyframe, n == 0);
      bytes = payload_bytes(link.encoded);
    }
    EXPECT_LT(bytes, 3000u * components * 3) << "raw: " << 3000u * (components * 16 + 16);
    EXPECT_EQ(link.encoded[0].method, static_cast<std::uint8_t>(Method::unchanged));
    EXPECT_EQ(link.encoded[1].method, static_cast<std::uint8_t>(Method::unchanged));
    EXPECT_EQ(link.encoded[2].method, static_cast<std::uint8_t>(Method::follows));
    EXPECT_EQ(link.encoded[2].payload.size(), 1u) << "the rule holds without exception";
    EXPECT_GE(link.encoded[3].order, 3);
  }
}

TEST(Codec, RestartMakesExactlyTheNextFrameAKeyframe) {
  Orbits orbits(500, 2);
  Link link(Orbits::schema(2));
  auto late = FrameDecoder::create(Orbits::schema(2));
  for (int n = 0; n < 300; ++n) {
    if (n % 64 == 0 && n > 0) {
      link.encoder->restart();
    }
    const Frame frame = orbits.next(1e-4);
    ASSERT_TRUE(link.same(frame)) << n;
    ASSERT_EQ(link.keyframe, n % 64 == 0) << n;
    if (n >= 128) {  // a reader that starts in the middle sees the same
      const Frame& back =
          late->decode(link.encoded, link.keyframe, frame.step, frame.time, frame.dt);
      ASSERT_EQ(back.fields, frame.fields);
    }
  }
}

TEST(Codec, PeriodicWrapIsAnExceptionNotAnError) {
  Orbits orbits(2000, 2);
  orbits.wrap_at(35.0);
  Link link(Orbits::schema(2));
  std::size_t with_exceptions = 0;
  for (int n = 0; n < 80; ++n) {
    ASSERT_TRUE(link.same(orbits.next(1e-2))) << n;
    if (n > 0 && link.encoded[2].method == static_cast<std::uint8_t>(Method::follows) &&
        link.encoded[2].payload.size() > 1) {
      ++with_exceptions;
    }
  }
  EXPECT_GT(with_exceptions, 10u);
}

TEST(Codec, UnequalStepsAreExactAndStillPredicted) {
  Orbits orbits(2000, 2);
  Link link(Orbits::schema(2));
  std::size_t halved = 0;
  for (int n = 0; n < 120; ++n) {
    const double dt = (n / 40) % 2 == 0 ? 1e-4 : 0.5e-4;
    ASSERT_TRUE(link.same(orbits.next(dt))) << n;
    if (n == 42) {
      halved = link.encoded[3].payload.size();
    }
  }
  EXPECT_LT(halved, 2000u * 2 * 4) << "prediction across a change of dt works";
}

TEST(Codec, StrangeTimesCostBytesNeverBits) {
  Orbits orbits(300, 2);
  Link link(Orbits::schema(2));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> times{0, 0, 0, 1, 1, 0.5, nan, 3, 1e300, -1e300, 1e-300, 0, 1, 2, 3, 4};
  for (const double time : times) {
    Frame frame = orbits.next(1e-4);
    frame.time = time;
    frame.dt = time;
    ASSERT_TRUE(link.same(frame)) << time;
  }
}

TEST(Codec, FramesSeveralStepsApartFallBackFromTheRule) {
  Orbits orbits(2000, 2);
  Link link(Orbits::schema(2));
  for (int n = 0; n < 60; ++n) {
    orbits.next(1e-4);
    orbits.next(1e-4);
    ASSERT_TRUE(link.same(orbits.next(1e-4))) << n;
  }
  EXPECT_NE(link.encoded[2].method, static_cast<std::uint8_t>(Method::follows));
  EXPECT_LT(link.encoded[2].payload.size(), 2000u * 2 * 4);
}

TEST(Codec, FloatsFollowFloats) {
  Schema schema;
  schema.fields = {field("p.x", "p", ScalarType::f32, 2, "p.v"),
                   field("p.v", "p", ScalarType::f32, 2)};
  Link link(schema);
  std::vector<float> x(4000), v(4000);
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = 0.01f * static_cast<float>(i);
    v[i] = 0.5f;
  }
  const float dt = 1e-3f;
  for (int n = 0; n < 50; ++n) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const float dv = dt * static_cast<float>(std::cos(0.1 * n + 0.01 * static_cast<double>(i)));
      v[i] = v[i] + dv;
      const float dx = dt * v[i];
      x[i] = x[i] + dx;
    }
    Frame frame = empty_frame(schema);
    frame.time = 1e-3 * n;
    frame.dt = dt;
    set_values(frame, 0, 2, x);
    set_values(frame, 1, 2, v);
    ASSERT_TRUE(link.same(frame)) << n;
  }
  EXPECT_EQ(link.encoded[0].method, static_cast<std::uint8_t>(Method::follows));
  EXPECT_LT(link.encoded[1].payload.size(), 4000u * 2);
}

TEST(Codec, DoublesFollowFloats) {
  Schema schema;
  schema.fields = {field("p.x", "p", ScalarType::f64, 1, "p.v"),
                   field("p.v", "p", ScalarType::f32)};
  Link link(schema);
  std::vector<double> x(1000, 1.0);
  std::vector<float> v(1000, 0.25f);
  for (int n = 0; n < 10; ++n) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      v[i] += 1e-3f * static_cast<float>(i);
      const double dx = 1e-3 * static_cast<double>(v[i]);
      x[i] = x[i] + dx;
    }
    Frame frame = empty_frame(schema);
    frame.time = 1e-3 * n;
    frame.dt = 1e-3;
    set_values(frame, 0, 1, x);
    set_values(frame, 1, 1, v);
    ASSERT_TRUE(link.same(frame));
  }
  EXPECT_EQ(link.encoded[0].method, static_cast<std::uint8_t>(Method::follows));
}

TEST(Codec, SpecialValuesKeepTheirBits) {
  Schema schema;
  schema.fields = {field("d", "p", ScalarType::f64), field("f", "p", ScalarType::f32),
                   field("x", "p", ScalarType::f64, 1, "d"),
                   field("y", "p", ScalarType::f32, 1, "f")};
  const std::vector<std::uint64_t> special{
      0,                   0x8000000000000000u, 1,                   0x8000000000000001u,
      0x7ff0000000000000u, 0xfff0000000000000u, 0x7ff8000000000000u, 0x7ff0000000000001u,
      0xfff4000000abcdefu, 0x7fefffffffffffffu, 0xffefffffffffffffu, 0x000fffffffffffffu,
      0x3ff0000000000000u, 0xffffffffffffffffu};
  const std::vector<std::uint32_t> special_float{
      0,          0x80000000u, 1,           0x80000001u, 0x7f800000u, 0xff800000u, 0x7fc00000u,
      0x7f800001u, 0xffa12345u, 0x7f7fffffu, 0xff7fffffu, 0x007fffffu, 0x3f800000u, 0xffffffffu};
  std::mt19937_64 random(7);
  for (const std::size_t count : {std::size_t{1}, std::size_t{14}, std::size_t{700}}) {
    Link link(schema);
    for (int n = 0; n < 40; ++n) {
      std::vector<std::uint64_t> d(count), x(count);
      std::vector<std::uint32_t> f(count), y(count);
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t pick = n % 10 < 5 ? i : random();  // calm for a while, then wild
        d[i] = special[pick % special.size()];
        x[i] = special[(pick + 3) % special.size()];
        f[i] = special_float[pick % special_float.size()];
        y[i] = special_float[(pick + 5) % special_float.size()];
      }
      Frame frame = empty_frame(schema);
      frame.time = n;
      frame.dt = n % 3 == 0 ? std::numeric_limits<double>::infinity() : 1.0;
      set_values(frame, 0, 1, d);
      set_values(frame, 1, 1, f);
      set_values(frame, 2, 1, x);
      set_values(frame, 3, 1, y);
      ASSERT_TRUE(link.same(frame)) << "count " << count << " step " << n;
    }
  }
}

TEST(Codec, IntegersOfAllWidths) {
  Schema schema;
  schema.fields = {field("clock.step", "clock", ScalarType::u64),
                   field("a", "p", ScalarType::u64, 2), field("b", "p", ScalarType::u32, 3),
                   field("c", "p", ScalarType::u8, 1)};
  std::mt19937_64 random(3);
  Link link(schema);
  for (int n = 0; n < 40; ++n) {
    std::vector<std::uint64_t> a(600);
    std::vector<std::uint32_t> b(900);
    std::vector<std::uint8_t> c(300);
    for (auto& value : a) value = n < 20 ? ~std::uint64_t{0} - static_cast<unsigned>(n) : random();
    for (auto& value : b) value = static_cast<std::uint32_t>(random() >> (n % 40));
    for (auto& value : c) value = static_cast<std::uint8_t>(random() >> (n % 60));
    Frame frame = empty_frame(schema);
    frame.time = n;
    set_values(frame, 0, 1, std::vector<std::uint64_t>{static_cast<std::uint64_t>(n) + 1000000});
    set_values(frame, 1, 2, a);
    set_values(frame, 2, 3, b);
    set_values(frame, 3, 1, c);
    ASSERT_TRUE(link.same(frame)) << n;
    if (n > 3) {
      EXPECT_LE(link.encoded[0].payload.size(), 2u) << "a counter costs nothing";
    }
  }
}

TEST(Codec, AConstantThatChangesIsStored) {
  Schema schema;
  schema.fields = {constant_field("m", "p", ScalarType::f64), id_field("id", "p")};
  Link link(schema);
  Frame frame = empty_frame(schema);
  set_values(frame, 0, 1, std::vector<double>{1, 2, 3});
  set_values(frame, 1, 1, std::vector<std::uint64_t>{5, 6, 7});
  ASSERT_TRUE(link.same(frame));
  ASSERT_TRUE(link.same(frame));
  EXPECT_EQ(payload_bytes(link.encoded), 0u);
  set_values(frame, 0, 1, std::vector<double>{1, 2.5, 3});
  ASSERT_TRUE(link.same(frame));
  EXPECT_FALSE(link.keyframe);
  ASSERT_TRUE(link.same(frame));
  EXPECT_EQ(payload_bytes(link.encoded), 0u);
}

TEST(Codec, EmptyPopulationsAndEmptySchema) {
  Link nothing(Schema{});
  ASSERT_TRUE(nothing.same(empty_frame(Schema{})));
  ASSERT_TRUE(nothing.same(empty_frame(Schema{})));
  const Schema schema = Orbits::schema(2);
  Link link(schema);
  Orbits none(0, 2);
  Orbits some(100, 2);
  ASSERT_TRUE(link.same(none.next(1e-3)));
  ASSERT_TRUE(link.same(none.next(1e-3)));
  ASSERT_TRUE(link.same(some.next(1e-3)));
  ASSERT_TRUE(link.same(some.next(1e-3)));
  ASSERT_TRUE(link.same(none.next(1e-3)));
  ASSERT_TRUE(link.same(none.next(1e-3)));
}

TEST(Codec, ContactsComeAndGoWithoutKeyframes) {
  Schema schema;
  schema.fields = {id_field("contacts.key", "contacts", 3),
                   field("contacts.spring", "contacts", ScalarType::f64, 2),
                   field("free", "no ids", ScalarType::f64, 1)};
  std::mt19937_64 random(11);
  Link link(schema);
  std::vector<std::array<std::uint64_t, 3>> keys;
  std::size_t edits = 0;
  for (int n = 0; n < 300; ++n) {
    if (n % 50 == 49) {
      keys.clear();
    }
    std::erase_if(keys, [&](const auto&) { return random() % 20 == 0; });
    for (std::uint64_t k = random() % 4 + (keys.size() < 40 ? 10 : 0); k > 0; --k) {
      keys.push_back({random() % 30, random() % 2, random() % 1000});
    }
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    std::vector<std::uint64_t> flat;
    std::vector<double> spring;
    for (const auto& key : keys) {
      flat.insert(flat.end(), key.begin(), key.end());
      spring.push_back(1e-6 * std::sin(0.01 * n + static_cast<double>(key[2])));
      spring.push_back(1e-6 * std::cos(0.01 * n + static_cast<double>(key[2])));
    }
    Frame frame = empty_frame(schema);
    frame.step = static_cast<std::uint64_t>(n);
    frame.time = 1e-3 * n;
    set_values(frame, 0, 3, flat);
    set_values(frame, 1, 2, spring);
    set_values(frame, 2, 1, std::vector<double>(random() % 3 + 5, 1.5 * n));
    ASSERT_TRUE(link.same(frame)) << n;
    EXPECT_EQ(link.keyframe, n == 0);
    edits += link.encoded[0].method == static_cast<std::uint8_t>(Method::id_edit);
  }
  EXPECT_GT(edits, 200u);
}

TEST(Codec, ParticlesThatStayKeepTheirHistory) {
  Orbits orbits(3000, 2);
  Link link(Orbits::schema(2));
  std::size_t before = 0;
  for (int n = 0; n < 40; ++n) {
    Frame frame = orbits.next(1e-4);
    if (n >= 30) {  // one particle in the middle is gone
      for (std::size_t i = 0; i < frame.fields.size(); ++i) {
        const auto width = static_cast<std::ptrdiff_t>(frame.fields[i].size() / frame.counts[i]);
        const auto at = frame.fields[i].begin() + 1500 * width;
        frame.fields[i].erase(at, at + width);
        --frame.counts[i];
      }
    }
    ASSERT_TRUE(link.same(frame)) << n;
    EXPECT_EQ(link.keyframe, n == 0);
    if (n == 29) {
      before = link.encoded[3].payload.size();
    }
    if (n == 30) {
      EXPECT_LT(link.encoded[3].payload.size(), before * 11 / 10);
      EXPECT_LT(link.encoded[0].payload.size(), 8u);
    }
  }
}

TEST(Codec, IdsAreStoredAsRuns) {
  Schema schema;
  schema.fields = {id_field("id", "p")};
  Link link(schema);
  std::vector<std::uint64_t> ids;
  for (std::uint64_t i = 0; i < 100000; ++i) {
    ids.push_back(i < 5000 ? i : i + 17);
  }
  Frame frame = empty_frame(schema);
  set_values(frame, 0, 1, ids);
  ASSERT_TRUE(link.same(frame));
  EXPECT_LT(link.encoded[0].payload.size(), 16u);
  ids = {~std::uint64_t{0} - 1, ~std::uint64_t{0}};  // the last ids of all
  set_values(frame, 0, 1, ids);
  link.encoder->restart();
  ASSERT_TRUE(link.same(frame));
  ids = {9, 3, 3, 7};  // a wrong hint: they do not ascend
  set_values(frame, 0, 1, ids);
  ASSERT_TRUE(link.same(frame));
  ids = {9, 3, 4, 7, 1};
  set_values(frame, 0, 1, ids);
  ASSERT_TRUE(link.same(frame));
}

TEST(Codec, StillnessDoesNotExceedTheReadersRatio) {
  Schema schema;
  schema.fields = {id_field("id", "p"), field("v", "p", ScalarType::f64, 2),
                   constant_field("m", "p", ScalarType::f64)};
  Link link(schema);
  const std::size_t count = 300000;
  std::vector<std::uint64_t> ids(count);
  for (std::size_t i = 0; i < count; ++i) {
    ids[i] = i;
  }
  Frame frame = empty_frame(schema);
  set_values(frame, 0, 1, ids);
  set_values(frame, 1, 2, std::vector<double>(2 * count, 0.0));
  set_values(frame, 2, 1, std::vector<double>(count, 0.5));
  ASSERT_TRUE(link.same(frame));
  ASSERT_TRUE(link.same(frame));
  EXPECT_LT(payload_bytes(link.encoded), count / 100);
}

TEST(Codec, TheThreadsFloatModeReachesNoBit) {
  Schema schema;
  schema.fields = {field("v", "p", ScalarType::f64), field("f", "p", ScalarType::f32)};
  auto encoder = FrameEncoder::create(schema);
  auto decoder = FrameDecoder::create(schema);
  for (int n = 0; n < 60; ++n) {
    std::vector<double> v(500);
    std::vector<float> f(500);
    for (std::size_t i = 0; i < v.size(); ++i) {  // down to where values are subnormal
      v[i] = std::sin(0.01 * n + static_cast<double>(i)) * std::pow(10.0, -static_cast<double>(i));
      f[i] = static_cast<float>(v[i]);
    }
    Frame frame = empty_frame(schema);
    frame.time = 0.01 * n;
    set_values(frame, 0, 1, v);
    set_values(frame, 1, 1, f);
    bool keyframe = false;
    std::fesetround(n % 2 == 0 ? FE_UPWARD : FE_DOWNWARD);
#ifdef __SSE2__
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040);  // results and operands that are subnormal count as zero
#endif
    const auto encoded = encoder->encode(frame.view(), keyframe);
    EXPECT_EQ(std::fegetround(), n % 2 == 0 ? FE_UPWARD : FE_DOWNWARD) << "restored";
#ifdef __SSE2__
    _mm_setcsr(before);
#endif
    std::fesetround(FE_TONEAREST);
    const Frame& back = decoder->decode(encoded, keyframe, 0, frame.time, frame.dt);
    ASSERT_EQ(back.fields, frame.fields) << n;
  }
}

TEST(Codec, FramesThatDoNotFitTheSchemaAreRefused) {
  Orbits orbits(10, 2);
  Link link(Orbits::schema(2));
  ASSERT_TRUE(link.same(orbits.next(1e-3)));
  Frame frame = orbits.next(1e-3);
  frame.counts[3] = 9;
  bool keyframe = false;
  try {
    link.encoder->encode(frame.view(), keyframe);
    FAIL() << "a velocity of 9 particles in a fluid of 10";
  } catch (const LogError& error) {
    EXPECT_EQ(error.kind(), ErrorKind::mismatch);
    EXPECT_NE(std::string(error.what()).find("fluid.velocity"), std::string::npos) << error.what();
  }
  frame.fields.pop_back();
  frame.counts.pop_back();
  EXPECT_THROW(link.encoder->encode(frame.view(), keyframe), LogError);
  ASSERT_TRUE(link.same(orbits.next(1e-3))) << "the encoder goes on";
}

/// One random case: schema, counts, kinds of motion, restarts, all from one seed.
void random_case(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto below = [&](std::uint64_t n) { return random() % n; };
  Schema schema;
  const std::size_t populations = 1 + below(3);
  for (std::size_t p = 0; p < populations; ++p) {
    const std::string name = "p" + std::to_string(p);
    if (below(2) == 0) {
      const auto components = static_cast<std::uint32_t>(1 + below(3));
      schema.fields.push_back(id_field(name + ".id", name, components));
    }
    for (std::size_t k = 1 + below(3); k > 0; --k) {
      const auto type = static_cast<ScalarType>(1 + below(5));
      const auto components = static_cast<std::uint32_t>(1 + below(4));
      const std::string v = name + ".v" + std::to_string(k);
      schema.fields.push_back(field(v, name, type, components));
      schema.fields.back().constant = below(6) == 0;
      if (below(2) == 0) {
        schema.fields.push_back(
            field(name + ".x" + std::to_string(k), name, below(4) == 0 ? ScalarType::f64 : type,
                  components, below(5) == 0 ? "nobody" : v));
      }
    }
  }
  Link link(schema);
  std::vector<std::uint64_t> count(populations);
  for (auto& n : count) n = below(4) == 0 ? below(3) : below(300);
  Frame frame = empty_frame(schema);
  const auto fill = [&](std::size_t f, bool wild) {
    const FieldDescriptor& descriptor = schema.fields[f];
    const std::uint64_t n = count[static_cast<std::size_t>(descriptor.population[1] - '0')];
    auto& bytes = frame.fields[f];
    const std::size_t old = bytes.size();
    bytes.resize(n * descriptor.bytes_per_particle());
    for (std::size_t b = wild ? 0 : std::min(old, bytes.size()); b < bytes.size(); ++b) {
      bytes[b] = static_cast<std::byte>(random());
    }
    frame.counts[f] = n;
    if (descriptor.is_id && below(8) != 0) {
      std::vector<std::uint64_t> ids(n * descriptor.components);
      std::uint64_t id = 0;
      for (std::size_t i = 0; i < ids.size(); ++i) {
        id += 1 + below(2) * below(2) * below(5);
        ids[i] = id;
      }
      set_values(frame, f, descriptor.components, ids);
    } else if (!wild && descriptor.type == ScalarType::f64) {
      auto values = get_values<double>(frame, f);
      for (auto& value : values) value += 1e-3 * static_cast<double>(below(100));
      set_values(frame, f, descriptor.components, values);
    }
  };
  for (int n = 0; n < 20; ++n) {
    frame.step = static_cast<std::uint64_t>(n);
    frame.dt = 1e-3 * static_cast<double>(1 + below(3) / 2);
    frame.time += frame.dt;
    if (below(6) == 0) {
      count[below(populations)] = below(300);
    }
    const bool wild = below(5) == 0;
    for (std::size_t f = 0; f < schema.fields.size(); ++f) {
      fill(f, wild || below(20) == 0);
    }
    if (below(10) == 0) {
      link.encoder->restart();
    }
    ASSERT_TRUE(link.same(frame)) << "seed " << seed << " step " << n;
  }
}

TEST(Codec, ThousandsOfRandomCasesComeBackBitForBit) {
  const std::uint64_t cases = std::getenv("VARVE_LONG") != nullptr ? 20000 : 1000;
  for (std::uint64_t seed = 1; seed <= cases; ++seed) {
    random_case(seed);
    if (HasFatalFailure()) {
      return;
    }
  }
}

}  // namespace
}  // namespace varve::io::test
