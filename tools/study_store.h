// The folder of a study's results: what is there of each member, and the tables made of it. Every
// file is written beside its place and renamed into it, so that none is ever there in half.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tools/measure.h"
#include "tools/study_plan.h"

namespace varve::tools {

/// What is known of a member once it has ended.
struct StudyRow {
  std::string id;
  bool failed = false;
  int code = 0;           ///< exit code of what failed
  std::string error;      ///< of a failure, without paths
  std::string run_id, final_chain;
  std::uint64_t last_step = 0;
  double time = 0;        ///< [s] at it
  std::string stop;       ///< "end", or with stop_when "rule" or "limit"
  /// By measure_key() and curve_key(): a value stays where its measure is only renamed.
  std::map<std::string, double> values;  ///< NaN: none
  std::map<std::string, Measured::Samples> curves;
};

/// What defines a measure's value.
std::string measure_key(const Measure& measure);
std::string curve_key(const Curve& curve);

struct StudyTiming {
  double run_s = 0, measure_s = 0;  ///< wall time, added up over interruptions
  std::uint64_t steps = 0, log_bytes = 0;
};

enum class MemberState {
  missing,   ///< nothing, or nothing usable
  partial,   ///< a log that can be resumed
  unmeasured,  ///< ended, but not all that is asked for has been measured; its log is there
  failed,
  done,
};
std::string_view name_of(MemberState state);

class StudyStore {
 public:
  StudyStore(const StudyPlan& plan, std::string folder);

  const std::string& folder() const { return folder_; }
  std::string path(const std::string& file) const;
  std::string member_folder(const std::string& id) const;
  std::string log_path(const std::string& id) const;

  /// Measures and curves that are taken of the member with this id, in whatever cases it stands.
  std::vector<Measure> measures_of(const std::string& id) const;
  std::vector<Curve> curves_of(const std::string& id) const;

  std::optional<StudyRow> read_row(const std::string& id) const;
  void write_row(const StudyRow& row) const;
  StudyTiming read_timing(const std::string& id) const;
  void write_timing(const std::string& id, const StudyTiming& timing) const;
  /// Its log is whole, closed and the one that the row speaks of.
  bool has_log(const StudyMember& member, const StudyRow& row) const;
  MemberState state_of(const StudyMember& member) const;
  /// Forgets a failure, and the log that led to it.
  void forget(const std::string& id) const;
  /// Removes logs that need not stay and that no fork still waits for.
  void tidy() const;

  void write_plan() const;
  /// results.csv and timings.csv of all that has ended.
  void write_results() const;

 private:
  static std::optional<StudyRow> parse_row(const std::string& id, const std::string& path);

  const StudyPlan& plan_;
  std::string folder_;
  mutable std::map<std::string, std::pair<std::filesystem::file_time_type, StudyRow>> rows_;
};

/// Writes a file whole, or not at all. ToolError(74) if it can't be.
void write_whole(const std::string& path, const std::string& text);

/// A number of a table: shortest decimal, and as hex float; both empty for none.
std::string decimal_text(double value);
std::string hex_text(double value);
/// A cell of a table, quoted where it needs to be.
std::string csv_cell(const std::string& text);

}  // namespace varve::tools
