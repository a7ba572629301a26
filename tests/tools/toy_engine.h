// A foreign engine: heat in a rod that grows. It includes nothing of varve's own engine and needs
// only io's public headers to be recorded, replayed, forked and compared.
#pragma once

#include <cstring>
#include <string>
#include <vector>

#include "io/engine.h"
#include "io/errors.h"
#include "io/genesis.h"

namespace varve::testing {

/// Explicit heat conduction along a rod of cells. A cell is added at the cold end every 40 steps
/// and one removed at the hot end every 50 (the count varies, and an id is no index), every 64
/// there is a remark, and cells hotter than 1 at a step's end are listed in a table.
class HeatRod : public io::Engine {
 public:
  explicit HeatRod(double conductivity = 0.2, std::size_t cells = 24)
      : conductivity_(conductivity), temperature_(cells, 0.0) {
    for (std::size_t i = 0; i < cells; ++i) id_.push_back(i);
    temperature_[0] = 10;
    schema_.fields = {
        {"clock.step", "clock", io::ScalarType::u64, 1, "", false, false, ""},
        {"rod.id", "rod", io::ScalarType::u64, 1, "", true, true, ""},
        {"rod.temperature", "rod", io::ScalarType::f64, 1, "K", false, false, ""},
        {"knob.conductivity", "knob", io::ScalarType::f64, 1, "", false, false, ""},
    };
    schema_.tables = {{"hot", {{"cell", io::ScalarType::u64, ""},
                               {"temperature", io::ScalarType::f64, "K"}}}};
  }

  const io::Schema& schema() const override { return schema_; }
  const std::vector<io::Event>& events() const override { return events_; }
  std::uint64_t executed = 0;  ///< steps really done

  io::FrameView frame() const override {
    io::FrameView view;
    view.step = step_;
    view.time = 0.5 * static_cast<double>(step_);
    view.dt = 0.5;
    view.fields = {{1, span(&step_, 1)},
                   {id_.size(), span(id_.data(), id_.size())},
                   {temperature_.size(), span(temperature_.data(), temperature_.size())},
                   {1, span(&conductivity_, 1)}};
    view.tables = {{hot_id_.size(),
                    {span(hot_id_.data(), hot_id_.size()),
                     span(hot_temperature_.data(), hot_temperature_.size())}}};
    return view;
  }

  void advance() override {
    events_.clear();
    const std::vector<double> old = temperature_;
    for (std::size_t i = 1; i + 1 < old.size(); ++i)
      temperature_[i] += conductivity_ * (old[i - 1] - 2 * old[i] + old[i + 1]);
    ++step_;
    ++executed;
    if (step_ % 40 == 0) {
      id_.push_back(id_.back() + 1);
      temperature_.push_back(0);
      events_.push_back({step_, "cell_added", {{"id", std::to_string(id_.back())}}});
    }
    if (step_ % 50 == 0) {
      events_.push_back({step_, "cell_removed", {{"id", std::to_string(id_.front())}}});
      id_.erase(id_.begin());
      temperature_.erase(temperature_.begin());
    }
    if (step_ % 64 == 0)
      events_.push_back({step_, "annotation", {{"text", std::to_string(id_.size()) + " cells"}}});
    list_hot_cells();
  }

  void restore(const io::FrameView& frame) override {
    if (frame.fields.size() != 4 || frame.fields[1].count != frame.fields[2].count)
      throw io::LogError(io::ErrorKind::mismatch, "", "not a state of a heat rod");
    id_.resize(frame.fields[1].count);
    temperature_.resize(frame.fields[2].count);
    std::memcpy(&step_, frame.fields[0].bytes.data(), sizeof step_);
    std::memcpy(id_.data(), frame.fields[1].bytes.data(), frame.fields[1].bytes.size());
    std::memcpy(temperature_.data(), frame.fields[2].bytes.data(), frame.fields[2].bytes.size());
    std::memcpy(&conductivity_, frame.fields[3].bytes.data(), sizeof conductivity_);
    events_.clear();
    hot_id_.clear();
    hot_temperature_.clear();
  }

  void change(const std::vector<io::Setting>& settings) override {
    for (const auto& [key, value] : settings) {
      if (key != "knob.conductivity")
        throw io::LogError(io::ErrorKind::mismatch, "", "unknown key '" + key + "'");
      events_.push_back({step_, "change", {{key, value}}});
      conductivity_ = std::stod(value);
    }
  }

 private:
  template <class T>
  static std::span<const std::byte> span(const T* data, std::size_t count) {
    return std::as_bytes(std::span<const T>(data, count));
  }

  void list_hot_cells() {
    hot_id_.clear();
    hot_temperature_.clear();
    for (std::size_t i = 0; i < id_.size(); ++i) {
      if (temperature_[i] <= 1) continue;
      hot_id_.push_back(id_[i]);
      hot_temperature_.push_back(temperature_[i]);
    }
  }

  io::Schema schema_;
  std::uint64_t step_ = 0;
  double conductivity_;
  std::vector<std::uint64_t> id_, hot_id_;
  std::vector<double> temperature_, hot_temperature_;
  std::vector<io::Event> events_;
};

/// The genesis of a rod's log.
inline io::Genesis rod_genesis(const io::Engine& rod, std::uint32_t keyframe_steps = 16) {
  io::Genesis genesis;
  genesis.engine = "heat rod";
  genesis.engine_revision = 1;
  genesis.schema = rod.schema();
  genesis.scenario = "cells = 24\n";
  genesis.keyframe_steps = keyframe_steps;
  return genesis;
}

}  // namespace varve::testing
