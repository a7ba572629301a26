// Turns frames into compressed field blobs and back. The codec knows scalars and time, not physics:
// positions from the `follows` hint with an exception list, everything else by high-order
// extrapolation in time, order-preserving integer differences, transposed planes, zstd. Bits are
// never lost whatever the data; bad hints only cost bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/frame.h"

namespace varve::io {

/// One field of one record, as stored. `payload` is self-contained given the codec's history.
struct EncodedField {
  std::uint8_t method = 0;  ///< io/FORMAT.md, "Field methods"
  std::uint8_t order = 0;   ///< of the extrapolation
  std::uint64_t count = 0;  ///< particles
  std::vector<std::byte> payload;
};

struct CodecLimits {
  std::uint64_t field_bytes_max = std::uint64_t{1} << 30;  ///< uncompressed
  std::uint64_t ratio_max = 10000;                         ///< unless below 1 MiB
};

/// Encodes consecutive frames. A keyframe starts a new history.
class FrameEncoder {
 public:
  static std::unique_ptr<FrameEncoder> create(const Schema& schema);
  virtual ~FrameEncoder() = default;
  /// Encodes all fields; a change of any count forces a keyframe, which is then reported in
  /// `keyframe`. The frame becomes history.
  virtual std::vector<EncodedField> encode(const FrameView& frame, bool& keyframe) = 0;
};

/// Decodes consecutive frames, starting at a keyframe.
class FrameDecoder {
 public:
  static std::unique_ptr<FrameDecoder> create(const Schema& schema, const CodecLimits& limits = {});
  virtual ~FrameDecoder() = default;
  /// Decodes one record; the result is valid until the next call. Hostile input ends in LogError
  /// (damaged or limit), never in a crash or an allocation above the limits.
  virtual const Frame& decode(std::span<const EncodedField> fields, bool keyframe,
                              std::uint64_t step, double time, double dt) = 0;
};

}  // namespace varve::io
