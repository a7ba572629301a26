// Residuals by way of the second stage and the entropy coder: the method for fields of some size.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "io/codec_bytes.h"
#include "io/codec_choice.h"
#include "io/codec_stage.h"
#include "io/codec_tans.h"
#include "io/codec_track.h"

namespace varve::io::codec {

/// One field's residuals; T is float or double. Serves either an encoder or a decoder.
template <class T>
class StagedCoder {
 public:
  using U = ImageOf<T>;
  /// The frame just stored did not pass through here: the next one starts anew.
  void forget() { active_ = false; }
  /// Particles came or went (Track::remap).
  void remap(std::span<const std::uint64_t> sources, std::uint32_t components);

  /// Appends the residuals of `frame` to `payload`; the frame becomes history of `track`, too.
  void encode(Track<T>& track, std::span<const std::byte> frame, const Choice& choice,
              std::vector<std::byte>& payload);
  /// Inverse.
  void decode(Track<T>& track, ByteSource& source, const Weights& weights,
              std::span<std::byte> frame);

 private:
  using Shifts = std::array<std::int16_t, candidates>;
  void look_back(const Track<T>& track, const Weights& weights);
  Shifts find_shifts(const Track<T>& track, std::span<const std::byte> frame,
                     const Weights& weights, int step) const;
  bool improve_model(bool fresh);

  Stage stage_;
  bool active_ = false;  ///< the stage holds the frame before
  Model model_;
  TansEncoder<U> encoder_;
  TansDecoder<U> decoder_;
  unsigned frames_since_model_ = 0;
  unsigned frames_to_model_ = 1;
  SymbolCounts counts_{};
  std::size_t counted_ = 0;
  std::vector<std::byte> description_;
  std::vector<U> residuals_;  ///< their raw bits, once they are tokens
  std::vector<Token> tokens_;
};

}  // namespace varve::io::codec
