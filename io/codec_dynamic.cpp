#include "io/codec_dynamic.h"

#include <algorithm>
#include <array>
#include <type_traits>

#include "io/codec_bytes.h"
#include "io/codec_follow.h"
#include "io/codec_method.h"
#include "io/codec_residual.h"
#include "io/codec_stage.h"
#include "io/codec_tans.h"

namespace varve::io::codec {
namespace {

/// Fields of fewer values are written as variable-length numbers or byte planes.
constexpr std::size_t staged_values_min = 384;
/// Frames between two looks at the model of the entropy coder.
constexpr unsigned model_interval = 8;
/// Mean error of the expected bit lengths, 64 per bit, from which on all of them are shifted.
constexpr int shift_min = 48;
/// Bits of the first byte of a payload of residual_bits.
constexpr std::uint8_t has_model = 1;
constexpr std::uint8_t has_shift = 2;
constexpr std::uint8_t is_fresh = 4;
/// Frames between two choices of the order of extrapolation.
constexpr unsigned choice_interval = 8;
/// Values per run and runs per component on which the order is chosen.
constexpr std::size_t sample_run = 16;
constexpr std::size_t sample_runs = 32;
/// How a payload of differences says which weights it used.
constexpr std::uint8_t weights_polynomial = 0;

template <class T>
class TrackField final : public DynamicField {
 public:
  using U = ImageOf<T>;
  /// Integers are counters or labels: constant or linear in time, if anything.
  static constexpr unsigned order_limit = std::is_floating_point_v<T> ? order_max : 2;

  explicit TrackField(const FieldDescriptor& field)
      : name_(field.name), track_(field.components) {}

  std::uint64_t count() const override { return track_.count(); }

  void restart(const FieldView& frame) override {
    track_.restart(frame.bytes, frame.count);
    order_ = 0;
    frames_since_choice_ = 0;
    staged_ = false;
  }

  void remap(std::span<const std::uint64_t> sources) override {
    track_.remap(sources);
    if (staged_) {
      stage_.remap(sources, track_.components());
    }
  }

  void encode(const FieldView& frame, const Timeline& times, Zstd& zstd,
              EncodedField& out) override {
    choose_order(frame, times);
    const Weights weights = weights_for(order_, times);
    out.order = static_cast<std::uint8_t>(order_);
    out.count = frame.count;
    out.payload.clear();
    ByteSink sink(out.payload);
    sink.u8(weights_polynomial);
    if (std::is_floating_point_v<T> && track_.values() >= staged_values_min) {
      out.method = static_cast<std::uint8_t>(Method::residual_bits);
      encode_staged(frame, weights, sink, out.payload);
    } else {
      encode_simple(frame, weights, zstd, out);
    }
  }

  void decode(const EncodedField& encoded, const Timeline& times, Zstd& zstd,
              std::span<std::byte> frame) override {
    if (encoded.order > order_limit || encoded.order > track_.depth()) {
      fail_damaged(name_, "extrapolation of order " + std::to_string(encoded.order) + " where " +
                              std::to_string(track_.depth()) + " differences are known");
    }
    ByteSource source(encoded.payload, name_);
    if (const unsigned kind = source.u8(); kind != weights_polynomial) {
      fail_damaged(name_, "unknown kind of weights " + std::to_string(kind));
    }
    const Weights weights = weights_for(encoded.order, times);
    if (encoded.method == static_cast<std::uint8_t>(Method::residual_bits)) {
      decode_staged(source, weights, frame);
    } else {
      decode_simple(static_cast<Method>(encoded.method), source, weights, zstd, frame);
    }
  }

  bool encode_following(const DynamicField& slopes, double dt, const FieldView& frame,
                        EncodedField& out) override {
    if constexpr (std::is_floating_point_v<T>) {
      if (!encode_follow(track_, {slopes.doubles(), slopes.floats()}, dt, frame.bytes, folded_,
                         out.payload)) {
        return false;
      }
      track_.replace(folded_);
      staged_ = false;
      out.method = static_cast<std::uint8_t>(Method::follows);
      out.order = 0;
      out.count = frame.count;
      return true;
    } else {
      return false;
    }
  }

  void decode_following(const DynamicField& slopes, double dt, const EncodedField& encoded,
                        std::span<std::byte> frame) override {
    if constexpr (std::is_floating_point_v<T>) {
      decode_follow(track_, {slopes.doubles(), slopes.floats()}, dt, encoded.payload, name_,
                    folded_);
      track_.replace(folded_);
      staged_ = false;
      for_blocks([&](std::size_t first, std::size_t n) {
        track_.scatter(folded_.data() + first, first, n, frame);
      });
    } else {
      fail_damaged(name_, "integers do not follow a field");
    }
  }

  const Track<double>* doubles() const override {
    if constexpr (std::is_same_v<T, double>) {
      return &track_;
    }
    return nullptr;
  }
  const Track<float>* floats() const override {
    if constexpr (std::is_same_v<T, float>) {
      return &track_;
    }
    return nullptr;
  }

 private:
  void encode_simple(const FieldView& frame, const Weights& weights, Zstd& zstd,
                     EncodedField& out) {
    staged_ = false;
    folded_.resize(track_.values());
    track_.begin_frame();
    for_blocks([&](std::size_t first, std::size_t n) {
      std::array<U, block_values> bits;
      std::array<U, block_values> predicted;
      track_.predict(weights, first, n, predicted.data());
      track_.gather(frame.bytes, first, n, bits.data());
      kernels<T>().fold(bits.data(), predicted.data(), n, folded_.data() + first);
      track_.advance(bits.data(), first, n);
    });
    track_.end_frame();
    const std::span<const U> folded(folded_);
    const std::size_t header = out.payload.size();
    out.method = static_cast<std::uint8_t>(Method::residual_planes);
    encode_planes(folded, zstd, scratch_, out.payload);
    if (folded.size() < staged_values_min) {
      std::vector<std::byte> numbers(out.payload.begin(),
                                     out.payload.begin() + static_cast<std::ptrdiff_t>(header));
      ByteSink sink(numbers);
      encode_varints(folded, sink);
      if (numbers.size() <= out.payload.size()) {
        out.method = static_cast<std::uint8_t>(Method::residual_varint);
        out.payload = std::move(numbers);
      }
    }
  }

  void decode_simple(Method method, ByteSource& source, const Weights& weights, Zstd& zstd,
                     std::span<std::byte> frame) {
    staged_ = false;
    folded_.resize(track_.values());
    const std::span<U> folded(folded_);
    if (method == Method::residual_varint) {
      decode_varints(source, folded);
    } else {
      decode_planes(source, zstd, scratch_, folded);
    }
    source.finish();
    track_.begin_frame();
    for_blocks([&](std::size_t first, std::size_t n) {
      std::array<U, block_values> bits;
      std::array<U, block_values> predicted;
      track_.predict(weights, first, n, predicted.data());
      kernels<T>().unfold(folded_.data() + first, predicted.data(), n, bits.data());
      track_.advance(bits.data(), first, n);
      track_.scatter(bits.data(), first, n, frame);
    });
    track_.end_frame();
  }

  void encode_staged(const FieldView& frame, const Weights& weights, ByteSink& sink,
                     std::vector<std::byte>& payload) {
    const std::size_t values = track_.values();
    const bool fresh = !staged_;
    if (fresh) {
      stage_.reset(values);
      model_ = Model();
      frames_since_model_ = model_interval;
    }
    staged_ = true;
    const int shift = fresh || order_ != order_before_ ? find_shift(frame, weights) : 0;
    order_before_ = order_;
    folded_.resize(values);
    expected_.resize(values);
    symbols_.resize(values);
    track_.begin_frame();
    for_blocks([&](std::size_t first, std::size_t n) {
      std::array<U, block_values> bits;
      std::array<U, block_values> base;
      std::array<U, block_values> predicted;
      const StageBlock block = stage_.block(first);
      track_.predict(weights, first, n, base.data());
      kernels<T>().expect(block, shift, base.data(), n, predicted.data(), expected_.data() + first);
      track_.gather(frame.bytes, first, n, bits.data());
      U* const residuals = folded_.data() + first;
      kernels<T>().subtract(bits.data(), predicted.data(), n, residuals);
      kernels<T>().symbolise(residuals, expected_.data() + first, n, symbols_.data() + first);
      kernels<T>().learn(block, shift, bits.data(), base.data(), n);
      track_.advance(bits.data(), first, n);
    });
    track_.end_frame();
    stage_.end_frame();
    const bool new_model = ++frames_since_model_ >= model_interval && improve_model(fresh);
    sink.u8(static_cast<std::uint8_t>((new_model ? has_model : 0) | (shift != 0 ? has_shift : 0) |
                                      (fresh ? is_fresh : 0)));
    if (shift != 0) {
      sink.u16(static_cast<std::uint16_t>(shift));
    }
    if (new_model) {
      model_.write(sink);
      encoder_.set_model(model_);
    }
    encoder_.encode(folded_, expected_, symbols_, track_.count(), payload);
  }

  void decode_staged(ByteSource& source, const Weights& weights, std::span<std::byte> frame) {
    if constexpr (std::is_floating_point_v<T>) {
      const unsigned flags = source.u8();
      const bool fresh = (flags & is_fresh) != 0;
      if (flags > (has_model | has_shift | is_fresh) || (!fresh && !staged_) ||
          (fresh && (flags & has_model) == 0)) {
        fail_damaged(name_, "flags " + std::to_string(flags) + " of the residuals do not fit");
      }
      if (fresh) {
        stage_.reset(track_.values());
      }
      staged_ = true;
      const int shift =
          (flags & has_shift) != 0 ? static_cast<std::int16_t>(source.u16()) : 0;
      if ((flags & has_model) != 0) {
        model_.read(source);
        decoder_.set_model(model_);
      }
      decoder_.begin(source);
      track_.begin_frame();
      for_blocks([&](std::size_t first, std::size_t n) {
        std::array<U, block_values> bits;
        std::array<U, block_values> base;
        std::array<U, block_values> predicted;
        std::array<U, block_values> residual;
        std::array<Expectation, block_values> expected;
        const StageBlock block = stage_.block(first);
        track_.predict(weights, first, n, base.data());
        kernels<T>().expect(block, shift, base.data(), n, predicted.data(), expected.data());
        decoder_.decode({expected.data(), n}, residual.data());
        kernels<T>().add(residual.data(), predicted.data(), n, bits.data());
        kernels<T>().learn(block, shift, bits.data(), base.data(), n);
        track_.advance(bits.data(), first, n);
        track_.scatter(bits.data(), first, n, frame);
      });
      decoder_.finish();
      track_.end_frame();
      stage_.end_frame();
    } else {
      fail_damaged(name_, "integers have no second stage");
    }
  }

  /// Counts symbols; true if a model that fits them saves more than its description costs.
  bool improve_model(bool fresh) {
    frames_since_model_ = 0;
    counts_ = {};
    for (std::size_t i = 0; i < symbols_.size(); ++i) {
      ++counts_[expected_[i].context & 0x7f][symbols_[i]];
    }
    Model better = model_;
    better.fit(counts_);
    std::vector<std::byte> description;
    ByteSink sink(description);
    better.write(sink);
    const double saved = (model_.cost(counts_) - better.cost(counts_)) * model_interval;
    if (!fresh && saved < 8.0 * static_cast<double>(description.size())) {
      return false;
    }
    model_ = better;
    return true;
  }

  /// Mean difference between the bit lengths that a sample needs and those that are expected.
  int find_shift(const FieldView& frame, const Weights& weights) const {
    std::int64_t sum = 0;
    std::int64_t values = 0;
    const std::size_t count = track_.count();
    const std::size_t stride = std::max(sample_run, count / sample_runs);
    for (std::uint32_t c = 0; c < track_.components(); ++c) {
      for (std::size_t at = 0; at < count; at += stride) {
        const std::size_t first = c * count + at;
        const std::size_t n = std::min(sample_run, count - at);
        std::array<U, sample_run> bits;
        std::array<U, sample_run> predicted;
        std::array<Expectation, sample_run> expected;
        track_.predict(weights, first, n, predicted.data());
        kernels<T>().expect(stage_.block(first), 0, predicted.data(), n, predicted.data(),
                            expected.data());
        track_.gather(frame.bytes, first, n, bits.data());
        for (std::size_t i = 0; i < n; ++i) {
          const U folded = zigzag<U>(image_of_bits<T>(bits[i]) - predicted[i]) >> 1;
          sum += 64 * static_cast<int>(bit_length(folded)) + 32 * (folded != 0) -
                 static_cast<int>(stage_.level(first + i));
        }
        values += static_cast<std::int64_t>(n);
      }
    }
    const auto mean = static_cast<int>(sum / std::max<std::int64_t>(values, 1));
    return mean >= shift_min || mean <= -shift_min ? mean : 0;
  }

  static Weights weights_for(unsigned order, const Timeline& times) {
    return std::is_floating_point_v<T> ? polynomial_weights(order, times)
                                       : equal_step_weights(order);
  }

  /// Calls work(first, n) for blocks that lie within one component each.
  template <class Work>
  void for_blocks(Work&& work) const {
    const std::size_t count = track_.count();
    for (std::uint32_t c = 0; c < track_.components(); ++c) {
      for (std::size_t at = 0; at < count; at += block_values) {
        work(c * count + at, std::min(block_values, count - at));
      }
    }
  }

  /// Tries all orders on a sample: at every frame while the history grows, else now and then.
  void choose_order(const FieldView& frame, const Timeline& times) {
    const unsigned highest = std::min(track_.depth(), order_limit);
    const bool growing = track_.depth() < order_max;
    if (!growing && ++frames_since_choice_ < choice_interval) {
      return;
    }
    frames_since_choice_ = 0;
    std::array<std::uint64_t, order_max + 1> cost{};
    const std::size_t count = track_.count();
    const std::size_t stride = std::max(sample_run, count / sample_runs);
    for (unsigned order = 0; order <= highest; ++order) {
      const Weights weights = weights_for(order, times);
      for (std::uint32_t c = 0; c < track_.components(); ++c) {
        for (std::size_t at = 0; at < count; at += stride) {
          cost[order] += run_cost(frame, weights, c * count + at, std::min(sample_run, count - at));
        }
      }
    }
    order_ = static_cast<unsigned>(std::min_element(cost.begin(), cost.begin() + highest + 1) -
                                   cost.begin());
  }

  /// Bits that differences of one sampled run need.
  std::uint64_t run_cost(const FieldView& frame, const Weights& weights, std::size_t first,
                         std::size_t n) const {
    std::array<U, sample_run> bits;
    std::array<U, sample_run> predicted;
    track_.predict(weights, first, n, predicted.data());
    track_.gather(frame.bytes, first, n, bits.data());
    std::uint64_t cost = 0;
    for (std::size_t i = 0; i < n; ++i) {
      cost += bit_length(zigzag<U>(image_of_bits<T>(bits[i]) - predicted[i]));
    }
    return cost;
  }

  std::string name_;
  Track<T> track_;
  std::vector<U> folded_;
  std::vector<std::byte> scratch_;
  Stage stage_;
  bool staged_ = false;  ///< the stage holds the frame before
  Model model_;
  SymbolCounts counts_;
  std::vector<Expectation> expected_;
  std::vector<std::uint8_t> symbols_;
  TansEncoder<U> encoder_;
  TansDecoder<U> decoder_;
  unsigned frames_since_model_ = 0;
  unsigned order_before_ = 0;
  unsigned order_ = 0;
  unsigned frames_since_choice_ = 0;
};

}  // namespace

std::unique_ptr<DynamicField> DynamicField::create(const FieldDescriptor& field) {
  switch (field.type) {
    case ScalarType::f64: return std::make_unique<TrackField<double>>(field);
    case ScalarType::f32: return std::make_unique<TrackField<float>>(field);
    case ScalarType::u64: return std::make_unique<TrackField<std::uint64_t>>(field);
    case ScalarType::u32: return std::make_unique<TrackField<std::uint32_t>>(field);
    case ScalarType::u8: return std::make_unique<TrackField<std::uint8_t>>(field);
  }
  throw LogError(ErrorKind::mismatch, "", "field '" + field.name + "' has an unknown type");
}

}  // namespace varve::io::codec
