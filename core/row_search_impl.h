// The loop of core/row_search.h, included once per instruction set (core/lanes_impl.h says what may
// be called here).
#pragma once

#include "core/lanes_impl.h"
#include "core/row_search.h"

#ifdef __AVX512VL__
#include <immintrin.h>
#endif

namespace varve::core::VARVE_ISA {
namespace {

/// Writes the ids at the lanes that `chosen` marks with -1, in order; returns their end.
inline __attribute__((always_inline)) std::int32_t* compress(const std::int32_t* ids,
                                                             Lane<std::int64_t> chosen,
                                                             std::int32_t* out) {
#ifdef __AVX512VL__
  const __mmask8 mask = _mm512_movepi64_mask(reinterpret_cast<__m512i>(chosen));
  const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(ids));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_maskz_compress_epi32(mask, all));
  return out + __builtin_popcount(mask);
#else
  // Without a branch on the distance, which is as good as random.
  for (std::size_t l = 0; l < lanes; ++l) {
    *out = ids[l];
    out -= chosen[l];
  }
  return out;
#endif
}

template <int D, bool periodic>
inline __attribute__((always_inline)) std::int32_t* near(const RowSearchData<D>& s,
                                                         Stretch stretch, const double* point,
                                                         std::int32_t own, std::int32_t* out) {
  const Lane<std::int64_t> ramp = {0, 1, 2, 3, 4, 5, 6, 7};
  for (std::uint32_t k = stretch.begin; k < stretch.end; k += lanes) {
    Lane<double> r2{};
    for (int c = 0; c < D; ++c) {
      Lane<double> x;
      __builtin_memcpy(&x, s.coordinates[c] + k, sizeof x);
      Lane<double> d = point[c] - x;
      if constexpr (periodic) {
        const Lane<double> lengths = s.period[c] - Lane<double>{};
        d = d > 0.5 * lengths ? d - lengths : d;
        d = d < -0.5 * lengths ? d + lengths : d;
      }
      r2 += d * d;
    }
    LaneVector<std::int32_t>::type ids;
    __builtin_memcpy(&ids, s.ids + k, sizeof ids);
    const std::int64_t left = static_cast<std::int64_t>(stretch.end - k);
    const Lane<std::int64_t> inside = (r2 < s.radius2) & (ramp < left) &
                                      __builtin_convertvector(ids != own, Lane<std::int64_t>);
    out = compress(s.ids + k, inside, out);
  }
  return out;
}

/// Sorts different numbers by counting for each the smaller ones, sixteen at a time: no branch that
/// could be guessed wrong.
inline __attribute__((always_inline)) void sort_by_counting(std::int32_t* first, int count) {
  typedef std::int32_t Sixteen __attribute__((vector_size(64)));
  constexpr int width = 16;
  const int parts = (count + width - 1) / width;
  Sixteen number[longest_sorted / width], rank[longest_sorted / width];
  for (int p = 0; p < parts; ++p) number[p] = Sixteen{};
  __builtin_memcpy(number, first, static_cast<std::size_t>(count) * sizeof *first);
  for (int p = 0; p < parts; ++p) {
    Sixteen smaller{};
    for (int j = 0; j < count; ++j) smaller -= number[p] > (first[j] - Sixteen{});
    rank[p] = smaller;
  }
  for (int j = 0; j < count; ++j) first[rank[j / width][j % width]] = number[j / width][j % width];
}

template <int D, bool periodic>
std::int32_t* find_row(const RowSearchData<D>& data, const Stretch* stretches, int stretch_count,
                       const double* point, std::int32_t own, std::int32_t* out) {
  std::int32_t* last = out;
  for (int k = 0; k < stretch_count; ++k)
    last = near<D, periodic>(data, stretches[k], point, own, last);
  if (last - out <= longest_sorted) sort_by_counting(out, static_cast<int>(last - out));
  return last;
}

}  // namespace

template <int D>
RowSearch<D> search_row(bool periodic) {
  return periodic ? find_row<D, true> : find_row<D, false>;
}
template RowSearch<2> search_row<2>(bool);
template RowSearch<3> search_row<3>(bool);

}  // namespace varve::core::VARVE_ISA
