// Fields stored whole: in keyframes, and where a population has no past to compare with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/codec.h"
#include "io/codec_zstd.h"

namespace varve::io::codec {

/// The values as they are.
void encode_plain(const FieldDescriptor& field, const FieldView& view, EncodedField& out);

/// Byte planes and zstd, or plain where that is not smaller.
void encode_whole(const FieldDescriptor& field, const FieldView& view, Zstd& zstd,
                  EncodedField& out);

/// Inverse of both, by `encoded.method`; `values.size()` is what the count asks for.
void decode_whole(const FieldDescriptor& field, const EncodedField& encoded, Zstd& zstd,
                  std::span<std::byte> values);

}  // namespace varve::io::codec
