#include "io/codec_identity.h"

#include <algorithm>
#include <compare>

#include "io/codec_bytes.h"
#include "io/codec_image.h"
#include "io/codec_method.h"
#include "io/codec_track.h"

namespace varve::io::codec {
namespace {

/// Keys of a field in host order, read and written as numbers.
class Keys {
 public:
  Keys(const FieldDescriptor& field, std::span<const std::byte> bytes)
      : type_(field.type), components_(field.components), data_(bytes.data()) {}
  std::uint32_t components() const { return components_; }
  std::uint64_t at(std::uint64_t particle, std::uint32_t component) const {
    const std::byte* const scalar = data_ + (particle * components_ + component) * size_of(type_);
    switch (type_) {
      case ScalarType::u64: return load_bits<std::uint64_t>(scalar);
      case ScalarType::u32: return load_bits<std::uint32_t>(scalar);
      default: return load_bits<std::uint8_t>(scalar);
    }
  }
  /// Order of key `i` here and key `j` there.
  std::strong_ordering compare(std::uint64_t i, const Keys& other, std::uint64_t j) const {
    for (std::uint32_t c = 0; c < components_; ++c) {
      if (const auto order = at(i, c) <=> other.at(j, c); order != 0) {
        return order;
      }
    }
    return std::strong_ordering::equal;
  }

 private:
  ScalarType type_;
  std::uint32_t components_;
  const std::byte* data_;
};

std::uint64_t largest(ScalarType type) {
  switch (type) {
    case ScalarType::u64: return ~std::uint64_t{0};
    case ScalarType::u32: return ~std::uint32_t{0};
    default: return 0xff;
  }
}

void store_id(const FieldDescriptor& field, std::span<std::byte> ids, std::uint64_t index,
              std::uint64_t value) {
  if (value > largest(field.type)) {
    fail_damaged(field.name, "id " + std::to_string(value) + " does not fit its type");
  }
  std::byte* const at = ids.data() + index * size_of(field.type);
  switch (field.type) {
    case ScalarType::u64: store_bits<std::uint64_t>(at, value); break;
    case ScalarType::u32: store_bits<std::uint32_t>(at, static_cast<std::uint32_t>(value)); break;
    default: store_bits<std::uint8_t>(at, static_cast<std::uint8_t>(value)); break;
  }
}

/// a + b, refused where it does not fit into 64 bits.
std::uint64_t sum(const FieldDescriptor& field, std::uint64_t a, std::uint64_t b) {
  if (a > ~std::uint64_t{0} - b) {
    fail_damaged(field.name, "an id exceeds 64 bits");
  }
  return a + b;
}

void encode_runs(const Keys& keys, std::uint64_t count, ByteSink& sink) {
  std::uint64_t expected = 0;
  for (std::uint64_t i = 0; i < count;) {
    const std::uint64_t start = keys.at(i, 0);
    std::uint64_t length = 1;
    while (i + length < count && keys.at(i + length, 0) == start + length) {
      ++length;
    }
    sink.varint(start - expected);
    sink.varint(length - 1);
    expected = start + length;
    i += length;
  }
}

void decode_runs(const FieldDescriptor& field, ByteSource& source, std::uint64_t count,
                 std::span<std::byte> ids) {
  std::uint64_t next = 0;
  for (std::uint64_t i = 0; i < count;) {
    const std::uint64_t start = sum(field, next, source.varint());
    const std::uint64_t length = sum(field, source.varint(), 1);
    if (length > count - i) {
      fail_damaged(field.name, "a run of " + std::to_string(length) + " ids where " +
                                   std::to_string(count - i) + " are left");
    }
    sum(field, start, length - 1);
    for (std::uint64_t k = 0; k < length; ++k) {
      store_id(field, ids, i + k, start + k);
    }
    next = start + length;  // 0 behind the last id of all, where only damage can follow
    if (next == 0 && i + length < count) {
      fail_damaged(field.name, "ids do not ascend");
    }
    i += length;
  }
}

/// Key `i` relative to the key before (`previous`, zeros at first): the first component that
/// differs as a difference, the ones behind it as they are.
void put_key(const Keys& keys, std::uint64_t i, std::vector<std::uint64_t>& previous,
             ByteSink& sink) {
  bool same = true;
  for (std::uint32_t c = 0; c < keys.components(); ++c) {
    const std::uint64_t value = keys.at(i, c);
    sink.varint(same ? value - previous[c] : value);
    same = same && value == previous[c];
    previous[c] = value;
  }
}

void take_key(const FieldDescriptor& field, ByteSource& source, bool first,
              std::vector<std::uint64_t>& key) {
  bool same = true;
  for (std::uint32_t c = 0; c < field.components; ++c) {
    const std::uint64_t number = source.varint();
    const std::uint64_t value = same ? sum(field, key[c], number) : number;
    same = same && number == 0;
    key[c] = value;
  }
  if (same && !first) {
    fail_damaged(field.name, "keys do not ascend");
  }
}

}  // namespace

bool is_identity(const FieldDescriptor& field) {
  return field.is_id && field.type != ScalarType::f64 && field.type != ScalarType::f32;
}

bool ascending(const FieldDescriptor& field, std::span<const std::byte> ids, std::uint64_t count) {
  const Keys keys(field, ids);
  for (std::uint64_t i = 1; i < count; ++i) {
    if (keys.compare(i - 1, keys, i) >= 0) {
      return false;
    }
  }
  return true;
}

void encode_ids(const FieldDescriptor& field, const FieldView& ids, EncodedField& out) {
  const Keys keys(field, ids.bytes);
  out.order = 0;
  out.count = ids.count;
  out.payload.clear();
  ByteSink sink(out.payload);
  if (field.components == 1) {
    out.method = static_cast<std::uint8_t>(Method::id_runs);
    encode_runs(keys, ids.count, sink);
  } else {
    out.method = static_cast<std::uint8_t>(Method::id_deltas);
    std::vector<std::uint64_t> previous(field.components);
    for (std::uint64_t i = 0; i < ids.count; ++i) {
      put_key(keys, i, previous, sink);
    }
  }
}

void decode_ids(const FieldDescriptor& field, const EncodedField& encoded,
                std::span<std::byte> ids) {
  ByteSource source(encoded.payload, field.name);
  if (encoded.method == static_cast<std::uint8_t>(Method::id_runs)) {
    if (field.components != 1) {
      fail_damaged(field.name, "runs of ids need one component");
    }
    decode_runs(field, source, encoded.count, ids);
  } else {
    std::vector<std::uint64_t> key(field.components);
    for (std::uint64_t i = 0; i < encoded.count; ++i) {
      take_key(field, source, i == 0, key);
      for (std::uint32_t c = 0; c < field.components; ++c) {
        store_id(field, ids, i * field.components + c, key[c]);
      }
    }
  }
  source.finish();
}

bool encode_edit(const FieldDescriptor& field, const FieldView& before, const FieldView& after,
                 EncodedField& out, std::vector<std::uint64_t>& sources) {
  const Keys old_keys(field, before.bytes);
  const Keys new_keys(field, after.bytes);
  std::vector<std::uint64_t> removed;
  sources.assign(after.count, no_source);
  std::uint64_t kept = 0;
  std::uint64_t i = 0;
  for (std::uint64_t j = 0; j < after.count || i < before.count;) {
    const auto order = i == before.count  ? std::strong_ordering::greater
                       : j == after.count ? std::strong_ordering::less
                                          : old_keys.compare(i, new_keys, j);
    if (order < 0) {
      removed.push_back(i++);
    } else if (order > 0) {
      ++j;
    } else {
      sources[j++] = i++;
      ++kept;
    }
  }
  if (kept < after.count - kept || kept < removed.size()) {
    return false;
  }
  out.method = static_cast<std::uint8_t>(Method::id_edit);
  out.order = 0;
  out.count = after.count;
  out.payload.clear();
  ByteSink sink(out.payload);
  sink.varint(removed.size());
  std::uint64_t next = 0;
  for (const std::uint64_t index : removed) {
    sink.varint(index - next);
    next = index + 1;
  }
  sink.varint(after.count - kept);
  std::vector<std::uint64_t> previous(field.components);
  for (std::uint64_t j = 0; j < after.count; ++j) {
    if (sources[j] == no_source) {
      put_key(new_keys, j, previous, sink);
    }
  }
  return true;
}

void decode_edit(const FieldDescriptor& field, const FieldView& before,
                 const EncodedField& encoded, std::span<std::byte> after,
                 std::vector<std::uint64_t>& sources) {
  ByteSource source(encoded.payload, field.name);
  const std::uint64_t removed = source.varint();
  if (removed > before.count || removed > source.left()) {
    fail_damaged(field.name, std::to_string(removed) + " ids taken out of " +
                                 std::to_string(before.count));
  }
  std::vector<bool> gone(before.count);
  std::uint64_t next = 0;
  for (std::uint64_t k = 0; k < removed; ++k) {
    const std::uint64_t index = sum(field, next, source.varint());
    if (index >= before.count) {
      fail_damaged(field.name, "an id taken out lies behind the last one");
    }
    gone[index] = true;
    next = index + 1;
  }
  const std::uint64_t added = source.varint();
  if (added > source.left() || before.count - removed + added != encoded.count) {
    fail_damaged(field.name, "ids taken out and put in do not lead to the declared count");
  }
  const std::size_t width = field.components * size_of(field.type);
  std::vector<std::byte> fresh(added * width);
  std::vector<std::uint64_t> key(field.components);
  for (std::uint64_t k = 0; k < added; ++k) {
    take_key(field, source, k == 0, key);
    for (std::uint32_t c = 0; c < field.components; ++c) {
      store_id(field, fresh, k * field.components + c, key[c]);
    }
  }
  source.finish();

  const Keys old_keys(field, before.bytes);
  const Keys fresh_keys(field, fresh);
  sources.assign(encoded.count, no_source);
  std::uint64_t i = 0;
  std::uint64_t k = 0;
  for (std::uint64_t j = 0; j < encoded.count; ++j) {
    while (i < before.count && gone[i]) {
      ++i;
    }
    const bool take_old =
        k == added || (i < before.count && old_keys.compare(i, fresh_keys, k) < 0);
    const std::byte* const from =
        take_old ? before.bytes.data() + i * width : fresh.data() + k * width;
    std::copy_n(from, width, after.data() + j * width);
    sources[j] = take_old ? i++ : no_source;
    k += take_old ? 0 : 1;
  }
  if (!ascending(field, after, encoded.count)) {
    fail_damaged(field.name, "ids do not ascend");
  }
}

}  // namespace varve::io::codec
