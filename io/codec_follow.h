// The integrator's own rule for positions: value = old value + dt * slope, one multiplication and
// one addition in the value's type, plus a list of values for which that does not hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/codec.h"
#include "io/codec_track.h"

namespace varve::io::codec {

/// Slopes' newest bits, of either floating type.
struct Slopes {
  const Track<double>* doubles = nullptr;
  const Track<float>* floats = nullptr;
  std::size_t values() const {
    return doubles != nullptr ? doubles->values() : floats != nullptr ? floats->values() : 0;
  }
};

/// Writes the exceptions to `payload` and the frame's bits to `bits`. False where more than a
/// twentieth of the values are exceptions; `payload` and `bits` then mean nothing.
template <class T>
bool encode_follow(const Track<T>& values, const Slopes& slopes, double dt,
                   std::span<const std::byte> frame, std::vector<ImageOf<T>>& bits,
                   std::vector<std::byte>& payload);

/// Inverse: the frame's bits.
template <class T>
void decode_follow(const Track<T>& values, const Slopes& slopes, double dt,
                   std::span<const std::byte> payload, const std::string& field,
                   std::vector<ImageOf<T>>& bits);

}  // namespace varve::io::codec
