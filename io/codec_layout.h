// How a schema's fields depend on each other in the codec: populations, ids first, followers last.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/frame.h"

namespace varve::io::codec {

inline constexpr std::size_t none = ~std::size_t{0};

enum class FieldKind {
  identity,  ///< ids that other fields of the population are matched by
  fixed,     ///< expected not to change
  dynamic,   ///< expected to change at every step
};

struct FieldPlan {
  FieldKind kind = FieldKind::dynamic;
  std::size_t slopes = none;  ///< field that this one follows, if it can
};

struct PopulationPlan {
  std::string name;
  std::size_t identity = none;      ///< the field of ids
  std::vector<std::size_t> fields;  ///< all, in coding order: ids, others, followers
};

struct Layout {
  std::vector<FieldPlan> fields;  ///< in the schema's order
  std::vector<PopulationPlan> populations;
};

/// Throws LogError(mismatch) for a field without components. Hints that cannot hold (a field that
/// is not there, of another population or shape, that follows itself another one) are dropped.
Layout plan_layout(const Schema& schema);

}  // namespace varve::io::codec
