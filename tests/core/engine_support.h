// What the tests of the whole engine share: scenes, states as bytes, digests, checks on the ledger.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/parameters.h"
#include "core/simulation.h"
#include "io/digest.h"

namespace varve::core::test {

using Settings = std::vector<std::pair<std::string, std::string>>;

/// Resolves, or throws with the first problem.
inline Scenario resolved(Scenario scenario) {
  const std::vector<Problem> problems = resolve(scenario);
  if (!problems.empty())
    throw std::invalid_argument(problems.front().key + ": " + problems.front().text);
  return scenario;
}

inline std::unique_ptr<Simulation> started(const Scenario& scenario, RunOptions options = {}) {
  return Simulation::create(resolved(scenario), options);
}

// ---- scenes ----

/// The benchmark: one disc in a box of 2 x 6 cm, released at (1, 4) cm.
inline Scenario single_disc() {
  Scenario s;
  s.domain.width = 0.02;
  s.domain.height = 0.06;
  s.fluid.sound_speed = 1;
  s.grains.rows = s.grains.columns = 1;
  s.grains.density = 1250;
  s.grains.centre_x = 0.01;
  s.grains.lowest_y = 0.04;
  s.time.until = 1.5;
  return s;
}

/// 3 x 3 grains dropped near the floor of a 2 x 2 cm box: contacts within a few steps, and from
/// then on all the time.
inline Scenario small_column() {
  Scenario s;
  s.domain.width = s.domain.height = 0.02;
  s.fluid.sound_speed = 2.5;
  s.grains.rows = s.grains.columns = 3;
  s.grains.density = 2000;
  s.grains.gap = 0.02;
  s.grains.jitter = 0.005;
  s.grains.lowest_y = 1.4e-3;
  s.grains.velocity_x = 0.015;
  s.grains.velocity_y = -0.05;
  s.time.steps = 1000;
  return s;
}

// ---- states ----

/// A deep copy of a state.
struct Snapshot {
  std::vector<std::vector<std::byte>> bytes;
  std::vector<std::uint64_t> counts;

  explicit Snapshot(const Simulation& simulation) {
    for (std::size_t k = 0; k < simulation.fields().size(); ++k) {
      const FieldSpan span = simulation.field(k);
      bytes.emplace_back(span.bytes.begin(), span.bytes.end());
      counts.push_back(span.count);
    }
  }
  std::vector<FieldSpan> spans() const {
    std::vector<FieldSpan> result;
    for (std::size_t k = 0; k < bytes.size(); ++k) result.push_back({counts[k], bytes[k]});
    return result;
  }
  bool operator==(const Snapshot&) const = default;
};

inline std::size_t field_index(const Simulation& simulation, const std::string& name) {
  for (std::size_t k = 0; k < simulation.fields().size(); ++k)
    if (simulation.fields()[k].name == name) return k;
  throw std::out_of_range("no field " + name);
}

/// Numbers of a field or of a table's column.
template <class T>
std::vector<T> numbers(std::span<const std::byte> bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}
template <class T = double>
std::vector<T> field(const Simulation& simulation, const std::string& name) {
  return numbers<T>(simulation.field(field_index(simulation, name)).bytes);
}

template <class T = double>
std::vector<T> column(const Simulation& simulation, std::size_t table, const std::string& name) {
  const auto& columns = simulation.tables().at(table).columns;
  for (std::size_t k = 0; k < columns.size(); ++k)
    if (columns[k].name == name) return numbers<T>(simulation.table(table).columns[k]);
  throw std::out_of_range("no column " + name);
}

/// The state with one field's bytes replaced.
template <class T>
void set_field(Simulation& simulation, const std::string& name, const std::vector<T>& values) {
  Snapshot state(simulation);
  const std::size_t k = field_index(simulation, name);
  if (state.bytes[k].size() != values.size() * sizeof(T)) throw std::length_error(name);
  std::memcpy(state.bytes[k].data(), values.data(), state.bytes[k].size());
  simulation.set_state(state.spans());
}

/// Least distance between two fluid particles of a plane, in spacings.
inline double closest(const Simulation& simulation) {
  const std::vector<double> x = field(simulation, "fluid.position");
  double least = std::numeric_limits<double>::max();
  for (std::size_t a = 0; a < x.size(); a += 2)
    for (std::size_t b = a + 2; b < x.size(); b += 2) {
      const double dx = x[a] - x[b], dy = x[a + 1] - x[b + 1];
      least = std::min(least, dx * dx + dy * dy);
    }
  return std::sqrt(least) / simulation.scenario().fluid.spacing;
}

// ---- digests, by the code that a log's digests come from ----

inline io::Schema schema_of(const Simulation& simulation) {
  static constexpr std::array types = {io::ScalarType::f64, io::ScalarType::f32,
                                       io::ScalarType::u64, io::ScalarType::u32,
                                       io::ScalarType::u8};
  io::Schema schema;
  for (const FieldInfo& f : simulation.fields())
    schema.fields.push_back({f.name, f.population, types.at(static_cast<std::size_t>(f.type)),
                             f.components, f.unit, f.is_id, f.constant, f.follows});
  return schema;
}

inline io::Digest digest(const Simulation& simulation, const io::Schema& schema) {
  io::FrameView frame;
  for (std::size_t k = 0; k < schema.fields.size(); ++k)
    frame.fields.push_back({simulation.field(k).count, simulation.field(k).bytes});
  return io::digest_frame(schema, frame);
}
inline io::Digest digest(const Simulation& simulation) {
  return digest(simulation, schema_of(simulation));
}

/// Digest of the event tables of the last step.
inline io::Digest tables_digest(const Simulation& simulation) {
  std::vector<std::byte> all;
  for (std::size_t k = 0; k < simulation.tables().size(); ++k) {
    const TableSpan span = simulation.table(k);
    const auto rows = std::as_bytes(std::span(&span.rows, 1));
    all.insert(all.end(), rows.begin(), rows.end());
    for (const auto& bytes : span.columns) all.insert(all.end(), bytes.begin(), bytes.end());
  }
  return io::digest_bytes(all);
}

/// What every step of a run leaves behind.
struct Trace {
  std::vector<io::Digest> states, tables;  // states[0]: the first state
  std::uint64_t contact_rows = 0;
};
inline Trace traced(Simulation& simulation, std::uint64_t steps) {
  const io::Schema schema = schema_of(simulation);
  Trace trace;
  trace.states.push_back(digest(simulation, schema));
  trace.tables.push_back(tables_digest(simulation));
  for (std::uint64_t n = 0; n < steps; ++n) {
    simulation.advance();
    trace.states.push_back(digest(simulation, schema));
    trace.tables.push_back(tables_digest(simulation));
    if (!simulation.tables().empty()) trace.contact_rows += simulation.table(0).rows;
  }
  return trace;
}

/// The first step at which two traces differ, or -1.
inline std::int64_t first_difference(const Trace& a, const Trace& b) {
  for (std::size_t n = 0; n < std::min(a.states.size(), b.states.size()); ++n)
    if (a.states[n] != b.states[n] || a.tables[n] != b.tables[n])
      return static_cast<std::int64_t>(n);
  return a.states.size() == b.states.size() ? -1 : static_cast<std::int64_t>(a.states.size());
}

// ---- momentum ----

inline double norm(const std::vector<double>& v) {
  double sum = 0;
  for (const double each : v) sum += each * each;
  return std::sqrt(sum);
}

/// |change of (fluid + grains) - dt (walls + external)| over dt sum |F|.
inline double momentum_residual(const StepLedger& ledger, double dt) {
  std::vector<double> off(ledger.fluid_momentum_change.size());
  for (std::size_t k = 0; k < off.size(); ++k)
    off[k] = ledger.fluid_momentum_change[k] + ledger.grain_momentum_change[k] -
             dt * (ledger.walls_on_fluid[k] + ledger.walls_on_grains[k] +
                   ledger.external_on_fluid[k] + ledger.external_on_grains[k]);
  return norm(off) / (dt * ledger.force_scale);
}

/// |sum of reactions + sum of forces on grains| over the sum of |F|.
inline double reaction_residual(const StepLedger& ledger) {
  std::vector<double> off(ledger.fluid_from_grains.size());
  for (std::size_t k = 0; k < off.size(); ++k)
    off[k] = ledger.fluid_from_grains[k] + ledger.grains_from_fluid[k];
  return norm(off) / ledger.force_scale;
}

}  // namespace varve::core::test

namespace varve::io {
inline void PrintTo(const Digest& digest, std::ostream* out) { *out << digest.hex(); }
}  // namespace varve::io
