#include "io/schema_check.h"

#include <fmt/format.h>

#include <set>

#include "io/codec_identity.h"
#include "io/framing.h"

namespace varve::io {

namespace {

// Throws on the first broken rule; carries the kind and the path so that rules stay one line each.
struct Rules {
  ErrorKind kind;
  const std::string& path;
  const Limits& limits;

  void require(bool holds, const std::string& text) const {
    if (!holds) throw LogError(kind, path, text);
  }
  void at_most(std::uint64_t value, std::uint64_t cap, const char* name,
               const std::string& what) const {
    if (value > cap) {
      throw LogError(ErrorKind::limit, path, fmt::format("{}: {} exceeds {} {}", what, value, name,
                                                         cap));
    }
  }
  void string(const std::string& text, const std::string& what) const {
    at_most(text.size(), limits.string_bytes_max, "string_bytes_max", what);
  }
  void pairs(const std::vector<std::pair<std::string, std::string>>& list,
             const std::string& what) const {
    at_most(list.size(), limits.list_items_max, "list_items_max", what);
    for (const auto& [key, value] : list) {
      string(key, what);
      string(value, what + " '" + key + "'");
    }
  }
};

bool known(ScalarType type) { return name_of(type) != "unknown"; }

void check_field(const Rules& rules, const Schema& schema, const FieldDescriptor& field) {
  const std::string what = "field '" + field.name + "'";
  rules.require(!field.name.empty(), "a field has no name");
  rules.string(field.name, "a field's name");
  rules.string(field.population, what);
  rules.string(field.unit, what);
  rules.require(known(field.type), fmt::format("{}: scalar type {} is not known", what,
                                               static_cast<int>(field.type)));
  rules.require(field.components > 0, what + ": no components");
  rules.at_most(field.components, rules.limits.components_max, "components_max", what);
  rules.require(!field.is_id || codec::is_identity(field), what + ": ids must be whole numbers");
  if (field.follows.empty()) return;
  const int at = schema.find(field.follows);
  rules.require(at >= 0, fmt::format("{}: follows '{}', which is no field", what, field.follows));
  const FieldDescriptor& rate = schema.fields[static_cast<std::size_t>(at)];
  rules.require(rate.population == field.population && rate.components == field.components &&
                    rate.name != field.name,
                fmt::format("{}: follows '{}', which is not of the same shape", what,
                            field.follows));
}

void check_table(const Rules& rules, const TableDescriptor& table) {
  const std::string what = "table '" + table.name + "'";
  rules.require(!table.name.empty(), "a table has no name");
  rules.string(table.name, "a table's name");
  rules.require(!table.columns.empty(), what + ": no columns");
  rules.at_most(table.columns.size(), rules.limits.columns_max, "columns_max", what);
  std::set<std::string> names;
  for (const ColumnDescriptor& column : table.columns) {
    rules.string(column.name, what);
    rules.string(column.unit, what);
    rules.require(!column.name.empty(), what + ": a column has no name");
    rules.require(known(column.type), fmt::format("{}: scalar type {} is not known", what,
                                                  static_cast<int>(column.type)));
    rules.require(names.insert(column.name).second,
                  fmt::format("{}: two columns '{}'", what, column.name));
  }
}

void check_lineage(const Rules& rules, const Lineage& lineage) {
  rules.require(Digest::from_hex(lineage.parent_run_id).has_value(),
                "lineage: the parent's run id is not 32 hexadecimal digits");
  rules.string(lineage.parent_name, "lineage: the parent's name");
  rules.at_most(lineage.changes.size(), rules.limits.list_items_max, "list_items_max",
                "lineage: changes");
  for (const Lineage::Change& change : lineage.changes) {
    for (const std::string* text : {&change.key, &change.from, &change.to}) {
      rules.string(*text, "lineage: change of '" + change.key + "'");
    }
  }
  rules.at_most(lineage.ancestors.size(), rules.limits.lineage_depth_max, "lineage_depth_max",
                "lineage: ancestors");
  for (const std::string& id : lineage.ancestors) {
    rules.require(Digest::from_hex(id).has_value(),
                  "lineage: an ancestor's run id is not 32 hexadecimal digits");
  }
}

}  // namespace

std::size_t row_bytes(const TableDescriptor& table) {
  std::size_t sum = 0;
  for (const ColumnDescriptor& column : table.columns) sum += size_of(column.type);
  return sum;
}

void check_schema(const Schema& schema, ErrorKind kind, const std::string& path,
                  const Limits& limits) {
  const Rules rules{kind, path, limits};
  rules.at_most(schema.fields.size(), limits.fields_max, "fields_max", "schema");
  rules.at_most(schema.tables.size(), limits.tables_max, "tables_max", "schema");
  rules.require(!schema.fields.empty(), "schema: no field");
  std::set<std::string> names;
  std::set<std::string> populations_with_ids;
  for (const FieldDescriptor& field : schema.fields) {
    check_field(rules, schema, field);
    rules.require(names.insert(field.name).second,
                  fmt::format("two fields are called '{}'", field.name));
    rules.require(!field.is_id || populations_with_ids.insert(field.population).second,
                  fmt::format("population '{}' has two id fields", field.population));
  }
  for (const TableDescriptor& table : schema.tables) {
    check_table(rules, table);
    rules.require(names.insert(table.name).second,
                  fmt::format("'{}' names a table and something else", table.name));
  }
}

void check_genesis(const Genesis& genesis, ErrorKind kind, const std::string& path,
                   const Limits& limits) {
  const Rules rules{kind, path, limits};
  check_schema(genesis.schema, kind, path, limits);
  rules.string(genesis.engine, "the engine's name");
  rules.at_most(genesis.scenario.size(), limits.text_bytes_max, "text_bytes_max", "the scenario");
  rules.pairs(genesis.parameters, "parameter");
  rules.pairs(genesis.models, "model");
  rules.pairs(genesis.build, "build fact");
  rules.at_most(genesis.files.size(), limits.list_items_max, "list_items_max", "embedded files");
  for (const auto& [name, content] : genesis.files) {
    rules.string(name, "an embedded file's name");
    rules.at_most(content.size(), limits.text_bytes_max, "text_bytes_max",
                  "embedded file '" + name + "'");
  }
  rules.require(genesis.tier == Tier::deltas || genesis.tier == Tier::digests,
                fmt::format("tier {} is not known", static_cast<int>(genesis.tier)));
  rules.require(genesis.every >= 1, "deltas every 0 steps: at least 1 is needed");
  rules.require(genesis.keyframe_steps >= 1, "a keyframe every 0 steps: at least 1 is needed");
  rules.require(genesis.log_id.empty() || log_id_from(genesis.log_id).has_value(),
                "the log id is not 32 hexadecimal digits");
  if (genesis.lineage) check_lineage(rules, *genesis.lineage);
}

void check_frame(const Schema& schema, const FrameView& frame, const std::string& path,
                 std::uint64_t particles_max, const Limits& limits) {
  const Rules rules{ErrorKind::mismatch, path, limits};
  const auto fail = [&](const std::string& text) {
    throw LogError(ErrorKind::mismatch, path, fmt::format("step {}: {}", frame.step, text));
  };
  if (frame.fields.size() != schema.fields.size()) {
    fail(fmt::format("{} fields where the schema has {}", frame.fields.size(),
                     schema.fields.size()));
  }
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    const FieldDescriptor& field = schema.fields[i];
    const FieldView& view = frame.fields[i];
    if (view.count > particles_max) {
      rules.at_most(view.count, particles_max, "particles_max", "field '" + field.name + "'");
    }
    if (view.bytes.size() != view.count * field.bytes_per_particle()) {
      fail(fmt::format("field '{}': {} bytes for {} particles of {} bytes", field.name,
                       view.bytes.size(), view.count, field.bytes_per_particle()));
    }
    if (view.bytes.size() > limits.field_bytes_max) {
      rules.at_most(view.bytes.size(), limits.field_bytes_max, "field_bytes_max",
                    "field '" + field.name + "'");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (schema.fields[j].population != field.population) continue;
      if (frame.fields[j].count != view.count) {
        fail(fmt::format("field '{}' has {} particles, '{}' of the same population has {}",
                         field.name, view.count, schema.fields[j].name, frame.fields[j].count));
      }
      break;
    }
  }
  if (frame.tables.empty()) return;
  if (frame.tables.size() != schema.tables.size()) {
    fail(fmt::format("{} tables where the schema has {}", frame.tables.size(),
                     schema.tables.size()));
  }
  for (std::size_t i = 0; i < schema.tables.size(); ++i) {
    const TableDescriptor& table = schema.tables[i];
    const TableView& view = frame.tables[i];
    rules.at_most(view.rows, limits.rows_max, "rows_max", "a table");
    if (view.columns.size() != table.columns.size()) {
      fail(fmt::format("table '{}': {} columns where the schema has {}", table.name,
                       view.columns.size(), table.columns.size()));
    }
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      if (view.columns[c].size() != view.rows * size_of(table.columns[c].type)) {
        fail(fmt::format("table '{}', column '{}': {} bytes for {} rows", table.name,
                         table.columns[c].name, view.columns[c].size(), view.rows));
      }
    }
  }
}

void check_ids(const Schema& schema, const FrameView& frame, const std::string& path) {
  for (std::size_t i = 0; i < schema.fields.size(); ++i) {
    const FieldDescriptor& field = schema.fields[i];
    if (!field.is_id || codec::ascending(field, frame.fields[i].bytes, frame.fields[i].count)) {
      continue;
    }
    throw LogError(ErrorKind::mismatch, path,
                   fmt::format("step {}: ids of '{}' do not ascend", frame.step, field.name));
  }
}

void check_events(std::span<const Event> events, std::uint64_t step, const std::string& path,
                  const Limits& limits) {
  const Rules rules{ErrorKind::limit, path, limits};
  rules.at_most(events.size(), step_events_max(limits), "half of list_items_max",
                fmt::format("step {}: events", step));
  for (const Event& event : events) {
    const std::string what = fmt::format("step {}: event '{}'", step, event.kind.substr(0, 40));
    rules.string(event.kind, what);
    rules.pairs(event.items, what);
    std::uint64_t bytes = event.kind.size();
    for (const auto& [key, value] : event.items) bytes += key.size() + value.size() + 48;
    rules.at_most(2 * bytes, limits.message_bytes_max, "message_bytes_max", what);
  }
}

}  // namespace varve::io
