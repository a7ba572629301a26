// Claims about the codec's parts: weights, integer images, inner loops, entropy coder.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "io/codec_extrapolate.h"
#include "io/codec_image.h"
#include "io/codec_kernels.h"
#include "io/codec_tans.h"
#include "io/errors.h"

namespace varve::io::codec {
namespace {

TEST(CodecImage, OrdersAsTheValuesDoAndComesBack) {
  const std::vector<double> ascending{-std::numeric_limits<double>::infinity(), -1e300, -1.5, -1,
                                      -5e-324, -0.0, 0.0, 5e-324, 1, 1.5, 2, 1e300,
                                      std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < ascending.size(); ++i) {
    const auto bits = std::bit_cast<std::uint64_t>(ascending[i]);
    EXPECT_EQ(bits_of_image<double>(image_of_bits<double>(bits)), bits);
    if (i > 0) {
      EXPECT_LT(image_of_bits<double>(std::bit_cast<std::uint64_t>(ascending[i - 1])),
                image_of_bits<double>(bits));
    }
  }
  std::mt19937_64 random(1);
  for (int k = 0; k < 1000; ++k) {
    const auto bits = static_cast<std::uint32_t>(random());
    EXPECT_EQ(bits_of_image<float>(image_of_bits<float>(bits)), bits);
    EXPECT_EQ(unzigzag(zigzag(bits)), bits);
  }
}

/// Predicts f at times[0] from its past values by the codec's weights.
template <class F>
double predict(const F& f, const std::vector<double>& times, unsigned order) {
  Timeline timeline;
  for (auto time = times.rbegin(); time != times.rend(); ++time) {
    timeline.push(*time);
  }
  const Weights weights = polynomial_weights(order, timeline);
  double value = f(1);
  for (unsigned j = 0; j < order; ++j) {
    value += weights.value[j] * (f(j + 1) - f(j + 2));
  }
  return value;
}

TEST(CodecWeights, EqualStepsContinuePolynomialsExactly) {
  const std::vector<double> times{7, 6, 5, 4, 3, 2, 1, 0};
  for (unsigned order = 0; order <= 6; ++order) {
    const auto power = [&](std::size_t age) {
      double product = 1;
      for (unsigned k = 0; k < order; ++k) {
        product *= times[age];
      }
      return product;
    };
    EXPECT_EQ(predict(power, times, order), power(0)) << order;
  }
}

TEST(CodecWeights, UnequalStepsContinueSmoothSlopes) {
  const std::vector<double> times{2.9, 2.5, 2.2, 1.6, 1.1, 0.9, 0.3, 0};
  // v is integrated from a slope that is a polynomial of the time at each step's start.
  const auto slope = [](double t) { return 3 - t + 0.5 * t * t; };
  std::vector<double> v(times.size());
  for (std::size_t age = times.size() - 1; age-- > 0;) {
    v[age] = v[age + 1] + (times[age] - times[age + 1]) * slope(times[age + 1]);
  }
  const auto value = [&](std::size_t age) { return v[age]; };
  EXPECT_NEAR(predict(value, times, 3), v[0], 1e-12);
  EXPECT_GT(std::abs(predict(value, times, 2) - v[0]), 1e-3);
}

TEST(CodecWeights, RoundedTimesCountAsEqualSteps) {
  Timeline timeline;
  const double dt = 1e-5;
  for (int n = 0; n < 14; ++n) {
    timeline.push(12.3 + n * dt);
  }
  EXPECT_TRUE(steps_are_equal(12, timeline));
  timeline.push(12.3 + 13 * dt + dt * (1 + 1e-6));
  EXPECT_FALSE(steps_are_equal(12, timeline));
}

/// Bits of all kinds of values: smooth ones, any ones, special ones.
template <class T>
std::vector<ImageOf<T>> some_bits(std::mt19937_64& random, std::size_t n) {
  std::vector<ImageOf<T>> bits(n);
  for (std::size_t i = 0; i < n; ++i) {
    if constexpr (std::is_floating_point_v<T>) {
      const T smooth = static_cast<T>(std::sin(0.01 * static_cast<double>(i)));
      bits[i] = random() % 4 != 0 ? std::bit_cast<ImageOf<T>>(smooth)
                                  : static_cast<ImageOf<T>>(random());
    } else {
      bits[i] = static_cast<ImageOf<T>>(static_cast<T>(random()));
    }
  }
  return bits;
}

/// Everything that a set of kernels computes for one block of made-up data, as bytes.
template <class T>
std::vector<std::byte> run_kernels(const Kernels<T>& kernel, std::uint64_t seed, std::size_t n) {
  using U = ImageOf<T>;
  std::mt19937_64 random(seed);
  std::vector<std::byte> result;
  const auto keep = [&](const auto& values) {
    const auto* bytes = reinterpret_cast<const std::byte*>(values.data());
    result.insert(result.end(), bytes, bytes + values.size() * sizeof(values[0]));
  };
  auto newest = some_bits<T>(random, n);
  const auto bits = some_bits<T>(random, n);
  std::vector<std::vector<T>> planes(order_max + 1, std::vector<T>(n));
  std::array<const T*, order_max + 1> differences{};
  std::array<T, order_max> weights{};
  for (unsigned j = 0; j <= order_max; ++j) {
    for (T& value : planes[j]) {
      value = static_cast<T>(static_cast<double>(random() % 2001) - 1000) / T{8};
    }
    planes[j][j % n] = std::numeric_limits<T>::has_quiet_NaN ? std::numeric_limits<T>::quiet_NaN()
                                                             : std::numeric_limits<T>::max();
    differences[j] = planes[j].data();
    weights[j % order_max] = static_cast<T>(j + 1);
  }
  std::vector<U> image(n), folded(n), back(n), predicted(n), residuals(n);
  std::vector<Expectation> expected(n);
  std::vector<Token> tokens(n);
  std::vector<T> difference(n);
  for (const unsigned order : {0u, 1u, 2u, 3u, 7u, 12u}) {
    kernel.predict(newest.data(), differences.data(), weights.data(), order, n, image.data());
    keep(image);
  }
  kernel.fold(bits.data(), image.data(), n, folded.data());
  kernel.unfold(folded.data(), image.data(), n, back.data());
  keep(folded);
  EXPECT_EQ(back, bits);
  kernel.subtract(bits.data(), image.data(), n, residuals.data());
  kernel.add(residuals.data(), image.data(), n, back.data());
  EXPECT_EQ(back, bits);
  for (const std::size_t components : {1u, 2u, 3u, 5u}) {
    std::vector<std::byte> frame(n * components * sizeof(T), std::byte{1});
    kernel.scatter(bits.data(), components, n, frame.data());
    kernel.gather(frame.data(), components, n, back.data());
    EXPECT_EQ(back, bits);
    keep(frame);
  }
  if constexpr (std::is_floating_point_v<T>) {
    std::vector<std::vector<float>> past(past_residuals, std::vector<float>(n));
    std::vector<std::vector<std::uint16_t>> levels(candidates, std::vector<std::uint16_t>(n));
    StageBlock block;
    for (unsigned k = 0; k < past_residuals; ++k) {
      kernel.look_back(newest.data(), differences.data(), weights.data(), k, n, past[k].data());
      keep(past[k]);
      for (float& value : past[k]) {
        value += static_cast<float>(random() % 100) * (random() % 50 == 0 ? 1e17f : 1.0f);
      }
      for (auto& level : levels[k]) {
        level = static_cast<std::uint16_t>(random() % 2000);
      }
      block.past[k] = past[k].data();
      block.level[k] = levels[k].data();
    }
    block.incoming = past[3].data();
    kernel.expect(block, image.data(), n, predicted.data(), expected.data());
    keep(predicted);
    for (const Expectation& known : expected) {
      EXPECT_LT(known.context & 0x7f, tans_contexts);
      result.push_back(static_cast<std::byte>(known.context));
      result.push_back(static_cast<std::byte>(known.offset));
    }
    kernel.subtract(bits.data(), predicted.data(), n, residuals.data());
    kernel.tokenise(residuals.data(), expected.data(), n, tokens.data());
    keep(residuals);
    for (std::size_t i = 0; i < n; ++i) {
      const Token token = tokens[i];
      EXPECT_EQ(token.context(), expected[i].context & 0x7f);
      result.push_back(static_cast<std::byte>(token.symbol() | token.nonzero() << 5 |
                                              token.negative() << 6));
      result.push_back(static_cast<std::byte>(token.raw()));
    }
    kernel.learn(block, bits.data(), image.data(), n);
    keep(past[3]);
    for (const auto& level : levels) {
      keep(level);
    }
  }
  kernel.advance(bits.data(), newest.data(), difference.data(), n);
  EXPECT_EQ(newest, bits);
  if constexpr (!std::is_floating_point_v<T>) {
    keep(difference);  // where it is not a number, which one is the machine's choice
  }
  return result;
}

template <class T>
class CodecKernels : public testing::Test {};
using Types = testing::Types<double, float, std::uint64_t, std::uint32_t, std::uint8_t>;
TYPED_TEST_SUITE(CodecKernels, Types);

TYPED_TEST(CodecKernels, EveryWidthComputesTheSameBits) {
  const auto sets = all_kernels<TypeParam>();
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const std::size_t n = seed < 20 ? seed * 7 : block_values;
    const auto narrowest = run_kernels<TypeParam>(*sets[0], seed, n);
    for (std::size_t k = 1; k < sets.size(); ++k) {
      ASSERT_EQ(run_kernels<TypeParam>(*sets[k], seed, n), narrowest) << "set " << k;
    }
  }
}

TEST(CodecTans, FrequenciesFillTheStatesWhateverTheModelSays) {
  std::mt19937_64 random(2);
  for (int k = 0; k < 300; ++k) {
    SymbolCounts counts{};
    for (auto& context : counts) {
      for (auto& count : context) {
        count = random() % 3 == 0 ? static_cast<std::uint32_t>(random() >> (random() % 60)) % 100000
                                  : 0;
      }
    }
    Model model;
    model.fit(counts);
    std::vector<std::byte> bytes;
    ByteSink sink(bytes);
    model.write(sink);
    Model read;
    const std::string name = "f";
    ByteSource source(bytes, name);
    read.read(source);
    for (unsigned c = 0; c < tans_contexts; ++c) {
      const auto slots = read.frequencies(c);
      EXPECT_EQ(slots, model.frequencies(c));
      unsigned sum = 0;
      for (const unsigned slot : slots) {
        sum += slot;
      }
      EXPECT_EQ(sum, tans_states);
      EXPECT_GE(slots[tans_escape], 1);
    }
  }
}

template <class U>
void code_and_decode(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::size_t run = 1 + random() % 700;
  const std::size_t runs = 1 + random() % 3;
  std::vector<U> residuals(run * runs);
  std::vector<Expectation> expected(residuals.size());
  std::vector<Token> tokens(residuals.size());
  const unsigned spread = 1 + static_cast<unsigned>(random() % 64);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    residuals[i] = static_cast<U>(random() >> (random() % spread));
    residuals[i] = random() % 2 == 0 ? residuals[i] : U{0} - residuals[i];
    residuals[i] = random() % 100 == 0 ? U{1} << (sizeof(U) * 8 - 1) : residuals[i];
    expected[i].context = static_cast<std::uint8_t>((random() % 70) | (random() % 2) << 7);
    expected[i].offset = static_cast<std::uint8_t>(random() % 3 == 0 ? random() % 50 : 0);
  }
  using T = std::conditional_t<sizeof(U) == 8, double, float>;
  std::vector<U> raw_bits = residuals;
  for (std::size_t at = 0; at < residuals.size(); at += block_values) {
    const std::size_t n = std::min(block_values, residuals.size() - at);
    kernels<T>().tokenise(raw_bits.data() + at, expected.data() + at, n, tokens.data() + at);
  }
  SymbolCounts counts{};
  for (std::size_t i = 0; i < residuals.size(); i += 2) {
    ++counts[expected[i].context & 0x7f][tokens[i].symbol()];
  }
  Model model;
  model.fit(counts);
  TansEncoder<U> encoder;
  encoder.set_model(model);
  std::vector<std::byte> bytes;
  encoder.encode(raw_bits, tokens, run, bytes);
  TansDecoder<U> decoder;
  decoder.set_model(model);
  const std::string name = "f";
  ByteSource source(bytes, name);
  decoder.begin(source);
  std::vector<U> back(residuals.size());
  for (std::size_t r = 0; r < runs; ++r) {
    decoder.decode({expected.data() + r * run, run}, back.data() + r * run);
  }
  decoder.finish();
  EXPECT_EQ(back, residuals) << "seed " << seed;
}

TEST(CodecTans, ResidualsOfAnySizeComeBack) {
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    code_and_decode<std::uint64_t>(seed);
    code_and_decode<std::uint32_t>(seed);
  }
}

}  // namespace
}  // namespace varve::io::codec
