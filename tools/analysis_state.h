// Fields and tables of a decoded state as the numbers that observables take.
#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>
#include <vector>

#include "core/observe/contacts.h"
#include "io/frame.h"

namespace varve::tools {

/// A field's scalars as doubles; empty where the log has no such field, or the state not.
std::vector<double> reals(const io::Schema& schema, const io::Frame& frame, std::string_view name);
/// A field of whole numbers, u64 or u32.
std::vector<std::uint64_t> wholes(const io::Schema& schema, const io::Frame& frame,
                                  std::string_view name);

/// Columns of one table, by name.
class TableReader {
 public:
  TableReader(const io::Schema& schema, std::string_view table);
  std::uint64_t rows(const io::Frame& frame) const {
    return table_ < 0 ? 0 : frame.rows[static_cast<std::size_t>(table_)];
  }
  /// The value must be of the column's type; 0 where there is no such column.
  template <class T>
  T at(const io::Frame& frame, std::string_view column, std::uint64_t row) const {
    const io::TableDescriptor& table = schema_.tables[static_cast<std::size_t>(table_)];
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      if (table.columns[c].name != column) continue;
      const auto& bytes = frame.tables[static_cast<std::size_t>(table_)][c];
      T value{};
      std::memcpy(&value, bytes.data() + row * sizeof value, sizeof value);
      return value;
    }
    return T{};
  }

 private:
  const io::Schema& schema_;
  int table_ = -1;
};

std::vector<core::ContactRow> contact_rows(const TableReader& table, const io::Frame& frame,
                                           std::size_t dimension);

}  // namespace varve::tools
