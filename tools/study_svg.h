// Plots as SVG text: points with error bars, lines with bands, on linear axes.
#pragma once

#include <string>
#include <vector>

namespace varve::tools {

struct PlotSeries {
  std::string name;
  std::vector<double> x, y;
  std::vector<double> spread;  ///< half-length of bars, half-width of the band; may be empty
  bool line = true;
  bool band = false;           ///< spread as a band, no marks
};

struct Plot {
  std::string title, x_label, y_label;
  /// Names instead of numbers along x: series then have x = 0, 1, ...
  std::vector<std::string> categories;
  std::vector<PlotSeries> series;
  /// Points that can be drawn: NaN ones are left out.
  bool empty() const;
};

std::string svg_of(const Plot& plot);

/// "<" as "&lt;" and so on.
std::string escape_markup(const std::string& text);

/// About `count` round numbers that cover least..most.
std::vector<double> axis_ticks(double least, double most, std::size_t count);

}  // namespace varve::tools
