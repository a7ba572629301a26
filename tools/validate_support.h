// What validation cases share: a running scene with its fields as doubles, fits, closed forms of
// drag and settling written apart from the engine's.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/simulation.h"

namespace varve::tools {

inline constexpr double standard_gravity = 9.81;  // [m/s2]

/// A scene that runs. Throws std::invalid_argument with the first problem of a scene that makes no
/// sense; what the engine throws goes through.
class Experiment {
 public:
  explicit Experiment(core::Scenario scenario);

  const core::Scenario& scenario() const { return scenario_; }
  core::Simulation& simulation() { return *simulation_; }
  double time() const { return simulation_->clock().time; }
  double dt() const { return scenario_.time.dt; }

  void step() { simulation_->advance(); }
  /// Steps while time < `seconds`.
  void run_until(double seconds);

  /// Values of a field as doubles, particle-major, whatever the precision.
  std::vector<double> field(std::string_view name) const;
  /// A column of an event table of the last step; empty where the scene has no such table.
  std::vector<double> column(std::string_view table, std::string_view name) const;
  /// Replaces one field of the state (f64 fields only).
  void set_field(std::string_view name, const std::vector<double>& values);

 private:
  core::Scenario scenario_;
  std::unique_ptr<core::Simulation> simulation_;
};

/// Values scattered over a plane or a line (y = 0 then), to be read off at a point.
struct Samples {
  std::vector<double> x, y, value;
  void add(double at_x, double at_y, double number);
  /// Weighted linear fit around a point, weights falling to 0 at `radius` [m]; NaN where fewer than
  /// three points, or points on one line only, are near.
  double at(double at_x, double at_y, double radius) const;
};

/// y over x: slope and value at x = 0 by least squares.
struct Line {
  double slope = 0, intercept = 0;
};
Line fit_line(const std::vector<double>& x, const std::vector<double>& y);

/// Piecewise linear through points of ascending x, level beyond them.
double interpolated(const std::vector<double>& x, const std::vector<double>& y, double at);

// ---- closed forms ----

/// Cd of a sphere at Re (published formulas).
double stokes_cd(double re);
double schiller_naumann_cd(double re);
double dallavalle_cd(double re);
/// Di Felice's exponent chi = 3.7 - 0.65 exp(-(1.5 - log10 Re)^2 / 2).
double di_felice_chi(double re);

/// A sphere in fluid at rest.
struct Sphere {
  double diameter = 0, density = 0;         // [m], [kg/m3]
  double fluid_density = 0, viscosity = 0;  // [kg/m3], [Pa s]
  double volume() const;
  double mass() const { return density * volume(); }
  /// [N] weight less buoyancy.
  double submerged_weight() const;
  /// [N] drag at a speed by Cd(Re).
  double drag(double speed, const std::function<double(double)>& cd) const;
};

/// m dv/dt = submerged weight - drag from rest, by Runge-Kutta: speed [m/s] at `time` [s].
double falling_speed(const Sphere& sphere, const std::function<double(double)>& cd, double time);
/// [m/s] where drag holds the submerged weight.
double settling_speed(const Sphere& sphere, const std::function<double(double)>& cd);

/// Restitution of a linear spring and a dashpot that never pulls, eta = alpha sqrt(m k); and the
/// time over which it pushes, in units of 1/w0 = sqrt(m/k) (Schwager and Poeschel 2007).
double restitution_of(double alpha);
double push_time_of(double alpha);
/// The alpha that gives a restitution.
double damping_for(double restitution);

/// What closures are proven with: one set for every case that needs the coupling to be smooth.
/// Coupling length four grain diameters, everything else as it is by default.
void use_closure_set(core::Scenario& scenario);

}  // namespace varve::tools
