// The parts of a report that show members side by side: figures and comparisons.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>

#include "core/observe/series.h"
#include "core/parameters.h"
#include "tools/measure_reduce.h"
#include "tools/study_report.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

using Row = std::vector<DocumentCell>;

/// Value of a measure for a table, marked where any member's deserves attention.
DocumentCell cell_of(const StudyData& data, const Ensemble& ensemble, const StudyMeasure& measure) {
  const auto value = value_of(data, ensemble, measure);
  if (!value) return "-";
  const bool flagged = measure.flag && (measure.flag->holds(value->least) ||
                                        measure.flag->holds(value->greatest));
  return {spread_text(*value) + (flagged ? " (!)" : ""), flagged};
}

DocumentTable table_of(const StudyData& data, const std::vector<Ensemble>& ensembles,
                       const std::vector<const StudyMeasure*>& measures) {
  DocumentTable table{{"case"}, {}};
  for (const StudyMeasure* each : measures)
    table.header.push_back(label_of(*each) +
                           (each->flag ? fmt::format(" (! {})", each->flag->text()) : ""));
  for (const Ensemble& ensemble : ensembles) {
    Row row{ensemble.label(data.plan())};
    for (const StudyMeasure* each : measures) row.push_back(cell_of(data, ensemble, *each));
    const bool any = std::any_of(row.begin() + 1, row.end(),
                                 [](const DocumentCell& cell) { return cell.text != "-"; });
    if (any) table.rows.push_back(std::move(row));
  }
  return table;
}

/// The horizontal axis of a figure's plots.
struct Axis {
  std::string key;                        ///< or
  const StudyMeasure* measure = nullptr;  ///< or neither: the ensembles side by side
};

Axis axis_of(const StudyData& data, const std::string& wanted,
             const std::vector<Ensemble>& ensembles) {
  if (const StudyMeasure* measure = data.plan().file.find_measure(wanted)) return {"", measure};
  if (!wanted.empty()) return {wanted, nullptr};
  // One key that varies in every case, by number.
  std::set<std::string> keys;
  for (const Ensemble& each : ensembles) {
    if (each.varied.size() != 1) return {};
    keys.insert(each.varied[0].first);
  }
  if (keys.size() != 1) return {};
  for (const Ensemble& each : ensembles)
    if (std::isnan(key_number(data.plan().members[each.members[0]], *keys.begin()))) return {};
  return {*keys.begin(), nullptr};
}

std::string axis_label(const Axis& axis) {
  if (axis.measure) return label_of(*axis.measure);
  const core::Parameter* parameter = core::find_parameter(axis.key);
  if (!parameter || parameter->unit.empty()) return axis.key;
  return fmt::format("{} [{}]", axis.key, parameter->unit);
}

/// What is told apart by colour: the case, and varied keys other than the axis.
std::string series_name(const StudyData& data, const Ensemble& ensemble, const Axis& axis) {
  std::string name = data.plan().file.cases[ensemble.case_index].name;
  for (const auto& [key, value] : ensemble.varied)
    if (key != axis.key) name += fmt::format(" {}={}", key, value);
  return name;
}

Plot plot_of(const StudyData& data, const std::string& title,
             const std::vector<Ensemble>& ensembles, const Axis& axis,
             const StudyMeasure& measure) {
  Plot plot;
  plot.title = title;
  plot.y_label = label_of(measure);
  const bool side_by_side = axis.key.empty() && !axis.measure;
  if (!side_by_side) plot.x_label = axis_label(axis);
  std::map<std::string, std::size_t> places;
  for (const Ensemble& ensemble : ensembles) {
    const auto value = value_of(data, ensemble, measure);
    if (!value) continue;
    double x = static_cast<double>(plot.categories.size());
    if (side_by_side) {
      plot.categories.push_back(ensemble.label(data.plan()));
    } else if (axis.measure) {
      const auto at = value_of(data, ensemble, *axis.measure);
      x = at ? at->mean : none;
    } else {
      x = key_number(data.plan().members[ensemble.members[0]], axis.key);
    }
    if (std::isnan(x)) continue;
    const std::string name = side_by_side || axis.measure ? "" : series_name(data, ensemble, axis);
    const auto [place, is_new] = places.emplace(name, plot.series.size());
    if (is_new) plot.series.push_back({name, {}, {}, {}, !side_by_side && !axis.measure, false});
    PlotSeries& series = plot.series[place->second];
    series.x.push_back(x);
    series.y.push_back(value->mean);
    series.spread.push_back(value->deviation);
  }
  return plot;
}

Plot plot_of(const StudyData& data, const std::string& title,
             const std::vector<Ensemble>& ensembles, const StudyCurve& curve) {
  Plot plot;
  const std::string& name = curve.title.empty() ? curve.curve.name : curve.title;
  plot.title = title;
  plot.x_label = "time [s]";
  plot.y_label = curve.unit.empty() ? name : fmt::format("{} [{}]", name, curve.unit);
  for (const Ensemble& ensemble : ensembles) {
    EnsembleCurve drawn = curve_of(data, ensemble, curve);
    if (drawn.time.empty()) continue;
    plot.series.push_back({ensemble.label(data.plan()), std::move(drawn.time),
                           std::move(drawn.mean), std::move(drawn.deviation), true, true});
  }
  return plot;
}

std::vector<const StudyMeasure*> measures_named(const StudyFile& file,
                                                const std::vector<std::string>& names,
                                                bool quality) {
  std::vector<const StudyMeasure*> measures;
  for (const StudyMeasure& each : file.measures) {
    const bool named = std::find(names.begin(), names.end(), each.measure.name) != names.end();
    if (quality ? each.quality : (names.empty() ? !each.quality : named && !each.quality))
      measures.push_back(&each);
  }
  return measures;
}

/// Measures that any of the ensembles has.
void drop_empty(const StudyData& data, const std::vector<Ensemble>& ensembles,
                std::vector<const StudyMeasure*>& measures) {
  std::erase_if(measures, [&](const StudyMeasure* each) {
    return std::none_of(ensembles.begin(), ensembles.end(), [&](const Ensemble& ensemble) {
      return value_of(data, ensemble, *each).has_value();
    });
  });
}

void add_claims_of(Document& document, const StudyData& data, const std::string& figure) {
  DocumentTable table{{"claim", "what is said", "verdict"}, {}};
  for (const StudyClaim& claim : data.plan().file.claims)
    if (!figure.empty() && claim.figure == figure)
      table.rows.push_back(
          {claim.id, claim.text, {std::string(name_of(judge(data, claim).verdict)), true}});
  document.table(std::move(table));
}

void add_figure(Document& document, const StudyData& data, const StudyFigure& figure) {
  const StudyFile& file = data.plan().file;
  const std::vector<Ensemble> ensembles = ensembles_of(data.plan(), figure.cases);
  document.heading(3, figure.title.empty() ? figure.id
                                           : fmt::format("{}: {}", figure.id, figure.title));
  if (!figure.note.empty()) document.text(figure.note);
  std::vector<const StudyMeasure*> measures = measures_named(file, figure.measures, false);
  std::vector<const StudyMeasure*> quality = measures_named(file, {}, true);
  drop_empty(data, ensembles, measures);
  drop_empty(data, ensembles, quality);
  if (measures.empty() && quality.empty()) document.text("Nothing of it has been run.");
  if (!measures.empty()) document.table(table_of(data, ensembles, measures));
  const Axis axis = axis_of(data, figure.x, ensembles);
  for (const StudyMeasure* each : measures)
    if (each != axis.measure)
      document.plot(fmt::format("{}_{}", figure.id, each->measure.name),
                    plot_of(data, fmt::format("{}: {}", figure.id, each->measure.name), ensembles,
                            axis, *each));
  for (const std::string& name : figure.curves)
    if (const StudyCurve* curve = file.find_curve(name))
      document.plot(fmt::format("{}_{}", figure.id, name),
                    plot_of(data, fmt::format("{}: {}", figure.id, name), ensembles, *curve));
  add_claims_of(document, data, figure.id);
  if (!quality.empty()) {
    document.text("How far these members can be trusted:");
    document.table(table_of(data, ensembles, quality));
  }
}

}  // namespace

EnsembleCurve curve_of(const StudyData& data, const Ensemble& ensemble, const StudyCurve& curve) {
  EnsembleCurve result;
  std::vector<Rows> all;
  for (const std::size_t member : ensemble.members)
    if (const auto* samples = data.curve(member, curve); samples && !samples->time.empty())
      all.push_back({samples->time, samples->value});
  if (all.empty()) return result;
  result.members = all.size();
  for (const double time : all.front().time) {
    std::vector<double> values;
    for (const Rows& each : all) values.push_back(value_at(each, time));
    if (std::any_of(values.begin(), values.end(), [](double v) { return std::isnan(v); })) continue;
    const core::Spread spread = core::spread_of(values);
    result.time.push_back(time);
    result.mean.push_back(spread.mean);
    result.deviation.push_back(spread.deviation);
  }
  return result;
}

double agreement_time(const EnsembleCurve& a, const EnsembleCurve& b) {
  if (a.members + b.members < 3) return none;
  const Rows mean{b.time, b.mean}, deviation{b.time, b.deviation};
  const double free_a = static_cast<double>(a.members - 1);
  const double free_b = static_cast<double>(b.members - 1);
  double agreed = none;
  for (std::size_t i = 0; i < a.time.size(); ++i) {
    const double other = value_at(mean, a.time[i]);
    if (std::isnan(other)) continue;
    const double sb = value_at(deviation, a.time[i]), sa = a.deviation[i];
    const double pooled = std::sqrt((free_a * sa * sa + free_b * sb * sb) / (free_a + free_b));
    if (std::abs(a.mean[i] - other) > 2 * pooled)
      agreed = none;
    else if (std::isnan(agreed))
      agreed = a.time[i];
  }
  return agreed;
}

void add_figures(Document& document, const StudyData& data) {
  const StudyFile& file = data.plan().file;
  document.heading(2, "Figures");
  std::set<std::string> shown;
  for (const StudyFigure& figure : file.figures) {
    add_figure(document, data, figure);
    for (const StudyCase& each : file.cases)
      if (figure.cases.contains(each.name)) shown.insert(each.name);
  }
  for (const StudyCase& each : file.cases) {
    if (shown.count(each.name) > 0) continue;
    StudyFigure figure;
    figure.id = each.name;
    figure.title = each.title;
    figure.cases.patterns = {each.name};
    for (const StudyCurve& curve : file.curves)
      if (curve.cases.contains(each.name)) figure.curves.push_back(curve.curve.name);
    add_figure(document, data, figure);
  }
}

namespace {

void add_measure_row(DocumentTable& table, const StudyData& data, const Ensemble& of,
                     const Ensemble& with, const std::string& label, const StudyMeasure& measure) {
  const auto a = value_of(data, of, measure), b = value_of(data, with, measure);
  if (!a || !b) return;
  const double free_a = static_cast<double>(a->count - 1);
  const double free_b = static_cast<double>(b->count - 1);
  std::string noise = "no seeds";
  bool differs = false;
  if (free_a + free_b > 0) {
    const double pooled = std::sqrt((free_a * a->deviation * a->deviation +
                                     free_b * b->deviation * b->deviation) / (free_a + free_b));
    differs = std::abs(a->mean - b->mean) > 2 * pooled;
    noise = differs ? "differs" : "within noise";
  }
  const double relative = b->mean == 0 ? none : 100 * (a->mean - b->mean) / std::abs(b->mean);
  table.rows.push_back(Row{label, label_of(measure), spread_text(*a), spread_text(*b),
                           short_number(a->mean - b->mean),
                           std::isnan(relative) ? "-" : fmt::format("{:.3g} %", relative),
                           {noise, differs}});
}

void add_comparison(Document& document, const StudyData& data, const StudyCompare& compare) {
  const StudyFile& file = data.plan().file;
  document.heading(3, compare.title.empty() ? compare.name : compare.title);
  const std::vector<Ensemble> of = ensembles_of(data.plan(), {{compare.of}, {}});
  const std::vector<Ensemble> with = ensembles_of(data.plan(), {{compare.with}, {}});
  std::vector<const StudyMeasure*> measures = measures_named(file, compare.measures, false);
  DocumentTable values{
      {"at", "measure", compare.of, compare.with, "difference", "relative", ""}, {}};
  DocumentTable curves{{"at", "curve", "agree from t [s]", "until t [s]"}, {}};
  for (const Ensemble& a : of) {
    const auto b = std::find_if(with.begin(), with.end(),
                                [&](const Ensemble& each) { return each.varied == a.varied; });
    if (b == with.end()) continue;
    std::string label;
    for (const auto& [key, value] : a.varied)
      label += fmt::format("{}{}={}", label.empty() ? "" : " ", key, value);
    for (const StudyMeasure* each : measures) add_measure_row(values, data, a, *b, label, *each);
    for (const std::string& name : compare.curves) {
      const StudyCurve* curve = file.find_curve(name);
      if (!curve) continue;
      const EnsembleCurve ours = curve_of(data, a, *curve), theirs = curve_of(data, *b, *curve);
      if (ours.time.empty() || theirs.time.empty()) continue;
      const double from = agreement_time(ours, theirs);
      curves.rows.push_back(Row{label, name, std::isnan(from) ? "never" : short_number(from),
                                short_number(std::min(ours.time.back(), theirs.time.back()))});
      document.plot(fmt::format("{}_{}_{}", compare.name, name, curves.rows.size()),
                    plot_of(data, fmt::format("{} {}", compare.name, label), {a, *b}, *curve));
    }
  }
  document.table(std::move(values));
  document.table(std::move(curves));
}

}  // namespace

void add_comparisons(Document& document, const StudyData& data) {
  if (data.plan().file.compares.empty()) return;
  document.heading(2, "Comparisons");
  document.text(
      "Ensembles of two cases at equal varied values. They differ where their means are further "
      "apart than twice the spread over seeds of both; curves agree from the time on after which "
      "they never differ again.");
  for (const StudyCompare& each : data.plan().file.compares) add_comparison(document, data, each);
}

}  // namespace varve::tools
