// What a contact of two grains, or of a grain and a wall, is made of: coefficients per pair of
// species, computed once, and the laws that turn an overlap into a spring and a dashpot.
// core/PHYSICS.md has the equations and their sources.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/scenario.h"

namespace varve::core {

/// Coefficients of one pair of species; a wall is a partner of infinite radius and mass. What
/// `stiffness`, `tangential_stiffness` and `damping` mean is the law's business.
struct ContactPair {
  double radius_i = 0, radius_j = 0;  // [m] arms; 0 for a wall
  double reach = 0;                   // [m] distance of centres (from the wall) at which they touch
  double sight = 0, sight2 = 0;       // [m], [m2] beyond which nothing happens; rounded up
  double least_diameter = 0;          // [m] of the two
  double effective_mass = 0;          // [kg] m_i m_j / (m_i + m_j)
  double effective_radius = 0;        // [m] R_i R_j / (R_i + R_j)
  double stiffness = 0, tangential_stiffness = 0;
  double damping = 0;
  double rolling_stiffness = 0;  // over the normal stiffness [m2]
  double rolling_inertia = 0;    // [kg m2] of the relative rolling
  double lubrication = 0;        // [N s] viscous force x gap / speed (x sqrt(gap) too for discs)
};

/// Spring and dashpot at one overlap.
struct ContactResponse {
  double elastic;             // [N] normal force of the spring
  double damping;             // [N s/m] of the normal dashpot
  double tangential_stiffness;  // [N/m]
  double tangential_damping;  // [N s/m]
  double normal_stiffness;    // [N/m] d elastic / d overlap
};

/// Cundall and Strack (1979): F = k delta, eta = alpha sqrt(m_eff k).
struct LinearLaw {
  static ContactResponse at(const ContactPair& pair, double overlap) {
    return {pair.stiffness * overlap, pair.damping, pair.tangential_stiffness, pair.damping,
            pair.stiffness};
  }
};

/// Hertz (1882), Mindlin (1949), Tsuji et al. (1992): with S_n = 2 E* sqrt(R* delta) and
/// S_t = 8 G* sqrt(R* delta), F = 2/3 S_n delta, eta = 2 sqrt(5/6) zeta sqrt(m_eff S).
struct HertzLaw {
  static ContactResponse at(const ContactPair& pair, double overlap) {
    const double root = std::sqrt(overlap);
    const double normal = pair.stiffness * root, tangential = pair.tangential_stiffness * root;
    return {2.0 / 3.0 * normal * overlap, pair.damping * std::sqrt(normal), tangential,
            pair.damping * std::sqrt(tangential), normal};
  }
};

/// Restitution of a spring and a dashpot of relative damping `zeta` that never pulls. Exact for the
/// linear law (Schwager and Poeschel 2007) and, since its orbit in the phase plane of
/// (delta^(5/4), v) is the same, for Hertz and Tsuji's too.
double restitution_of(double zeta);
/// The relative damping that gives restitution `e`, 0 < e <= 1, by halving.
double damping_for(double e);

/// Grain of one species as far as contacts care.
struct ContactBody {
  double radius, mass, inertia;
};
/// Coefficients for two bodies of a resolved scenario; `j` nullptr: a wall.
ContactPair contact_pair(const Contact& contact, int dimension, const ContactBody& i,
                         const ContactBody* j);

/// [s] Duration of an undamped contact: pi sqrt(m_eff / k), or by Hertz's law, of an impact at
/// `speed` [m/s], 2.943 (15/16 m_eff / (E* sqrt(R*)))^(2/5) speed^(-1/5).
double undamped_contact_time(const Contact& contact, const ContactPair& pair, double speed);

}  // namespace varve::core
