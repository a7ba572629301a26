#include "io/frame_diff.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "io/errors.h"
#include "io/ulp.h"

namespace varve::io {
namespace {

bool is_real(ScalarType type) { return type == ScalarType::f64 || type == ScalarType::f32; }

std::uint64_t load_bits(const std::byte* at, std::size_t size) {
  switch (size) {
    case 8: {
      std::uint64_t v;
      std::memcpy(&v, at, 8);
      return v;
    }
    case 4: {
      std::uint32_t v;
      std::memcpy(&v, at, 4);
      return v;
    }
    default:
      return std::to_integer<std::uint64_t>(*at);
  }
}

double to_double(Scalar s) {
  switch (s.type) {
    case ScalarType::f64:
      return std::bit_cast<double>(s.bits);
    case ScalarType::f32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(s.bits)));
    default:
      return static_cast<double>(s.bits);
  }
}

template <class Real>
std::string real_text(Real x, std::uint64_t bits, bool hex) {
  if (std::isnan(x)) return fmt::format("{}nan({:#x})", std::signbit(x) ? "-" : "", bits);
  if (std::isinf(x)) return x < 0 ? "-inf" : "inf";
  char text[64];
  if (!hex) {
    const auto end = std::to_chars(text, text + sizeof text, x);
    return std::string(text, end.ptr);
  }
  const auto end = std::to_chars(text, text + sizeof text, std::abs(x), std::chars_format::hex);
  return fmt::format("{}0x{}", std::signbit(x) ? "-" : "", std::string_view(text, end.ptr));
}

std::string scalar_text(Scalar s, bool hex) {
  switch (s.type) {
    case ScalarType::f64:
      return real_text(std::bit_cast<double>(s.bits), s.bits, hex);
    case ScalarType::f32: {
      const float x = std::bit_cast<float>(static_cast<std::uint32_t>(s.bits));
      return real_text(x, s.bits, hex);
    }
    default:
      return hex ? fmt::format("{:#x}", s.bits) : fmt::format("{}", s.bits);
  }
}

ValueDifference measure(Scalar a, Scalar b) {
  ValueDifference d;
  d.a = a;
  d.b = b;
  if (!a.is_real()) {
    d.ulp = a.bits < b.bits ? b.bits - a.bits : a.bits - b.bits;
    d.absolute = static_cast<double>(d.ulp);
    d.relative = d.absolute / static_cast<double>(std::max(a.bits, b.bits));
    return d;
  }
  const double x = to_double(a), y = to_double(b);
  if (a.type == ScalarType::f32 && b.type == ScalarType::f32) {
    d.ulp = ulp_distance(std::bit_cast<float>(static_cast<std::uint32_t>(a.bits)),
                         std::bit_cast<float>(static_cast<std::uint32_t>(b.bits)));
  } else {
    d.ulp = ulp_distance(x, y);
  }
  const double infinite = std::numeric_limits<double>::infinity();
  if (std::isnan(x) || std::isnan(y)) {
    d.absolute = d.relative = infinite;
  } else if (x != y) {
    d.absolute = std::abs(x - y);
    // Halving first keeps the ratio right where the difference itself overflows.
    d.relative = std::isinf(x) || std::isinf(y)
                     ? infinite
                     : std::abs(x / 2 - y / 2) / (std::max(std::abs(x), std::abs(y)) / 2);
    if (std::isnan(d.relative)) d.relative = 1;  // both subnormal enough to vanish when halved
  }
  return d;
}

bool within(const ValueDifference& d, const Tolerance& tolerance) {
  if (!tolerance.given()) return false;
  const double x = to_double(d.a), y = to_double(d.b);
  if (d.a.is_real()) {
    if (!std::isfinite(x) || !std::isfinite(y)) return false;
    if (x == y) return true;
  }
  return (tolerance.absolute && d.absolute <= *tolerance.absolute) ||
         (tolerance.relative && d.relative <= *tolerance.relative) ||
         (tolerance.ulp && d.ulp <= *tolerance.ulp);
}

// Which particle of one side is which of the other. `identity`: both sides hold the same ids in the
// same order (or have none and equal counts), so that indices agree and nothing is stored.
struct Alignment {
  bool identity = true;
  std::uint64_t count = 0;  // identity: particles
  std::vector<std::pair<std::uint64_t, std::uint64_t>> pairs;  // otherwise: index in a, index in b
  std::vector<std::uint64_t> only_a, only_b;  // indices
};

// The ids of one population on one side.
struct Ids {
  const FieldDescriptor* field = nullptr;  // null: none, particles are numbered by position
  FieldView view;

  std::vector<std::uint64_t> at(std::uint64_t index) const {
    if (field == nullptr) return {index};
    std::vector<std::uint64_t> id(field->components);
    for (std::uint32_t c = 0; c < field->components; ++c)
      id[c] = scalar_at(*field, view, index * field->components + c).bits;
    return id;
  }
  bool ascending() const {
    if (field == nullptr) return true;
    for (std::uint64_t i = 1; i < view.count; ++i)
      if (!(at(i - 1) < at(i))) return false;
    return true;
  }
};

void align_by_position(std::uint64_t count_a, std::uint64_t count_b, Alignment& out) {
  out.count = std::min(count_a, count_b);
  for (std::uint64_t i = out.count; i < count_a; ++i) out.only_a.push_back(i);
  for (std::uint64_t i = out.count; i < count_b; ++i) out.only_b.push_back(i);
}

Alignment align(const Ids& a, const Ids& b, std::uint64_t count_a, std::uint64_t count_b) {
  Alignment out;
  const bool same = a.field != nullptr && b.field != nullptr && a.field->type == b.field->type &&
                    a.view.bytes.size() == b.view.bytes.size() &&
                    std::equal(a.view.bytes.begin(), a.view.bytes.end(), b.view.bytes.begin());
  // Ids out of order can't be matched; positions still tell what differs, the ids themselves first.
  if (same || a.field == nullptr || b.field == nullptr || !a.ascending() || !b.ascending()) {
    align_by_position(count_a, count_b, out);
    return out;
  }
  out.identity = false;
  std::uint64_t i = 0, k = 0;
  while (i < count_a || k < count_b) {
    if (k == count_b) {
      out.only_a.push_back(i++);
    } else if (i == count_a) {
      out.only_b.push_back(k++);
    } else {
      const auto id_a = a.at(i), id_b = b.at(k);
      if (id_a == id_b)
        out.pairs.emplace_back(i++, k++);
      else if (id_a < id_b)
        out.only_a.push_back(i++);
      else
        out.only_b.push_back(k++);
    }
  }
  return out;
}

struct Side {
  const Schema& schema;
  const FrameView& frame;

  Ids ids(const std::string& population) const {
    for (std::size_t f = 0; f < schema.fields.size(); ++f)
      if (schema.fields[f].is_id && schema.fields[f].population == population)
        return {&schema.fields[f], frame.fields[f]};
    return {};
  }
};

struct FieldPair {
  const FieldDescriptor &a, &b;
  const FieldView &view_a, &view_b;
};

void add(FieldDifference& out, ValueDifference d, bool accepted) {
  ++out.differing;
  const double x = to_double(d.a), y = to_double(d.b);
  if (out.real && (!std::isfinite(x) || !std::isfinite(y))) ++out.not_finite;
  if (out.real && x == 0 && y == 0) ++out.zero_signs;
  out.largest_ulp = std::max(out.largest_ulp, d.ulp);
  out.largest_relative = std::max(out.largest_relative, d.relative);
  if (!out.largest || d.absolute > out.largest->absolute) out.largest = d;
  if (!accepted) {
    ++out.beyond;
    if (!out.first_beyond) out.first_beyond = d;
  }
  if (!out.first) out.first = std::move(d);
}

void compare_particle(const FieldPair& pair, const Ids& ids, std::uint64_t i, std::uint64_t k,
                      const Tolerance& tolerance, FieldDifference& out) {
  const std::uint32_t components = pair.a.components;
  const std::size_t size_a = size_of(pair.a.type), size_b = size_of(pair.b.type);
  const std::byte* at_a = pair.view_a.bytes.data() + i * components * size_a;
  const std::byte* at_b = pair.view_b.bytes.data() + k * components * size_b;
  out.compared += components;
  const bool same_type = pair.a.type == pair.b.type;
  if (same_type && std::memcmp(at_a, at_b, components * size_a) == 0) return;
  bool any = false;
  for (std::uint32_t c = 0; c < components; ++c) {
    const Scalar a{pair.a.type, load_bits(at_a + c * size_a, size_a)};
    const Scalar b{pair.b.type, load_bits(at_b + c * size_b, size_b)};
    if (same_type ? a.bits == b.bits
                  : std::bit_cast<std::uint64_t>(to_double(a)) ==
                        std::bit_cast<std::uint64_t>(to_double(b)))
      continue;
    ValueDifference d = measure(a, b);
    d.component = c;
    d.particle = ids.at(i);
    const bool accepted = within(d, tolerance);
    add(out, std::move(d), accepted);
    any = true;
  }
  if (any) ++out.particles;
}

void compare_values(const FieldPair& pair, const Alignment& alignment, const Ids& ids,
                    const Tolerance& tolerance, FieldDifference& out) {
  if (!alignment.identity) {
    for (const auto& [i, k] : alignment.pairs) compare_particle(pair, ids, i, k, tolerance, out);
    return;
  }
  const std::size_t bytes = alignment.count * pair.a.bytes_per_particle();
  if (pair.a.type == pair.b.type &&
      std::equal(pair.view_a.bytes.begin(),
                 pair.view_a.bytes.begin() + static_cast<std::ptrdiff_t>(bytes),
                 pair.view_b.bytes.begin())) {
    out.compared = alignment.count * pair.a.components;
    return;
  }
  for (std::uint64_t i = 0; i < alignment.count; ++i)
    compare_particle(pair, ids, i, i, tolerance, out);
}

// The field that reports particles present on one side only: the ids if they are compared, else the
// first compared field of the population.
const FieldDescriptor& carrier(const Schema& schema, const SchemaMatch& match,
                               const std::string& population) {
  const FieldDescriptor* out = nullptr;
  for (const auto& [i, k] : match.pairs) {
    const FieldDescriptor& field = schema.fields[i];
    if (field.population == population && (out == nullptr || field.is_id)) out = &field;
  }
  return *out;
}

void check_fits(const Schema& schema, const FrameView& frame) {
  bool fits = frame.fields.size() == schema.fields.size();
  for (std::size_t f = 0; fits && f < schema.fields.size(); ++f) {
    const FieldView& view = frame.fields[f];
    fits = view.bytes.size() == view.count * schema.fields[f].bytes_per_particle();
    for (std::size_t g = 0; fits && g < f; ++g)
      fits = schema.fields[g].population != schema.fields[f].population ||
             frame.fields[g].count == view.count;
  }
  if (!fits)
    throw LogError(ErrorKind::mismatch, "",
                   fmt::format("the state at step {} does not fit its schema", frame.step));
}

}  // namespace

double Scalar::as_double() const { return to_double(*this); }
std::string Scalar::decimal() const { return scalar_text(*this, false); }
std::string Scalar::hex() const { return scalar_text(*this, true); }

Scalar scalar_at(const FieldDescriptor& field, const FieldView& view, std::uint64_t index) {
  const std::size_t size = size_of(field.type);
  return {field.type, load_bits(view.bytes.data() + index * size, size)};
}

bool Tolerances::given() const {
  return all.given() || std::any_of(by_field.begin(), by_field.end(),
                                    [](const auto& entry) { return entry.second.given(); });
}

Tolerance Tolerances::of(const FieldDescriptor& field) const {
  Tolerance out;
  if (is_real(field.type)) out = all;
  for (const auto& [name, own] : by_field) {
    if (name != field.name) continue;
    if (own.absolute) out.absolute = own.absolute;
    if (own.relative) out.relative = own.relative;
    if (own.ulp) out.ulp = own.ulp;
  }
  return out;
}

SchemaMatch match_schemas(const Schema& a, const Schema& b) {
  SchemaMatch out;
  for (std::size_t i = 0; i < a.fields.size(); ++i) {
    const FieldDescriptor& x = a.fields[i];
    const int found = b.find(x.name);
    if (found < 0) {
      out.obstacles.push_back(fmt::format("field {} is only in a", x.name));
      continue;
    }
    const FieldDescriptor& y = b.fields[static_cast<std::size_t>(found)];
    if (x.components != y.components || x.population != y.population) {
      out.obstacles.push_back(
          fmt::format("field {} has {} components of '{}' in a, {} of '{}' in b", x.name,
                      x.components, x.population, y.components, y.population));
      continue;
    }
    if (x.type != y.type) {
      const std::string types =
          fmt::format("field {} is {} in a and {} in b", x.name, name_of(x.type), name_of(y.type));
      if (!is_real(x.type) || !is_real(y.type)) {
        out.obstacles.push_back(types);
        continue;
      }
      out.widened.push_back(types);
    }
    out.pairs.emplace_back(i, static_cast<std::size_t>(found));
  }
  for (const FieldDescriptor& y : b.fields)
    if (a.find(y.name) < 0) out.obstacles.push_back(fmt::format("field {} is only in b", y.name));
  return out;
}

FrameDifference compare_frames(const Schema& schema_a, const FrameView& a, const Schema& schema_b,
                               const FrameView& b, const SchemaMatch& match,
                               const Tolerances& tolerances) {
  check_fits(schema_a, a);
  check_fits(schema_b, b);
  const Side side_a{schema_a, a}, side_b{schema_b, b};
  FrameDifference out;
  std::vector<std::pair<std::string, Alignment>> alignments;
  for (const auto& [i, k] : match.pairs) {
    const FieldPair pair{schema_a.fields[i], schema_b.fields[k], a.fields[i], b.fields[k]};
    const std::string& population = pair.a.population;
    const Ids ids_a = side_a.ids(population), ids_b = side_b.ids(population);
    auto known = std::find_if(alignments.begin(), alignments.end(),
                              [&](const auto& entry) { return entry.first == population; });
    if (known == alignments.end()) {
      alignments.emplace_back(population,
                              align(ids_a, ids_b, pair.view_a.count, pair.view_b.count));
      known = alignments.end() - 1;
    }
    const Alignment& alignment = known->second;
    FieldDifference field;
    field.name = pair.a.name;
    field.unit = pair.a.unit;
    field.components = pair.a.components;
    field.real = is_real(pair.a.type);
    compare_values(pair, alignment, ids_a, tolerances.of(pair.a), field);
    if (&carrier(schema_a, match, population) == &pair.a) {
      field.only_a = alignment.only_a.size();
      field.only_b = alignment.only_b.size();
      if (field.only_a != 0) field.first_only_a = ids_a.at(alignment.only_a.front());
      if (field.only_b != 0) field.first_only_b = ids_b.at(alignment.only_b.front());
    }
    out.fields.push_back(std::move(field));
  }
  return out;
}

bool FrameDifference::equal() const { return first() == nullptr; }
bool FrameDifference::within() const { return first_beyond() == nullptr; }

const FieldDifference* FrameDifference::first() const {
  for (const FieldDifference& field : fields)
    if (!field.equal()) return &field;
  return nullptr;
}

const FieldDifference* FrameDifference::first_beyond() const {
  for (const FieldDifference& field : fields)
    if (!field.within()) return &field;
  return nullptr;
}

std::uint64_t FrameDifference::differing() const {
  std::uint64_t sum = 0;
  for (const FieldDifference& field : fields) sum += field.differing;
  return sum;
}

std::string component_name(const FieldDifference& field, std::uint32_t component) {
  if (field.components == 1) return field.name;
  if (field.real && field.components <= 3) return field.name + "." + "xyz"[component];
  return fmt::format("{}[{}]", field.name, component);
}

std::string particle_name(const std::vector<std::uint64_t>& id) {
  return fmt::format("{}", fmt::join(id, ":"));
}

}  // namespace varve::io
