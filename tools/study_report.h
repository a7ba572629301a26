// The report of a study: claims with verdicts, what each key does to each measure, figures with
// spread, comparisons, parameters, what failed. The same rows give the same bytes.
#pragma once

#include <string>
#include <vector>

#include "tools/study_claims.h"
#include "tools/study_data.h"
#include "tools/study_document.h"

namespace varve::tools {

Document report_of(const StudyData& data);

/// "0.1123 ± 0.0021 (3)": mean, standard deviation, number.
std::string spread_text(const EnsembleValue& value);
/// Four digits; "-" for none.
std::string short_number(double value);
/// "terminal speed [m/s]"
std::string label_of(const StudyMeasure& measure);

/// Mean and standard deviation of a curve over an ensemble, at times that all members have.
struct EnsembleCurve {
  std::vector<double> time, mean, deviation;
  std::size_t members = 0;
};
EnsembleCurve curve_of(const StudyData& data, const Ensemble& ensemble, const StudyCurve& curve);

/// First time from which on two ensembles' means differ by at most twice their spread (that of
/// both, pooled) for good; NaN where they never do, or where neither has a spread.
double agreement_time(const EnsembleCurve& a, const EnsembleCurve& b);

void add_figures(Document& document, const StudyData& data);
void add_comparisons(Document& document, const StudyData& data);

}  // namespace varve::tools
