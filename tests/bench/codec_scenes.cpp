#include "tests/bench/codec_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace varve::bench {
namespace {

/// Wendland C2 in 2D: -(dW/dr)/r for support 2h.
template <class Real>
Real kernel_slope(Real r, Real h) {
  const Real q = r / h;
  if (q >= 2) {
    return 0;
  }
  const Real t = 1 - q / 2;
  return Real(7.0 / (4 * 3.14159265358979)) * 5 * t * t * t / (h * h * h * h);
}

struct Grain {
  double x, y, vx, vy;
};

template <class Real>
class Flow {
 public:
  explicit Flow(const SceneOptions& options) : dam_(options.scene == "dam") {
    if (!dam_ && options.scene != "cluster") {
      throw std::invalid_argument("unknown scene '" + options.scene + "': dam or cluster");
    }
    const double n = static_cast<double>(options.particles);
    if (dam_) {  // a column 1 x 2 in a tank 4 x 3
      dx_ = Real(std::sqrt(2.0 / n));
      width_ = 4, height_ = 3, c0_ = 40, gravity_ = Real(9.81);
      add_fluid(1, 2);
    } else {  // a box 6 cm x 15 cm full of fluid
      dx_ = Real(std::sqrt(0.06 * 0.15 / n));
      width_ = Real(0.06), height_ = Real(0.15), c0_ = Real(2.5), gravity_ = 0;
      add_fluid(width_, height_);
      for (int i = 0; i < 32; ++i) {
        grains_.push_back({0.012 + 0.0045 * (i % 8) + 0.0003 * (i % 3),
                           0.100 + 0.0045 * (i / 8) + 0.0002 * (i % 5), 0, 0});
      }
    }
    h_ = Real(1.25) * dx_;
    fluid_ = rho_.size();
    add_walls();
    a_.resize(x_.size());
    drho_.resize(rho_.size());
  }

  double largest_dt() const {
    return dam_ ? 0.16 * static_cast<double>(h_) / 40 : 0.25 * static_cast<double>(h_) / 2.5;
  }

  void step(double dt) {
    bin();
    density_rates();
    const Real d = static_cast<Real>(dt);
    for (std::size_t i = 0; i < rho_.size(); ++i) {
      rho_[i] += d * drho_[i];
    }
    accelerations();
    move_grains(dt);
    for (std::size_t k = 0; k < 2 * fluid_; ++k) {
      v_[k] += d * a_[k];
      x_[k] += d * v_[k];
    }
    time_ += dt;
  }

  void read(SceneState<Real>& state, double dt) const {
    const auto n = static_cast<std::ptrdiff_t>(fluid_);
    state.time = time_;
    state.dt = dt;
    state.x.assign(x_.begin(), x_.begin() + 2 * n);
    state.v.assign(v_.begin(), v_.begin() + 2 * n);
    state.rho.assign(rho_.begin(), rho_.begin() + n);
  }

 private:
  void add(Real x, Real y) {
    x_.insert(x_.end(), {x, y});
    v_.insert(v_.end(), {0, 0});
    rho_.push_back(1000);
  }
  void add_fluid(Real width, Real height) {
    for (Real y = dx_ / 2; y < height; y += dx_) {
      for (Real x = dx_ / 2; x < width; x += dx_) {
        add(x, y);
      }
    }
  }
  /// Three layers of fixed particles around the tank.
  void add_walls() {
    const int nx = static_cast<int>(width_ / dx_ + Real(0.5));
    const int ny = static_cast<int>(height_ / dx_ + Real(0.5));
    for (int j = -3; j < ny + 3; ++j) {
      for (int i = -3; i < nx + 3; ++i) {
        const bool inside = i >= 0 && i < nx && j >= 0 && j < ny;
        if (!inside) {
          add((static_cast<Real>(i) + Real(0.5)) * dx_, (static_cast<Real>(j) + Real(0.5)) * dx_);
        }
      }
    }
  }

  std::size_t cell_of(Real x, Real y) const {
    const auto clamp = [](double value, std::size_t n) {
      return static_cast<std::size_t>(std::clamp(value, 0.0, static_cast<double>(n - 1)));
    };
    const double size = 2 * static_cast<double>(h_);
    return clamp((static_cast<double>(y) + size * 2) / size, cells_y_) * cells_x_ +
           clamp((static_cast<double>(x) + size * 2) / size, cells_x_);
  }
  void bin() {
    const double size = 2 * static_cast<double>(h_);
    cells_x_ = static_cast<std::size_t>(static_cast<double>(width_) / size) + 5;
    cells_y_ = static_cast<std::size_t>(static_cast<double>(height_) / size) + 5;
    cells_.assign(cells_x_ * cells_y_, {});
    for (std::size_t i = 0; i < rho_.size(); ++i) {
      cells_[cell_of(x_[2 * i], x_[2 * i + 1])].push_back(i);
    }
  }
  template <class Work>
  void near(Real x, Real y, Work&& work) const {
    const std::size_t cell = cell_of(x, y);
    const std::size_t cx = cell % cells_x_;
    const std::size_t cy = cell / cells_x_;
    for (std::size_t j = cy == 0 ? 0 : cy - 1; j <= std::min(cy + 1, cells_y_ - 1); ++j) {
      for (std::size_t i = cx == 0 ? 0 : cx - 1; i <= std::min(cx + 1, cells_x_ - 1); ++i) {
        for (const std::size_t k : cells_[j * cells_x_ + i]) {
          work(k);
        }
      }
    }
  }

  Real pressure(std::size_t i) const {
    if (!dam_) {
      return c0_ * c0_ * (rho_[i] - 1000);
    }
    const Real s = rho_[i] / 1000;
    const Real s7 = s * s * s * s * s * s * s;
    return c0_ * c0_ * 1000 / 7 * (s7 - 1);
  }

  /// Calls work(j, rx, ry, r2, slope) for the partners of particle i.
  template <class Work>
  void pairs(std::size_t i, Work&& work) const {
    near(x_[2 * i], x_[2 * i + 1], [&](std::size_t j) {
      const Real rx = x_[2 * i] - x_[2 * j], ry = x_[2 * i + 1] - x_[2 * j + 1];
      const Real r2 = rx * rx + ry * ry;
      if (j != i && r2 < 4 * h_ * h_ && (i < fluid_ || j < fluid_)) {
        work(j, rx, ry, r2, kernel_slope(std::sqrt(r2), h_));
      }
    });
  }

  void density_rates() {
    const Real mass = 1000 * dx_ * dx_;
    for (std::size_t i = 0; i < rho_.size(); ++i) {
      Real rate = 0;
      pairs(i, [&](std::size_t j, Real rx, Real ry, Real, Real slope) {
        const Real approach =
            (v_[2 * i] - v_[2 * j]) * rx + (v_[2 * i + 1] - v_[2 * j + 1]) * ry;
        rate -= mass * (rho_[i] / rho_[j]) * approach * slope;
        rate += Real(0.2) * h_ * c0_ * (rho_[j] - rho_[i]) * slope * mass / rho_[j];
      });
      drho_[i] = rate;
    }
  }

  void accelerations() {
    const Real mass = 1000 * dx_ * dx_;
    for (std::size_t i = 0; i < fluid_; ++i) {
      Real ax = 0, ay = -gravity_;
      const Real own = pressure(i);
      pairs(i, [&](std::size_t j, Real rx, Real ry, Real r2, Real slope) {
        const Real ux = v_[2 * i] - v_[2 * j], uy = v_[2 * i + 1] - v_[2 * j + 1];
        const Real approach = ux * rx + uy * ry;
        Real push = (own + pressure(j)) / (rho_[i] * rho_[j]);
        if (dam_ && approach < 0) {
          push -= Real(0.02) * c0_ * h_ * approach / (r2 + Real(0.01) * h_ * h_) /
                  (Real(0.5) * (rho_[i] + rho_[j]));
        }
        const Real shear = dam_ ? 0 : 2 * Real(0.01) / (rho_[i] * rho_[j]);
        ax += mass * slope * (push * rx - shear * ux);
        ay += mass * slope * (push * ry - shear * uy);
      });
      a_[2 * i] = ax;
      a_[2 * i + 1] = ay;
    }
  }

  /// Drag between a grain and the fluid around it, both ways; springs between grains and floor.
  void move_grains(double dt) {
    const double mass = 2000 * 4.9e-6, weight = 1000 * 4.9e-6 * 9.81, reach = 0.005;
    for (std::size_t g = 0; g < grains_.size(); ++g) {
      Grain& grain = grains_[g];
      double sum = 0, ux = 0, uy = 0;
      const auto share = [&](std::size_t j) {
        const double rx = static_cast<double>(x_[2 * j]) - grain.x;
        const double ry = static_cast<double>(x_[2 * j + 1]) - grain.y;
        const double t = 1 - (rx * rx + ry * ry) / (reach * reach);
        return j < fluid_ && t > 0 ? t * t * t : 0.0;
      };
      const auto around = [&](auto&& work) {
        for (std::size_t j = 0; j < fluid_; ++j) {
          if (std::abs(static_cast<double>(x_[2 * j + 1]) - grain.y) < reach) {
            work(j);
          }
        }
      };
      around([&](std::size_t j) {
        const double w = share(j);
        sum += w;
        ux += w * static_cast<double>(v_[2 * j]);
        uy += w * static_cast<double>(v_[2 * j + 1]);
      });
      const double slip_x = ux / sum - grain.vx, slip_y = uy / sum - grain.vy;
      const double speed = std::sqrt(slip_x * slip_x + slip_y * slip_y);
      const double drag = 0.5 * 1000 * 0.0025 * (1.5 * speed + 0.01);
      around([&](std::size_t j) {
        const double w = share(j) / sum / (1000 * static_cast<double>(dx_ * dx_));
        a_[2 * j] += static_cast<Real>(-drag * slip_x * w);
        a_[2 * j + 1] += static_cast<Real>(-drag * slip_y * w);
      });
      double fx = drag * slip_x, fy = drag * slip_y - weight;
      for (std::size_t o = 0; o < grains_.size(); ++o) {
        const double rx = grain.x - grains_[o].x, ry = grain.y - grains_[o].y;
        const double r = std::sqrt(rx * rx + ry * ry);
        if (o != g && r < 0.0025) {
          fx += 2e4 * (0.0025 - r) * rx / r;
          fy += 2e4 * (0.0025 - r) * ry / r;
        }
      }
      fy += grain.y < 0.00125 ? 2e4 * (0.00125 - grain.y) : 0;
      grain.vx += dt * fx / mass;
      grain.vy += dt * fy / mass;
    }
    for (Grain& grain : grains_) {
      grain.x += dt * grain.vx;
      grain.y += dt * grain.vy;
    }
  }

  bool dam_;
  Real dx_ = 0, h_ = 0, width_ = 0, height_ = 0, c0_ = 0, gravity_ = 0;
  double time_ = 0;
  std::size_t fluid_ = 0;
  std::vector<Real> x_, v_, rho_, a_, drho_;
  std::vector<Grain> grains_;
  std::size_t cells_x_ = 0, cells_y_ = 0;
  std::vector<std::vector<std::size_t>> cells_;
};

}  // namespace

template <class Real>
void run_scene(const SceneOptions& options,
               const std::function<void(const SceneState<Real>&)>& visit) {
  Flow<Real> flow(options);
  const double dt = options.dt > 0 ? options.dt : flow.largest_dt();
  for (std::size_t n = 0; n < options.settle; ++n) {
    flow.step(flow.largest_dt());
  }
  for (int n = 0; n < 20; ++n) {  // a change of dt leaves a kink behind
    flow.step(dt);
  }
  SceneState<Real> state;
  for (std::size_t n = 0; n < options.steps; ++n) {
    for (std::size_t k = 0; k < options.every; ++k) {
      flow.step(dt);
    }
    flow.read(state, dt);
    visit(state);
  }
}

template void run_scene<double>(const SceneOptions&,
                                const std::function<void(const SceneState<double>&)>&);
template void run_scene<float>(const SceneOptions&,
                               const std::function<void(const SceneState<float>&)>&);

}  // namespace varve::bench
