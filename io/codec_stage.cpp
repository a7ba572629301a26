#include "io/codec_stage.h"

#include <algorithm>
#include <cstring>

#include "io/codec_track.h"

namespace varve::io::codec {

void Stage::reset(std::size_t values) {
  if (values != values_ || past_ == nullptr) {
    values_ = values;
    // Equal indices of different planes must not fall into one set of the cache.
    stride_ = (values + 1023) / 1024 * 1024 + 80;
    past_ = std::make_unique_for_overwrite<float[]>(past_residuals * stride_);
    level_ = std::make_unique_for_overwrite<std::uint16_t[]>(candidates * stride_);
  }
  newest_ = 0;
  std::fill_n(past_.get(), past_residuals * stride_, 0.0f);
  std::fill_n(level_.get(), candidates * stride_, std::uint16_t{0});
}

void Stage::remap(std::span<const std::uint64_t> sources, std::uint32_t components) {
  const Stage old = std::move(*this);
  *this = Stage();
  reset(sources.size() * components);
  const std::size_t old_count = old.values_ / components;
  for (std::size_t v = 0; v < values_; ++v) {
    const std::size_t component = v / sources.size();
    const std::uint64_t source = sources[v % sources.size()];
    if (source == no_source) {
      continue;
    }
    const std::size_t from = component * old_count + source;
    for (unsigned k = 0; k < past_residuals; ++k) {
      past(k)[v] = old.past(k)[from];
    }
    for (unsigned k = 0; k < candidates; ++k) {
      level_of(k)[v] = old.level_of(k)[from];
    }
  }
}

StageBlock Stage::block(std::size_t first) const {
  StageBlock block;
  for (unsigned k = 0; k < past_residuals; ++k) {
    block.past[k] = past(k) + first;
  }
  for (unsigned k = 0; k < candidates; ++k) {
    block.level[k] = level_of(k) + first;
  }
  block.incoming = past(past_residuals - 1) + first;
  return block;
}

// In 16 bits throughout, of which every machine has vectors: a shift beyond the largest level does
// what one of that size does.
void Stage::rebase_levels(int step, const std::array<std::int16_t, candidates>& shifts) {
  constexpr std::size_t block = 512;
  std::array<std::array<std::int16_t, block>, candidates> before;
  for (std::size_t first = 0; first < values_; first += block) {
    const std::size_t n = std::min(block, values_ - first);
    for (unsigned k = 0; k < candidates; ++k) {
      std::memcpy(before[k].data(), level_of(k) + first, n * sizeof(std::int16_t));
    }
    for (unsigned k = 0; k < candidates; ++k) {
      const auto shift =
          static_cast<std::int16_t>(std::clamp<int>(shifts[k], -level_max, level_max));
      const std::int16_t* const from = before[inherited(k, step)].data();
      std::uint16_t* const to = level_of(k) + first;
      for (std::size_t i = 0; i < n; ++i) {
        const auto level = static_cast<std::int16_t>(from[i] + shift);
        to[i] = static_cast<std::uint16_t>(
            std::clamp(level, std::int16_t{0}, static_cast<std::int16_t>(level_max)));
      }
    }
  }
}

}  // namespace varve::io::codec
