#include "io/codec_track.h"

#include <algorithm>
#include <cassert>

namespace varve::io::codec {

template <class T>
void Track<T>::restart(std::span<const std::byte> frame, std::uint64_t count) {
  count_ = count;
  depth_ = 0;
  newest_.resize(count * components_);
  for (std::uint32_t c = 0; count > 0 && c < components_; ++c) {
    gather(frame, c * count, count, newest_.data() + c * count);
  }
}

template <class T>
void Track<T>::remap(std::span<const std::uint64_t> sources) {
  const std::size_t count = sources.size();
  const auto moved = [&](const auto* from, auto* to) {
    for (std::uint32_t c = 0; c < components_; ++c) {
      for (std::size_t i = 0; i < count; ++i) {
        using Value = std::remove_reference_t<decltype(*to)>;
        to[c * count + i] = sources[i] == no_source ? Value{} : from[c * count_ + sources[i]];
      }
    }
  };
  std::vector<U> newest(count * components_);
  moved(newest_.data(), newest.data());
  std::vector<T> differences(count * components_);
  for (unsigned age = 0; age < depth_; ++age) {
    const std::size_t slot = (head_ + age) % order_max;
    moved(planes_[slot].data, differences.data());
    resize_plane(slot, differences.size());
    std::copy(differences.begin(), differences.end(), planes_[slot].data);
  }
  newest_ = std::move(newest);
  count_ = count;
}

template <class T>
typename Track<T>::Terms Track<T>::terms(const Weights& weights, unsigned age, unsigned count,
                                         std::size_t first) const {
  Terms result;
  for (unsigned j = 0; j < count; ++j) {
    result.differences[j] = difference(age + j) + first;
  }
  for (unsigned j = 0; j < weights.order; ++j) {
    if constexpr (std::is_floating_point_v<T>) {
      result.factors[j] = static_cast<T>(weights.value[j]);
    } else {
      result.factors[j] = static_cast<T>(static_cast<std::int64_t>(weights.value[j]));
    }
  }
  return result;
}

template <class T>
void Track<T>::predict(const Weights& weights, std::size_t first, std::size_t n, U* image) const {
  assert(weights.order <= depth_ && n <= block_values);
  const Terms past = terms(weights, 0, weights.order, first);
  kernels<T>().predict(newest_.data() + first, past.differences.data(), past.factors.data(),
                       weights.order, n, image);
}

template <class T>
void Track<T>::look_back(const Weights& weights, unsigned age, std::size_t first, std::size_t n,
                         float* residual) const {
  if (age + 1 + weights.order > depth_) {
    std::fill_n(residual, n, 0.0f);
    return;
  }
  const Terms past = terms(weights, age, weights.order + 1, first);
  kernels<T>().look_back(newest_.data() + first, past.differences.data(), past.factors.data(),
                         weights.order, n, residual);
}

template <class T>
void Track<T>::gather(std::span<const std::byte> frame, std::size_t first, std::size_t n,
                      U* bits) const {
  kernels<T>().gather(frame.data() + offset_in_frame(first), components_, n, bits);
}

template <class T>
void Track<T>::scatter(const U* bits, std::size_t first, std::size_t n,
                       std::span<std::byte> frame) const {
  kernels<T>().scatter(bits, components_, n, frame.data() + offset_in_frame(first));
}

template <class T>
void Track<T>::begin_frame() {
  resize_plane(incoming(), newest_.size());
}

template <class T>
void Track<T>::advance(const U* bits, std::size_t first, std::size_t n) {
  kernels<T>().advance(bits, newest_.data() + first, planes_[incoming()].data + first, n);
}

template <class T>
void Track<T>::end_frame() {
  head_ = incoming();
  depth_ = std::min(depth_ + 1, order_max);
}

template <class T>
void Track<T>::replace(std::span<const U> bits) {
  assert(bits.size() == newest_.size());
  std::copy(bits.begin(), bits.end(), newest_.begin());
  depth_ = 0;
}

template <class T>
void Track<T>::resize_plane(std::size_t slot, std::size_t size) {
  Plane& plane = planes_[slot];
  if (plane.size == size) {
    return;
  }
  const std::size_t shift = slot * 5 * 64 / sizeof(T);
  plane.memory = std::make_unique_for_overwrite<T[]>(size + shift);
  plane.data = plane.memory.get() + shift;
  plane.size = size;
}

template class Track<double>;
template class Track<float>;
template class Track<std::uint64_t>;
template class Track<std::uint32_t>;
template class Track<std::uint8_t>;

}  // namespace varve::io::codec
