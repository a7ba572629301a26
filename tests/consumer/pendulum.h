// A foreign engine: a double pendulum (two unit masses on unit rods, angles from the vertical). It
// knows nothing of varve but the engine interface.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "io/engine.h"
#include "io/errors.h"
#include "io/genesis.h"

class Pendulum : public varve::io::Engine {
 public:
  Pendulum() {
    using varve::io::ScalarType;
    schema_.fields = {{"clock.step", "clock", ScalarType::u64, 1, "", false, false, ""},
                      {"bob.id", "bob", ScalarType::u64, 1, "", true, true, ""},
                      {"bob.angle", "bob", ScalarType::f64, 1, "rad", false, false, "bob.rate"},
                      {"bob.rate", "bob", ScalarType::f64, 1, "rad/s", false, false, ""},
                      {"world.gravity", "world", ScalarType::f64, 1, "m/s2", false, false, ""}};
  }

  const varve::io::Schema& schema() const override { return schema_; }
  const std::vector<varve::io::Event>& events() const override { return events_; }

  varve::io::FrameView frame() const override {
    return {step_,
            dt * static_cast<double>(step_),
            step_ == 0 ? 0 : dt,
            {{1, bytes(&step_, 1)},
             {2, bytes(id_.data(), 2)},
             {2, bytes(angle_.data(), 2)},
             {2, bytes(rate_.data(), 2)},
             {1, bytes(&gravity_, 1)}},
            {}};
  }

  void advance() override {
    events_.clear();
    const double difference = angle_[0] - angle_[1];
    const double s = std::sin(difference), c = std::cos(difference), scale = 2 - c * c;
    const double w0 = rate_[0] * rate_[0], w1 = rate_[1] * rate_[1];
    const double g0 = gravity_ * std::sin(angle_[0]), g1 = gravity_ * std::sin(angle_[1]);
    rate_[0] += dt * ((g1 * c - s * (w0 * c + w1) - 2 * g0) / scale);
    rate_[1] += dt * ((2 * (w0 * s - g1 + g0 * c) + w1 * s * c) / scale);
    for (std::size_t i = 0; i < 2; ++i) angle_[i] += dt * rate_[i];
    ++step_;
    if (angle_[1] > turns_ + pi || angle_[1] < turns_ - pi) {
      turns_ += angle_[1] > turns_ ? 2 * pi : -2 * pi;
      events_.push_back({step_, "annotation", {{"text", "the lower bob went over the top"}}});
    }
  }

  void restore(const varve::io::FrameView& frame) override {
    if (frame.fields.size() != 5 || frame.fields[2].count != 2)
      throw varve::io::LogError(varve::io::ErrorKind::mismatch, "", "not a state of a pendulum");
    std::memcpy(&step_, frame.fields[0].bytes.data(), sizeof step_);
    std::memcpy(angle_.data(), frame.fields[2].bytes.data(), sizeof angle_);
    std::memcpy(rate_.data(), frame.fields[3].bytes.data(), sizeof rate_);
    std::memcpy(&gravity_, frame.fields[4].bytes.data(), sizeof gravity_);
    turns_ = 2 * pi * std::round(angle_[1] / (2 * pi));
    events_.clear();
  }

  void change(const std::vector<varve::io::Setting>& settings) override {
    for (const auto& [key, value] : settings) {
      double number = 0;
      const auto read = std::from_chars(value.data(), value.data() + value.size(), number);
      if (key != "gravity" || read.ec != std::errc{} || read.ptr != value.data() + value.size())
        throw varve::io::LogError(varve::io::ErrorKind::mismatch, "",
                                  key + " = " + value + ": expected gravity = NUMBER");
      gravity_ = number;
      events_.push_back({step_, "change", {{key, value}}});
    }
  }

 private:
  static constexpr double dt = 1e-3, pi = 3.14159265358979323846;
  template <class T>
  static std::span<const std::byte> bytes(const T* data, std::size_t count) {
    return std::as_bytes(std::span<const T>(data, count));
  }

  varve::io::Schema schema_;
  std::uint64_t step_ = 0;
  std::array<std::uint64_t, 2> id_{1, 2};
  std::array<double, 2> angle_{2.5, 2.6}, rate_{};
  double gravity_ = 9.81;
  double turns_ = 0;  // follows from the angle: no part of the state
  std::vector<varve::io::Event> events_;
};

inline varve::io::Genesis pendulum_genesis(const Pendulum& pendulum) {
  varve::io::Genesis genesis;
  genesis.engine = "double pendulum";
  genesis.engine_revision = 1;
  genesis.schema = pendulum.schema();
  genesis.scenario = "gravity = 9.81\n";
  genesis.parameters = {{"gravity", "9.81"}};
  genesis.keyframe_steps = 128;
  return genesis;
}
