#include "io/frame.h"

#include <fmt/format.h>

#include "io/errors.h"

namespace varve::io {

std::size_t size_of(ScalarType type) {
  switch (type) {
    case ScalarType::f64:
    case ScalarType::u64: return 8;
    case ScalarType::f32:
    case ScalarType::u32: return 4;
    case ScalarType::u8: return 1;
  }
  throw LogError(ErrorKind::mismatch, "",
                 fmt::format("scalar type {} is not known", static_cast<int>(type)));
}

std::string_view name_of(ScalarType type) {
  switch (type) {
    case ScalarType::f64: return "f64";
    case ScalarType::f32: return "f32";
    case ScalarType::u64: return "u64";
    case ScalarType::u32: return "u32";
    case ScalarType::u8: return "u8";
  }
  return "unknown";
}

int Schema::find(std::string_view name) const {
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (fields[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

FrameView Frame::view() const {
  FrameView out;
  out.step = step;
  out.time = time;
  out.dt = dt;
  out.fields.reserve(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) out.fields.push_back({counts[i], fields[i]});
  out.tables.reserve(tables.size());
  for (std::size_t i = 0; i < tables.size(); ++i) {
    TableView table;
    table.rows = rows[i];
    table.columns.assign(tables[i].begin(), tables[i].end());
    out.tables.push_back(std::move(table));
  }
  return out;
}

Frame Frame::copy_of(const FrameView& view) {
  Frame out;
  out.step = view.step;
  out.time = view.time;
  out.dt = view.dt;
  for (const FieldView& field : view.fields) {
    out.counts.push_back(field.count);
    out.fields.emplace_back(field.bytes.begin(), field.bytes.end());
  }
  for (const TableView& table : view.tables) {
    out.rows.push_back(table.rows);
    auto& columns = out.tables.emplace_back();
    for (const auto& column : table.columns) columns.emplace_back(column.begin(), column.end());
  }
  return out;
}

}  // namespace varve::io
