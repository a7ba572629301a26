// varve plot: columns of `varve analyze` over time, of one run or several, as SVG.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include "io/log_reader.h"
#include "tools/analysis.h"
#include "tools/cli.h"
#include "tools/measure.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"
#include "tools/svg_plot.h"

namespace varve::tools {
namespace {

/// One curve as asked for: "NAME=EXPRESSION", or the expression alone, which then is its own name.
Curve curve_of(const std::string& text) {
  std::string name = text, expression = text;
  // The first '=' outside brackets parts the two; inside them it belongs to a filter.
  const std::size_t equals = text.find('=');
  if (equals != std::string::npos && text.find('[') > equals) {
    name = text.substr(0, equals);
    expression = text.substr(equals + 1);
  }
  try {
    return make_curve(name, expression);
  } catch (const ExpressionError& error) {
    throw UsageError(fmt::format("--curve '{}': column {}: {}", text, error.column(),
                                 error.what()));
  }
}

std::vector<Curve> curves_asked_for(const Invocation& invocation, const core::Scenario& first) {
  std::vector<std::string> texts = invocation.values("curve");
  if (texts.empty())
    texts = {first.has_grains() && first.grains.motion != core::GrainMotion::frozen
                 ? "settling.settling_speed_m_s"
                 : "energy.fluid_kinetic_J"};
  std::vector<Curve> curves;
  for (const std::string& text : texts) curves.push_back(curve_of(text));
  if (invocation.has("x")) curves.push_back(curve_of(invocation.value("x")));
  const std::uint64_t every = invocation.count("every").value_or(1);
  const std::uint64_t points = invocation.count("points").value_or(400);
  if (every < 1) throw UsageError("--every: expected at least 1");
  if (points < 2 || points > 100000)
    throw UsageError(fmt::format("--points: expected 2 to 100000, got {}", points));
  for (Curve& curve : curves) {
    curve.every = every;
    curve.points = points;
    if (invocation.has("from")) curve.from = duration_option(invocation, "from");
    if (invocation.has("to")) curve.to = duration_option(invocation, "to");
  }
  return curves;
}

/// What a run is called in the legend: its file's name, with as much of the path as tells it from
/// the others'.
std::string label_of(const std::string& path, const std::vector<std::string>& all) {
  const auto stem = [](const std::string& each) {
    return std::filesystem::path(each).stem().string();
  };
  const auto alike = std::count_if(all.begin(), all.end(), [&](const std::string& other) {
    return stem(other) == stem(path);
  });
  return alike > 1 ? path : stem(path);
}

void add_run(const std::string& path, const std::vector<std::string>& runs,
             const std::vector<Curve>& curves, bool over_curve, Plot& plot) {
  const auto log = io::LogReader::open(path);
  const core::Scenario scenario = scenario_of(log->genesis(), log->path());
  Measured measured;
  try {
    measured = evaluate_measures(*log, scenario, {}, curves);
  } catch (const ExpressionError& error) {
    throw UsageError(fmt::format("{}: {}", path, error.what()));
  }
  const std::size_t drawn = curves.size() - (over_curve ? 1 : 0);
  for (std::size_t c = 0; c < drawn; ++c) {
    const Measured::Samples& y = measured.curves[c];
    const Measured::Samples& x = over_curve ? measured.curves.back() : y;
    PlotSeries series;
    series.marks = false;
    // Both were taken at the same times, unless one of them has rows for a part of them only.
    for (std::size_t k = 0; k < std::min(x.time.size(), y.time.size()); ++k)
      if (std::abs(x.time[k] - y.time[k]) <= 1e-9 * std::max(1.0, std::abs(y.time[k]))) {
        series.x.push_back(over_curve ? x.value[k] : x.time[k]);
        series.y.push_back(y.value[k]);
      }
    std::string name = drawn > 1 ? curves[c].name : "";
    if (runs.size() > 1) name = label_of(path, runs) + (name.empty() ? "" : ": " + name);
    series.name = name;
    if (series.x.empty())
      warn(fmt::format("{}: '{}' has no value there", path, curves[c].name));
    plot.series.push_back(std::move(series));
  }
}

void write_text(const std::string& path, const std::string& text, bool overwrite) {
  if (path == "-") return print(text);
  if (!overwrite && std::filesystem::exists(path))
    throw UsageError(fmt::format("{}: exists already; --overwrite replaces it", path));
  std::FILE* file = std::fopen(path.c_str(), "wb");
  const bool written = file && std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (!file || std::fclose(file) != 0 || !written)
    throw ToolError(exit_output, fmt::format("{}: can't be written", path));
}

int run_plot(const Invocation& invocation) {
  const std::vector<std::string>& runs = invocation.arguments;
  const auto first = io::LogReader::open(runs.front());
  const std::vector<Curve> curves =
      curves_asked_for(invocation, scenario_of(first->genesis(), first->path()));
  const bool over_curve = invocation.has("x");
  Plot plot;
  plot.title = invocation.has("title") ? invocation.value("title")
               : runs.size() == 1      ? label_of(runs.front(), runs)
                                       : std::string();
  plot.x_label = over_curve ? curves.back().name : "time_s";
  plot.y_label = curves.size() - (over_curve ? 1 : 0) == 1 ? curves.front().name : "";
  plot.log_x = invocation.has("log-x");
  plot.log_y = invocation.has("log-y");
  for (const std::string& run : runs) add_run(run, runs, curves, over_curve, plot);
  const std::string path =
      invocation.has("output")
          ? invocation.value("output")
          : std::filesystem::path(runs.front()).stem().string() + ".svg";
  write_text(path, svg_of(plot), invocation.has("overwrite"));
  if (path != "-") note(invocation.globals, path);
  return exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "plot";
  verb.usage = "RUN...";
  verb.summary = "Curves of one run or several as SVG.";
  verb.description =
      "Draws columns of the tables of varve analyze over time, or over another column. A curve is\n"
      "TABLE.COLUMN with filters in brackets, or arithmetic of such; varve analyze RUN --list\n"
      "names tables and columns. Without --curve: the settling speed, or the fluid's energy where\n"
      "no grain moves.\n\n"
      "  varve plot disc.varve damping.varve -o damping.svg\n"
      "  varve plot column.varve --curve 'row 1=rows.settling_speed_m_s[row=1]' \\\n"
      "                          --curve 'row 4=rows.settling_speed_m_s[row=4]'\n"
      "  varve plot disc.varve --curve trajectories.y_m --x trajectories.x_m --every 10\n";
  verb.options = {
      {"output,o", "FILE", "SVG to write, - for standard output [RUN.svg, in this folder]", false,
       ""},
      {"curve", "[NAME=]EXPR", "what is drawn; may be repeated", true, ""},
      {"x", "[NAME=]EXPR", "drawn over this instead of time", false, ""},
      {"from", "T", "first time drawn", false, ""},
      {"to", "T", "last time drawn", false, ""},
      {"every", "K", "read tables every K-th step only", false, "1"},
      {"points", "N", "points of a curve, linear between rows", false, "400"},
      {"log-x", "", "logarithmic x; what is not positive is left out", false, ""},
      {"log-y", "", "logarithmic y; likewise", false, ""},
      {"title", "TEXT", "over the plot [the run's name]", false, ""},
      {"overwrite", "", "replace an existing file", false, ""},
  };
  verb.arguments_min = 1;
  verb.arguments_max = 64;
  verb.run = run_plot;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
