// What a comparison found, and the forms in which it is told: text, JSON, JUnit, GitHub
// annotations.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/frame_diff.h"
#include "tools/digest_file.h"

namespace varve::tools {

enum class Verdict { identical, within_tolerance, different, not_comparable };
std::string_view name_of(Verdict verdict);
/// 0, 0, 1, 2.
int exit_code(Verdict verdict);

/// The first difference, as far as it can be narrowed down.
struct FirstDifference {
  std::uint64_t step = 0;
  double time = 0;  ///< [s]
  /// Last step known equal, where digests of the steps between it and `step` are not at hand.
  std::optional<std::uint64_t> last_equal;
  std::string field;  ///< "fluid.velocity.y"; empty if unknown
  std::string particle;  ///< id; empty if unknown
  /// The two values as hexadecimal floats and decimals; "absent" where one side lacks the particle.
  std::string a, b, a_decimal, b_decimal;
  std::optional<std::uint64_t> ulp;
  std::optional<double> absolute, relative;
  std::string why_no_field;  ///< set where `field` is empty
};

/// Fills in field, particle and values from the first difference of two states.
void describe_first(const io::FrameDifference& states, bool beyond_tolerance, FirstDifference& out);

/// Differences at one step after the first.
struct GrowthSample {
  std::uint64_t step = 0;
  double time = 0;  ///< [s]
  std::vector<io::FieldDifference> fields;
};

struct Reconvergence {
  std::uint64_t equal_steps = 0;  ///< steps after the first difference, states equal
  std::optional<std::uint64_t> first_equal;  ///< the first of them
  std::optional<std::uint64_t> equal_to_the_end;  ///< from this step on all are equal
};

/// Something in which the two geneses differ; explains, never decides.
struct GenesisDifference {
  std::string part;  ///< "parameter", "model", "engine", "build", "record", "lineage"
  std::string key, a, b;
};

struct DiffReport {
  std::string a, b;  ///< as named by the user
  Verdict verdict = Verdict::identical;
  std::vector<std::string> reasons;  ///< why not comparable
  std::vector<GenesisDifference> genesis;
  std::string relation;  ///< lineage in words; empty where there is none
  std::uint64_t from = 0, to = 0;  ///< compared steps, inclusive
  std::uint64_t steps_compared = 0;
  std::string chain;  ///< at `to`, where both agree
  bool tolerance_given = false;
  std::vector<std::string> selected;  ///< fields asked for; empty: all
  std::optional<FirstDifference> first;  ///< the one that decides
  std::optional<FirstDifference> first_bitwise;  ///< where a tolerance accepts earlier ones
  std::vector<io::FieldDifference> fields;  ///< at the first differing step
  std::vector<GrowthSample> growth;
  std::optional<Reconvergence> reconvergence;
  std::vector<std::string> notes;  ///< information that decides nothing
  /// Records and index entries read to find the first differing step.
  std::uint64_t header_reads_a = 0, header_reads_b = 0;
};

/// "IDENTICAL ...", "DIFFER first at step ...", "WITHIN TOLERANCE ...", "NOT COMPARABLE ...".
std::string headline(const DiffReport& report);

/// Headline, genesis differences, both values, counts per field, growth, notes.
std::string text_report(const DiffReport& report, bool quiet);
/// One object; tools/schemas/diff.json describes it.
std::string json_report(const DiffReport& report);
/// A suite with one case per compared field and one for the comparison as a whole.
std::string junit_report(const DiffReport& report, double seconds);
/// Workflow commands, at most ten lines; empty where nothing is wrong.
std::string github_report(const DiffReport& report);

/// Escapes for XML attributes and text (characters that XML 1.0 forbids become '?').
std::string xml_escape(std::string_view text);
/// Escapes for the data, or for a property, of a GitHub workflow command.
std::string github_escape(std::string_view text, bool property);

}  // namespace varve::tools
