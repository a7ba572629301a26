// io/CODEC.md says what the bytes mean: a decoder that was written from it alone agrees.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/io/codec_reference.h"
#include "tests/io/codec_support.h"

namespace varve::io::test {
namespace {

/// What happens to the particles of a run.
struct Story {
  const char* name;
  std::size_t count;
  double noise;       ///< of the acceleration, relative
  bool uneven_steps;
  bool wild;          ///< now and then a value of any bits
};

template <class T>
void compare(const Story& story) {
  const ScalarType type = sizeof(T) == 8 ? ScalarType::f64 : ScalarType::f32;
  Schema schema;
  schema.fields = {field("x", "p", type, 2, "v"), field("v", "p", type, 2)};
  auto encoder = FrameEncoder::create(schema);
  ReferenceField<T> x_reference(2), v_reference(2);
  std::mt19937_64 random(story.count);
  std::vector<T> x(2 * story.count), v(2 * story.count);
  std::vector<double> times;
  double time = 0;
  std::size_t staged = 0, written_weights = 0;
  for (int n = 0; n < 90; ++n) {
    const double dt = story.uneven_steps ? 1e-3 * (1 + 0.3 * std::sin(n)) : 1e-3;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double a = std::sin(0.01 * static_cast<double>(i) + 20 * time) +
                       story.noise * (static_cast<double>(random() % 2001) - 1000);
      const T dv = static_cast<T>(dt * a);
      v[i] = v[i] + dv;
      const T dx = static_cast<T>(dt) * v[i];
      x[i] = x[i] + dx;
      if (story.wild && random() % 5000 == 0) {
        v[i] = std::bit_cast<T>(static_cast<typename ReferenceField<T>::U>(random()));
        x[i] = v[i];
      }
    }
    time += dt;
    times.insert(times.begin(), time);
    Frame frame = empty_frame(schema);
    frame.time = time;
    frame.dt = dt;
    set_values(frame, 0, 2, x);
    set_values(frame, 1, 2, v);
    bool keyframe = false;
    const auto encoded = encoder->encode(frame.view(), keyframe);
    if (keyframe) {
      x_reference.whole(frame.fields[0]);
      v_reference.whole(frame.fields[1]);
      continue;
    }
    staged += encoded[1].method == 21;
    written_weights += encoded[1].payload[0] != std::byte{0};
    ASSERT_EQ(v_reference.decode(encoded[1].method, encoded[1].order, encoded[1].payload, times),
              frame.fields[1])
        << story.name << " step " << n;
    const auto back =
        encoded[0].method == 18
            ? x_reference.follow(v_reference, dt, encoded[0].payload)
            : x_reference.decode(encoded[0].method, encoded[0].order, encoded[0].payload, times);
    ASSERT_EQ(back, frame.fields[0]) << story.name << " step " << n;
    times.resize(std::min<std::size_t>(times.size(), 14));
  }
  EXPECT_EQ(staged > 0, story.count > 200) << story.name;
  if (std::string(story.name) == "noisy" && sizeof(T) == 8) {
    EXPECT_GT(written_weights, 0u) << "all kinds of weights are compared";
  }
}

TEST(CodecReference, DecodesWhatTheEncoderWrites) {
  for (const Story& story :
       {Story{"smooth", 700, 0, false, false}, Story{"few", 9, 0, false, false},
        Story{"noisy", 701, 1e-9, false, false}, Story{"rough", 702, 1e-4, false, false},
        Story{"uneven", 703, 1e-9, true, false}, Story{"wild", 1500, 1e-7, false, true}}) {
    compare<double>(story);
    compare<float>(story);
  }
}

}  // namespace
}  // namespace varve::io::test
