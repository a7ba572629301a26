#include "io/codec_staged.h"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>

namespace varve::io::codec {
namespace {

/// Frames between two looks at the model of the entropy coder, once the history is old.
constexpr unsigned model_interval = 16;
/// Frames between two that are counted for it, and values of each.
constexpr unsigned count_interval = 4;
constexpr std::size_t count_values = 4096;
/// Runs of neighbours per component on which levels are measured.
constexpr std::size_t sample_run = 16;
constexpr std::size_t sample_runs = 32;
/// Bits of the first byte.
constexpr std::uint8_t has_model = 1;
constexpr std::uint8_t is_rebased = 2;
constexpr std::uint8_t is_fresh = 4;

/// Level that one error alone would set: 64 per bit.
int level_of_error(float error) {
  const int quarters =
      static_cast<int>((std::bit_cast<std::uint32_t>(error) & 0x7fffffffu) >> 21) - (126 << 2);
  return std::max(quarters, 0) * 16;
}

}  // namespace

template <class T>
void StagedCoder<T>::remap(std::span<const std::uint64_t> sources, std::uint32_t components) {
  if (active_) {
    stage_.remap(sources, components);
  }
}

template <class T>
void StagedCoder<T>::encode(Track<T>& track, std::span<const std::byte> frame,
                            const Choice& choice, std::vector<std::byte>& payload) {
  const Weights& weights = choice.weights;
  const bool fresh = !active_;
  if (fresh) {
    stage_.reset(track.values());
    model_ = Model();
    counts_ = {};
    counted_ = 0;
  }
  active_ = true;
  const bool rebased = fresh || choice.changed;
  const int step = fresh ? 0 : choice.step;
  Shifts shifts{};
  if (rebased) {
    look_back(track, weights);
    shifts = find_shifts(track, frame, weights, step);
    stage_.rebase_levels(step, shifts);
  }
  residuals_.resize(track.values());
  tokens_.resize(track.values());
  track.begin_frame();
  track.for_blocks([&](std::size_t first, std::size_t n) {
    std::array<U, block_values> bits;
    std::array<U, block_values> base;
    std::array<U, block_values> predicted;
    std::array<Expectation, block_values> expected;
    const Kernels<T>& kernel = kernels<T>();
    const StageBlock block = stage_.block(first);
    track.predict(weights, first, n, base.data());
    kernel.expect(block, base.data(), n, predicted.data(), expected.data());
    track.gather(frame, first, n, bits.data());
    kernel.subtract(bits.data(), predicted.data(), n, residuals_.data() + first);
    kernel.tokenise(residuals_.data() + first, expected.data(), n, tokens_.data() + first);
    kernel.learn(block, bits.data(), base.data(), n);
    track.advance(bits.data(), first, n);
  });
  track.end_frame();
  stage_.end_frame();

  const bool new_model = improve_model(fresh);
  ByteSink sink(payload);
  sink.u8(static_cast<std::uint8_t>((new_model ? has_model : 0) | (rebased ? is_rebased : 0) |
                                    (fresh ? is_fresh : 0)));
  if (rebased) {
    sink.u8(static_cast<std::uint8_t>(step));
    for (const std::int16_t shift : shifts) {
      sink.u16(static_cast<std::uint16_t>(shift));
    }
  }
  if (new_model) {
    sink.bytes(description_);
    encoder_.set_model(model_);
  }
  encoder_.encode(residuals_, tokens_, track.count(), payload);
}

template <class T>
void StagedCoder<T>::decode(Track<T>& track, ByteSource& source, const Weights& weights,
                            std::span<std::byte> frame) {
  const unsigned flags = source.u8();
  const bool fresh = (flags & is_fresh) != 0;
  const bool rebased = (flags & is_rebased) != 0;
  const bool modelled = (flags & has_model) != 0;
  if (flags > (has_model | is_rebased | is_fresh) || (!fresh && !active_) ||
      (fresh && !(modelled && rebased))) {
    fail_damaged(source.field(), "flags " + std::to_string(flags) + " of residuals do not fit");
  }
  if (fresh) {
    stage_.reset(track.values());
  }
  active_ = true;
  if (rebased) {
    const int step = static_cast<std::int8_t>(source.u8());
    Shifts shifts;
    for (std::int16_t& shift : shifts) {
      shift = static_cast<std::int16_t>(source.u16());
    }
    look_back(track, weights);
    stage_.rebase_levels(step, shifts);
  }
  if (modelled) {
    model_.read(source);
    decoder_.set_model(model_);
  }
  decoder_.begin(source);
  track.begin_frame();
  track.for_blocks([&](std::size_t first, std::size_t n) {
    std::array<U, block_values> bits;
    std::array<U, block_values> base;
    std::array<U, block_values> predicted;
    std::array<U, block_values> residuals;
    std::array<Expectation, block_values> expected;
    const Kernels<T>& kernel = kernels<T>();
    const StageBlock block = stage_.block(first);
    track.predict(weights, first, n, base.data());
    kernel.expect(block, base.data(), n, predicted.data(), expected.data());
    decoder_.decode({expected.data(), n}, residuals.data());
    kernel.add(residuals.data(), predicted.data(), n, bits.data());
    kernel.learn(block, bits.data(), base.data(), n);
    track.advance(bits.data(), first, n);
    track.scatter(bits.data(), first, n, frame);
  });
  decoder_.finish();
  track.end_frame();
  stage_.end_frame();
}

/// Counts the frame's symbols, and now and then fits a model to all counts, the older the less;
/// true if that saves more than its description costs.
template <class T>
bool StagedCoder<T>::improve_model(bool fresh) {
  const bool due = fresh || ++frames_since_model_ >= frames_to_model_;
  if (due || frames_since_model_ % count_interval == 0) {
    const std::size_t stride = std::max<std::size_t>(1, tokens_.size() / count_values) | 1;
    for (std::size_t i = 0; i < tokens_.size(); i += stride) {
      ++counts_[tokens_[i].context()][tokens_[i].symbol()];
    }
    counted_ += tokens_.size() / stride;
  }
  if (!due) {
    return false;
  }
  frames_since_model_ = 0;
  frames_to_model_ = fresh ? 1 : std::min(2 * frames_to_model_, model_interval);
  Model better = model_;
  better.fit(counts_);
  description_.clear();
  ByteSink sink(description_);
  better.write(sink);
  const double saved_per_symbol =
      (model_.cost(counts_) - better.cost(counts_)) / static_cast<double>(counted_);
  const double saved = saved_per_symbol * static_cast<double>(tokens_.size() * model_interval);
  for (auto& context : counts_) {
    for (std::uint32_t& count : context) {
      count /= 2;
    }
  }
  counted_ /= 2;
  if (!fresh && saved < 8.0 * static_cast<double>(description_.size())) {
    return false;
  }
  model_ = better;
  return true;
}

/// Replaces the past residuals by what these weights would have left.
template <class T>
void StagedCoder<T>::look_back(const Track<T>& track, const Weights& weights) {
  track.for_blocks([&](std::size_t first, std::size_t n) {
    for (unsigned age = 0; age < past_residuals; ++age) {
      track.look_back(weights, age, first, n, stage_.past(age) + first);
    }
  });
}

/// What has to be added to the levels that candidates inherit, so that they fit a sample of the
/// frame on average.
template <class T>
typename StagedCoder<T>::Shifts StagedCoder<T>::find_shifts(const Track<T>& track,
                                                            std::span<const std::byte> frame,
                                                            const Weights& weights,
                                                            int step) const {
  std::array<std::int64_t, candidates> sum{};
  std::int64_t values = 0;
  const std::size_t count = track.count();
  const std::size_t stride = std::max(sample_run, count / sample_runs);
  for (std::uint32_t c = 0; c < track.components(); ++c) {
    for (std::size_t at = 0; at < count; at += stride) {
      const std::size_t first = c * count + at;
      const std::size_t n = std::min(sample_run, count - at);
      std::array<U, sample_run> bits;
      std::array<U, sample_run> base;
      track.predict(weights, first, n, base.data());
      track.gather(frame, first, n, bits.data());
      for (std::size_t i = 0; i < n; ++i) {
        using Signed = std::make_signed_t<U>;
        const auto residual =
            static_cast<float>(static_cast<Signed>(image_of_bits<T>(bits[i]) - base[i]));
        const float r1 = stage_.past(0)[first + i];
        const float r2 = stage_.past(1)[first + i];
        const float r3 = stage_.past(2)[first + i];
        const std::array<float, candidates> expected{0, r1, 2 * r1 - r2, 3 * (r1 - r2) + r3};
        for (unsigned k = 0; k < candidates; ++k) {
          sum[k] += level_of_error(residual - expected[k]) -
                    static_cast<int>(stage_.level(inherited(k, step), first + i));
        }
      }
      values += static_cast<std::int64_t>(n);
    }
  }
  Shifts shifts;
  for (unsigned k = 0; k < candidates; ++k) {
    shifts[k] = static_cast<std::int16_t>(sum[k] / std::max<std::int64_t>(values, 1));
  }
  return shifts;
}

template class StagedCoder<double>;
template class StagedCoder<float>;

}  // namespace varve::io::codec
