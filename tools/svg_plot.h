// Plots as SVG text: points with error bars, lines with bands, on linear or logarithmic axes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace varve::tools {

struct PlotSeries {
  std::string name;
  std::vector<double> x, y;
  std::vector<double> spread;  ///< half-length of bars, half-width of the band; may be empty
  bool line = true;
  bool band = false;           ///< spread as a band, no marks
  bool marks = true;
  bool hollow = false;                   ///< marks
  std::vector<std::string> labels = {};  ///< beside the marks; may be empty
  std::vector<std::string> tips = {};    ///< shown where a mark is pointed at; may be empty
};

struct Plot {
  std::string title, x_label, y_label;
  /// Names instead of numbers along x: series then have x = 0, 1, ...
  std::vector<std::string> categories;
  std::vector<PlotSeries> series;
  bool log_x = false, log_y = false;
  /// Points that can be drawn: ones that are not finite, or not positive on a logarithmic axis, are
  /// left out.
  bool empty() const;
};

/// A whole SVG document. A plot without a point that can be drawn says so.
std::string svg_of(const Plot& plot);

/// "<" as "&lt;" and so on.
std::string escape_markup(const std::string& text);

/// About `count` round numbers that cover least..most.
std::vector<double> axis_ticks(double least, double most, std::size_t count);
/// Decades within least..most, both > 0; with 2 and 5 times them where they are few.
std::vector<double> log_ticks(double least, double most);

}  // namespace varve::tools
