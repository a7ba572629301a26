#include "io/codec_layout.h"

#include <algorithm>

#include "io/codec_identity.h"
#include "io/errors.h"

namespace varve::io::codec {
namespace {

bool is_floating(ScalarType type) { return type == ScalarType::f64 || type == ScalarType::f32; }

/// Index of the field that `field` can follow, or none.
std::size_t slopes_of(const Schema& schema, const std::vector<FieldPlan>& plans,
                      const FieldDescriptor& field) {
  if (field.follows.empty() || !is_floating(field.type)) {
    return none;
  }
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    const FieldDescriptor& other = schema.fields[i];
    if (other.name == field.follows) {
      const bool fits = other.population == field.population &&
                        other.components == field.components && is_floating(other.type) &&
                        other.follows.empty() && plans[i].kind == FieldKind::dynamic;
      return fits ? i : none;
    }
  }
  return none;
}

}  // namespace

Layout plan_layout(const Schema& schema) {
  Layout layout;
  layout.fields.resize(schema.fields.size());
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    const FieldDescriptor& field = schema.fields[i];
    if (field.components == 0) {
      throw LogError(ErrorKind::mismatch, "", "field '" + field.name + "' has no components");
    }
    auto population =
        std::find_if(layout.populations.begin(), layout.populations.end(),
                     [&](const PopulationPlan& known) { return known.name == field.population; });
    if (population == layout.populations.end()) {
      population =
          layout.populations.insert(population, PopulationPlan{field.population, none, {}});
    }
    if (is_identity(field) && population->identity == none) {
      layout.fields[i].kind = FieldKind::identity;
      population->identity = i;
    } else if (field.constant || field.is_id) {
      layout.fields[i].kind = FieldKind::fixed;
    }
    population->fields.push_back(i);
  }
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    if (layout.fields[i].kind == FieldKind::dynamic) {
      layout.fields[i].slopes = slopes_of(schema, layout.fields, schema.fields[i]);
    }
  }
  const auto rank = [&](std::size_t i) {
    const FieldPlan& plan = layout.fields[i];
    return plan.kind == FieldKind::identity ? 0 : plan.slopes == none ? 1 : 2;
  };
  for (PopulationPlan& population : layout.populations) {
    std::stable_sort(population.fields.begin(), population.fields.end(),
                     [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  }
  return layout;
}

}  // namespace varve::io::codec
