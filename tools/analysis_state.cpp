#include "tools/analysis_state.h"

namespace varve::tools {
namespace {

template <class T, class Stored>
std::vector<T> read_as(const std::vector<std::byte>& bytes) {
  std::vector<T> values(bytes.size() / sizeof(Stored));
  for (std::size_t k = 0; k < values.size(); ++k) {
    Stored value;
    std::memcpy(&value, bytes.data() + k * sizeof value, sizeof value);
    values[k] = static_cast<T>(value);
  }
  return values;
}

}  // namespace

std::vector<double> reals(const io::Schema& schema, const io::Frame& frame,
                          std::string_view name) {
  const int index = schema.find(name);
  if (index < 0 || frame.fields.empty()) return {};
  const auto f = static_cast<std::size_t>(index);
  return schema.fields[f].type == io::ScalarType::f64 ? read_as<double, double>(frame.fields[f])
                                                      : read_as<double, float>(frame.fields[f]);
}

std::vector<std::uint64_t> wholes(const io::Schema& schema, const io::Frame& frame,
                                  std::string_view name) {
  const int index = schema.find(name);
  if (index < 0 || frame.fields.empty()) return {};
  const auto f = static_cast<std::size_t>(index);
  return schema.fields[f].type == io::ScalarType::u64
             ? read_as<std::uint64_t, std::uint64_t>(frame.fields[f])
             : read_as<std::uint64_t, std::uint32_t>(frame.fields[f]);
}

TableReader::TableReader(const io::Schema& schema, std::string_view table) : schema_(schema) {
  for (std::size_t t = 0; t < schema.tables.size(); ++t)
    if (schema.tables[t].name == table) table_ = static_cast<int>(t);
}

std::vector<core::ContactRow> contact_rows(const TableReader& table, const io::Frame& frame,
                                           std::size_t dimension) {
  static constexpr const char* impulses[] = {"impulse_x", "impulse_y", "impulse_z"};
  std::vector<core::ContactRow> rows(table.rows(frame));
  for (std::uint64_t r = 0; r < rows.size(); ++r) {
    core::ContactRow& row = rows[r];
    row.grain = table.at<std::uint64_t>(frame, "grain", r);
    row.partner = table.at<std::uint64_t>(frame, "partner", r);
    row.kind = table.at<std::uint8_t>(frame, "kind", r);
    row.begin = table.at<std::uint8_t>(frame, "begin", r) != 0;
    row.end = table.at<std::uint8_t>(frame, "end", r) != 0;
    row.peak_force = table.at<double>(frame, "peak_force", r);
    row.peak_overlap = table.at<double>(frame, "peak_overlap", r);
    for (std::size_t k = 0; k < dimension; ++k)
      row.impulse[k] = table.at<double>(frame, impulses[k], r);
    row.impact_speed = table.at<double>(frame, "impact_speed", r);
    row.rebound_speed = table.at<double>(frame, "rebound_speed", r);
    row.normal_loss = table.at<double>(frame, "normal_loss", r);
    row.tangential_loss = table.at<double>(frame, "tangential_loss", r);
    row.friction_loss = table.at<double>(frame, "friction_loss", r);
  }
  return rows;
}

}  // namespace varve::tools
