#include "io/ulp.h"

#include <bit>

namespace varve::io {
namespace {

// Sign-magnitude to unsigned: negative numbers are mirrored below the middle, the others above it.
template <class Bits>
Bits to_order(Bits bits) {
  constexpr Bits sign = Bits{1} << (8 * sizeof(Bits) - 1);
  return (bits & sign) != 0 ? static_cast<Bits>(~bits) : static_cast<Bits>(bits | sign);
}

}  // namespace

std::uint64_t ordered_bits(double x) { return to_order(std::bit_cast<std::uint64_t>(x)); }
std::uint32_t ordered_bits(float x) { return to_order(std::bit_cast<std::uint32_t>(x)); }

std::uint64_t ulp_distance(double a, double b) {
  const std::uint64_t i = ordered_bits(a), k = ordered_bits(b);
  return i < k ? k - i : i - k;
}

std::uint64_t ulp_distance(float a, float b) {
  const std::uint32_t i = ordered_bits(a), k = ordered_bits(b);
  return i < k ? k - i : i - k;
}

}  // namespace varve::io
