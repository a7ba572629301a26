// Small plots as SVG: points and lines over linear or logarithmic axes, with ticks and a legend.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace varve::tools {

struct SvgSeries {
  std::string name;                                ///< in the legend; empty: not listed
  std::vector<std::pair<double, double>> points;   ///< not finite (or <= 0 on a log axis): left out
  std::vector<std::string> labels;                 ///< beside the points; may be empty
  bool line = true, markers = false;
  bool hollow = false;                             ///< markers
  std::vector<std::string> tips = {};              ///< shown when a marker is pointed at
};

struct SvgPlot {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<SvgSeries> series;
  double width = 760, height = 480;  ///< [px]
};

/// A whole SVG document. A plot without a point that can be drawn says so in place of axes.
std::string svg_of(const SvgPlot& plot);

/// Text with what XML reserves written as entities.
std::string xml_text(const std::string& text);

/// Places of ticks within [low, high]: 1, 2, 5 times powers of ten, or decades (with 2 and 5 where
/// few) on a logarithmic axis.
std::vector<double> svg_ticks(double low, double high, bool logarithmic);

}  // namespace varve::tools
