// What a tradeoff prints and writes: table, plan, JSON, CSV, plot.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/progress.h"
#include "tools/svg_plot.h"
#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

/// "+1.2 %", "-0.034 %": two digits.
std::string percent(double value, bool with_sign) {
  if (value == 0) return "0 %";
  const double shown = 100 * value;
  const int power = static_cast<int>(std::floor(std::log10(std::abs(shown))));
  const int digits = std::clamp(1 - power, 0, 4);
  return with_sign ? fmt::format("{:+.{}f} %", shown, digits)
                   : fmt::format("{:.{}f} %", shown, digits);
}

std::string error_text(const Judged& judged, std::uint64_t seeds) {
  if (!judged.error) return "-";
  std::string text = percent(*judged.error, true);
  if (seeds > 1) text += " ~ " + percent(judged.spread, false);
  return text;
}

/// Columns as wide as their widest cell, the first to the left, the others to the right.
std::string aligned(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows)
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (widths.size() <= k) widths.push_back(0);
      widths[k] = std::max(widths[k], row[k].size());
    }
  std::string out;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k)
      line += k == 0 ? fmt::format("{:<{}}", row[k], widths[k])
                     : fmt::format("  {:>{}}", row[k], widths[k]);
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

std::string reference_text(const TradeReport& report) {
  std::string against, known;
  for (const TradeMeasure& measure : report.measures)
    (measure.known ? known : against) +=
        ((measure.known ? known : against).empty() ? "" : ", ") + measure.name;
  std::string text;
  if (!against.empty())
    text += fmt::format("{}: against `{}`", against, report.rungs[report.reference].rung.name);
  if (!known.empty())
    text += fmt::format("{}{}: against a known value", text.empty() ? "" : "; ", known);
  return text;
}

/// What the reference itself may still owe: how far the next best level is from it.
std::string doubt_of(const TradeReport& report) {
  const auto is_known = [](const TradeMeasure& each) { return each.known.has_value(); };
  const bool all_known = std::all_of(report.measures.begin(), report.measures.end(), is_known);
  if (all_known) return "";
  for (const RungResult& rung : report.rungs)
    if (rung.rung.name == "fine" && !rung.reference && rung.worst)
      return fmt::format("`{}` is no truth: `fine` is {} away from it\n",
                         report.rungs[report.reference].rung.name, percent(*rung.worst, false));
  return "";
}

Json optional_json(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json cost_json(const Cost& cost) {
  return {{"cpu_s", cost.cpu_s},
          {"wall_s", cost.wall_s},
          {"steps", std::to_string(cost.steps)},
          {"bytes", std::to_string(cost.bytes)}};
}

Json rung_json(const RungResult& rung, const std::vector<TradeMeasure>& measures) {
  Json object{{"name", rung.rung.name},
              {"knob", rung.rung.knob},
              {"settings", rung.rung.settings},
              {"status", rung.status},
              {"why", rung.why},
              {"reference", rung.reference},
              {"front", rung.front},
              {"predicted", cost_json(rung.predicted)}};
  object["cost"] = rung.status == "ran" ? cost_json(rung.cost) : Json();
  object["worst_error"] = optional_json(rung.worst);
  Json& values = object["measures"] = Json::array();
  for (std::size_t m = 0; m < rung.judged.size() && m < measures.size(); ++m)
    values.push_back({{"name", measures[m].name},
                      {"value", optional_json(rung.judged[m].value)},
                      {"error", optional_json(rung.judged[m].error)},
                      {"spread", rung.judged[m].spread}});
  Json& runs = object["runs"] = Json::array();
  for (const RungRun& run : rung.runs)
    runs.push_back({{"code", run.code},
                    {"failure", run.failure},
                    {"chain", run.chain},
                    {"cached", run.cached},
                    {"cost", cost_json(run.cost)}});
  return object;
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

double fraction(const std::string& text, std::string_view option) {
  std::string digits = text;
  while (!digits.empty() && digits.back() == ' ') digits.pop_back();
  const bool hundredths = !digits.empty() && digits.back() == '%';
  if (hundredths) digits.pop_back();
  char* end = nullptr;
  const double value = std::strtod(digits.c_str(), &end);
  while (end && *end == ' ') ++end;
  if (digits.empty() || (end && *end != '\0') || !std::isfinite(value) || !(value > 0))
    throw UsageError(
        fmt::format("{}: expected a share > 0 such as 2% or 0.02, got '{}'", option, text));
  return hundredths ? value / 100 : value;
}

std::string plan_text(const TradeReport& report) {
  std::vector<std::vector<std::string>> rows{
      {"rung", "CPU s", "steps", "log", "settings"}};
  double total = 0, finished = 0;
  for (const RungResult& rung : report.rungs) {
    std::string settings = fmt::format("{}", fmt::join(rung.rung.settings, " "));
    if (!rung.why.empty()) settings = rung.status + ": " + rung.why;
    rows.push_back({rung.rung.name, fmt::format("{:.3g}", rung.predicted.cpu_s),
                    std::to_string(rung.predicted.steps), human_bytes(rung.predicted.bytes),
                    settings});
    if (rung.status == "refused" || rung.status == "dropped")
      rows.back()[1] = rows.back()[2] = rows.back()[3] = "-";
    else
      (rung.status == "finished" ? finished : total) += rung.predicted.cpu_s;
  }
  // Settings are prose: to the left, behind two blanks.
  std::vector<std::vector<std::string>> numbers;
  for (const auto& row : rows) numbers.push_back({row.begin(), row.end() - 1});
  std::string table = aligned(numbers), out;
  std::size_t begin = 0;
  for (const auto& row : rows) {
    const std::size_t end = table.find('\n', begin);
    out += table.substr(begin, end - begin) + (row.back().empty() ? "" : "  " + row.back()) + "\n";
    begin = end + 1;
  }
  out += fmt::format("predicted: {:.3g} CPU-seconds to run", total);
  if (report.seeds > 1) out += fmt::format(" ({} seeds each)", report.seeds);
  if (finished > 0) out += fmt::format(", {:.3g} finished before", finished);
  return out + "; reading the logs comes on top\n";
}

std::string text_of(const TradeReport& report) {
  std::string out = fmt::format("{} to {:g} s, {} thread{}{}\n{}\n", report.scene.file,
                                report.scene.until, report.threads,
                                report.threads == 1 ? "" : "s",
                                report.seeds > 1 ? fmt::format(", {} seeds each (error ~ standard "
                                                               "deviation over seeds; worst: with "
                                                               "the mean's standard error)",
                                                               report.seeds)
                                                 : std::string(),
                                reference_text(report));
  for (const std::string& name : report.missing)
    out += fmt::format("{}: did not happen in `{}`, left out\n", name,
                       report.rungs[report.reference].rung.name);
  std::vector<std::vector<std::string>> rows{{"", "CPU s", "wall s", "steps", "bytes"}};
  for (const TradeMeasure& measure : report.measures) rows.front().push_back(measure.name);
  rows.front().push_back("worst");
  std::string notes;
  for (const RungResult& rung : report.rungs) {
    if (rung.status != "ran") {
      notes += fmt::format("{}: {}: {}\n", rung.rung.name, rung.status, rung.why);
      continue;
    }
    std::vector<std::string> row{(rung.front ? "* " : "  ") + rung.rung.name,
                                 fmt::format("{:.3g}", rung.cost.cpu_s),
                                 fmt::format("{:.3g}", rung.cost.wall_s),
                                 std::to_string(rung.cost.steps), human_bytes(rung.cost.bytes)};
    for (const Judged& judged : rung.judged) row.push_back(error_text(judged, report.seeds));
    row.push_back(rung.worst ? percent(*rung.worst, false) : "-");
    rows.push_back(std::move(row));
  }
  out += aligned(rows) + notes + "* on the front: nothing else is as cheap and as accurate\n" +
         doubt_of(report);
  const core::Scenario& base = report.scene.base;
  if (report.seeds == 1 && (base.grains.jitter > 0 || base.fluid.jitter > 0 ||
                            base.grains.arrangement == core::Arrangement::random))
    out += "one seed: a small error may be luck; --seeds N tells\n";
  for (const Recommendation& each : report.recommended) {
    if (!each.rung) {
      out += fmt::format("within {}: no rung\n", percent(each.within, false));
      continue;
    }
    const RungResult& rung = report.rungs[*each.rung];
    out += fmt::format("within {}: {} ({:.3g} CPU-seconds, worst error {}){}\n",
                       percent(each.within, false), rung.rung.name, rung.cost.cpu_s,
                       percent(*rung.worst, false),
                       rung.reference ? ", the reference itself" : "");
    std::string command = fmt::format("  varve run {}", report.scene.file);
    for (const std::string& setting : settings_on_top(report.scene.given, rung.rung.settings))
      command += " -s '" + setting + "'";
    out += command + "\n";
  }
  return out;
}

std::string json_of(const TradeReport& report) {
  Json object{{"schema", "varve.tradeoff/1"},
              {"scenario", report.scene.file},
              {"settings", report.scene.settings},
              {"until_s", report.scene.until},
              {"threads", report.threads},
              {"seeds", report.seeds},
              {"reference", report.rungs[report.reference].rung.name}};
  Json& measures = object["measures"] = Json::array();
  for (const TradeMeasure& measure : report.measures)
    measures.push_back({{"name", measure.name},
                        {"unit", measure.unit},
                        {"meaning", measure.meaning},
                        {"known", optional_json(measure.known)}});
  object["did_not_happen"] = report.missing;
  Json& rungs = object["rungs"] = Json::array();
  for (const RungResult& rung : report.rungs) rungs.push_back(rung_json(rung, report.measures));
  Json& recommended = object["recommended"] = Json::array();
  for (const Recommendation& each : report.recommended)
    recommended.push_back(
        {{"within", each.within},
         {"rung", each.rung ? Json(report.rungs[*each.rung].rung.name) : Json()}});
  return object.dump(2) + "\n";
}

std::string csv_of(const TradeReport& report) {
  std::string out = "rung,knob,settings,status,cpu_s,wall_s,steps,bytes,worst_error,front";
  for (const TradeMeasure& measure : report.measures)
    out += fmt::format(",{0},{0}_error,{0}_spread", measure.name);
  out += "\n";
  for (const RungResult& rung : report.rungs) {
    out += fmt::format("{},{},{},{}", csv_cell(rung.rung.name), csv_cell(rung.rung.knob),
                       csv_cell(fmt::format("{}", fmt::join(rung.rung.settings, " "))),
                       rung.status);
    if (rung.status == "ran")
      out += fmt::format(",{},{},{},{},{},{}", rung.cost.cpu_s, rung.cost.wall_s, rung.cost.steps,
                         rung.cost.bytes, rung.worst ? fmt::format("{}", *rung.worst) : "",
                         rung.front ? 1 : 0);
    else
      out += ",,,,,,0";
    for (std::size_t m = 0; m < report.measures.size(); ++m) {
      const bool there = m < rung.judged.size();
      const auto cell = [](const std::optional<double>& value) {
        return value ? fmt::format("{}", *value) : std::string();
      };
      out += fmt::format(",{},{},{}", there ? cell(rung.judged[m].value) : "",
                         there ? cell(rung.judged[m].error) : "",
                         there && rung.judged[m].error ? fmt::format("{}", rung.judged[m].spread)
                                                       : "");
    }
    out += "\n";
  }
  return out;
}

std::string svg_of(const TradeReport& report) {
  Plot plot;
  plot.title = fmt::format("{} to {:g} s: cost against error", report.scene.file,
                           report.scene.until);
  plot.x_label = "CPU seconds";
  plot.y_label = "worst relative error";
  plot.log_x = plot.log_y = true;
  PlotSeries front, others;
  front.name = "front";
  others.name = "beaten";
  others.line = false;
  others.hollow = true;
  std::vector<const RungResult*> order;
  for (const RungResult& rung : report.rungs)
    if (rung.worst) order.push_back(&rung);
  std::sort(order.begin(), order.end(), [](const RungResult* a, const RungResult* b) {
    return a->cost.cpu_s < b->cost.cpu_s;
  });
  for (const RungResult* rung : order) {
    PlotSeries& series = rung->front ? front : others;
    series.x.push_back(rung->cost.cpu_s);
    series.y.push_back(*rung->worst);
    // Beaten ones lie close together: only levels are named among them.
    series.labels.push_back(rung->front || rung->rung.knob == "level" ? rung->rung.name : "");
    series.tips.push_back(rung->rung.name);
  }
  plot.series = {front, others};
  return svg_of(plot);
}

}  // namespace varve::tools
