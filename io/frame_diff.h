// Compares two states field by field, as bits. Pure: two schemas and two frames in, findings out.
// Particles are matched by id, so that a state with a few more of them compares as well.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/frame.h"

namespace varve::io {

/// One stored number: its type and its bits (in the low bytes of `bits`).
struct Scalar {
  ScalarType type = ScalarType::f64;
  std::uint64_t bits = 0;

  bool is_real() const { return type == ScalarType::f64 || type == ScalarType::f32; }
  /// Nearest double (exact for reals, u32 and u8).
  double as_double() const;
  /// Shortest decimal that reads back to the same bits; a NaN shows its bits: "nan(0x7ff8...)".
  std::string decimal() const;
  /// Reals: exact C99 hexadecimal ("-0x1.8p+1"); integers: "0x1f".
  std::string hex() const;
  bool operator==(const Scalar&) const = default;
};

/// The `index`-th scalar of a field's bytes.
Scalar scalar_at(const FieldDescriptor& field, const FieldView& view, std::uint64_t index);

/// What is still accepted. A pair of numbers is within tolerance if its bits are equal, or if any
/// one of the limits that are given holds. NaNs and infinities are only within tolerance of the
/// same bits; -0 and +0 are always within tolerance of each other.
struct Tolerance {
  std::optional<double> absolute;  ///< |a - b| <= absolute, in the field's unit
  std::optional<double> relative;  ///< |a - b| <= relative max(|a|, |b|)
  std::optional<std::uint64_t> ulp;  ///< distance in representable values
  bool given() const { return absolute || relative || ulp; }
};

/// Tolerances of all real fields, and of single fields by name. A field's own limit replaces the
/// general one of the same kind. Integer fields are exact unless they are named.
struct Tolerances {
  Tolerance all;
  std::vector<std::pair<std::string, Tolerance>> by_field;
  bool given() const;
  Tolerance of(const FieldDescriptor& field) const;
};

/// One number that is not the same on both sides. Differences and ULPs of numbers of unequal type
/// are taken after widening to double.
struct ValueDifference {
  std::uint32_t component = 0;
  std::vector<std::uint64_t> particle;  ///< id (one number per component of the id field)
  Scalar a, b;
  std::uint64_t ulp = 0;  ///< integers: |a - b|
  double absolute = 0;  ///< |a - b|; infinite where either is a NaN or they are unlike infinities
  double relative = 0;  ///< |a - b| / max(|a|, |b|); infinite likewise
};

/// Everything found in one field.
struct FieldDifference {
  std::string name, unit;
  std::uint32_t components = 1;
  bool real = true;
  std::uint64_t compared = 0;  ///< numbers present on both sides
  std::uint64_t differing = 0;  ///< numbers with unequal bits
  std::uint64_t beyond = 0;  ///< of these, outside the tolerance (without one: all of them)
  std::uint64_t particles = 0;  ///< particles with at least one differing number
  std::uint64_t not_finite = 0;  ///< differing numbers of which at least one is NaN or infinite
  std::uint64_t zero_signs = 0;  ///< differing numbers that are -0 and +0
  /// Particles present on one side only; counted once per population, at its id field (at its first
  /// compared field where the ids are not compared).
  std::uint64_t only_a = 0, only_b = 0;
  std::optional<std::vector<std::uint64_t>> first_only_a, first_only_b;
  std::optional<ValueDifference> first, first_beyond;  ///< in order of id, then component
  std::optional<ValueDifference> largest;  ///< by absolute difference
  std::uint64_t largest_ulp = 0;
  double largest_relative = 0;

  bool equal() const { return differing == 0 && only_a == 0 && only_b == 0; }
  bool within() const { return beyond == 0 && only_a == 0 && only_b == 0; }
};

/// Which field of one schema is which of the other.
struct SchemaMatch {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< in the order of the first schema
  std::vector<std::string> obstacles;  ///< why states can't be compared at all
  std::vector<std::string> widened;  ///< fields of unequal real type, comparable by tolerance only
};
/// Matches by name; population, components and kind of number must agree.
SchemaMatch match_schemas(const Schema& a, const Schema& b);

struct FrameDifference {
  std::vector<FieldDifference> fields;  ///< one per compared pair, in the schema's order
  bool equal() const;
  bool within() const;
  /// First field, in the schema's order, that is not equal / not within tolerance; or nullptr.
  const FieldDifference* first() const;
  const FieldDifference* first_beyond() const;
  std::uint64_t differing() const;  ///< numbers with unequal bits, all fields
};

/// Compares the pairs of `match` (both schemas as given to match_schemas). Throws
/// LogError(mismatch) if a frame does not fit its schema.
FrameDifference compare_frames(const Schema& schema_a, const FrameView& a, const Schema& schema_b,
                               const FrameView& b, const SchemaMatch& match,
                               const Tolerances& tolerances = {});

/// "fluid.velocity.y": components of reals are called x y z up to three, else "[3]".
std::string component_name(const FieldDifference& field, std::uint32_t component);
/// "1733", or "3:0:7" where an id has several parts.
std::string particle_name(const std::vector<std::uint64_t>& id);

}  // namespace varve::io
