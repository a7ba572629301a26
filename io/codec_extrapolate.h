// Extrapolation in time: the frames' times, and the weights that predict a value from its own past.
#pragma once

#include <array>
#include <cstddef>

namespace varve::io::codec {

/// Highest order of extrapolation: the number of past differences that a prediction may use.
inline constexpr unsigned order_max = 12;

/// Times of the newest frames, newest first; enough for a prediction of the highest order.
class Timeline {
 public:
  static constexpr std::size_t capacity = order_max + 2;
  /// Forgets all frames.
  void clear() { size_ = 0; }
  /// Adds the frame that follows all others. [s]
  void push(double time);
  std::size_t size() const { return size_; }
  /// Time of the i-th newest frame, i < size(). [s]
  double operator[](std::size_t i) const { return times_[i]; }

 private:
  std::array<double, capacity> times_{};
  std::size_t size_ = 0;
};

/// c_j in  prediction = newest + sum_j c_j d_j,  where d_j is the j-th newest difference of
/// consecutive values. `order` of them are used; 0 predicts the newest value itself.
struct Weights {
  unsigned order = 0;
  std::array<double, order_max> value{};
};

/// True if the steps that a prediction of this order looks at are equal to a billionth, or if time
/// does not advance in one of them. `times[0]` is the frame to be predicted.
bool steps_are_equal(unsigned order, const Timeline& times);

/// Weights that are exact for polynomials of degree `order` at equal steps: alternating binomials.
Weights equal_step_weights(unsigned order);

/// The same where steps are equal. At unequal steps the slopes d_j / (length of step j), each taken
/// at its step's start, are extrapolated: a first-order integrator's increments are smooth in just
/// that sense. `times[0]` is the frame to be predicted; needs times.size() >= order + 2. Only
/// + - * / in a fixed order, so that every machine finds the same weights.
Weights polynomial_weights(unsigned order, const Timeline& times);

}  // namespace varve::io::codec
