// Files of particles for other programs: VTK's PolyData, OVITO's extended XYZ, CSV.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/frame.h"

namespace varve::tools {

/// One population as it is exported.
struct ExportPopulation {
  std::string name;
  std::vector<std::size_t> fields;  ///< of the schema, without ids and positions
  int id = -1, position = -1;       ///< fields; -1: it has none
};

/// What of a log is exported, and what its frames alone do not tell.
struct ExportPlan {
  const io::Schema* schema = nullptr;
  std::vector<ExportPopulation> populations;
  std::string folder;
  bool overwrite = false;
  /// [m] lower corner and edges of the domain, which OVITO draws; three numbers each, empty: none.
  std::vector<double> origin, edges;
  std::vector<bool> periodic;  ///< along x, y, z
  /// Radii [m] of the particles of a population, empty where it has none.
  std::function<std::vector<double>(const std::string& population, const io::Frame& frame)> radii;
};

/// Takes states in ascending step. Files appear as they are needed; one that can't be written whole
/// is an error (ToolError, exit 74), one that exists already UsageError.
class ExportWriter {
 public:
  virtual ~ExportWriter() = default;
  virtual void take(const io::Frame& frame) = 0;
  /// Closes everything; without it files are not complete.
  virtual void finish() = 0;
  const std::vector<std::string>& files() const { return files_; }

 protected:
  std::vector<std::string> files_;  ///< paths, in the order of their making
};

/// One .vtp per population and state, PolyData of points and vertices, appended raw data with
/// UInt64 headers, little endian, vectors with three components; one .pvd per population.
std::unique_ptr<ExportWriter> vtp_writer(const ExportPlan& plan);
/// One .extxyz per population, a frame per state.
std::unique_ptr<ExportWriter> extxyz_writer(const ExportPlan& plan);
/// One .csv per population, a row per particle and state, units in the names of the columns.
std::unique_ptr<ExportWriter> csv_writer(const ExportPlan& plan);

}  // namespace varve::tools
