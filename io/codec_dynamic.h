// A field that changes from step to step: extrapolated from its own past, or rebuilt from the field
// it follows. One object serves either an encoder or a decoder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "io/codec.h"
#include "io/codec_extrapolate.h"
#include "io/codec_track.h"
#include "io/codec_zstd.h"

namespace varve::io::codec {

class DynamicField {
 public:
  static std::unique_ptr<DynamicField> create(const FieldDescriptor& field);
  virtual ~DynamicField() = default;

  /// Particles in the history.
  virtual std::uint64_t count() const = 0;
  /// `frame` was stored whole: it is all the history there is.
  virtual void restart(const FieldView& frame) = 0;
  /// Particles came or went (Track::remap).
  virtual void remap(std::span<const std::uint64_t> sources) = 0;

  /// Stores the difference from the extrapolation; the frame becomes history.
  virtual void encode(const FieldView& frame, const Timeline& times, Zstd& zstd,
                      EncodedField& out) = 0;
  virtual void decode(const EncodedField& encoded, const Timeline& times, Zstd& zstd,
                      std::span<std::byte> frame) = 0;

  /// Stores the exceptions from  value = old value + dt * slope,  where `slopes` already holds the
  /// new frame. False, and nothing is changed, where there are too many.
  virtual bool encode_following(const DynamicField& slopes, double dt, const FieldView& frame,
                                EncodedField& out) = 0;
  virtual void decode_following(const DynamicField& slopes, double dt, const EncodedField& encoded,
                                std::span<std::byte> frame) = 0;

  /// The history, where the field is of that type; else null.
  virtual const Track<double>* doubles() const { return nullptr; }
  virtual const Track<float>* floats() const { return nullptr; }
};

}  // namespace varve::io::codec
