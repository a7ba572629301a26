#include "io/codec_choice.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <type_traits>

namespace varve::io::codec {
namespace {

/// Frames between two choices, choices between two fits.
constexpr unsigned choice_interval = 16;
constexpr unsigned fit_interval = 3;
/// Values on which the choice is made, in runs of neighbours.
constexpr std::size_t sample_values = 512;
constexpr std::size_t sample_run = 16;
/// Differences that fitted weights use: two less than there are, so that a sample can be judged as
/// the second stage will see it.
constexpr unsigned fit_order = order_max - 2;
/// A change disturbs the second stage a little: it must pay.
constexpr double worth_a_change = 0.995;
constexpr double worth_a_lower_order = 0.97;
constexpr double worth_a_refit = 0.995;

/// Four times the binary logarithm of |x|, in exponent and two bits.
std::int32_t quarter_bits(double x) {
  return static_cast<std::int32_t>((std::bit_cast<std::uint64_t>(x) << 1) >> 51);
}

/// Quarter bits of a difference of one in the image, for a value of this size.
template <class T>
std::int32_t unit_of(ImageOf<T> bits) {
  if constexpr (std::is_floating_point_v<T>) {
    constexpr int mantissa = sizeof(T) == 8 ? 52 : 23;
    const auto value = static_cast<double>(std::bit_cast<T>(bits));
    return std::max(quarter_bits(value) / 4 - mantissa, 1) * 4;
  } else {
    return quarter_bits(1.0);
  }
}

template <class T>
double difference_of(ImageOf<T> a, ImageOf<T> b) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<double>(std::bit_cast<T>(a)) - static_cast<double>(std::bit_cast<T>(b));
  } else {
    return static_cast<double>(static_cast<std::make_signed_t<ImageOf<T>>>(a - b));
  }
}

template <class T>
double as_double(T difference) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<double>(difference);
  } else {
    return static_cast<double>(static_cast<std::make_signed_t<T>>(difference));
  }
}

/// Bits that a residual needs, in quarters, given the unit.
std::int32_t residual_bits(double residual, std::int32_t unit) {
  return std::max(quarter_bits(residual) - unit + 4, 0);
}

/// Solves the symmetric system given by its lower triangle in place; the solution ends up in the
/// last column.
void solve(std::vector<std::vector<double>>& matrix) {
  const std::size_t n = matrix.size();
  std::vector<double> scale(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      matrix[j][i] = matrix[i][j];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    scale[i] = matrix[i][i] > 0 ? 1 / std::sqrt(matrix[i][i]) : 0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      matrix[i][j] *= scale[i] * scale[j];
    }
    matrix[i][n] *= scale[i];
    matrix[i][i] += 1e-9;  // directions that the sample does not show stay unused
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      if (j != i) {
        const double factor = matrix[j][i] / matrix[i][i];
        for (std::size_t k = i; k <= n; ++k) {
          matrix[j][k] -= factor * matrix[i][k];
        }
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    matrix[i][n] *= scale[i] / matrix[i][i];
  }
}

}  // namespace

template <class T>
Weights weights_for(unsigned order, const Timeline& times) {
  return std::is_floating_point_v<T> ? polynomial_weights(order, times) : equal_step_weights(order);
}

template <class T>
void WeightsChoice<T>::restart() {
  order_ = 0;
  use_fitted_ = false;
  fitted_written_ = false;
  growing_ = true;
  frames_since_choice_ = 0;
  was_fitted_ = false;
  order_before_ = ~0u;
}

template <class T>
Choice WeightsChoice<T>::choose(const Track<T>& track, std::span<const std::byte> frame,
                                const Timeline& times) {
  const unsigned depth = std::min(track.depth(), order_limit<T>);
  const bool equal = !std::is_floating_point_v<T> || steps_are_equal(depth, times);
  refitted_ = false;
  ++frames_since_choice_;
  if (growing_ || frames_since_choice_ >= choice_interval || (use_fitted_ && !equal)) {
    frames_since_choice_ = 0;
    take_sample(track, frame);
    if (equal) {
      tabulate(depth);
      decide_polynomial(depth);
      decide_fitted();
    } else {
      decide_unequal(times, depth);
    }
    growing_ = track.depth() < order_max;
  }
  Choice choice;
  choice.changed = refitted_ || use_fitted_ != was_fitted_ ||
                   (!use_fitted_ && order_ != order_before_);
  if (choice.changed && !was_fitted_ && !use_fitted_ && order_before_ <= order_max) {
    choice.step = static_cast<int>(order_) - static_cast<int>(order_before_);
  }
  was_fitted_ = use_fitted_;
  order_before_ = order_;
  if (use_fitted_) {
    choice.weights = fitted_;
    choice.kind = fitted_written_ ? WeightsKind::kept : WeightsKind::written;
    fitted_written_ = true;
  } else {
    choice.weights = weights_for<T>(order_, times);
  }
  return choice;
}

template <class T>
void WeightsChoice<T>::take_sample(const Track<T>& track, std::span<const std::byte> frame) {
  const std::size_t count = track.count();
  const std::size_t runs =
      std::max<std::size_t>(1, sample_values / sample_run / track.components());
  const std::size_t stride = std::max(sample_run, count / runs);
  places_.clear();
  for (std::size_t component = 0; component < track.components(); ++component) {
    for (std::size_t at = 0; at < count; at += stride) {
      for (std::size_t i = at; i < std::min(at + sample_run, count); ++i) {
        places_.push_back(component * count + i);
      }
    }
  }
  const std::size_t lanes = places_.size();
  unit_.resize(lanes);
  sequence_.resize(order_max + 1);
  for (unsigned age = 0; age <= track.depth(); ++age) {
    sequence_[age].resize(lanes);
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t place = places_[lane];
    ImageOf<T> bits;
    track.gather(frame, place, 1, &bits);
    unit_[lane] = unit_of<T>(bits);
    sequence_[0][lane] = difference_of<T>(bits, track.newest()[place]);
    for (unsigned age = 0; age < track.depth(); ++age) {
      sequence_[age + 1][lane] = as_double<T>(track.difference(age)[place]);
    }
  }
}

/// Residuals of all orders, at this frame and the two before, by repeated differences.
template <class T>
void WeightsChoice<T>::tabulate(unsigned depth) {
  const std::size_t lanes = places_.size();
  table_.resize(order_max + 1);
  std::copy_n(sequence_.begin(), depth + 1, table_.begin());
  regressors_.resize(2 * fit_order);
  bits_.resize(3 * (order_max + 1));
  for (unsigned order = 0; order <= depth; ++order) {
    for (unsigned age = 0; age < 3 && order + age <= depth; ++age) {
      auto& row = bits_[3 * order + age];
      row.resize(lanes);
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        row[lane] = residual_bits(table_[age][lane], unit_[lane]);
      }
    }
    if (depth == order_max && order < fit_order) {
      regressors_[2 * order] = table_[1];
      regressors_[2 * order + 1] = table_[2];
    }
    for (unsigned age = 0; age + order < depth; ++age) {
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        table_[age][lane] -= table_[age + 1][lane];
      }
    }
  }
}

/// Bits that the second stage would leave: each value takes that order, of this one and the next
/// three, which was best at the two frames before.
template <class T>
double WeightsChoice<T>::polynomial_cost(unsigned order, unsigned depth) const {
  std::int64_t sum = 0;
  for (std::size_t lane = 0; lane < places_.size(); ++lane) {
    std::int32_t cost = bits_[3 * order][lane];
    std::int32_t lowest = 1 << 30;
    for (unsigned k = order; k < order + candidates && k + 2 <= depth; ++k) {
      const std::int32_t before = bits_[3 * k + 1][lane] + bits_[3 * k + 2][lane];
      cost = before < lowest ? bits_[3 * k][lane] : cost;
      lowest = std::min(lowest, before);
    }
    sum += cost;
  }
  return static_cast<double>(sum);
}

/// While the history grows the second stage has nothing to go by, and the order that is best alone
/// is best. Later one or two less can be better.
template <class T>
void WeightsChoice<T>::decide_polynomial(unsigned depth) {
  std::array<double, order_max + 1> alone{};
  for (unsigned order = 0; order <= depth; ++order) {
    const auto& row = bits_[3 * order];
    alone[order] = static_cast<double>(std::accumulate(row.begin(), row.end(), std::int64_t{0}));
  }
  auto best = static_cast<unsigned>(
      std::min_element(alone.begin(), alone.begin() + depth + 1) - alone.begin());
  if (growing_) {
    order_ = best;
    return;
  }
  double lowest = polynomial_cost(best, depth);
  const unsigned highest = best;
  for (unsigned order = highest; order-- > 0 && order + 2 >= highest;) {
    const double cost = polynomial_cost(order, depth);
    if (cost < worth_a_lower_order * lowest) {
      lowest = cost;
      best = order;
    }
  }
  if (lowest < worth_a_change * polynomial_cost(std::min(order_, depth), depth)) {
    order_ = best;
  }
}

template <class T>
void WeightsChoice<T>::decide_fitted() {
  if (!std::is_floating_point_v<T> || growing_) {
    use_fitted_ = false;
    return;
  }
  if (fitted_.order == 0 || ++choices_since_fit_ >= fit_interval) {
    choices_since_fit_ = 0;
    const Weights fresh = fit();
    if (fitted_.order == 0 || fitted_cost(fresh) < worth_a_refit * fitted_cost(fitted_)) {
      fitted_ = fresh;
      fitted_written_ = false;
      refitted_ = use_fitted_;
    }
  }
  const double polynomial = polynomial_cost(order_, order_max);
  use_fitted_ = fitted_.order > 0 &&
                fitted_cost(fitted_) < (use_fitted_ ? 1.0 : worth_a_change) * polynomial;
}

/// Bits that the second stage would leave: nothing is expected of a residual, or that it continues
/// the one before.
template <class T>
double WeightsChoice<T>::fitted_cost(const Weights& weights) const {
  std::int64_t sum = 0;
  for (std::size_t lane = 0; lane < places_.size(); ++lane) {
    std::array<double, 3> residual{};
    for (unsigned age = 0; age < 3; ++age) {
      residual[age] = sequence_[age][lane];
      for (unsigned j = 0; j < weights.order; ++j) {
        residual[age] -= weights.value[j] * sequence_[age + 1 + j][lane];
      }
    }
    const std::int32_t unit = unit_[lane];
    const bool continues =
        residual_bits(residual[1] - residual[2], unit) < residual_bits(residual[1], unit);
    sum += residual_bits(continues ? residual[0] - residual[1] : residual[0], unit);
  }
  return static_cast<double>(sum);
}

/// Least squares in which each value is weighted by the inverse square of its own error: bits
/// count, not squares. Finds corrections to the best polynomial, in terms of repeated differences.
/// Order 0 where there is nothing to improve.
template <class T>
Weights WeightsChoice<T>::fit() const {
  const std::size_t lanes = places_.size();
  if (lanes == 0) return {};  // an empty population has nothing to fit to
  const unsigned base = std::min(order_, fit_order);
  std::vector<double> target(2 * lanes);
  std::vector<double> size(2 * lanes);
  for (std::size_t row = 0; row < 2 * lanes; ++row) {
    target[row] = sequence_[row % 2][row / 2];
    for (unsigned m = 0; m < base; ++m) {
      target[row] -= regressors_[2 * m + row % 2][row / 2];
    }
    size[row] = std::abs(target[row]);
  }
  std::nth_element(size.begin(), size.begin() + static_cast<std::ptrdiff_t>(lanes), size.end());
  const double floor = 0.05 * size[lanes] * size[lanes];
  if (!(floor > 0) || !std::isfinite(floor)) {
    return {};
  }
  std::array<double, fit_order> factor{};
  for (int pass = 0; pass < 4; ++pass) {
    std::vector<std::vector<double>> normal(fit_order, std::vector<double>(fit_order + 1));
    for (std::size_t row = 0; row < 2 * lanes; ++row) {
      std::array<double, fit_order> x;
      double error = target[row];
      for (unsigned m = 0; m < fit_order; ++m) {
        x[m] = regressors_[2 * m + row % 2][row / 2];
        error -= factor[m] * x[m];
      }
      const double weight = 1 / (error * error + floor);
      for (unsigned a = 0; a < fit_order; ++a) {
        for (unsigned b = 0; b <= a; ++b) {
          normal[a][b] += weight * x[a] * x[b];
        }
        normal[a][fit_order] += weight * x[a] * target[row];
      }
    }
    solve(normal);
    for (unsigned m = 0; m < fit_order; ++m) {
      factor[m] = normal[m][fit_order];
    }
  }
  Weights weights = equal_step_weights(base);
  weights.order = fit_order;
  for (unsigned m = 0; m < fit_order; ++m) {
    double binomial = 1;  // the m-th difference in terms of plain ones
    for (unsigned j = 0; j <= m; ++j) {
      weights.value[j] += (j % 2 == 0 ? factor[m] : -factor[m]) * binomial;
      binomial = binomial * (m - j) / (j + 1);
    }
  }
  const bool sane = std::all_of(weights.value.begin(), weights.value.end(),
                                [](double weight) { return std::abs(weight) < 1e6; });
  return sane ? weights : Weights{};
}

/// Unequal steps: every order is tried as it will be used.
template <class T>
void WeightsChoice<T>::decide_unequal(const Timeline& times, unsigned depth) {
  use_fitted_ = false;
  std::array<double, order_max + 1> cost{};
  for (unsigned order = 0; order <= depth; ++order) {
    const Weights weights = weights_for<T>(order, times);
    for (std::size_t lane = 0; lane < places_.size(); ++lane) {
      double residual = sequence_[0][lane];
      for (unsigned j = 0; j < order; ++j) {
        residual -= weights.value[j] * sequence_[j + 1][lane];
      }
      cost[order] += residual_bits(residual, unit_[lane]);
    }
  }
  order_ = static_cast<unsigned>(std::min_element(cost.begin(), cost.begin() + depth + 1) -
                                 cost.begin());
}

template Weights weights_for<double>(unsigned, const Timeline&);
template Weights weights_for<float>(unsigned, const Timeline&);
template Weights weights_for<std::uint64_t>(unsigned, const Timeline&);
template Weights weights_for<std::uint32_t>(unsigned, const Timeline&);
template Weights weights_for<std::uint8_t>(unsigned, const Timeline&);
template class WeightsChoice<double>;
template class WeightsChoice<float>;
template class WeightsChoice<std::uint64_t>;
template class WeightsChoice<std::uint32_t>;
template class WeightsChoice<std::uint8_t>;

}  // namespace varve::io::codec
