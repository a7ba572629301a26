#include "io/codec_follow.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "io/codec_bytes.h"

namespace varve::io::codec {
namespace {

/// Bits of the rule's result for values [first, first + n). Where it is not a number, which bits a
/// NaN has is the machine's choice: then the old bits.
template <class T, class V>
void rule(const Track<T>& values, const Track<V>& slopes, T dt, std::size_t first, std::size_t n,
          ImageOf<T>* out) {
  const ImageOf<T>* const old_bits = values.newest().data() + first;
  const ImageOf<V>* const slope_bits = slopes.newest().data() + first;
  for (std::size_t i = 0; i < n; ++i) {
    const T step = dt * static_cast<T>(std::bit_cast<V>(slope_bits[i]));
    const T value = std::bit_cast<T>(old_bits[i]) + step;
    out[i] = value == value ? std::bit_cast<ImageOf<T>>(value) : old_bits[i];
  }
}

template <class T>
void rule(const Track<T>& values, const Slopes& slopes, double dt, std::size_t first,
          std::size_t n, ImageOf<T>* out) {
  if (slopes.doubles != nullptr) {
    rule(values, *slopes.doubles, static_cast<T>(dt), first, n, out);
  } else {
    rule(values, *slopes.floats, static_cast<T>(dt), first, n, out);
  }
}

/// Calls work(first, n) for blocks that lie within one component each, until it returns false.
template <class Work>
bool for_blocks(std::uint64_t count, std::uint32_t components, Work&& work) {
  for (std::uint32_t c = 0; c < components; ++c) {
    for (std::size_t at = 0; at < count; at += block_values) {
      if (!work(c * count + at, std::min<std::size_t>(block_values, count - at))) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

template <class T>
bool encode_follow(const Track<T>& values, const Slopes& slopes, double dt,
                   std::span<const std::byte> frame, std::vector<ImageOf<T>>& bits,
                   std::vector<std::byte>& payload) {
  using U = ImageOf<T>;
  assert(slopes.values() == values.values());
  const std::size_t exceptions_max = values.values() / 20;
  bits.resize(values.values());
  std::vector<std::byte> list;
  ByteSink sink(list);
  std::size_t exceptions = 0;
  std::size_t next = 0;
  const bool holds =
      for_blocks(values.count(), values.components(), [&](std::size_t first, std::size_t n) {
        U expected[block_values];
        rule(values, slopes, dt, first, n, expected);
        values.gather(frame, first, n, bits.data() + first);
        U wrong = 0;
        for (std::size_t i = 0; i < n; ++i) {
          wrong |= expected[i] ^ bits[first + i];
        }
        for (std::size_t i = 0; wrong != 0 && i < n; ++i) {
          if (expected[i] != bits[first + i]) {
            sink.varint(first + i - next);
            sink.varint(zigzag<U>(image_of_bits<T>(bits[first + i]) -
                                  image_of_bits<T>(expected[i])));
            next = first + i + 1;
            ++exceptions;
          }
        }
        return exceptions <= exceptions_max;
      });
  if (!holds) {
    return false;
  }
  payload.clear();
  ByteSink(payload).varint(exceptions);
  payload.insert(payload.end(), list.begin(), list.end());
  return true;
}

template <class T>
void decode_follow(const Track<T>& values, const Slopes& slopes, double dt,
                   std::span<const std::byte> payload, const std::string& field,
                   std::vector<ImageOf<T>>& bits) {
  using U = ImageOf<T>;
  if (slopes.values() != values.values()) {
    fail_damaged(field, "follows a field of another size");
  }
  bits.resize(values.values());
  for_blocks(values.count(), values.components(), [&](std::size_t first, std::size_t n) {
    rule(values, slopes, dt, first, n, bits.data() + first);
    return true;
  });
  ByteSource source(payload, field);
  const std::uint64_t exceptions = source.varint();
  std::uint64_t next = 0;
  for (std::uint64_t k = 0; k < exceptions; ++k) {
    const std::uint64_t gap = source.varint();
    const std::uint64_t difference = source.varint();
    if (next >= bits.size() || gap >= bits.size() - next ||
        difference > std::uint64_t{static_cast<U>(~U{0})}) {
      fail_damaged(field, "an exception lies outside the field");
    }
    U& value = bits[next + gap];
    value = bits_of_image<T>(image_of_bits<T>(value) + unzigzag(static_cast<U>(difference)));
    next += gap + 1;
  }
  source.finish();
}

#define VARVE_INSTANTIATE(T)                                                                      \
  template bool encode_follow<T>(const Track<T>&, const Slopes&, double,                          \
                                 std::span<const std::byte>, std::vector<ImageOf<T>>&,            \
                                 std::vector<std::byte>&);                                        \
  template void decode_follow<T>(const Track<T>&, const Slopes&, double,                          \
                                 std::span<const std::byte>, const std::string&,                  \
                                 std::vector<ImageOf<T>>&);
VARVE_INSTANTIATE(double)
VARVE_INSTANTIATE(float)
#undef VARVE_INSTANTIATE

}  // namespace varve::io::codec
