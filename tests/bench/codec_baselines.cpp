#include "tests/bench/codec_baselines.h"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#ifdef VARVE_HAVE_FPZIP
#include <fpzip.h>
#endif

namespace varve::bench {
namespace {

using io::FieldDescriptor;
using io::Frame;
using io::ScalarType;
using io::Schema;

bool is_measured(const FieldDescriptor& field) {
  return !field.constant && !field.is_id &&
         (field.type == ScalarType::f64 || field.type == ScalarType::f32);
}

/// How a frame is made small before zstd sees it.
enum class Prediction { none, exclusive_or, quadratic };

template <class T, class U>
U ordered(T value) {
  const U bits = std::bit_cast<U>(value);
  constexpr int top = sizeof(T) * 8 - 1;
  return (bits >> top) != 0 ? ~bits : bits | (U{1} << top);
}

template <class T, class U>
T from_ordered(U image) {
  constexpr int top = sizeof(T) * 8 - 1;
  return std::bit_cast<T>((image >> top) != 0 ? image ^ (U{1} << top) : ~image);
}

/// One frame through prediction, byte planes (or not) and zstd.
class Shuffled final : public Baseline {
 public:
  Shuffled(const Schema& schema, std::string name, Prediction prediction, bool planes, int level)
      : schema_(schema),
        name_(std::move(name)),
        prediction_(prediction),
        planes_(planes),
        level_(level),
        compress_(ZSTD_createCCtx()),
        expand_(ZSTD_createDCtx()) {}
  ~Shuffled() override {
    ZSTD_freeCCtx(compress_);
    ZSTD_freeDCtx(expand_);
  }
  Shuffled(const Shuffled&) = delete;
  Shuffled& operator=(const Shuffled&) = delete;

  std::string name() const override { return name_; }

  std::size_t encode(const Frame& frame) override {
    std::size_t bytes = 0;
    packed_.resize(schema_.fields.size());
    for (std::size_t f = 0; f < schema_.fields.size(); ++f) {
      if (is_measured(schema_.fields[f])) {
        bytes += schema_.fields[f].type == ScalarType::f64
                     ? encode_field<double, std::uint64_t>(f, frame)
                     : encode_field<float, std::uint32_t>(f, frame);
      }
    }
    return bytes;
  }

  bool decode(const Frame& frame) override {
    bool same = true;
    for (std::size_t f = 0; f < schema_.fields.size(); ++f) {
      if (is_measured(schema_.fields[f])) {
        const bool is_double = schema_.fields[f].type == ScalarType::f64;
        is_double ? decode_field<double, std::uint64_t>(f) : decode_field<float, std::uint32_t>(f);
        same = same && out_ == frame.fields[f];
      }
    }
    history_.insert(history_.begin(), frame);
    history_.resize(std::min<std::size_t>(history_.size(), 3));
    return same;
  }

 private:
  template <class T>
  T past(std::size_t f, std::size_t age, std::size_t i) const {
    T value{};
    if (age < history_.size()) {
      std::memcpy(&value, history_[age].fields[f].data() + i * sizeof(T), sizeof(T));
    }
    return value;
  }

  template <class T>
  T predicted(std::size_t f, std::size_t i) const {
    const T newest = past<T>(f, 0, i);
    return history_.size() < 3
               ? newest
               : newest + ((newest - past<T>(f, 1, i)) * 2 - (past<T>(f, 1, i) - past<T>(f, 2, i)));
  }

  template <class T, class U>
  std::size_t encode_field(std::size_t f, const Frame& frame) {
    const std::vector<std::byte>& bytes = frame.fields[f];
    const std::size_t n = bytes.size() / sizeof(T);
    residual_.resize(bytes.size());
    for (std::size_t i = 0; i < n; ++i) {
      T value;
      std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
      U code = std::bit_cast<U>(value);
      if (prediction_ == Prediction::exclusive_or) {
        code ^= std::bit_cast<U>(past<T>(f, 0, i));
      } else if (prediction_ == Prediction::quadratic) {
        const U d = ordered<T, U>(value) - ordered<T, U>(predicted<T>(f, i));
        code = (d << 1) ^ (U{0} - (d >> (sizeof(T) * 8 - 1)));
      }
      put(code, i, n);
    }
    packed_[f].resize(ZSTD_compressBound(bytes.size()));
    packed_[f].resize(ZSTD_compressCCtx(compress_, packed_[f].data(), packed_[f].size(),
                                        residual_.data(), residual_.size(), level_));
    return packed_[f].size();
  }

  template <class T, class U>
  void decode_field(std::size_t f) {
    const auto size = ZSTD_getFrameContentSize(packed_[f].data(), packed_[f].size());
    residual_.resize(size);
    out_.resize(size);
    ZSTD_decompressDCtx(expand_, residual_.data(), residual_.size(), packed_[f].data(),
                        packed_[f].size());
    const std::size_t n = size / sizeof(T);
    for (std::size_t i = 0; i < n; ++i) {
      U code = take<U>(i, n);
      if (prediction_ == Prediction::exclusive_or) {
        code ^= std::bit_cast<U>(past<T>(f, 0, i));
      } else if (prediction_ == Prediction::quadratic) {
        const U d = (code >> 1) ^ (U{0} - (code & 1));
        code = std::bit_cast<U>(from_ordered<T, U>(ordered<T, U>(predicted<T>(f, i)) + d));
      }
      std::memcpy(out_.data() + i * sizeof(T), &code, sizeof(T));
    }
  }

  template <class U>
  void put(U code, std::size_t i, std::size_t n) {
    if (!planes_) {
      std::memcpy(residual_.data() + i * sizeof(U), &code, sizeof(U));
      return;
    }
    for (std::size_t p = 0; p < sizeof(U); ++p) {
      residual_[p * n + i] = static_cast<std::byte>(code >> (8 * p));
    }
  }
  template <class U>
  U take(std::size_t i, std::size_t n) const {
    U code = 0;
    if (!planes_) {
      std::memcpy(&code, residual_.data() + i * sizeof(U), sizeof(U));
      return code;
    }
    for (std::size_t p = 0; p < sizeof(U); ++p) {
      code |= static_cast<U>(residual_[p * n + i]) << (8 * p);
    }
    return code;
  }

  Schema schema_;
  std::string name_;
  Prediction prediction_;
  bool planes_;
  int level_;
  ZSTD_CCtx* compress_;
  ZSTD_DCtx* expand_;
  std::vector<Frame> history_;
  std::vector<std::byte> residual_, out_;
  std::vector<std::vector<std::byte>> packed_;
};

#ifdef VARVE_HAVE_FPZIP
/// fpzip, lossless, on particles x 8 steps of each component: a frame comes out every 8 steps.
class Fpzip final : public Baseline {
 public:
  explicit Fpzip(const Schema& schema) : schema_(schema) {}
  std::string name() const override { return "fpzip, particles x 8 steps"; }

  std::size_t encode(const Frame& frame) override {
    block_.push_back(frame);
    if (block_.size() < steps) {
      return 0;
    }
    packed_.clear();
    std::size_t bytes = 0;
    for (std::size_t f = 0; f < schema_.fields.size(); ++f) {
      const FieldDescriptor& field = schema_.fields[f];
      for (std::uint32_t c = 0; is_measured(field) && c < field.components; ++c) {
        bytes += field.type == ScalarType::f64 ? pack<double>(f, c) : pack<float>(f, c);
      }
    }
    return bytes;
  }

  bool decode(const Frame&) override {
    if (block_.size() < steps) {
      return true;
    }
    bool same = true;
    std::size_t part = 0;
    for (std::size_t f = 0; f < schema_.fields.size(); ++f) {
      const FieldDescriptor& field = schema_.fields[f];
      for (std::uint32_t c = 0; is_measured(field) && c < field.components; ++c, ++part) {
        same = same && (field.type == ScalarType::f64 ? unpack<double>(f, c, packed_[part])
                                                      : unpack<float>(f, c, packed_[part]));
      }
    }
    block_.clear();
    return same;
  }

 private:
  static constexpr std::size_t steps = 8;

  template <class T>
  std::vector<T> gather(std::size_t f, std::uint32_t c) const {
    const std::uint32_t components = schema_.fields[f].components;
    const std::size_t n = block_[0].counts[f];
    std::vector<T> values(n * steps);
    for (std::size_t s = 0; s < steps; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        std::memcpy(&values[s * n + i],
                    block_[s].fields[f].data() + (i * components + c) * sizeof(T), sizeof(T));
      }
    }
    return values;
  }
  template <class T>
  void describe(FPZ* stream, std::size_t n) const {
    stream->type = sizeof(T) == 8 ? FPZIP_TYPE_DOUBLE : FPZIP_TYPE_FLOAT;
    stream->prec = 0;
    stream->nx = static_cast<int>(n);
    stream->ny = static_cast<int>(steps);
    stream->nz = 1;
    stream->nf = 1;
  }
  template <class T>
  std::size_t pack(std::size_t f, std::uint32_t c) {
    const std::vector<T> values = gather<T>(f, c);
    std::vector<std::byte> out(values.size() * sizeof(T) * 5 / 4 + 4096);
    FPZ* const stream = fpzip_write_to_buffer(out.data(), out.size());
    describe<T>(stream, values.size() / steps);
    out.resize(fpzip_write(stream, values.data()));
    fpzip_write_close(stream);
    packed_.push_back(std::move(out));
    return packed_.back().size();
  }
  template <class T>
  bool unpack(std::size_t f, std::uint32_t c, const std::vector<std::byte>& packed) const {
    const std::vector<T> expected = gather<T>(f, c);
    std::vector<T> values(expected.size());
    FPZ* const stream = fpzip_read_from_buffer(packed.data());
    describe<T>(stream, values.size() / steps);
    fpzip_read(stream, values.data());
    fpzip_read_close(stream);
    return std::memcmp(values.data(), expected.data(), values.size() * sizeof(T)) == 0;
  }

  Schema schema_;
  std::vector<Frame> block_;
  std::vector<std::vector<std::byte>> packed_;
};
#endif

}  // namespace

std::vector<std::unique_ptr<Baseline>> baselines(const Schema& schema) {
  std::vector<std::unique_ptr<Baseline>> all;
  const auto add = [&](const char* name, Prediction prediction, bool planes, int level) {
    all.push_back(std::make_unique<Shuffled>(schema, name, prediction, planes, level));
  };
  add("zstd -1", Prediction::none, false, 1);
  add("byte planes + zstd -1", Prediction::none, true, 1);
  add("XOR + byte planes + zstd -1", Prediction::exclusive_or, true, 1);
  add("quadratic + byte planes + zstd -1", Prediction::quadratic, true, 1);
  add("quadratic + byte planes + zstd -9", Prediction::quadratic, true, 9);
#ifdef VARVE_HAVE_FPZIP
  all.push_back(std::make_unique<Fpzip>(schema));
#endif
  return all;
}

}  // namespace varve::bench
