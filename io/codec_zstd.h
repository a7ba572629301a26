// zstd for one blob at a time: contexts are kept, sizes are exact, nothing is believed.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace varve::io::codec {

class Zstd {
 public:
  Zstd();
  ~Zstd();
  Zstd(const Zstd&) = delete;
  Zstd& operator=(const Zstd&) = delete;
  /// Appends one frame that holds `plain` and its size.
  void compress(std::span<const std::byte> plain, std::vector<std::byte>& out);
  /// Fills `plain` from exactly one frame. Throws LogError(damaged), naming `field`, unless the
  /// frame declares just that size, is whole and has nothing behind it.
  void expand(std::span<const std::byte> frame, std::span<std::byte> plain,
              const std::string& field);

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
};

}  // namespace varve::io::codec
