#include "core/initial_flow.h"

#include <algorithm>
#include <cmath>

#include "core/math.h"

namespace varve::core {
namespace {

/// Wave numbers [rad/m] and phases of one wave across the domain; kz = 0 in 2D.
struct Waves {
  double kx, ky, kz = 0;
  double x = 0, y = 0, z = 0;
};

template <int D>
Waves waves_at(const Scenario& s, const Vec<double, D>& x) {
  const Domain& d = s.domain;
  Waves waves{2 * pi / d.width, 2 * pi / d.height};
  waves.x = waves.kx * (x[0] - d.left);
  waves.y = waves.ky * x[1];
  if constexpr (D == 3) {
    waves.kz = 2 * pi / d.depth;
    waves.z = waves.kz * x[2];
  }
  return waves;
}

}  // namespace

template <int D>
Vec<double, D> initial_velocity(const Scenario& s, const Vec<double, D>& x) {
  Vec<double, D> v = Vec<double, D>::Zero();
  const double speed = s.fluid.initial_speed;
  switch (s.fluid.initial) {
    case InitialFlow::rest:
      break;
    case InitialFlow::uniform:
      v[0] = speed;
      break;
    case InitialFlow::shear:
      v[0] = speed * (x[1] / s.domain.height);
      break;
    case InitialFlow::taylor_green: {
      const Waves w = waves_at<D>(s, x);
      v[0] = speed * (sin(w.x) * cos(w.y) * cos(w.z));
      v[1] = -speed * (w.kx / w.ky) * (cos(w.x) * sin(w.y) * cos(w.z));
      break;
    }
  }
  return v;
}

template <int D>
double initial_excess_density(const Scenario& s, const Vec<double, D>& x) {
  if (s.fluid.initial != InitialFlow::taylor_green) return 0;
  const Waves w = waves_at<D>(s, x);
  const double x2 = w.kx * w.kx, y2 = w.ky * w.ky, z2 = w.kz * w.kz;
  const double along_x = cos(2 * w.x), along_y = cos(2 * w.y), along_z = cos(2 * w.z);
  const double shape = along_x / x2 + along_y / y2 + along_x * along_z / (x2 + z2) +
                       along_y * along_z / (y2 + z2);
  const double mach = s.fluid.initial_speed / s.fluid.sound_speed;
  return s.fluid.density * (mach * mach) * (x2 / 8) * shape;
}

double largest_initial_speed(const Scenario& s) {
  if (s.fluid.initial == InitialFlow::rest) return 0;
  const double speed = std::abs(s.fluid.initial_speed);
  if (s.fluid.initial != InitialFlow::taylor_green) return speed;
  return speed * std::max(1.0, s.domain.height / s.domain.width);
}

template Vec<double, 2> initial_velocity<2>(const Scenario&, const Vec<double, 2>&);
template Vec<double, 3> initial_velocity<3>(const Scenario&, const Vec<double, 3>&);
template double initial_excess_density<2>(const Scenario&, const Vec<double, 2>&);
template double initial_excess_density<3>(const Scenario&, const Vec<double, 3>&);

}  // namespace varve::core
