// zstd with the lengths fixed beforehand: what is decoded fills exactly the declared bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/framing.h"
#include "io/limits.h"

namespace varve::io {

/// Compresses where that saves something and stays within the ratio that a reader accepts;
/// otherwise returns the bytes as they are.
Packing pack(std::span<const std::byte> raw, std::vector<std::byte>& stored, const Limits& limits);

/// Fills `out` from `stored`. Throws LogError (damaged, limit) with a text that begins with `what`.
void unpack(Packing packing, std::span<const std::byte> stored, std::span<std::byte> out,
            const std::string& what, const Limits& limits);

/// Throws LogError(limit) where `raw` bytes out of `stored` exceed the allowed ratio.
void check_ratio(std::uint64_t raw, std::uint64_t stored, const std::string& what,
                 const Limits& limits);

}  // namespace varve::io
