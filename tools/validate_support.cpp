#include "tools/validate_support.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "core/math.h"
#include "core/parameters.h"

namespace varve::tools {
namespace {

constexpr double not_there = std::numeric_limits<double>::quiet_NaN();

template <class T>
std::vector<double> widened(std::span<const std::byte> bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  std::vector<double> result;
  result.reserve(values.size());
  for (const T value : values) result.push_back(static_cast<double>(value));
  return result;
}

std::vector<double> doubles(core::FieldType type, std::span<const std::byte> bytes) {
  switch (type) {
    case core::FieldType::f64: return widened<double>(bytes);
    case core::FieldType::f32: return widened<float>(bytes);
    case core::FieldType::u64: return widened<std::uint64_t>(bytes);
    case core::FieldType::u32: return widened<std::uint32_t>(bytes);
    case core::FieldType::u8: return widened<std::uint8_t>(bytes);
  }
  return {};
}

std::size_t field_index(const core::Simulation& simulation, std::string_view name) {
  const auto& fields = simulation.fields();
  for (std::size_t k = 0; k < fields.size(); ++k)
    if (fields[k].name == name) return k;
  throw std::invalid_argument("the scene has no field " + std::string(name));
}

}  // namespace

Experiment::Experiment(core::Scenario scenario) : scenario_(std::move(scenario)) {
  const std::vector<core::Problem> problems = core::resolve(scenario_);
  if (!problems.empty())
    throw std::invalid_argument(problems.front().key + ": " + problems.front().text);
  simulation_ = core::Simulation::create(scenario_, {});
}

void Experiment::run_until(double seconds) {
  while (time() < seconds) step();
}

std::vector<double> Experiment::field(std::string_view name) const {
  const std::size_t k = field_index(*simulation_, name);
  return doubles(simulation_->fields()[k].type, simulation_->field(k).bytes);
}

std::vector<double> Experiment::column(std::string_view table, std::string_view name) const {
  const auto& tables = simulation_->tables();
  for (std::size_t t = 0; t < tables.size(); ++t) {
    if (tables[t].name != table) continue;
    for (std::size_t k = 0; k < tables[t].columns.size(); ++k)
      if (tables[t].columns[k].name == name)
        return doubles(tables[t].columns[k].type, simulation_->table(t).columns[k]);
  }
  return {};
}

void Experiment::set_field(std::string_view name, const std::vector<double>& values) {
  const std::size_t changed = field_index(*simulation_, name);
  std::vector<std::vector<std::byte>> bytes;
  std::vector<core::FieldSpan> spans;
  for (std::size_t k = 0; k < simulation_->fields().size(); ++k) {
    const core::FieldSpan span = simulation_->field(k);
    bytes.emplace_back(span.bytes.begin(), span.bytes.end());
    spans.push_back({span.count, {}});
  }
  if (bytes[changed].size() != values.size() * sizeof(double))
    throw std::invalid_argument("values do not fit the field " + std::string(name));
  std::memcpy(bytes[changed].data(), values.data(), bytes[changed].size());
  for (std::size_t k = 0; k < spans.size(); ++k) spans[k].bytes = bytes[k];
  simulation_->set_state(spans);
}

void Samples::add(double at_x, double at_y, double number) {
  x.push_back(at_x);
  y.push_back(at_y);
  value.push_back(number);
}

double Samples::at(double at_x, double at_y, double radius) const {
  // Normal equations of value = a + b dx + c dy, lengths in units of the radius.
  double m[3][4] = {};
  int near = 0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    const double basis[3] = {1, (x[k] - at_x) / radius, (y[k] - at_y) / radius};
    const double q2 = basis[1] * basis[1] + basis[2] * basis[2];
    if (q2 >= 1) continue;
    ++near;
    const double weight = (1 - q2) * (1 - q2);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m[i][j] += weight * basis[i] * basis[j];
      m[i][3] += weight * basis[i] * value[k];
    }
  }
  if (near < 3) return not_there;
  const auto determinant = [&](int a, int b, int c) {
    return m[0][a] * (m[1][b] * m[2][c] - m[1][c] * m[2][b]) -
           m[0][b] * (m[1][a] * m[2][c] - m[1][c] * m[2][a]) +
           m[0][c] * (m[1][a] * m[2][b] - m[1][b] * m[2][a]);
  };
  const double whole = determinant(0, 1, 2);
  if (!(std::abs(whole) > 1e-9 * m[0][0] * m[0][0] * m[0][0])) return not_there;
  return determinant(3, 1, 2) / whole;
}

Line fit_line(const std::vector<double>& x, const std::vector<double>& y) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    n += 1;
    sx += x[k];
    sy += y[k];
    sxx += x[k] * x[k];
    sxy += x[k] * y[k];
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return {slope, (sy - slope * sx) / n};
}

double interpolated(const std::vector<double>& x, const std::vector<double>& y, double at) {
  if (at <= x.front()) return y.front();
  for (std::size_t k = 1; k < x.size(); ++k)
    if (at <= x[k])
      return y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1]);
  return y.back();
}

double stokes_cd(double re) { return 24 / re; }

double schiller_naumann_cd(double re) {
  return std::max(0.44, 24 / re * (1 + 0.15 * std::pow(re, 0.687)));
}

double dallavalle_cd(double re) {
  const double root = 0.63 + 4.8 / std::sqrt(re);
  return root * root;
}

double di_felice_chi(double re) {
  const double distance = 1.5 - std::log10(re);
  return 3.7 - 0.65 * std::exp(-0.5 * distance * distance);
}

double Sphere::volume() const { return core::pi * diameter * diameter * diameter / 6; }

double Sphere::submerged_weight() const {
  return (density - fluid_density) * volume() * standard_gravity;
}

double Sphere::drag(double speed, const std::function<double(double)>& cd) const {
  if (!(speed > 0)) return 0;
  const double re = fluid_density * speed * diameter / viscosity;
  return core::pi / 8 * fluid_density * diameter * diameter * cd(re) * speed * speed;
}

double settling_speed(const Sphere& sphere, const std::function<double(double)>& cd) {
  double low = 0, high = 1e3;
  for (int n = 0; n < 200; ++n) {
    const double middle = 0.5 * (low + high);
    (sphere.drag(middle, cd) < sphere.submerged_weight() ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double falling_speed(const Sphere& sphere, const std::function<double(double)>& cd, double time) {
  constexpr int steps = 20000;
  const double dt = time / steps;
  const auto slope = [&](double v) {
    return (sphere.submerged_weight() - sphere.drag(v, cd)) / sphere.mass();
  };
  double v = 0;
  for (int n = 0; n < steps; ++n) {
    const double a = slope(v), b = slope(v + 0.5 * dt * a), c = slope(v + 0.5 * dt * b);
    v += dt / 6 * (a + 2 * b + 2 * c + slope(v + dt * c));
  }
  return v;
}

double push_time_of(double alpha) {
  const double zeta = 0.5 * alpha, w = std::sqrt(1 - zeta * zeta);
  return (core::pi - std::atan2(2 * zeta * w, 1 - 2 * zeta * zeta)) / w;
}

double restitution_of(double alpha) { return std::exp(-0.5 * alpha * push_time_of(alpha)); }

double damping_for(double restitution) {
  double low = 0, high = 1.99;
  for (int n = 0; n < 200; ++n) {
    const double middle = 0.5 * (low + high);
    (restitution_of(middle) > restitution ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void use_closure_set(core::Scenario& scenario) {
  scenario.coupling.length = 4 * scenario.grains.diameter;
}

}  // namespace varve::tools
