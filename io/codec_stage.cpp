#include "io/codec_stage.h"

#include <algorithm>

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

void Stage::rebase_levels(int step, const std::array<std::int16_t, candidates>& shifts) {
  for (std::size_t v = 0; v < values_; ++v) {
    std::array<int, candidates> before;
    for (unsigned k = 0; k < candidates; ++k) {
      before[k] = level_of(k)[v];
    }
    for (unsigned k = 0; k < candidates; ++k) {
      const int level = before[inherited(k, step)] + shifts[k];
      level_of(k)[v] = static_cast<std::uint16_t>(std::clamp(level, 0, level_max));
    }
  }
}

}  // namespace varve::io::codec
