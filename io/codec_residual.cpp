#include "io/codec_residual.h"

#include <algorithm>

#include "io/codec_image.h"

namespace varve::io::codec {

template <class U>
void encode_varints(std::span<const U> folded, ByteSink& sink) {
  for (const U value : folded) {
    sink.varint(value);
  }
}

template <class U>
void decode_varints(ByteSource& source, std::span<U> folded) {
  for (U& value : folded) {
    const std::uint64_t number = source.varint();
    value = static_cast<U>(number);
    if (value != number) {
      fail_damaged(source.field(), "a difference exceeds the width of its type");
    }
  }
}

template <class U>
void encode_planes(std::span<const U> folded, Zstd& zstd, std::vector<std::byte>& scratch,
                   std::vector<std::byte>& out) {
  U all = 0;
  for (const U value : folded) {
    all |= value;
  }
  const unsigned planes = (bit_length(all) + 7) / 8;
  out.push_back(static_cast<std::byte>(planes));
  if (planes == 0) {
    return;
  }
  scratch.resize(planes * folded.size());
  for (unsigned p = 0; p < planes; ++p) {
    std::byte* const plane = scratch.data() + p * folded.size();
    for (std::size_t i = 0; i < folded.size(); ++i) {
      plane[i] = static_cast<std::byte>(folded[i] >> (8 * p));
    }
  }
  zstd.compress(scratch, out);
}

template <class U>
void decode_planes(ByteSource& source, Zstd& zstd, std::vector<std::byte>& scratch,
                   std::span<U> folded) {
  const unsigned planes = source.u8();
  if (planes > sizeof(U)) {
    fail_damaged(source.field(), std::to_string(planes) + " byte planes, at most " +
                                     std::to_string(sizeof(U)) + " possible");
  }
  std::fill(folded.begin(), folded.end(), U{0});
  if (planes == 0) {
    return;
  }
  scratch.resize(planes * folded.size());
  zstd.expand(source.rest(), scratch, source.field());
  for (unsigned p = 0; p < planes; ++p) {
    const std::byte* const plane = scratch.data() + p * folded.size();
    for (std::size_t i = 0; i < folded.size(); ++i) {
      folded[i] |= static_cast<U>(plane[i]) << (8 * p);
    }
  }
}

#define VARVE_INSTANTIATE(U)                                                                      \
  template void encode_varints<U>(std::span<const U>, ByteSink&);                                 \
  template void decode_varints<U>(ByteSource&, std::span<U>);                                     \
  template void encode_planes<U>(std::span<const U>, Zstd&, std::vector<std::byte>&,              \
                                 std::vector<std::byte>&);                                        \
  template void decode_planes<U>(ByteSource&, Zstd&, std::vector<std::byte>&, std::span<U>);
VARVE_INSTANTIATE(std::uint64_t)
VARVE_INSTANTIATE(std::uint32_t)
#undef VARVE_INSTANTIATE

}  // namespace varve::io::codec
