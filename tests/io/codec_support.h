// Frames made up for the codec's tests: any schema, any bits, owned.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "io/codec.h"
#include "io/frame.h"

namespace varve::io::test {

inline FieldDescriptor field(std::string name, std::string population, ScalarType type,
                             std::uint32_t components = 1, std::string follows = {}) {
  FieldDescriptor result;
  result.name = std::move(name);
  result.population = std::move(population);
  result.type = type;
  result.components = components;
  result.follows = std::move(follows);
  return result;
}

inline FieldDescriptor id_field(std::string name, std::string population,
                                std::uint32_t components = 1) {
  FieldDescriptor result =
      field(std::move(name), std::move(population), ScalarType::u64, components);
  result.is_id = true;
  return result;
}

inline FieldDescriptor constant_field(std::string name, std::string population, ScalarType type) {
  FieldDescriptor result = field(std::move(name), std::move(population), type);
  result.constant = true;
  return result;
}

/// A frame for `schema` in which every field is still empty.
inline Frame empty_frame(const Schema& schema) {
  Frame frame;
  frame.counts.resize(schema.fields.size());
  frame.fields.resize(schema.fields.size());
  frame.rows.resize(schema.tables.size());
  frame.tables.resize(schema.tables.size());
  return frame;
}

/// Sets field `index` to `values` (particle-major).
template <class T>
void set_values(Frame& frame, std::size_t index, std::uint32_t components,
                const std::vector<T>& values) {
  frame.counts[index] = values.size() / components;
  frame.fields[index].resize(values.size() * sizeof(T));
  if (!values.empty()) {
    std::memcpy(frame.fields[index].data(), values.data(), values.size() * sizeof(T));
  }
}

template <class T>
std::vector<T> get_values(const Frame& frame, std::size_t index) {
  std::vector<T> values(frame.fields[index].size() / sizeof(T));
  if (!values.empty()) {
    std::memcpy(values.data(), frame.fields[index].data(), frame.fields[index].size());
  }
  return values;
}

inline std::size_t payload_bytes(std::span<const EncodedField> fields) {
  std::size_t sum = 0;
  for (const EncodedField& encoded : fields) {
    sum += encoded.payload.size();
  }
  return sum;
}

/// Encoder and decoder side by side.
class Link {
 public:
  explicit Link(const Schema& schema)
      : encoder(FrameEncoder::create(schema)), decoder(FrameDecoder::create(schema)) {}

  /// Sends one frame through both; true if it comes out bit for bit.
  bool same(const Frame& frame) {
    encoded = encoder->encode(frame.view(), keyframe);
    const Frame& back = decoder->decode(encoded, keyframe, frame.step, frame.time, frame.dt);
    return back.counts == frame.counts && back.fields == frame.fields &&
           back.step == frame.step &&
           std::bit_cast<std::uint64_t>(back.time) == std::bit_cast<std::uint64_t>(frame.time);
  }

  std::unique_ptr<FrameEncoder> encoder;
  std::unique_ptr<FrameDecoder> decoder;
  std::vector<EncodedField> encoded;  ///< of the last frame
  bool keyframe = false;
};

}  // namespace varve::io::test
