// Payloads that were not written by the encoder end in LogError: never in a crash, never in memory
// beyond the limits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <cmath>
#include <cstdlib>

#include "io/codec_method.h"
#include "io/errors.h"
#include "tests/io/codec_support.h"

namespace varve::io::test {
namespace {

using codec::Method;

/// A record as it was written, with what the decoder is told besides.
struct Record {
  std::vector<EncodedField> fields;
  bool keyframe = false;
  std::uint64_t step = 0;
  double time = 0, dt = 0;
};

/// A short log in which every method occurs.
struct Sample {
  Schema schema;
  std::vector<Record> records;
};

Sample make_sample() {
  Sample sample;
  sample.schema.fields = {id_field("fluid.id", "fluid"),
                          constant_field("fluid.mass", "fluid", ScalarType::f64),
                          field("fluid.x", "fluid", ScalarType::f64, 2, "fluid.v"),
                          field("fluid.v", "fluid", ScalarType::f64, 2),
                          field("fluid.t", "fluid", ScalarType::f32),
                          field("fluid.n", "fluid", ScalarType::u32),
                          id_field("key", "contacts", 3),
                          field("spring", "contacts", ScalarType::f64, 2),
                          field("step", "clock", ScalarType::u64)};
  auto encoder = FrameEncoder::create(sample.schema);
  std::vector<double> x(1000), v(1000);
  for (int n = 0; n < 24; ++n) {
    const std::size_t count = n < 20 ? 500 : 499;
    Frame frame = empty_frame(sample.schema);
    frame.step = static_cast<std::uint64_t>(n);
    frame.dt = 1e-3;
    frame.time = 1e-3 * n;
    std::vector<std::uint64_t> id(count), key;
    std::vector<float> t(count);
    std::vector<std::uint32_t> number(count);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double dv = frame.dt * std::sin(0.1 * static_cast<double>(i) + 9 * frame.time);
      v[i] += dv;
      const double dx = frame.dt * v[i];
      x[i] += i == 7 && n == 5 ? 1.0 : dx;
    }
    for (std::size_t i = 0; i < count; ++i) {
      id[i] = i * 2;
      t[i] = static_cast<float>(x[i] * v[i]);
      number[i] = static_cast<std::uint32_t>(i * i + static_cast<std::size_t>(n));
    }
    for (std::uint64_t k = 0; k < 30 + static_cast<std::uint64_t>(n % 5); ++k) {
      key.insert(key.end(), {k / 3, 0, k + static_cast<std::uint64_t>(n / 7)});
    }
    set_values(frame, 0, 1, id);
    set_values(frame, 1, 1, std::vector<double>(count, 0.5));
    const auto values = static_cast<std::ptrdiff_t>(2 * count);
    set_values(frame, 2, 2, std::vector<double>(x.begin(), x.begin() + values));
    set_values(frame, 3, 2, std::vector<double>(v.begin(), v.begin() + values));
    set_values(frame, 4, 1, t);
    set_values(frame, 5, 1, number);
    set_values(frame, 6, 3, key);
    set_values(frame, 7, 2, std::vector<double>(key.size() / 3 * 2, 1e-6 * n));
    set_values(frame, 8, 1, std::vector<std::uint64_t>{frame.step});
    Record record;
    record.fields = encoder->encode(frame.view(), record.keyframe);
    record.step = frame.step, record.time = frame.time, record.dt = frame.dt;
    sample.records.push_back(std::move(record));
  }
  return sample;
}

const Sample& sample() {
  static const Sample made = make_sample();
  return made;
}

const Frame& feed(FrameDecoder& decoder, const Record& record) {
  return decoder.decode(record.fields, record.keyframe, record.step, record.time, record.dt);
}

/// A decoder that has read the records before `n`.
std::unique_ptr<FrameDecoder> decoder_before(std::size_t n) {
  auto decoder = FrameDecoder::create(sample().schema);
  for (std::size_t k = 0; k < n; ++k) {
    feed(*decoder, sample().records[k]);
  }
  return decoder;
}

/// What became of a record: decoded somehow, or refused. Anything else fails the test.
bool refused(FrameDecoder& decoder, const Record& record) {
  try {
    feed(decoder, record);
    return false;
  } catch (const LogError& error) {
    EXPECT_TRUE(error.kind() == ErrorKind::damaged || error.kind() == ErrorKind::limit);
    EXPECT_STRNE(error.what(), "");
    return true;
  }
}

TEST(CodecHostile, TheSampleHasEveryMethod) {
  std::vector<bool> seen(32);
  for (const Record& record : sample().records) {
    for (const EncodedField& encoded : record.fields) {
      seen[encoded.method] = true;
    }
  }
  for (const Method method :
       {Method::plain, Method::shuffled, Method::id_runs, Method::id_deltas, Method::unchanged,
        Method::id_edit, Method::follows, Method::residual_varint, Method::residual_planes,
        Method::residual_bits}) {
    EXPECT_TRUE(seen[static_cast<std::size_t>(method)]) << static_cast<int>(method);
  }
}

TEST(CodecHostile, EveryTruncationAndEveryExtraByteIsRefused) {
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{5}, std::size_t{20}}) {
    const Record& record = sample().records[n];
    for (std::size_t f = 0; f < record.fields.size(); ++f) {
      const std::size_t size = record.fields[f].payload.size();
      const std::size_t stride = std::max<std::size_t>(1, size / 40);
      for (std::size_t length = 0; length <= size + 1; length += length < size ? stride : 1) {
        if (length == size) {
          continue;
        }
        Record broken = record;
        broken.fields[f].payload.resize(length);
        auto decoder = decoder_before(n);
        EXPECT_TRUE(refused(*decoder, broken))
            << "record " << n << " field " << f << " method " << int{record.fields[f].method}
            << ": " << length << " of " << size << " bytes";
      }
    }
  }
}

TEST(CodecHostile, FlippedBitsNeverCrash) {
  std::mt19937_64 random(5);
  const int cases = std::getenv("VARVE_LONG") != nullptr ? 40000 : 1500;
  int stopped = 0;
  for (int k = 0; k < cases; ++k) {
    const std::size_t n = random() % sample().records.size();
    auto decoder = decoder_before(n);
    Record broken = sample().records[n];
    for (std::uint64_t flips = 1 + random() % 3; flips > 0; --flips) {
      EncodedField& encoded = broken.fields[random() % broken.fields.size()];
      if (!encoded.payload.empty()) {
        const std::size_t size = encoded.payload.size();
        const std::size_t reach = random() % 4 == 0 ? std::min<std::size_t>(size, 24) : size;
        const std::size_t byte = random() % reach;  // headers get more than their share
        encoded.payload[byte] ^= std::byte{1} << (random() % 8);
      }
    }
    bool good = !refused(*decoder, broken);
    for (std::size_t next = n + 1; good && next < sample().records.size() && next < n + 3; ++next) {
      good = !refused(*decoder, sample().records[next]);  // on a history that is not the true one
    }
    stopped += !good;
  }
  EXPECT_GT(stopped, cases / 10);
}

TEST(CodecHostile, RandomHeadersNeverCrash) {
  std::mt19937_64 random(6);
  for (int k = 0; k < 1000; ++k) {
    const std::size_t n = random() % sample().records.size();
    auto decoder = decoder_before(std::min<std::size_t>(n, 3));
    Record broken = sample().records[n];
    EncodedField& encoded = broken.fields[random() % broken.fields.size()];
    switch (random() % 4) {
      case 0: encoded.method = static_cast<std::uint8_t>(random() % 24); break;
      case 1: encoded.order = static_cast<std::uint8_t>(random() % 16); break;
      case 2: encoded.count = random() >> (random() % 64); break;
      default: broken.keyframe = !broken.keyframe; break;
    }
    if (random() % 2 == 0) {
      encoded.payload = broken.fields[random() % broken.fields.size()].payload;
    }
    refused(*decoder, broken);
  }
}

TEST(CodecHostile, AfterAFailureOnlyAKeyframeIsAccepted) {
  auto decoder = decoder_before(5);
  Record broken = sample().records[5];
  broken.fields[3].payload.pop_back();
  ASSERT_TRUE(refused(*decoder, broken));
  EXPECT_TRUE(refused(*decoder, sample().records[5]));
  EXPECT_FALSE(refused(*decoder, sample().records[0]));
  EXPECT_FALSE(refused(*decoder, sample().records[1]));
}

TEST(CodecHostile, ADeltaWithoutAKeyframeIsRefused) {
  auto decoder = FrameDecoder::create(sample().schema);
  EXPECT_TRUE(refused(*decoder, sample().records[1]));
}

Record one_field(std::uint8_t method, std::uint64_t count, std::vector<std::byte> payload) {
  Record record;
  record.keyframe = true;
  record.fields.resize(1);
  record.fields[0].method = method;
  record.fields[0].count = count;
  record.fields[0].payload = std::move(payload);
  return record;
}

std::string refusal(FrameDecoder& decoder, const Record& record) {
  try {
    feed(decoder, record);
  } catch (const LogError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(CodecHostile, BombsAreRefusedAndTheLimitIsNamed) {
  Schema schema;
  schema.fields = {id_field("id", "p")};
  CodecLimits limits;
  limits.field_bytes_max = 64 << 20;
  auto decoder = FrameDecoder::create(schema, limits);
  const std::vector<std::byte> run{std::byte{0}, std::byte{0xff}, std::byte{0xff}, std::byte{0x7f}};
  EXPECT_THAT(refusal(*decoder, one_field(3, std::uint64_t{1} << 62, run)),
              testing::HasSubstr("field_bytes_max"));
  EXPECT_THAT(refusal(*decoder, one_field(3, std::uint64_t{1} << 21, run)),
              testing::HasSubstr("ratio_max"));
  limits.ratio_max = ~std::uint64_t{0};
  auto trusting = FrameDecoder::create(schema, limits);
  EXPECT_EQ(refusal(*trusting, one_field(3, std::uint64_t{1} << 21, run)), "accepted");
}

TEST(CodecHostile, ZstdFramesAreTakenAtTheirWordAndChecked) {
  Schema schema;
  schema.fields = {field("f", "p", ScalarType::f64)};
  auto decoder = FrameDecoder::create(schema);
  const std::vector<std::byte> plain(800, std::byte{7});
  std::vector<std::byte> packed(ZSTD_compressBound(plain.size()));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 1));
  EXPECT_EQ(refusal(*decoder, one_field(2, 100, packed)), "accepted");
  EXPECT_THAT(refusal(*decoder, one_field(2, 101, packed)), testing::HasSubstr("808 expected"));

  auto twice = packed;
  twice.insert(twice.end(), packed.begin(), packed.end());
  EXPECT_THAT(refusal(*decoder, one_field(2, 100, twice)), testing::HasSubstr("behind"));

  ZSTD_CCtx* const context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  std::vector<std::byte> silent(ZSTD_compressBound(plain.size()));
  silent.resize(
      ZSTD_compress2(context, silent.data(), silent.size(), plain.data(), plain.size()));
  ZSTD_freeCCtx(context);
  EXPECT_THAT(refusal(*decoder, one_field(2, 100, silent)), testing::HasSubstr("declares"));
}

TEST(CodecHostile, FieldsOfAPopulationAgreeOnTheirCount) {
  auto decoder = FrameDecoder::create(sample().schema);
  Record broken = sample().records[0];
  broken.fields[1].count = 7;
  EXPECT_THAT(refusal(*decoder, broken), testing::HasSubstr("population 'fluid'"));
  broken = sample().records[0];
  broken.fields.pop_back();
  EXPECT_THAT(refusal(*decoder, broken), testing::HasSubstr("8 fields"));
}

TEST(CodecHostile, AFieldWithoutComponentsIsRefused) {
  Schema schema;
  schema.fields = {field("f", "p", ScalarType::f64, 0)};
  EXPECT_THROW(FrameDecoder::create(schema), LogError);
  EXPECT_THROW(FrameEncoder::create(schema), LogError);
}

}  // namespace
}  // namespace varve::io::test
