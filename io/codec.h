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
  std::uint8_t method = 0;  ///< io/CODEC.md, "Methods"
  std::uint8_t order = 0;   ///< of the extrapolation
  std::uint64_t count = 0;  ///< particles
  std::vector<std::byte> payload;
};

struct CodecLimits {
  std::uint64_t field_bytes_max = std::uint64_t{1} << 30;  ///< uncompressed, per field
  /// Uncompressed / stored bytes, over all fields of a record that are stored whole; not applied
  /// where they come to less than 1 MiB uncompressed.
  std::uint64_t ratio_max = 10000;
};

/// Encodes consecutive frames. A keyframe starts a new history.
class FrameEncoder {
 public:
  /// Throws LogError (mismatch) for a field without components.
  static std::unique_ptr<FrameEncoder> create(const Schema& schema);
  virtual ~FrameEncoder() = default;
  /// The next frame is a keyframe: stored whole, decodable without any frame before it. Deciding
  /// when is the caller's part; the encoder itself makes only the first frame one.
  virtual void restart() = 0;
  /// Encodes all fields, in the schema's order; the frame becomes history. `keyframe` tells whether
  /// the record is self-contained. A population whose particles came or went does not need a
  /// keyframe: where it has ascending ids, those that stay keep their history; where it has none,
  /// its fields alone are stored whole. Fields that are called constant and change all the same are
  /// stored whole as well. `frame.time` must be the frame's time, `frame.dt` the step's length for
  /// the `follows` rule; frames may lie several steps apart. Throws LogError (mismatch) where
  /// counts or sizes do not fit the schema; the next frame is then a keyframe.
  virtual std::vector<EncodedField> encode(const FrameView& frame, bool& keyframe) = 0;
};

/// Decodes consecutive frames, starting at a keyframe.
class FrameDecoder {
 public:
  static std::unique_ptr<FrameDecoder> create(const Schema& schema, const CodecLimits& limits = {});
  virtual ~FrameDecoder() = default;
  /// Decodes one record; the result is valid until the next call and holds no table rows. Hostile
  /// input ends in LogError (damaged or limit; path empty), never in a crash. Memory stays below 16
  /// times the declared sizes of the fields, each of which is limited. After a failure only a
  /// keyframe is accepted.
  virtual const Frame& decode(std::span<const EncodedField> fields, bool keyframe,
                              std::uint64_t step, double time, double dt) = 0;
  /// The same for some populations: `wanted` has an entry per field, alike over a population. Other
  /// fields need no payload and come out empty; deltas of theirs are refused until a keyframe in
  /// which they are wanted again.
  virtual const Frame& decode(std::span<const EncodedField> fields,
                              const std::vector<bool>& wanted, bool keyframe, std::uint64_t step,
                              double time, double dt) = 0;
};

}  // namespace varve::io
