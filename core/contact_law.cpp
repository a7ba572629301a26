#include "core/contact_law.h"

#include <algorithm>

#include "core/math.h"

namespace varve::core {

namespace {

/// Angle in (0, pi) whose tangent is sine / cosine, sine > 0: a sum of halvings, since core has no
/// arc tangent and this is not a place of haste.
double angle_of(double sine, double cosine) {
  double low = 0, high = pi;
  for (int i = 0; i < 64; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    // cot is decreasing: the angle is larger while cos/sin of the middle exceeds the wanted one.
    (cos(middle) * sine > cosine * sin(middle) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

double restitution_of(double zeta) {
  if (zeta < 1) {
    const double w = std::sqrt((1 - zeta) * (1 + zeta));
    // The force would turn to a pull before the overlap is gone; from there on the grains are free.
    return exp(-2 * zeta * angle_of(w, zeta) / w);
  }
  if (zeta == 1) return exp(-2.0);
  const double w = std::sqrt((zeta - 1) * (zeta + 1));
  return exp(-2 * zeta / w * log(zeta + w));
}

double damping_for(double e) {
  if (e >= 1) return 0;
  double low = 0, high = 1;
  while (restitution_of(high) > e && high < 1e6) high *= 2;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (restitution_of(middle) > e ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

ContactPair contact_pair(const Contact& contact, int dimension, const ContactBody& i,
                         const ContactBody* j) {
  ContactPair p;
  p.radius_i = i.radius;
  p.radius_j = j ? j->radius : 0;
  p.reach = p.radius_i + p.radius_j;
  p.least_diameter = 2 * (j ? std::min(i.radius, j->radius) : i.radius);
  // Written as quotients, so that equal partners give exactly half.
  p.effective_mass = j ? i.mass / (1 + i.mass / j->mass) : i.mass;
  p.effective_radius = j ? i.radius / (1 + i.radius / j->radius) : i.radius;
  if (contact.law == ContactLaw::linear) {
    p.stiffness = contact.stiffness;
    p.tangential_stiffness = contact.tangential_ratio * contact.stiffness;
    p.damping = contact.damping * std::sqrt(p.effective_mass * contact.stiffness);
  } else {
    // Partners of one material: 1/E* = 2 (1 - nu^2) / E, 1/G* = 2 (2 - nu) / G. A wall is rigid, as
    // in Hertz's problem of a sphere on a rigid plane.
    const double nu = contact.poisson_ratio, modulus = contact.youngs_modulus;
    const double sides = j ? 2 : 1;
    const double shear = modulus / (2 * (1 + nu));
    const double normal = modulus / (sides * (1 - nu * nu));
    const double tangential = shear / (sides * (2 - nu));
    const double root = std::sqrt(p.effective_radius);
    p.stiffness = 2 * normal * root;
    p.tangential_stiffness = 8 * tangential * root;
    p.damping = contact.damping * std::sqrt(5.0 / 6.0 * p.effective_mass);
  }
  p.sight = p.reach;
  if (contact.lubrication) p.sight += contact.lubrication_range * p.effective_radius;
  p.sight *= 1 + 1e-12;
  p.sight2 = p.sight * p.sight;
  if (contact.rolling_friction > 0) {
    const double arm = contact.rolling_friction * p.effective_radius;
    p.rolling_stiffness = 2.25 * arm * arm;
    const double own = 1 / (i.inertia + i.mass * i.radius * i.radius);
    const double other = j ? 1 / (j->inertia + j->mass * j->radius * j->radius) : 0;
    p.rolling_inertia = 1 / (own + other);
  }
  if (contact.lubrication) {
    // Reynolds' film between round bodies: 6 pi mu R*^2 v / h, and for discs, per metre of depth,
    // 3 sqrt(2) pi mu v (R* / h)^(3/2). The viscosity comes with the force.
    const double r = p.effective_radius;
    p.lubrication = dimension == 2 ? 3 * std::sqrt(2.0) * pi * r * std::sqrt(r) : 6 * pi * r * r;
  }
  return p;
}

double undamped_contact_time(const Contact& contact, const ContactPair& pair, double speed) {
  if (contact.law == ContactLaw::linear)
    return pi * std::sqrt(pair.effective_mass / pair.stiffness);
  // F = K delta^1.5, K = stiffness / 1.5: the longest compression is (5/4 m v^2 / K)^(2/5), and the
  // contact lasts 2.9432751 times as long as it would take at constant speed.
  const double k = pair.stiffness / 1.5;
  const double longest = pow(1.25 * pair.effective_mass * speed * speed / k, 0.4);
  return 2.9432751 * longest / speed;
}

}  // namespace varve::core
