#include "tools/study_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "core/parameters.h"
#include "core/simulation.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

using Row = std::vector<DocumentCell>;

void add_overview(Document& document, const StudyData& data,
                  const std::vector<ClaimResult>& results) {
  const StudyPlan& plan = data.plan();
  std::set<std::string> ids, done, failed;
  for (std::size_t i = 0; i < plan.members.size(); ++i) {
    const std::string& id = plan.members[i].id;
    ids.insert(id);
    if (data.ended_well(i)) done.insert(id);
    if (data.row(i) && data.row(i)->failed) failed.insert(id);
  }
  document.text(fmt::format(
      "{} members (runs and forks) in {} cases: {} done, {} failed, {} not run. Made by varve {} "
      "(engine revision {}) from {}; every number is computed from the members' logs. ± is the "
      "standard deviation over seeds, the number of seeds in brackets.",
      ids.size(), plan.file.cases.size(), done.size(), failed.size(),
      ids.size() - done.size() - failed.size(), version_text(), core::engine_revision,
      plan.file.path.substr(plan.file.path.rfind('/') + 1)));
  if (results.empty()) return;
  std::map<Verdict, std::size_t> counts;
  for (const ClaimResult& each : results) ++counts[each.verdict];
  DocumentTable table{{"verdict", "claims"}, {}};
  for (const auto& [verdict, count] : counts)
    table.rows.push_back({std::string(name_of(verdict)), std::to_string(count)});
  document.heading(2, "Claims");
  document.table(std::move(table));
}

std::string expectation_of(const StudyClaim& claim) {
  std::string text = claim.value_text;
  if (!claim.expected_text.empty() && !claim.expects_true) text += " : " + claim.expected_text;
  if (claim.direction) text += fmt::format("; at least {}", claim.direction->text());
  return text;
}

std::string ours_of(const StudyClaim& claim, const ClaimResult& result) {
  if (!claim.value || result.verdict == Verdict::not_run) return "-";
  if (claim.expects_true && result.seeds >= 2)
    return fmt::format("in {} of {} seeds", result.holding, result.seeds);
  if (std::isnan(result.ours)) return "never happened";
  if (result.seeds < 2) return short_number(result.ours);
  return fmt::format("{} ± {:.2g} ({})", short_number(result.ours), result.spread, result.seeds);
}

void add_claims(Document& document, const StudyData& data,
                const std::vector<ClaimResult>& results) {
  const std::vector<StudyClaim>& claims = data.plan().file.claims;
  if (claims.empty()) return;
  document.text(
      "Verdicts are computed: a value is reproduced where ours lies in the expected range; a "
      "direction where it holds by more than twice the spread over seeds, and is below noise where "
      "it is nearer than that. What the study says in two ways is marked as its own contradiction, "
      "with what we find.");
  DocumentTable table{
      {"claim", "figure", "what is said", "its value", "expected of us", "ours", "verdict", "note"},
      {}};
  for (std::size_t i = 0; i < claims.size(); ++i) {
    const StudyClaim& claim = claims[i];
    std::string note = claim.note;
    if (!claim.contradicts.empty())
      note = claim.contradicts + (note.empty() ? "" : ": ") + note;
    table.rows.push_back(Row{claim.id,
                             claim.figure,
                             claim.text,
                             claim.study_value,
                             expectation_of(claim),
                             ours_of(claim, results[i]),
                             {std::string(name_of(results[i].verdict)), true},
                             note});
  }
  document.table(std::move(table));
}

Row sensitivity_row(const StudyData& data, const Sensitivity& each) {
  const bool has_interval = each.numeric && !std::isnan(each.half_width);
  std::string noise = each.effect == 0 ? "no effect" : "no seeds";
  if (each.effect != 0 && !std::isnan(each.spread))
    noise = each.below_noise() ? "below noise" : "beyond noise";
  return {each.key,
          data.plan().file.cases[each.case_index].name,
          std::to_string(each.members),
          each.numeric ? short_number(each.slope) : "-",
          has_interval ? fmt::format("{} .. {}", short_number(each.slope - each.half_width),
                                     short_number(each.slope + each.half_width))
                       : "-",
          each.numeric ? short_number(each.elasticity) : "-",
          each.rank > 0 ? std::to_string(each.rank) : "-",
          short_number(each.effect),
          short_number(each.spread),
          {noise, noise == "below noise"}};
}

void add_sensitivities(Document& document, const StudyData& data) {
  bool begun = false;
  for (const StudyMeasure& measure : data.plan().file.measures) {
    if (measure.quality) continue;
    const std::vector<Sensitivity> all = sensitivities_of(data, measure);
    if (all.empty()) continue;
    if (!begun) {
      document.heading(2, "What each key does to each measure");
      document.text(
          "Slope: a straight line through all members of the case, other varied keys held, with "
          "its 95 % interval (Student's t). Elasticity: relative change of the measure per "
          "relative change of the key, at their means. Rank: by the size of the elasticity. "
          "Effect: the slope times the range of the key (of words, the range of the means); it "
          "is below noise where it is less than twice the spread over seeds. Damping and width "
          "come first.");
      begun = true;
    }
    document.heading(3, label_of(measure));
    DocumentTable table{{"key", "case", "members", "slope", "95 % interval", "elasticity", "rank",
                         "effect over the range", "spread over seeds", "noise"},
                        {}};
    for (const Sensitivity& each : all) table.rows.push_back(sensitivity_row(data, each));
    document.table(std::move(table));
  }
}

/// Keys that differ from their default, alike in every member or listed by case.
void add_parameters(Document& document, const StudyData& data) {
  const StudyPlan& plan = data.plan();
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, std::set<std::string>>> values;  // key, value, cases
  for (const StudyMember& member : plan.members)
    for (const core::Parameter& parameter : core::parameters()) {
      const std::string key(parameter.key);
      if (key == "grains.seed" || key.starts_with("record.") || key.starts_with("scenario."))
        continue;
      if (values.count(key) == 0) order.push_back(key);
      values[key][core::get_parameter(member.scenario, parameter)].insert(
          plan.case_of(member).name);
    }
  DocumentTable common{{"key", "value", "unit", "meaning"}, {}};
  DocumentTable differing{{"key", "unit", "values and the cases that have them"}, {}};
  for (const std::string& key : order) {
    const core::Parameter& parameter = *core::find_parameter(key);
    const auto& by_value = values[key];
    if (by_value.size() == 1) {
      const std::string& value = by_value.begin()->first;
      if (value != core::default_text(parameter))
        common.rows.push_back(Row{key, value, std::string(parameter.unit),
                                  std::string(parameter.meaning)});
      continue;
    }
    std::string text;
    for (const auto& [value, cases] : by_value)
      text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", value, fmt::join(cases, ", "));
    differing.rows.push_back(Row{key, std::string(parameter.unit), text});
  }
  document.heading(2, "Parameters");
  document.text("Resolved values that are no default and the same in every member:");
  document.table(std::move(common));
  if (differing.rows.empty()) return;
  document.text("Resolved values that differ between members:");
  document.table(std::move(differing));
}

void add_failures(Document& document, const StudyData& data) {
  const StudyPlan& plan = data.plan();
  DocumentTable table{{"member", "id", "last step", "error"}, {}};
  std::set<std::string> seen;
  for (std::size_t i = 0; i < plan.members.size(); ++i) {
    const auto& row = data.row(i);
    if (!row || !row->failed || !seen.insert(row->id).second) continue;
    table.rows.push_back(Row{label_of(plan, plan.members[i]), row->id,
                             std::to_string(row->last_step), row->error});
  }
  if (table.rows.empty()) return;
  document.heading(2, "What failed");
  document.table(std::move(table));
}

void add_measures(Document& document, const StudyData& data) {
  DocumentTable table{{"measure", "unit", "formula", "flagged"}, {}};
  for (const StudyMeasure& each : data.plan().file.measures)
    table.rows.push_back(Row{each.title.empty() ? each.measure.name
                                                : each.measure.name + ": " + each.title,
                             each.unit, text_of(each.measure.expression),
                             each.flag ? each.flag->text() : ""});
  if (table.rows.empty()) return;
  document.heading(2, "Measures");
  document.text("Names are those of varve analyze: its summary, and columns of its tables.");
  document.table(std::move(table));
}

}  // namespace

std::string short_number(double value) {
  return std::isnan(value) ? "-" : fmt::format("{:.4g}", value);
}

std::string spread_text(const EnsembleValue& value) {
  if (value.count < 2) return fmt::format("{} (1)", short_number(value.mean));
  return fmt::format("{} ± {:.2g} ({})", short_number(value.mean), value.deviation, value.count);
}

std::string label_of(const StudyMeasure& measure) {
  const std::string& name = measure.title.empty() ? measure.measure.name : measure.title;
  return measure.unit.empty() ? name : fmt::format("{} [{}]", name, measure.unit);
}

Document report_of(const StudyData& data) {
  Document document;
  const StudyFile& file = data.plan().file;
  document.title = file.title.empty() ? file.name : file.title;
  std::vector<ClaimResult> results;
  for (const StudyClaim& claim : file.claims) results.push_back(judge(data, claim));
  add_overview(document, data, results);
  add_claims(document, data, results);
  add_sensitivities(document, data);
  add_figures(document, data);
  add_comparisons(document, data);
  add_parameters(document, data);
  add_measures(document, data);
  add_failures(document, data);
  return document;
}

}  // namespace varve::tools
