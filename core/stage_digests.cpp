#include "core/stage_digests.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace varve::core {

template <class T>
void StageDigests::add(std::span<const T> values) {
  const std::size_t at = bytes_.size();
  bytes_.resize(at + values.size_bytes());
  if (values.empty()) return;
  std::memcpy(bytes_.data() + at, values.data(), values.size_bytes());
  if constexpr (std::endian::native == std::endian::big)
    for (std::size_t k = at; k < bytes_.size(); k += sizeof(T))
      std::reverse(bytes_.begin() + static_cast<std::ptrdiff_t>(k),
                   bytes_.begin() + static_cast<std::ptrdiff_t>(k + sizeof(T)));
}

void StageDigests::values(std::span<const double> values) { add(values); }
void StageDigests::values(std::span<const float> values) { add(values); }
void StageDigests::values(std::span<const std::uint64_t> values) { add(values); }
void StageDigests::values(std::span<const std::int32_t> values) { add(values); }

void StageDigests::finish(Stage stage) {
  const XXH128_hash_t hash = XXH3_128bits(bytes_.data(), bytes_.size());
  digests_.push_back({stage, hash.high64, hash.low64});
  bytes_.clear();
}

}  // namespace varve::core
