// The field table and the event tables of Engine: which fields a scene has, where their bytes are.
#pragma once

#include <cstring>

#include "core/engine.h"

namespace varve::core {

namespace engine_detail {

template <class T>
constexpr FieldType field_type() {
  if constexpr (sizeof(T) == 4) return FieldType::f32;
  return FieldType::f64;
}

template <class T>
FieldSpan span_of(const std::vector<T>& values) {
  return {values.size(), std::as_bytes(std::span(values))};
}

template <class T>
void append(std::vector<std::byte>& column, T value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  column.insert(column.end(), bytes, bytes + sizeof value);
}

/// Copies a recorded field into a vector of `T`; the byte count must fit.
template <class T>
void assign(std::vector<T>& values, const FieldInfo& info, const FieldSpan& span) {
  if (span.bytes.size() != span.count * sizeof(T))
    throw ModelError("field " + info.name + ": " + std::to_string(span.bytes.size()) +
                     " bytes do not hold " + std::to_string(span.count) + " values of " +
                     std::to_string(sizeof(T)) + " bytes");
  values.resize(span.count);
  if (span.count > 0)
    std::memcpy(static_cast<void*>(values.data()), span.bytes.data(), span.bytes.size());
}

}  // namespace engine_detail

template <int D, class P>
void Engine<D, P>::build_fields() {
  const FieldType real = engine_detail::field_type<Real>();
  const FieldType position = engine_detail::field_type<Position>();
  const auto add = [this](std::string name, std::string population, FieldType type,
                          unsigned components, std::string unit, bool is_id = false,
                          bool constant = false, std::string follows = "") {
    fields_.push_back({std::move(name), std::move(population), type, components, std::move(unit),
                       is_id, constant, std::move(follows)});
  };
  // In 2D masses are per metre of depth.
  const std::string mass_unit = D == 2 ? "kg/m" : "kg";
  add("clock.step", "clock", FieldType::u64, 2, "");
  add("clock.time", "clock", FieldType::f64, 3, "s");
  if (has_fluid()) {
    add("fluid.id", "fluid", FieldType::u64, 1, "", true, true);
    add("fluid.mass", "fluid", real, 1, mass_unit, false, true);
    add("fluid.position", "fluid", position, D, "m", false, false, "fluid.velocity");
    add("fluid.velocity", "fluid", real, D, "m/s");
    add("fluid.superficial_density", "fluid", real, 1, "kg/m3");
  }
  if (!has_grains()) return;
  add("grains.id", "grains", FieldType::u64, 1, "", true, true);
  add("grains.species", "grains", FieldType::u32, 1, "", false, true);
  add("grains.position", "grains", position, D, "m");
  add("grains.velocity", "grains", real, D, "m/s");
  if (c_.contact.rotation) add("grains.spin", "grains", real, spin_components<D>, "rad/s");
  if (is_driven()) add("grains.driven", "grains", FieldType::u32, 1, "");
  add("contacts.key", "contacts", FieldType::u64, 3, "", true);
  if (c_.contact.rotation) add("contacts.spring", "contacts", real, D, "m");
  if (rolls()) add("contacts.rolling", "contacts", real, spin_components<D>, "rad");
}

template <int D, class P>
void Engine<D, P>::refresh_spans() {
  using engine_detail::span_of;
  const ClockState& clock = state_.clock;
  step_numbers_ = {clock.step, clock.since_step};
  step_times_ = {clock.time, clock.dt, clock.since_time};
  spans_.clear();
  spans_.push_back({1, std::as_bytes(std::span(step_numbers_))});
  spans_.push_back({1, std::as_bytes(std::span(step_times_))});
  if (has_fluid()) {
    spans_.push_back(span_of(state_.fluid.id));
    spans_.push_back(span_of(state_.fluid.mass));
    spans_.push_back(span_of(state_.fluid.position));
    spans_.push_back(span_of(state_.fluid.velocity));
    spans_.push_back(span_of(state_.fluid.superficial_density));
  }
  if (!has_grains()) return;
  spans_.push_back(span_of(state_.grains.id));
  spans_.push_back(span_of(state_.grains.species));
  spans_.push_back(span_of(state_.grains.position));
  spans_.push_back(span_of(state_.grains.velocity));
  if (c_.contact.rotation) spans_.push_back(span_of(state_.grains.spin));
  if (is_driven()) spans_.push_back(span_of(state_.grains.driven));
  spans_.push_back(span_of(state_.contacts.key));
  if (c_.contact.rotation) spans_.push_back(span_of(state_.contacts.spring));
  if (rolls()) spans_.push_back(span_of(state_.contacts.rolling));
}

template <int D, class P>
void Engine<D, P>::set_state(std::span<const FieldSpan> values) {
  using engine_detail::assign;
  if (values.size() != fields_.size())
    throw ModelError("the recorded state has " + std::to_string(values.size()) +
                     " fields, this scene has " + std::to_string(fields_.size()));
  std::vector<std::uint64_t> numbers;
  std::vector<double> times;
  std::vector<std::byte> clock_bytes;
  State<D, P> state;
  std::size_t k = 0;
  const auto take = [&](auto& target) {
    assign(target, fields_[k], values[k]);
    ++k;
  };
  const auto take_clock = [&](auto& target, std::size_t count) {
    using T = typename std::remove_reference_t<decltype(target)>::value_type;
    assign(target, fields_[k], {count, values[k].bytes});
    static_assert(sizeof(T) == 8);
    ++k;
  };
  take_clock(numbers, 2);
  take_clock(times, 3);
  state.clock = {numbers[0], times[0], times[1], numbers[1], times[2]};
  if (has_fluid()) {
    take(state.fluid.id);
    take(state.fluid.mass);
    take(state.fluid.position);
    take(state.fluid.velocity);
    take(state.fluid.superficial_density);
  }
  if (has_grains()) {
    take(state.grains.id);
    take(state.grains.species);
    take(state.grains.position);
    take(state.grains.velocity);
    if (c_.contact.rotation) take(state.grains.spin);
    if (is_driven()) take(state.grains.driven);
    take(state.contacts.key);
    if (c_.contact.rotation) take(state.contacts.spring);
    if (rolls()) take(state.contacts.rolling);
  }
  check_counts(state);
  state_ = std::move(state);
  lists_.reset();
  contacts_.reset();
  next_ = state_;
  happenings_.clear();
  for (auto& rows : table_rows_) rows = 0;
  for (auto& table : table_bytes_)
    for (auto& column : table) column.clear();
  refresh_spans();
}

template <int D, class P>
void Engine<D, P>::check_counts(const State<D, P>& state) const {
  const auto same = [](const char* population, std::size_t expected, std::size_t found) {
    if (expected != found)
      throw ModelError(std::string("population ") + population + ": fields of " +
                       std::to_string(expected) + " and " + std::to_string(found) + " particles");
  };
  const std::size_t fluid = state.fluid.size(), grains = state.grains.size();
  same("fluid", fluid, state.fluid.mass.size());
  same("fluid", fluid, state.fluid.position.size());
  same("fluid", fluid, state.fluid.velocity.size());
  same("fluid", fluid, state.fluid.superficial_density.size());
  same("grains", grains, state.grains.species.size());
  same("grains", grains, state.grains.position.size());
  same("grains", grains, state.grains.velocity.size());
  for (const std::uint32_t species : state.grains.species)
    if (species >= c_.species.size())
      throw ModelError("grains.species: a grain of species " + std::to_string(species) +
                       ", this scene has " + std::to_string(c_.species.size()));
  if (c_.contact.rotation) {
    same("grains", grains, state.grains.spin.size());
    same("contacts", state.contacts.key.size(), state.contacts.spring.size());
  }
  if (is_driven()) same("grains", grains, state.grains.driven.size());
  if (rolls()) same("contacts", state.contacts.key.size(), state.contacts.rolling.size());
}

template <int D, class P>
void Engine<D, P>::build_tables() {
  if (has_grains()) build_grain_tables();
  has_stage_table_ = scenario_.record.stage_digests;
  if (has_stage_table_)
    tables_.push_back({"stages",
                       {{"stage", FieldType::u8, ""},
                        {"digest_high", FieldType::u64, ""},
                        {"digest_low", FieldType::u64, ""}}});
  table_rows_.assign(tables_.size(), 0);
  for (const TableInfo& table : tables_) table_bytes_.emplace_back(table.columns.size());
}

template <int D, class P>
void Engine<D, P>::build_grain_tables() {
  TableInfo contacts{"contacts",
                     {{"grain", FieldType::u64, ""},
                      {"kind", FieldType::u8, ""},
                      {"partner", FieldType::u64, ""},
                      {"begin", FieldType::u8, ""},
                      {"end", FieldType::u8, ""},
                      {"peak_force", FieldType::f64, "N"},
                      {"peak_overlap", FieldType::f64, "m"}}};
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (int k = 0; k < D; ++k)
    contacts.columns.push_back({std::string("impulse_") + axes[k], FieldType::f64, "N s"});
  for (const char* name : {"impact_speed", "rebound_speed"})
    contacts.columns.push_back({name, FieldType::f64, "m/s"});
  for (const char* name : {"normal_loss", "tangential_loss", "friction_loss"})
    contacts.columns.push_back({name, FieldType::f64, "J"});
  tables_.push_back(std::move(contacts));
  if (coupled())
    tables_.push_back({"work",
                       {{"drag_on_grains", FieldType::f64, "J"},
                        {"hydrodynamic_on_grains", FieldType::f64, "J"}}});
}

template <int D, class P>
TableSpan Engine<D, P>::table(std::size_t index) const {
  TableSpan span{table_rows_[index], {}};
  if (has_grains() && index == 0) {
    // The contacts' own arrays, which are laid out as the table is. None after a step that failed.
    span.rows = std::min<std::uint64_t>(span.rows, contacts_.record_count());
    span.columns = contacts_.record_columns();
    for (auto& column : span.columns) column = column.first(span.rows == 0 ? 0 : column.size());
    return span;
  }
  for (const auto& column : table_bytes_[index]) span.columns.push_back(column);
  return span;
}

template <int D, class P>
void Engine<D, P>::record_tables() {
  using engine_detail::append;
  for (auto& table : table_bytes_)
    for (auto& column : table) column.clear();
  if (has_grains()) record_grain_tables();
  if (!has_stage_table_) return;
  auto& stages = table_bytes_.back();
  table_rows_.back() = stage_digests_.digests().size();
  for (const StageDigest& digest : stage_digests_.digests()) {
    append(stages[0], static_cast<std::uint8_t>(digest.stage));
    append(stages[1], digest.high);
    append(stages[2], digest.low);
  }
}

template <int D, class P>
void Engine<D, P>::record_grain_tables() {
  using engine_detail::append;
  table_rows_[0] = c_.frozen ? 0 : contacts_.record_count();
  if (!coupled()) return;
  table_rows_[1] = 1;
  append(table_bytes_[1][0], drag_work_);
  append(table_bytes_[1][1], hydrodynamic_work_);
}

}  // namespace varve::core
