// How a field of a record is stored. The numbers are on disk (io/CODEC.md).
#pragma once

#include <cstdint>

namespace varve::io::codec {

enum class Method : std::uint8_t {
  // Need nothing but the payload, and start a new history of the field:
  plain = 1,      ///< the values, little endian
  shuffled = 2,   ///< byte planes per component, zstd
  id_runs = 3,    ///< ascending ids of one component, as runs
  id_deltas = 4,  ///< ascending keys of several components, as differences
  // Need the frame before:
  unchanged = 16,        ///< empty payload
  id_edit = 17,          ///< ids taken out and put in; moves the history of the whole population
  follows = 18,          ///< rebuilt from the field it follows, with exceptions
  residual_varint = 19,  ///< differences from the extrapolation, LEB128
  residual_planes = 20,  ///< the same, byte planes, zstd
  residual_bits = 21,    ///< the same, entropy-coded bit lengths and raw bits
};

/// True for methods that need no history.
constexpr bool is_whole(std::uint8_t method) { return method >= 1 && method <= 4; }

/// True for methods that store differences from an extrapolation.
constexpr bool is_extrapolated(std::uint8_t method) { return method >= 19 && method <= 21; }

}  // namespace varve::io::codec
