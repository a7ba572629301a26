// Turns folded differences (small unsigned numbers where the prediction was good) into bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/codec_bytes.h"
#include "io/codec_method.h"
#include "io/codec_zstd.h"

namespace varve::io::codec {

/// One LEB128 number per difference.
template <class U>
void encode_varints(std::span<const U> folded, ByteSink& sink);
template <class U>
void decode_varints(ByteSource& source, std::span<U> folded);

/// Number of planes (bytes of the largest difference), then the planes, lowest first, through zstd.
template <class U>
void encode_planes(std::span<const U> folded, Zstd& zstd, std::vector<std::byte>& scratch,
                   std::vector<std::byte>& out);
template <class U>
void decode_planes(ByteSource& source, Zstd& zstd, std::vector<std::byte>& scratch,
                   std::span<U> folded);

}  // namespace varve::io::codec
