// Random numbers without a generator's state: a pure function of (seed, id, draw), so that neither
// order, threads nor restarts matter.
#pragma once

#include <cstdint>

namespace varve::core {

/// Steele, Lea & Flood's SplitMix64 finaliser (variant 13 of Stafford): a bijection that mixes
/// well.
constexpr std::uint64_t mixed_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// 64 random bits for draw number `draw` of particle `id` under `seed`. Each argument enters
/// through its own round and odd constant, so that neighbouring seeds, ids and draws are unrelated.
constexpr std::uint64_t random_bits(std::uint64_t seed, std::uint64_t id, std::uint64_t draw) {
  std::uint64_t x = mixed_bits(seed + 0x9e3779b97f4a7c15u);
  x = mixed_bits(x ^ (id * 0xd1342543de82ef95u + 0x2545f4914f6cdd1du));
  return mixed_bits(x ^ (draw * 0xaf251af3b0f025b5u + 0xb564ef22ec7aece5u));
}

/// Uniform in [0, 1): a multiple of 2^-53.
constexpr double uniform(std::uint64_t seed, std::uint64_t id, std::uint64_t draw) {
  return static_cast<double>(random_bits(seed, id, draw) >> 11) * 0x1p-53;
}

/// Uniform in [-1, 1).
constexpr double symmetric(std::uint64_t seed, std::uint64_t id, std::uint64_t draw) {
  return 2.0 * uniform(seed, id, draw) - 1.0;
}

}  // namespace varve::core
