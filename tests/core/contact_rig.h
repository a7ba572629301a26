// Grains, their contacts and what acts on them, advanced step by step without an engine around.
#pragma once

#include <vector>

#include "core/contacts.h"
#include "core/math.h"

namespace varve::core::test {

template <int D>
struct ContactRig {
  using P = DoublePrecision;
  using V = Vec<double, D>;
  using Spin = Vec<double, spin_components<D>>;

  Constants<D> c;
  std::vector<Wall> walls;
  GrainState<D, P> grains;
  ContactState<D, P> contacts;
  std::vector<OuterForce<D>> outer;
  Contacts<D, P> stage;
  std::uint64_t step = 0;
  double limit = 1e300;

  ContactRig(double diameter, double density) {
    c.species = {species_constants<D>(diameter, density)};
    c.contact.tangential_ratio = D == 2 ? 1.0 / 3 : 2.0 / 7;
    c.contact.stiffness = c.species[0].mass * (pi / 0.5e-3) * (pi / 0.5e-3);
    c.dt = 0.5e-3 / 30;
    c.substeps = 1;
  }
  const SpeciesConstants<D>& of(std::size_t i) const { return c.species[grains.species[i]]; }
  void add_floor() { walls.push_back({wall_bottom, Boundary::no_slip, 1, 0.0, 1.0}); }
  void add(const V& x, const V& v, const Spin& spin = Spin::Zero(), std::uint32_t species = 0) {
    grains.id.push_back(grains.size());
    grains.species.push_back(species);
    grains.position.push_back(x);
    grains.velocity.push_back(v);
    grains.spin.push_back(spin);
    outer.push_back({V::Zero(), V::Zero(), 0});
  }
  /// Gravity along -y.
  void weigh(double g) {
    for (std::size_t i = 0; i < grains.size(); ++i) {
      outer[i].force.setZero();
      outer[i].force[1] = -g * of(i).mass;
    }
  }
  void advance(int steps = 1) {
    c.set_pairs();
    for (int n = 0; n < steps; ++n) stage.advance(c, outer, walls, limit, ++step, grains, contacts);
  }
  V momentum() const {
    V sum = V::Zero();
    for (std::size_t i = 0; i < grains.size(); ++i) sum += of(i).mass * grains.velocity[i];
    return sum;
  }
  double kinetic() const {
    double sum = 0;
    for (std::size_t i = 0; i < grains.size(); ++i)
      sum += 0.5 * of(i).mass * grains.velocity[i].squaredNorm() +
             0.5 * of(i).inertia * grains.spin[i].squaredNorm();
    return sum;
  }
};

/// What one impact was like.
struct Impact {
  double duration = 0, peak_force = 0, peak_overlap = 0;
};

/// Advances until the only contact has begun and ended.
template <int D>
Impact collide(ContactRig<D>& rig, int steps_most = 2'000'000) {
  Impact impact;
  bool begun = false;
  for (int n = 0; n < steps_most; ++n) {
    rig.advance();
    for (const auto& record : rig.stage.records()) {
      begun = true;
      impact.peak_force = std::max(impact.peak_force, record.peak_force);
      impact.peak_overlap = std::max(impact.peak_overlap, record.peak_overlap);
    }
    if (rig.contacts.size() > 0) impact.duration += rig.c.dt;
    if (begun && rig.contacts.size() == 0) break;
  }
  return impact;
}

}  // namespace varve::core::test
