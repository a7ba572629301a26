// T1 kernels and lattices, T6 drag: formulas and sums against tables, no run.
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "core/drag.h"
#include "core/initial.h"
#include "core/kernel.h"
#include "core/parameters.h"
#include "tools/validate.h"
#include "tools/validate_support.h"

namespace varve::tools {
namespace {

// ---- T1 kernels ----

/// int w(r) dV over the kernel's support, by the midpoint rule.
template <int D, core::Kernel K, class Integrand>
double integral(Integrand integrand) {
  const core::SmoothingKernel<D, K> kernel(1.0);
  constexpr int parts = 40000;
  const double dr = kernel.support() / parts;
  double sum = 0;
  for (int n = 0; n < parts; ++n) {
    const double r = (n + 0.5) * dr;
    sum += integrand(kernel, r) * (D == 2 ? 2 * core::pi * r : 4 * core::pi * r * r) * dr;
  }
  return sum;
}

/// The worst of W (and dW/dr) at h = 1 and q = 0, 0.5, 1, 1.5 against the table.
template <int D, core::Kernel K>
ValidationRow kernel_row(const char* name, const std::array<double, 4>& values,
                         const std::array<double, 3>& slopes = {}) {
  const core::SmoothingKernel<D, K> kernel(1.0);
  ValidationRow worst;
  const auto hold = [&](double reference, double ours) {
    if (worst.quantity.empty() ||
        std::abs(ours - reference) > std::abs(worst.ours - worst.reference))
      worst = absolute_row(fmt::format("W {} {}D, worst of the table", name, D), "", reference,
                           ours, 1e-6);
  };
  for (std::size_t k = 0; k < 4; ++k)
    hold(values[k], kernel.value(0.5 * static_cast<double>(k)));
  if (slopes[0] != 0)
    for (std::size_t k = 0; k < 3; ++k) {
      const double r = 0.5 * static_cast<double>(k + 1);
      hold(slopes[k], kernel.slope(r) * r);
    }
  return worst;
}

template <int D, core::Kernel K>
void add_moments(std::vector<ValidationRow>& rows, const char* name, double squared,
                 double second_moment) {
  const auto quantity = [&](const char* what) { return fmt::format("{} {}D: {}", name, D, what); };
  const auto one = [](const auto& w, double r) { return w.value(r); };
  const auto square = [](const auto& w, double r) { return w.value(r) * w.value(r); };
  const auto spread = [](const auto& w, double r) { return w.value(r) * r * r / D; };
  rows.push_back(absolute_row(quantity("int W"), "", 1, integral<D, K>(one), 1e-6));
  rows.push_back(absolute_row(quantity("int W^2"), "", squared, integral<D, K>(square), 1e-6));
  if (second_moment > 0)
    rows.push_back(
        absolute_row(quantity("<x^2>"), "h^2", second_moment, integral<D, K>(spread), 1e-6));
}

std::vector<ValidationRow> kernels() {
  using enum core::Kernel;
  std::vector<ValidationRow> rows;
  rows.push_back(kernel_row<2, wendland_c2>("Wendland C2", {0.557042, 0.352503, 0.104445, 0.008704},
                                            {-0.587506, -0.348151, -0.065278}));
  rows.push_back(kernel_row<3, wendland_c2>("Wendland C2", {0.417782, 0.264377, 0.078334, 0.006528},
                                            {-0.440629, -0.261114, -0.048959}));
  rows.push_back(kernel_row<2, cubic>("cubic", {0.454728, 0.326836, 0.113682, 0.014210}));
  rows.push_back(kernel_row<3, cubic>("cubic", {0.318310, 0.228785, 0.079577, 0.009947}));
  add_moments<2, wendland_c2>(rows, "Wendland C2", 0.275708, 0.277778);
  add_moments<3, wendland_c2>(rows, "Wendland C2", 0.149973, 0.266667);
  add_moments<2, cubic>(rows, "cubic", 0.238964, 0);
  add_moments<3, cubic>(rows, "cubic", 0.124040, 0);
  return rows;
}

// ---- T1 lattices ----

struct Spread {
  double least = 1, most = 0, mean = 0;
};

/// Porosity (E3) over a periodic packing of touching discs, sampled on a fine lattice of fluid.
Spread packing_porosity(bool staggered, double length_ratio) {
  constexpr double d = 1e-3;
  core::Scenario s;
  s.domain.sides = s.domain.bottom = s.domain.top = core::Boundary::periodic;
  s.fluid.spacing = 10 * d / 51;
  s.domain.width = 10 * d;
  // 12 staggered rows are 10.3923 d high; 53 spacings are 10.3922 d.
  s.domain.height = (staggered ? 53 : 51) * s.fluid.spacing;
  s.grains.diameter = d;
  s.grains.rows = s.grains.columns = 10;
  s.grains.motion = core::GrainMotion::frozen;
  s.coupling.length = length_ratio * d;
  s.coupling.porosity_floor = 0.01;
  s.time.steps = 1;
  const Experiment experiment(s);  // resolves, or says what is wrong
  const core::Scenario& resolved = experiment.scenario();
  auto state = core::first_state<2, core::DoublePrecision>(resolved);
  if (staggered) {
    auto& grains = state.grains;
    grains.position.clear();
    for (int row = 0; row < 12; ++row)
      for (int column = 0; column < 10; ++column)
        grains.position.push_back(core::Vec<double, 2>(
            d * (column + (row % 2 == 0 ? 0.25 : 0.75)), s.domain.height * (row + 0.5) / 12));
    const std::size_t count = grains.position.size();
    grains.id.resize(count);
    for (std::size_t i = 0; i < count; ++i) grains.id[i] = i;
    grains.species.assign(count, 0);
    grains.velocity.assign(count, core::Vec<double, 2>::Zero());
    if (!grains.spin.empty()) grains.spin.assign(count, core::Vec<double, 1>::Zero());
  }
  Spread spread;
  const std::vector<double> porosity = core::floored_porosity<2>(resolved, state);
  for (const double eps : porosity) {
    spread.least = std::min(spread.least, eps);
    spread.most = std::max(spread.most, eps);
    spread.mean += eps / static_cast<double>(porosity.size());
  }
  return spread;
}

std::vector<ValidationRow> lattices() {
  struct Packing {
    const char* name;
    bool staggered;
    double length, least, most, mean;
  };
  std::vector<ValidationRow> rows;
  for (const Packing& p : {Packing{"square, hc = d", false, 1, 0.185, 0.234, 0.2146},
                           Packing{"square, hc = 2 d", false, 2, 0.2137, 0.2152, 0.2146},
                           Packing{"staggered, hc = d", true, 1, 0.067, 0.104, 0.0931},
                           Packing{"staggered, hc = 2 d", true, 2, 0.0924, 0.0934, 0.0931}}) {
    const Spread ours = packing_porosity(p.staggered, p.length);
    const auto add = [&](const char* what, double reference, double value) {
      rows.push_back(
          absolute_row(fmt::format("{}: {} porosity", p.name, what), "", reference, value, 0.005));
    };
    add("mean", p.mean, ours.mean);
    add("least", p.least, ours.least);
    add("largest", p.most, ours.most);
  }
  return rows;
}

// ---- T6 drag ----

/// The worst deviation of a list of (reference, ours). A printed number is right to half a unit of
/// its last place, which is allowed on top of 1e-4.
class WorstOf {
 public:
  explicit WorstOf(double last_place) : half_unit_(0.5 * last_place) {}
  void add(const std::string& where, double reference, double ours) {
    const double excess = (std::abs(ours - reference) - half_unit_) / reference;
    ++count_;
    if (count_ > 1 && excess <= worst_) return;
    worst_ = excess;
    where_ = where;
    reference_ = reference;
    ours_ = ours;
  }
  ValidationRow row(const char* name) const {
    return relative_row(fmt::format("{}: {}, worst of {}", name, where_, count_), "", reference_,
                        ours_, 1e-4 + half_unit_ / reference_);
  }

 private:
  double half_unit_, worst_ = 0, reference_ = 0, ours_ = 0;
  int count_ = 0;
  std::string where_;
};

/// Cd by the engine's K at porosity 1: F = K u = pi/8 rho d^2 Cd u^2.
double engine_cd(core::Drag law, double re) {
  const core::Slip slip{re, 1, 1, 1, 1};  // speed, porosity, d, rho, mu: Re = speed
  return core::drag_coefficient<3>(core::make_drag_law<3>(law), slip) / (core::pi / 8 * re);
}

/// F / (3 pi mu d u_s) by the engine's K, u_s = eps u.
double engine_swarm(core::Drag law, double porosity, double re) {
  const core::Slip slip{re / porosity, porosity, 1, 1, 1};
  return core::drag_coefficient<3>(core::make_drag_law<3>(law), slip) /
         (3 * core::pi * porosity);
}

std::vector<ValidationRow> single_sphere_drag() {
  constexpr double re[] = {0.1, 1, 5, 10, 20, 50, 100, 500, 1000};
  constexpr double stokes[] = {240, 24, 4.8, 2.4, 1.2, 0.48, 0.24, 0.048, 0.024};
  constexpr double naumann[] = {247.401, 27.6, 6.975, 4.151, 2.610, 1.538, 1.092, 0.563, 0.44};
  constexpr double dallavalle[] = {249.922, 29.485, 7.710, 4.613, 2.901, 1.713, 1.232, 0.714,
                                   0.611};
  WorstOf a(0.001), b(0.001), c(0.001);
  for (std::size_t k = 0; k < 9; ++k) {
    const std::string where = fmt::format("Cd at Re {:g}", re[k]);
    a.add(where, stokes[k], engine_cd(core::Drag::stokes, re[k]));
    b.add(where, naumann[k], engine_cd(core::Drag::schiller_naumann, re[k]));
    c.add(where, dallavalle[k], engine_cd(core::Drag::dallavalle_di_felice, re[k]));
  }
  return {a.row("Stokes"), b.row("Schiller-Naumann"), c.row("DallaValle")};
}

std::vector<ValidationRow> swarm_drag() {
  struct Line {
    double porosity;
    double di_felice[4], wen_yu[4], ergun[4];  // at Re 0.1, 1, 10, 50
  };
  static constexpr Line table[] = {
      {1.0, {1.0413, 1.2285, 1.9223, 3.5688}, {1.0308, 1.1500, 1.7296, 3.2044}, {}},
      {0.9, {1.5332, 1.7743, 2.6722, 4.9279}, {1.5143, 1.6893, 2.5408, 4.7071}, {}},
      {0.8, {2.3626, 2.6761, 3.8618, 7.0686}, {2.3276, 2.5967, 3.9054, 7.2354}, {}},
      {0.7,
       {3.8575, 4.2642, 5.8627, 10.6401},
       {3.7895, 4.2276, 6.3583, 11.7797},
       {5.1219, 5.3005, 7.0862, 15.0227}},
      {0.6,
       {6.7936, 7.3015, 9.4929, 17.0602},
       {6.6518, 7.4207, 11.1608, 20.6771},
       {9.2863, 9.5293, 11.9599, 22.7623}},
      {0.5,
       {13.2681, 13.7935, 16.7860, 29.8193},
       {12.9405, 14.4363, 21.7124, 40.2255},
       {16.7056, 17.0556, 20.5556, 36.1111}},
      {0.4,
       {30.1028, 30.0463, 33.7229, 59.0618},
       {29.2194, 32.5971, 49.0263, 90.8287},
       {31.3108, 31.8576, 37.3264, 61.6319}}};
  constexpr double re[] = {0.1, 1, 10, 50};
  WorstOf di_felice(1e-4), wen_yu(1e-4), ergun(1e-4), dilute(1e-4);
  for (const Line& line : table)
    for (std::size_t k = 0; k < 4; ++k) {
      using enum core::Drag;
      const std::string where =
          fmt::format("F/F_Stokes at eps {:g}, Re {:g}", line.porosity, re[k]);
      di_felice.add(where, line.di_felice[k],
                    engine_swarm(dallavalle_di_felice, line.porosity, re[k]));
      wen_yu.add(where, line.wen_yu[k], engine_swarm(schiller_naumann, line.porosity, re[k]));
      if (line.ergun[0] > 0)
        ergun.add(where, line.ergun[k], engine_swarm(gidaspow, line.porosity, re[k]));
      if (line.porosity > 0.82)
        dilute.add(where, line.wen_yu[k], engine_swarm(gidaspow, line.porosity, re[k]));
    }
  return {di_felice.row("Di Felice"), wen_yu.row("Wen-Yu"), ergun.row("Gidaspow, dense (Ergun)"),
          dilute.row("Gidaspow, dilute (Wen-Yu)")};
}

}  // namespace

void add_law_cases(std::vector<ValidationCase>& cases) {
  cases.push_back({"kernels", "T1", CaseKind::fast, "kernels at table points and their moments",
                   "Wendland 1995, Monaghan 1992; moments in closed form", kernels});
  cases.push_back({"lattices", "T1", CaseKind::fast,
                   "porosity of touching discs, square and staggered",
                   "1 - pi/4 and 1 - pi/(2 sqrt 3); ripple by direct summation of the kernel",
                   lattices});
  cases.push_back({"drag", "T6", CaseKind::fast, "drag coefficient of one sphere, three laws",
                   "Stokes 1851, Schiller and Naumann 1935, DallaValle 1948", single_sphere_drag});
  cases.push_back({"swarm_drag", "T6", CaseKind::fast, "drag in a swarm, four laws",
                   "Di Felice 1994, Wen and Yu 1966, Ergun 1952, Gidaspow 1994", swarm_drag});
}

}  // namespace varve::tools
