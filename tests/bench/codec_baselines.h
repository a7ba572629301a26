// What others would do with the same states: the codec's benchmark measures it beside them.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "io/frame.h"

namespace varve::bench {

/// A lossless method for the changing floating fields of consecutive frames of equal counts.
class Baseline {
 public:
  virtual ~Baseline() = default;
  virtual std::string name() const = 0;
  /// Encodes a frame and returns the bytes it took (0 where frames are gathered into blocks).
  virtual std::size_t encode(const io::Frame& frame) = 0;
  /// Decodes what encode() left behind and compares it; false if a bit differs.
  virtual bool decode(const io::Frame& frame) = 0;
};

/// All of them, for the fields of `schema` that are neither constant nor ids.
std::vector<std::unique_ptr<Baseline>> baselines(const io::Schema& schema);

}  // namespace varve::bench
