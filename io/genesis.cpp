#include "io/genesis.h"

#include "io/bytes.h"

namespace varve::io {

namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

void put(CanonicalBytes& out, const Pairs& pairs) {
  out.number(static_cast<std::uint32_t>(pairs.size()));
  for (const auto& [key, value] : pairs) {
    out.text(key);
    out.text(value);
  }
}

void put(CanonicalBytes& out, const Schema& schema) {
  out.number(static_cast<std::uint32_t>(schema.fields.size()));
  for (const FieldDescriptor& field : schema.fields) {
    out.text(field.name);
    out.text(field.population);
    out.number(static_cast<std::uint8_t>(field.type));
    out.number(field.components);
    out.text(field.unit);
    out.number(static_cast<std::uint8_t>(field.is_id));
    out.number(static_cast<std::uint8_t>(field.constant));
    out.text(field.follows);
  }
  out.number(static_cast<std::uint32_t>(schema.tables.size()));
  for (const TableDescriptor& table : schema.tables) {
    out.text(table.name);
    out.number(static_cast<std::uint32_t>(table.columns.size()));
    for (const ColumnDescriptor& column : table.columns) {
      out.text(column.name);
      out.number(static_cast<std::uint8_t>(column.type));
      out.text(column.unit);
    }
  }
}

}  // namespace

std::string_view name_of(Tier tier) {
  switch (tier) {
    case Tier::deltas: return "deltas";
    case Tier::digests: return "digests";
  }
  return "unknown";
}

std::string Genesis::run_id() const {
  CanonicalBytes bytes;
  bytes.text(engine);
  bytes.number(engine_revision);
  put(bytes, schema);
  bytes.text(scenario);
  put(bytes, parameters);
  put(bytes, models);
  put(bytes, files);
  bytes.number(static_cast<std::uint8_t>(tier));
  bytes.number(every);
  bytes.number(keyframe_steps);
  bytes.number(static_cast<std::uint8_t>(lineage.has_value()));
  if (lineage) {
    bytes.text(lineage->parent_run_id);
    bytes.number(lineage->step);
    bytes.number(static_cast<std::uint32_t>(lineage->changes.size()));
    for (const Lineage::Change& change : lineage->changes) {
      bytes.text(change.key);
      bytes.text(change.from);
      bytes.text(change.to);
    }
  }
  return digest_bytes(bytes.bytes()).hex();
}

}  // namespace varve::io
