// Eight numbers side by side, for loops that are compiled once per instruction set with VARVE_ISA
// naming the inner namespace. No inline function of the standard library is called here: the
// linker might otherwise keep the copy made for a wider instruction set and run it on a processor
// that lacks it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/pair_sweeps.h"

namespace varve::core::VARVE_ISA {
namespace {

template <class T>
struct LaneVector {
  typedef T type __attribute__((vector_size(lanes * sizeof(T))));
};
template <class T>
using Lane = typename LaneVector<T>::type;

template <class T>
inline __attribute__((always_inline)) void square_root(Lane<T>& value) {
  for (std::size_t l = 0; l < lanes; ++l) {
    if constexpr (sizeof(T) == 8)
      value[l] = __builtin_sqrt(value[l]);
    else
      value[l] = __builtin_sqrtf(value[l]);
  }
}

template <class T>
inline __attribute__((always_inline)) Lane<T> positive(Lane<T> value) {
  return value > T(0) ? value : Lane<T>{};
}

/// Entry `component` of `stride`-component vectors at the lanes' indices.
template <class T>
inline __attribute__((always_inline)) Lane<T> gather(const T* data, const std::int32_t* index,
                                                     int stride, int component) {
  Lane<T> value;
  for (std::size_t l = 0; l < lanes; ++l)
    value[l] = data[static_cast<std::ptrdiff_t>(index[l]) * stride + component];
  return value;
}

template <class To, class From>
inline __attribute__((always_inline)) Lane<To> narrow(Lane<From> value) {
  if constexpr (sizeof(To) == sizeof(From))
    return value;
  else
    return __builtin_convertvector(value, Lane<To>);
}

}  // namespace
}  // namespace varve::core::VARVE_ISA
