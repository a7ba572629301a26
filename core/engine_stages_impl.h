// What Engine digests of each stage, where the scene asks for it (record.stage_digests).
#pragma once

#include "core/engine.h"

namespace varve::core {

namespace engine_detail {

/// The scalars of a vector of vectors, or of scalars.
template <class T>
std::span<const T> scalars(const std::vector<T>& values) {
  return values;
}
template <class T, int N>
std::span<const T> scalars(const std::vector<Eigen::Matrix<T, N, 1>>& values) {
  return {reinterpret_cast<const T*>(values.data()), values.size() * N};
}

}  // namespace engine_detail

/// Pairs by their current distance: the lists hold more, and how much more is nobody's business.
template <int D, class P>
void Engine<D, P>::digest_neighbours() {
  const auto support2 = static_cast<Real>(c_.support * c_.support);
  const GroupedLists lists = lists_.fluid();
  std::vector<std::int32_t> near;
  for (std::size_t i = 0; i < state_.fluid.size(); ++i) {
    near.assign(1, -1 - static_cast<std::int32_t>(i));
    const std::size_t at = lists_.place_of(i), g = at / lanes, l = at % lanes;
    for (std::uint32_t k = lists.start[g]; k < lists.start[g + 1]; ++k) {
      const auto j = static_cast<std::int32_t>(
          lists_.index_at(lists.index[static_cast<std::size_t>(k) * lanes + l]));
      if (static_cast<std::size_t>(j) == i) continue;
      Real r2 = 0;
      for (int a = 0; a < D; ++a) {
        Position d = state_.fluid.position[i][a] -
                     state_.fluid.position[static_cast<std::size_t>(j)][a];
        const auto length = static_cast<Position>(c_.period.length[a]);
        if (d > length / 2) d -= length;
        if (d < -length / 2) d += length;
        r2 += static_cast<Real>(d) * static_cast<Real>(d);
      }
      if (r2 < support2) near.push_back(j);
    }
    stage_digests_.values(std::span<const std::int32_t>(near));
  }
  stage_digests_.finish(Stage::neighbours);
}

template <int D, class P>
void Engine<D, P>::digest_stage(Stage stage) {
  if (!scenario_.record.stage_digests) return;
  using engine_detail::scalars;
  StageDigests& s = stage_digests_;
  const std::size_t dummies = work_.wall_count;
  switch (stage) {
    case Stage::neighbours:
      digest_neighbours();
      return;
    case Stage::porosity:
      s.values(scalars(work_.porosity));
      break;
    case Stage::pressure:
      s.values(scalars(next_.fluid.superficial_density));
      s.values(scalars(work_.pressure));
      break;
    case Stage::walls:
      s.values(scalars(work_.wall_push).first(dummies));
      s.values(scalars(work_.wall_velocity).first(dummies * D));
      break;
    case Stage::stress:
      s.values(scalars(work_.stress_force));
      break;
    case Stage::coupling:
      for (const GrainForce<D>& f : coupling_.grain_forces()) {
        s.values(std::span<const double>(f.hydrodynamic.data(), D));
        s.values(std::span<const double>(f.fluid_velocity.data(), D));
        s.values(std::span<const double>(&f.coefficient, 1));
      }
      break;
    case Stage::contacts:
      s.values(scalars(next_.grains.position));
      s.values(scalars(next_.grains.velocity));
      s.values(scalars(next_.grains.spin));
      for (const ContactKey& key : next_.contacts.key) {
        const std::uint64_t parts[] = {key.grain, key.kind, key.partner};
        s.values(std::span<const std::uint64_t>(parts));
      }
      s.values(scalars(next_.contacts.spring));
      s.values(scalars(next_.contacts.rolling));
      for (const std::uint64_t driven : next_.grains.driven)
        s.values(std::span<const std::uint64_t>(&driven, 1));
      break;
    case Stage::integration:
      s.values(scalars(next_.fluid.velocity));
      s.values(scalars(next_.fluid.position));
      break;
  }
  s.finish(stage);
}

}  // namespace varve::core
