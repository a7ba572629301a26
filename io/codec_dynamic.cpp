#include "io/codec_dynamic.h"

#include <algorithm>
#include <array>
#include <type_traits>

#include "io/codec_bytes.h"
#include "io/codec_follow.h"
#include "io/codec_method.h"
#include "io/codec_residual.h"

namespace varve::io::codec {
namespace {

/// Fields of fewer values are written as variable-length numbers.
constexpr std::size_t varint_values_max = 64;
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
  }

  void remap(std::span<const std::uint64_t> sources) override { track_.remap(sources); }

  void encode(const FieldView& frame, const Timeline& times, Zstd& zstd,
              EncodedField& out) override {
    choose_order(frame, times);
    const Weights weights = weights_for(order_, times);
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

    out.order = static_cast<std::uint8_t>(order_);
    out.count = frame.count;
    out.payload.clear();
    ByteSink sink(out.payload);
    sink.u8(weights_polynomial);
    const std::span<const U> folded(folded_);
    if (folded.size() <= varint_values_max) {
      out.method = static_cast<std::uint8_t>(Method::residual_varint);
      encode_varints(folded, sink);
    } else {
      out.method = static_cast<std::uint8_t>(Method::residual_planes);
      encode_planes(folded, zstd, scratch_, out.payload);
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
    folded_.resize(track_.values());
    const std::span<U> folded(folded_);
    if (encoded.method == static_cast<std::uint8_t>(Method::residual_varint)) {
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

  bool encode_following(const DynamicField& slopes, double dt, const FieldView& frame,
                        EncodedField& out) override {
    if constexpr (std::is_floating_point_v<T>) {
      if (!encode_follow(track_, {slopes.doubles(), slopes.floats()}, dt, frame.bytes, folded_,
                         out.payload)) {
        return false;
      }
      track_.replace(folded_);
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
