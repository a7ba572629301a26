#include "io/codec_dynamic.h"

#include <algorithm>
#include <array>
#include <type_traits>

#include "io/codec_bytes.h"
#include "io/codec_choice.h"
#include "io/codec_follow.h"
#include "io/codec_method.h"
#include "io/codec_residual.h"
#include "io/codec_staged.h"

namespace varve::io::codec {
namespace {

/// Fields of fewer values are written as variable-length numbers or byte planes: they do not pay
/// for the entropy coder's model.
constexpr std::size_t staged_values_min = 384;
/// Frames between two looks whether byte planes would make such a field smaller than numbers do: a
/// call of zstd takes as long as hundreds of values of a large field.
constexpr unsigned planes_interval = 16;

/// Integers have no second stage.
struct NoStage {
  void forget() {}
  void remap(std::span<const std::uint64_t>, std::uint32_t) {}
};

template <class T>
class TrackField final : public DynamicField {
 public:
  using U = ImageOf<T>;
  static constexpr bool floating = std::is_floating_point_v<T>;

  explicit TrackField(const FieldDescriptor& field)
      : name_(field.name), track_(field.components) {}

  std::uint64_t count() const override { return track_.count(); }

  void restart(const FieldView& frame) override {
    track_.restart(frame.bytes, frame.count);
    numbers_are_smaller_ = false;
    forget();
  }

  void remap(std::span<const std::uint64_t> sources) override {
    track_.remap(sources);
    staged_.remap(sources, track_.components());
  }

  void encode(const FieldView& frame, const Timeline& times, Zstd& zstd,
              EncodedField& out) override {
    const Choice choice = choice_.choose(track_, frame.bytes, times);
    out.order = static_cast<std::uint8_t>(choice.weights.order);
    out.count = frame.count;
    out.payload.clear();
    ByteSink sink(out.payload);
    sink.u8(static_cast<std::uint8_t>(choice.kind));
    if (choice.kind == WeightsKind::written) {
      for (unsigned j = 0; j < choice.weights.order; ++j) {
        sink.f64(choice.weights.value[j]);
      }
    }
    if constexpr (floating) {
      if (track_.values() >= staged_values_min) {
        out.method = static_cast<std::uint8_t>(Method::residual_bits);
        staged_.encode(track_, frame.bytes, choice, out.payload);
        return;
      }
    }
    encode_simple(frame, choice.weights, zstd, out);
  }

  void decode(const EncodedField& encoded, const Timeline& times, Zstd& zstd,
              std::span<std::byte> frame) override {
    if (encoded.order > order_limit<T> || encoded.order > track_.depth()) {
      fail_damaged(name_, "extrapolation of order " + std::to_string(encoded.order) + " where " +
                              std::to_string(track_.depth()) + " differences are known");
    }
    ByteSource source(encoded.payload, name_);
    const Weights weights = read_weights(source, encoded.order, times);
    if (encoded.method == static_cast<std::uint8_t>(Method::residual_bits)) {
      if constexpr (floating) {
        staged_.decode(track_, source, weights, frame);
      } else {
        fail_damaged(name_, "integers have no second stage");
      }
    } else {
      decode_simple(static_cast<Method>(encoded.method), source, weights, zstd, frame);
    }
  }

  bool encode_following(const DynamicField& slopes, double dt, const FieldView& frame,
                        EncodedField& out) override {
    if constexpr (floating) {
      if (!encode_follow(track_, {slopes.doubles(), slopes.floats()}, dt, frame.bytes, folded_,
                         out.payload)) {
        return false;
      }
      track_.replace(folded_);
      forget();
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
    if constexpr (floating) {
      decode_follow(track_, {slopes.doubles(), slopes.floats()}, dt, encoded.payload, name_,
                    folded_);
      track_.replace(folded_);
      forget();
      track_.for_blocks([&](std::size_t first, std::size_t n) {
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
  /// The history is shorter than what choice and second stage know of.
  void forget() {
    choice_.restart();
    staged_.forget();
    kept_ = Weights();
  }

  Weights read_weights(ByteSource& source, unsigned order, const Timeline& times) {
    const unsigned kind = source.u8();
    if (kind == static_cast<unsigned>(WeightsKind::polynomial)) {
      return weights_for<T>(order, times);
    }
    if (!floating || kind > static_cast<unsigned>(WeightsKind::kept)) {
      fail_damaged(name_, "unknown kind of weights " + std::to_string(kind));
    }
    if (kind == static_cast<unsigned>(WeightsKind::written)) {
      kept_.order = order;
      for (unsigned j = 0; j < order; ++j) {
        kept_.value[j] = source.f64();
      }
    }
    if (kept_.order != order || order == 0) {
      fail_damaged(name_, "kept weights of order " + std::to_string(kept_.order) + ", " +
                              std::to_string(order) + " expected");
    }
    return kept_;
  }

  void encode_simple(const FieldView& frame, const Weights& weights, Zstd& zstd,
                     EncodedField& out) {
    staged_.forget();
    folded_.resize(track_.values());
    track_.begin_frame();
    track_.for_blocks([&](std::size_t first, std::size_t n) {
      std::array<U, block_values> bits;
      std::array<U, block_values> predicted;
      track_.predict(weights, first, n, predicted.data());
      track_.gather(frame.bytes, first, n, bits.data());
      kernels<T>().fold(bits.data(), predicted.data(), n, folded_.data() + first);
      track_.advance(bits.data(), first, n);
    });
    track_.end_frame();
    const std::span<const U> folded(folded_);
    const bool few = folded.size() < staged_values_min;
    const std::size_t head = out.payload.size();
    if (few && numbers_are_smaller_ && ++frames_since_planes_ < planes_interval) {
      encode_numbers(folded, out);
      return;
    }
    frames_since_planes_ = 0;
    out.method = static_cast<std::uint8_t>(Method::residual_planes);
    encode_planes(folded, zstd, scratch_, out.payload);
    if (!few) return;
    const std::vector<std::byte> planes = out.payload;
    out.payload.resize(head);
    encode_numbers(folded, out);
    numbers_are_smaller_ = out.payload.size() <= planes.size();
    if (numbers_are_smaller_) return;
    out.method = static_cast<std::uint8_t>(Method::residual_planes);
    out.payload = planes;
  }

  void encode_numbers(std::span<const U> folded, EncodedField& out) {
    out.method = static_cast<std::uint8_t>(Method::residual_varint);
    ByteSink sink(out.payload);
    encode_varints(folded, sink);
  }

  void decode_simple(Method method, ByteSource& source, const Weights& weights, Zstd& zstd,
                     std::span<std::byte> frame) {
    staged_.forget();
    folded_.resize(track_.values());
    const std::span<U> folded(folded_);
    if (method == Method::residual_varint) {
      decode_varints(source, folded);
    } else {
      decode_planes(source, zstd, scratch_, folded);
    }
    source.finish();
    track_.begin_frame();
    track_.for_blocks([&](std::size_t first, std::size_t n) {
      std::array<U, block_values> bits;
      std::array<U, block_values> predicted;
      track_.predict(weights, first, n, predicted.data());
      kernels<T>().unfold(folded_.data() + first, predicted.data(), n, bits.data());
      track_.advance(bits.data(), first, n);
      track_.scatter(bits.data(), first, n, frame);
    });
    track_.end_frame();
  }

  std::string name_;
  Track<T> track_;
  WeightsChoice<T> choice_;  ///< encoder only
  Weights kept_;             ///< decoder only
  std::conditional_t<floating, StagedCoder<T>, NoStage> staged_;
  std::vector<U> folded_;
  std::vector<std::byte> scratch_;
  bool numbers_are_smaller_ = false;  ///< when last looked at
  unsigned frames_since_planes_ = 0;
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
