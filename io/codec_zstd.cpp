#include "io/codec_zstd.h"

#include <zstd.h>

#include <new>
#include <string>

#include "io/codec_bytes.h"

namespace varve::io::codec {
namespace {

/// Higher levels buy 1-3 % for 5-100 times the time on state data.
constexpr int level = 1;

}  // namespace

struct Zstd::Contexts {
  ZSTD_CCtx* compress = nullptr;
  ZSTD_DCtx* expand = nullptr;
  ~Contexts() {
    ZSTD_freeCCtx(compress);
    ZSTD_freeDCtx(expand);
  }
};

Zstd::Zstd() : contexts_(std::make_unique<Contexts>()) {}
Zstd::~Zstd() = default;

void Zstd::compress(std::span<const std::byte> plain, std::vector<std::byte>& out) {
  if (contexts_->compress == nullptr) {
    contexts_->compress = ZSTD_createCCtx();
    if (contexts_->compress == nullptr) {
      throw std::bad_alloc();
    }
    ZSTD_CCtx_setParameter(contexts_->compress, ZSTD_c_compressionLevel, level);
    ZSTD_CCtx_setParameter(contexts_->compress, ZSTD_c_contentSizeFlag, 1);
    ZSTD_CCtx_setParameter(contexts_->compress, ZSTD_c_checksumFlag, 0);
  }
  const std::size_t before = out.size();
  out.resize(before + ZSTD_compressBound(plain.size()));
  const std::size_t size = ZSTD_compress2(contexts_->compress, out.data() + before,
                                          out.size() - before, plain.data(), plain.size());
  if (ZSTD_isError(size)) {
    throw LogError(ErrorKind::write_failed, "",
                   std::string("zstd could not compress: ") + ZSTD_getErrorName(size));
  }
  out.resize(before + size);
}

void Zstd::expand(std::span<const std::byte> frame, std::span<std::byte> plain,
                  const std::string& field) {
  const unsigned long long declared = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (declared == ZSTD_CONTENTSIZE_ERROR || declared == ZSTD_CONTENTSIZE_UNKNOWN) {
    fail_damaged(field, "not a zstd frame that declares its size");
  }
  if (declared != plain.size()) {
    fail_damaged(field, "zstd frame declares " + std::to_string(declared) + " bytes, " +
                            std::to_string(plain.size()) + " expected");
  }
  const std::size_t length = ZSTD_findFrameCompressedSize(frame.data(), frame.size());
  if (ZSTD_isError(length)) {
    fail_damaged(field, std::string("zstd frame does not hold: ") + ZSTD_getErrorName(length));
  }
  if (length != frame.size()) {
    fail_damaged(field, std::to_string(frame.size() - length) + " bytes behind the zstd frame");
  }
  if (contexts_->expand == nullptr) {
    contexts_->expand = ZSTD_createDCtx();
    if (contexts_->expand == nullptr) {
      throw std::bad_alloc();
    }
  }
  const std::size_t size = ZSTD_decompressDCtx(contexts_->expand, plain.data(), plain.size(),
                                               frame.data(), frame.size());
  if (ZSTD_isError(size) || size != plain.size()) {
    fail_damaged(field, std::string("zstd frame does not hold: ") +
                            (ZSTD_isError(size) ? ZSTD_getErrorName(size) : "wrong size"));
  }
}

}  // namespace varve::io::codec
