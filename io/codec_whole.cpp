#include "io/codec_whole.h"

#include <algorithm>

#include "io/codec_bytes.h"
#include "io/codec_image.h"
#include "io/codec_method.h"

namespace varve::io::codec {
namespace {

/// Below this many bytes zstd's own header costs more than it saves.
constexpr std::size_t zstd_bytes_min = 64;

/// Values to planes: plane p of component c holds byte p (0: lowest) of that component of all
/// particles. Planes are written by shifts, so that the machine's own byte order does not matter.
template <class T>
void split_planes(std::span<const std::byte> values, std::uint32_t components, std::byte* planes) {
  const std::size_t count = values.size() / (components * sizeof(T));
  for (std::uint32_t c = 0; c < components; ++c) {
    for (std::size_t p = 0; p < sizeof(T); ++p) {
      std::byte* const plane = planes + (c * sizeof(T) + p) * count;
      const std::byte* at = values.data() + c * sizeof(T);
      for (std::size_t i = 0; i < count; ++i) {
        plane[i] = static_cast<std::byte>(load_bits<T>(at + i * components * sizeof(T)) >> (8 * p));
      }
    }
  }
}

template <class T>
void join_planes(std::span<const std::byte> planes, std::uint32_t components,
                 std::span<std::byte> values) {
  const std::size_t count = values.size() / (components * sizeof(T));
  for (std::uint32_t c = 0; c < components; ++c) {
    const std::byte* const first = planes.data() + c * sizeof(T) * count;
    for (std::size_t i = 0; i < count; ++i) {
      ImageOf<T> bits = 0;
      for (std::size_t p = 0; p < sizeof(T); ++p) {
        bits |= static_cast<ImageOf<T>>(first[p * count + i]) << (8 * p);
      }
      store_bits<T>(values.data() + (i * components + c) * sizeof(T), bits);
    }
  }
}

/// Calls `work` with a value of the field's type.
template <class Work>
void with_type(ScalarType type, Work&& work) {
  switch (type) {
    case ScalarType::f64: work(double{}); break;
    case ScalarType::f32: work(float{}); break;
    case ScalarType::u64: work(std::uint64_t{}); break;
    case ScalarType::u32: work(std::uint32_t{}); break;
    case ScalarType::u8: work(std::uint8_t{}); break;
  }
}

template <class T>
void swap_to_little_endian(std::span<std::byte> values) {
  if constexpr (std::endian::native == std::endian::big && sizeof(T) > 1) {
    for (std::size_t i = 0; i < values.size(); i += sizeof(T)) {
      std::reverse(values.begin() + static_cast<std::ptrdiff_t>(i),
                   values.begin() + static_cast<std::ptrdiff_t>(i + sizeof(T)));
    }
  }
}

}  // namespace

void encode_plain(const FieldDescriptor& field, const FieldView& view, EncodedField& out) {
  out.method = static_cast<std::uint8_t>(Method::plain);
  out.order = 0;
  out.count = view.count;
  out.payload.assign(view.bytes.begin(), view.bytes.end());
  with_type(field.type, [&](auto type) { swap_to_little_endian<decltype(type)>(out.payload); });
}

void encode_whole(const FieldDescriptor& field, const FieldView& view, Zstd& zstd,
                  EncodedField& out) {
  if (view.bytes.size() >= zstd_bytes_min) {
    std::vector<std::byte> planes(view.bytes.size());
    with_type(field.type, [&](auto type) {
      split_planes<decltype(type)>(view.bytes, field.components, planes.data());
    });
    out.method = static_cast<std::uint8_t>(Method::shuffled);
    out.order = 0;
    out.count = view.count;
    out.payload.clear();
    zstd.compress(planes, out.payload);
    if (out.payload.size() < view.bytes.size()) {
      return;
    }
  }
  encode_plain(field, view, out);
}

void decode_whole(const FieldDescriptor& field, const EncodedField& encoded, Zstd& zstd,
                  std::span<std::byte> values) {
  if (encoded.method == static_cast<std::uint8_t>(Method::plain)) {
    if (encoded.payload.size() != values.size()) {
      fail_damaged(field.name, "plain payload of " + std::to_string(encoded.payload.size()) +
                                   " bytes, " + std::to_string(values.size()) + " expected");
    }
    std::copy(encoded.payload.begin(), encoded.payload.end(), values.begin());
    with_type(field.type, [&](auto type) { swap_to_little_endian<decltype(type)>(values); });
  } else {
    std::vector<std::byte> planes(values.size());
    zstd.expand(encoded.payload, planes, field.name);
    with_type(field.type, [&](auto type) {
      join_planes<decltype(type)>(planes, field.components, values);
    });
  }
}

}  // namespace varve::io::codec
