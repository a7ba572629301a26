// Caps on everything that a log can declare. A reader checks each before it allocates; a writer
// keeps them, so that no log is written that could not be read. Messages name the cap that was hit.
#pragma once

#include <cstdint>

namespace varve::io {

struct Limits {
  std::uint64_t message_bytes_max = std::uint64_t{64} << 20;  ///< one message, uncompressed
  std::uint64_t body_bytes_max = std::uint64_t{1} << 30;      ///< one record's blobs, as stored
  std::uint64_t field_bytes_max = std::uint64_t{1} << 30;     ///< one field or table, uncompressed
  std::uint64_t ratio_max = 10000;  ///< uncompressed / stored, above ratio_free_bytes
  std::uint64_t ratio_free_bytes = std::uint64_t{1} << 20;
  std::uint64_t particles_max = std::uint64_t{1} << 28;  ///< per field; genesis declares its own
  std::uint64_t rows_max = std::uint64_t{1} << 26;       ///< per table and step
  std::uint64_t string_bytes_max = std::uint64_t{64} << 10;  ///< names, keys, values
  std::uint64_t text_bytes_max = std::uint64_t{16} << 20;    ///< scenario, each embedded file
  std::uint64_t list_items_max = std::uint64_t{1} << 16;     ///< parameters, files, event items ...
  std::uint64_t fields_max = 256;
  std::uint64_t tables_max = 64;
  std::uint64_t columns_max = 64;
  std::uint64_t components_max = 64;
  std::uint64_t lineage_depth_max = 10000;
  std::uint64_t index_steps_max = std::uint64_t{1} << 16;  ///< steps in one index record
  /// A step's number: exact in the doubles of JSON, and far from where counting on wraps.
  std::uint64_t step_max = std::uint64_t{1} << 53;
  std::uint64_t damage_max = 10000;  ///< places listed; further ones are counted by the last
};

}  // namespace varve::io
