#include "io/codec_extrapolate.h"

#include <algorithm>
#include <cassert>

namespace varve::io::codec {
namespace {

/// Spread of step lengths, relative to the step and to the time itself, below which they count as
/// equal: times carry rounding, and equal steps deserve exact integer weights.
constexpr double equal_to_step = 1e-9;
constexpr double equal_to_time = 1e-15;

}  // namespace

void Timeline::push(double time) {
  const std::size_t kept = std::min(size_, capacity - 1);
  std::copy_backward(times_.begin(), times_.begin() + static_cast<std::ptrdiff_t>(kept),
                     times_.begin() + static_cast<std::ptrdiff_t>(kept + 1));
  times_[0] = time;
  size_ = kept + 1;
}

bool steps_are_equal(unsigned order, const Timeline& times) {
  const double newest = times[0] - times[1];
  const double size = times[0] < 0 ? -times[0] : times[0];
  const double spread = equal_to_step * newest + equal_to_time * size;
  for (unsigned i = 1; i <= order; ++i) {
    const double step = times[i] - times[i + 1];
    if (!(step > 0) || !(newest > 0)) {
      return true;
    }
    const double difference = step - newest;
    if (difference > spread || difference < -spread) {
      return false;
    }
  }
  return true;
}

// The products stay exact in double.
Weights equal_step_weights(unsigned order) {
  Weights weights;
  weights.order = order;
  double binomial = 1;
  for (unsigned j = 0; j < order; ++j) {
    binomial = binomial * static_cast<double>(order - j) / static_cast<double>(j + 1);
    weights.value[j] = j % 2 == 0 ? binomial : -binomial;
  }
  return weights;
}

Weights polynomial_weights(unsigned order, const Timeline& times) {
  assert(order <= order_max && times.size() >= order + 2);
  if (steps_are_equal(order, times)) {
    return equal_step_weights(order);
  }
  Weights weights;
  weights.order = order;
  const double step = times[0] - times[1];
  std::array<double, order_max> start{};  // of past steps, relative to the newest's, in new steps
  for (unsigned j = 0; j < order; ++j) {
    start[j] = (times[j + 2] - times[1]) / step;
  }
  for (unsigned j = 0; j < order; ++j) {
    double lagrange = 1;
    for (unsigned m = 0; m < order; ++m) {
      if (m != j) {
        lagrange = lagrange * (start[m] / (start[m] - start[j]));
      }
    }
    weights.value[j] = lagrange * (step / (times[j + 1] - times[j + 2]));
  }
  return weights;
}

}  // namespace varve::io::codec
