// What the fuzz targets share. Each target is one function over bytes: libFuzzer calls it with
// bytes that it makes up, replay.cpp with the files of the corpus and the regressions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace varve::fuzz {

/// A promise that was broken: says which, and dies so that the input is kept.
inline void require(bool holds, const std::string& promise) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", promise.c_str());
  std::abort();
}

/// Takes an input apart. Behind its end everything is zero.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}
  bool empty() const { return rest_.empty(); }

  template <typename T>
    requires std::is_arithmetic_v<T>
  T number() {
    std::uint8_t raw[sizeof(T)] = {};
    const auto taken = take(sizeof(T));
    if (!taken.empty()) std::memcpy(raw, taken.data(), taken.size());
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }
  /// At most `size` bytes; fewer where there are no more.
  std::span<const std::uint8_t> take(std::size_t size) {
    const auto out = rest_.first(std::min(size, rest_.size()));
    rest_ = rest_.subspan(out.size());
    return out;
  }
  std::vector<std::byte> bytes(std::size_t size) {
    const auto taken = std::as_bytes(take(size));
    return {taken.begin(), taken.end()};
  }
  std::vector<std::byte> rest() { return bytes(rest_.size()); }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Puts together what Input takes apart.
class Output {
 public:
  template <typename T>
    requires std::is_arithmetic_v<T>
  Output& number(T value) {
    const auto* raw = reinterpret_cast<const std::byte*>(&value);
    out_.insert(out_.end(), raw, raw + sizeof(T));
    return *this;
  }
  Output& bytes(std::span<const std::byte> value) {
    out_.insert(out_.end(), value.begin(), value.end());
    return *this;
  }
  const std::vector<std::byte>& all() const { return out_; }

 private:
  std::vector<std::byte> out_;
};

}  // namespace varve::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
