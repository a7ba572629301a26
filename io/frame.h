// What io knows of a state: named spans of scalars at a step. Nothing here is physics; an engine
// publishes a Schema once and a FrameView per step, and reads a Frame back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace varve::io {

/// Scalar types of fields and table columns. The numbers are on disk (io/FORMAT.md).
enum class ScalarType : std::uint8_t { f64 = 1, f32 = 2, u64 = 3, u32 = 4, u8 = 5 };

/// Size of one scalar in bytes.
std::size_t size_of(ScalarType type);
std::string_view name_of(ScalarType type);

/// One field of the state: `count` particles x `components` scalars, particle-major
/// (x0 y0 x1 y1 ...), in ascending particle id.
struct FieldDescriptor {
  std::string name;        ///< unique, e.g. "fluid.velocity"
  std::string population;  ///< e.g. "fluid"; the fields of a population have one count
  ScalarType type = ScalarType::f64;
  std::uint32_t components = 1;
  std::string unit;       ///< SI, e.g. "m/s"; empty for pure numbers
  bool is_id = false;     ///< ascending u64 keys of its population (one field each; one or more
                          ///< components, the first leading)
  bool constant = false;  ///< changes only where the count does: in keyframes, not in deltas
  /// Hint: name of a field v such that this[n+1] = this[n] + dt[n+1] * v[n+1], evaluated in the
  /// field's own scalar type as one multiplication and one addition. A wrong hint costs bytes,
  /// never bits. Empty: no hint.
  std::string follows;

  std::size_t bytes_per_particle() const { return components * size_of(type); }
  bool operator==(const FieldDescriptor&) const = default;
};

/// One column of an event table.
struct ColumnDescriptor {
  std::string name;
  ScalarType type = ScalarType::f64;
  std::string unit;
  bool operator==(const ColumnDescriptor&) const = default;
};

/// A per-step table of things that happened within the step (contacts, work done). Tables are
/// outputs: stored and compared, never part of the digest.
struct TableDescriptor {
  std::string name;
  std::vector<ColumnDescriptor> columns;
  bool operator==(const TableDescriptor&) const = default;
};

struct Schema {
  std::vector<FieldDescriptor> fields;
  std::vector<TableDescriptor> tables;
  /// Index of the field called `name`, or -1.
  int find(std::string_view name) const;
  bool operator==(const Schema&) const = default;
};

/// Bytes of one field, in host order; `bytes.size() == count * bytes_per_particle()`.
struct FieldView {
  std::uint64_t count = 0;
  std::span<const std::byte> bytes;
};

/// One table at one step: for each column, `rows` scalars in host order.
struct TableView {
  std::uint64_t rows = 0;
  std::vector<std::span<const std::byte>> columns;
};

/// A state at the end of a step; fields and tables in the schema's order. Borrowed memory.
struct FrameView {
  std::uint64_t step = 0;
  double time = 0;  ///< [s]
  double dt = 0;    ///< [s] length of the step that led here; 0 where none did
  std::vector<FieldView> fields;
  std::vector<TableView> tables;
};

/// Something that happened at a step's end, in words: a parameter change, a wall's motion, fluid or
/// grains added or removed, an annotation. `kind` is one word ("change", "fluid_added", ...).
struct Event {
  std::uint64_t step = 0;
  std::string kind;
  std::vector<std::pair<std::string, std::string>> items;  ///< key, value
  bool operator==(const Event&) const = default;
};

/// An owned frame, as decoded from a log.
class Frame {
 public:
  std::uint64_t step = 0;
  double time = 0;
  double dt = 0;
  std::vector<std::uint64_t> counts;             ///< per field
  std::vector<std::vector<std::byte>> fields;    ///< per field
  std::vector<std::uint64_t> rows;               ///< per table
  std::vector<std::vector<std::vector<std::byte>>> tables;  ///< per table, per column
  /// A view into this frame, valid while it lives unchanged.
  FrameView view() const;
  /// A deep copy of `view`.
  static Frame copy_of(const FrameView& view);
};

}  // namespace varve::io
