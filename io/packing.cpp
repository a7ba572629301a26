#include "io/packing.h"

#include <fmt/format.h>
#include <zstd.h>

#include <cstring>
#include <memory>
#include <new>

#include "io/errors.h"

namespace varve::io {

namespace {

constexpr int zstd_level = 1;
constexpr std::size_t smallest_packed = 128;  // a frame's own overhead eats the gain below

// One context of each per thread: making one costs more than packing a small message.
struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

ZSTD_CCtx* compressor() {
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  return context.get();
}

ZSTD_DCtx* decompressor() {
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  if (!context) throw std::bad_alloc();
  return context.get();
}

[[noreturn]] void damaged(const std::string& what, const std::string& text) {
  throw LogError(ErrorKind::damaged, "", what + ": " + text);
}

}  // namespace

Packing pack(std::span<const std::byte> raw, std::vector<std::byte>& stored, const Limits& limits) {
  if (raw.size() >= smallest_packed) {
    stored.resize(ZSTD_compressBound(raw.size()));
    const std::size_t size =
        ZSTD_compressCCtx(compressor(), stored.data(), stored.size(), raw.data(), raw.size(),
                          zstd_level);
    const bool accepted =
        !ZSTD_isError(size) && size < raw.size() &&
        (raw.size() <= limits.ratio_free_bytes || raw.size() / limits.ratio_max < size);
    if (accepted) {
      stored.resize(size);
      return Packing::zstd;
    }
  }
  stored.assign(raw.begin(), raw.end());
  return Packing::plain;
}

void check_ratio(std::uint64_t raw, std::uint64_t stored, const std::string& what,
                 const Limits& limits) {
  if (raw > limits.ratio_free_bytes && raw / limits.ratio_max > stored) {
    throw LogError(ErrorKind::limit, "",
                   fmt::format("{}: {} bytes out of {} exceed ratio_max {}:1", what, raw, stored,
                               limits.ratio_max));
  }
}

void unpack(Packing packing, std::span<const std::byte> stored, std::span<std::byte> out,
            const std::string& what, const Limits& limits) {
  if (packing == Packing::plain) {
    if (stored.size() != out.size()) {
      damaged(what,
              fmt::format("{} bytes stored where {} are declared", stored.size(), out.size()));
    }
    if (!out.empty()) std::memcpy(out.data(), stored.data(), out.size());
    return;
  }
  if (packing != Packing::zstd) {
    damaged(what, fmt::format("packing {} is not known", static_cast<int>(packing)));
  }
  check_ratio(out.size(), stored.size(), what, limits);
  const unsigned long long declared = ZSTD_getFrameContentSize(stored.data(), stored.size());
  if (declared != out.size()) {
    damaged(what, declared == ZSTD_CONTENTSIZE_UNKNOWN || declared == ZSTD_CONTENTSIZE_ERROR
                      ? std::string("not a zstd frame that declares its content size")
                      : fmt::format("the zstd frame declares {} bytes where the log declares {}",
                                    declared, out.size()));
  }
  const std::size_t frame = ZSTD_findFrameCompressedSize(stored.data(), stored.size());
  if (ZSTD_isError(frame) || frame != stored.size()) {
    damaged(what, "the zstd frame does not end where the stored bytes end");
  }
  if (ZSTD_getDictID_fromFrame(stored.data(), stored.size()) != 0) {
    damaged(what, "the zstd frame asks for a dictionary");
  }
  const std::size_t got = ZSTD_decompressDCtx(decompressor(), out.data(), out.size(),
                                              stored.data(), stored.size());
  if (ZSTD_isError(got)) damaged(what, fmt::format("zstd: {}", ZSTD_getErrorName(got)));
  if (got != out.size()) {
    damaged(what, fmt::format("zstd gave {} bytes where {} are declared", got, out.size()));
  }
}

}  // namespace varve::io
