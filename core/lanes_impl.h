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

#ifdef __AVX512F__
/// All components of records at the lanes' indices. Records are as long as a vector: each is loaded
/// whole, then rows are turned into columns, which costs a third of what loading every number by
/// itself does. (Narrower vectors gain nothing by it.)
template <class T>
inline __attribute__((always_inline)) void gather_records(const T* data, const std::int32_t* index,
                                                          Lane<T>* component) {
  static_assert(record_length == lanes);
  Lane<T> row[lanes];
  for (std::size_t l = 0; l < lanes; ++l)
    __builtin_memcpy(&row[l], data + static_cast<std::ptrdiff_t>(index[l]) * record_length,
                     sizeof(Lane<T>));
  Lane<T> pairs[2][4];  // even and odd components of rows 2 k and 2 k + 1
  for (int k = 0; k < 4; ++k) {
    const Lane<T> a = row[2 * k], b = row[2 * k + 1];
    pairs[0][k] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
    pairs[1][k] = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int odd = 0; odd < 2; ++odd) {
    const Lane<T>* const u = pairs[odd];
    const Lane<T> low01 = __builtin_shufflevector(u[0], u[1], 0, 1, 2, 3, 8, 9, 10, 11);
    const Lane<T> low23 = __builtin_shufflevector(u[2], u[3], 0, 1, 2, 3, 8, 9, 10, 11);
    const Lane<T> high01 = __builtin_shufflevector(u[0], u[1], 4, 5, 6, 7, 12, 13, 14, 15);
    const Lane<T> high23 = __builtin_shufflevector(u[2], u[3], 4, 5, 6, 7, 12, 13, 14, 15);
    component[odd] = __builtin_shufflevector(low01, low23, 0, 1, 4, 5, 8, 9, 12, 13);
    component[2 + odd] = __builtin_shufflevector(low01, low23, 2, 3, 6, 7, 10, 11, 14, 15);
    component[4 + odd] = __builtin_shufflevector(high01, high23, 0, 1, 4, 5, 8, 9, 12, 13);
    component[6 + odd] = __builtin_shufflevector(high01, high23, 2, 3, 6, 7, 10, 11, 14, 15);
  }
}
#endif

template <class To, class From>
inline __attribute__((always_inline)) Lane<To> narrow(Lane<From> value) {
  if constexpr (sizeof(To) == sizeof(From))
    return value;
  else
    return __builtin_convertvector(value, Lane<To>);
}

}  // namespace
}  // namespace varve::core::VARVE_ISA
