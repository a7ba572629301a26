// The encoder's choice of weights: which order of extrapolation, or which fitted weights, leave the
// least behind on a sample of a field. The decoder only reads the result.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "io/codec_extrapolate.h"
#include "io/codec_track.h"

namespace varve::io::codec {

/// How a record says which weights it used (io/CODEC.md).
enum class WeightsKind : std::uint8_t {
  polynomial = 0,  ///< of the record's order
  written = 1,     ///< they follow
  kept = 2,        ///< the ones written last
};

struct Choice {
  Weights weights;
  WeightsKind kind = WeightsKind::polynomial;
  bool changed = true;  ///< other weights than for the frame before
  int step = 0;         ///< where both are polynomials: orders more than before
};

/// Weights for a field of type T: for integers those of equal steps, whatever the times.
template <class T>
Weights weights_for(unsigned order, const Timeline& times);

/// Integers are counters or labels: constant or linear in time, if anything.
template <class T>
inline constexpr unsigned order_limit = std::is_floating_point_v<T> ? order_max : 2;

template <class T>
class WeightsChoice {
 public:
  /// A new history begins. Fitted weights are remembered, but have to be written again.
  void restart();
  /// Weights to predict `frame` with, `times[0]` being its time.
  Choice choose(const Track<T>& track, std::span<const std::byte> frame, const Timeline& times);

 private:
  void take_sample(const Track<T>& track, std::span<const std::byte> frame);
  void tabulate(unsigned depth);
  void decide_polynomial(unsigned depth);
  void decide_fitted();
  void decide_unequal(const Timeline& times, unsigned depth);
  double polynomial_cost(unsigned order, unsigned depth) const;
  double fitted_cost(const Weights& weights) const;
  Weights fit() const;

  // The sample. A lane is a sampled value; ages count back from the frame to be predicted.
  std::vector<std::size_t> places_;              ///< [lane]: which value
  std::vector<std::int32_t> unit_;               ///< [lane]: quarter bits of one step of the image
  std::vector<std::vector<double>> sequence_;    ///< [age][lane]: differences of the field
  std::vector<std::vector<double>> table_;       ///< scratch
  std::vector<std::vector<double>> regressors_;  ///< [2 m + age - 1][lane]: m-th differences
  std::vector<std::vector<std::int32_t>> bits_;  ///< [3 order + age][lane]: quarters

  unsigned order_ = 0;            ///< best polynomial
  Weights fitted_;                ///< order 0: none
  bool use_fitted_ = false;
  bool fitted_written_ = false;   ///< since the history began
  bool refitted_ = false;         ///< at this frame
  bool growing_ = true;           ///< the history was not yet full
  unsigned frames_since_choice_ = 0;
  unsigned choices_since_fit_ = 0;
  bool was_fitted_ = false;
  unsigned order_before_ = 0;
};

}  // namespace varve::io::codec
