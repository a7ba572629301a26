#include "io/errors.h"

#include <utility>

namespace varve::io {

namespace {

std::string compose(const std::string& path, const std::string& text, std::int64_t offset) {
  std::string out;
  if (!path.empty()) out += path + ": ";
  if (offset >= 0) out += std::to_string(offset) + ": ";
  return out + text;
}

}  // namespace

LogError::LogError(ErrorKind kind, std::string path, std::string text, std::int64_t offset)
    : std::runtime_error(compose(path, text, offset)),
      kind_(kind),
      path_(std::move(path)),
      offset_(offset) {}

}  // namespace varve::io
