#include "tools/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace varve::tools {
namespace {

constexpr double left = 78, right = 24, top = 40, bottom = 52;  // [px]
constexpr std::array<const char*, 8> colours{"#1f5fa8", "#c1440e", "#2e7d32", "#7b3fa0",
                                             "#b8860b", "#00838f", "#ad1457", "#555555"};

/// One axis: from values to pixels.
class Axis {
 public:
  Axis(double low, double high, bool logarithmic, double from, double to)
      : low_(low), high_(high), logarithmic_(logarithmic), from_(from), to_(to) {
    if (logarithmic_) {
      if (!(high_ > low_)) low_ /= 2, high_ *= 2;
      const double margin = 0.06 * std::log(high_ / low_);
      low_ *= std::exp(-margin);
      high_ *= std::exp(margin);
    } else {
      if (!(high_ > low_)) {
        const double half = low_ == 0 ? 1 : 0.5 * std::abs(low_);
        low_ -= half;
        high_ += half;
      }
      const double margin = 0.04 * (high_ - low_);
      low_ -= margin;
      high_ += margin;
    }
  }
  double at(double value) const {
    const double part = logarithmic_ ? std::log(value / low_) / std::log(high_ / low_)
                                     : (value - low_) / (high_ - low_);
    return from_ + part * (to_ - from_);
  }
  std::vector<double> ticks() const { return svg_ticks(low_, high_, logarithmic_); }

 private:
  double low_, high_;
  bool logarithmic_;
  double from_, to_;
};

std::string number(double value) {
  return std::abs(value) < 1e-12 ? "0" : fmt::format("{:.6g}", value);
}

bool drawable(const SvgPlot& plot, const std::pair<double, double>& point) {
  return std::isfinite(point.first) && std::isfinite(point.second) &&
         !(plot.log_x && point.first <= 0) && !(plot.log_y && point.second <= 0);
}

std::string frame_of(const SvgPlot& plot, const Axis& x, const Axis& y) {
  std::string out;
  const double x0 = left, x1 = plot.width - right, y0 = plot.height - bottom, y1 = top;
  for (const double tick : x.ticks()) {
    out += fmt::format("<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.1f}\" "
                       "y2=\"{2:.1f}\"/>\n", x.at(tick), y0, y1);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                       x.at(tick), y0 + 17, number(tick));
  }
  for (const double tick : y.ticks()) {
    out += fmt::format("<line class=\"grid\" x1=\"{1:.1f}\" x2=\"{2:.1f}\" y1=\"{0:.1f}\" "
                       "y2=\"{0:.1f}\"/>\n", y.at(tick), x0, x1);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", x0 - 7,
                       y.at(tick) + 4, number(tick));
  }
  out += fmt::format("<rect class=\"frame\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" "
                     "height=\"{:.1f}\"/>\n", x0, y1, x1 - x0, y0 - y1);
  return out;
}

std::string series_of(const SvgPlot& plot, const SvgSeries& series, const char* colour,
                      const Axis& x, const Axis& y) {
  std::string path, marks;
  bool pen_down = false;
  for (std::size_t k = 0; k < series.points.size(); ++k) {
    if (!drawable(plot, series.points[k])) {
      pen_down = false;
      continue;
    }
    const double px = x.at(series.points[k].first), py = y.at(series.points[k].second);
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? " L " : (path.empty() ? "M " : " M "), px,
                        py);
    pen_down = true;
    const std::string tip = k < series.tips.size() ? xml_text(series.tips[k]) : "";
    if (series.markers)
      marks += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" fill=\"{}\" "
                           "stroke=\"{}\"><title>{}</title></circle>\n", px, py,
                           series.hollow ? "white" : colour, colour, tip);
    if (k < series.labels.size() && !series.labels[k].empty())
      marks += fmt::format("<text class=\"label\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", px + 6,
                           py - 4, xml_text(series.labels[k]));
  }
  std::string out;
  if (series.line && !path.empty())
    out = fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", path,
                      colour);
  return out + marks;
}

std::string legend_of(const SvgPlot& plot) {
  std::string out;
  double y = top + 16;
  for (std::size_t k = 0; k < plot.series.size(); ++k) {
    const SvgSeries& series = plot.series[k];
    if (series.name.empty()) continue;
    const char* colour = colours[k % colours.size()];
    const double x = plot.width - right - 12;
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" fill=\"{}\" "
                       "stroke=\"{}\"/>\n", x, y - 4, series.hollow ? "white" : colour, colour);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", x - 9, y,
                       xml_text(series.name));
    y += 16;
  }
  return out;
}

}  // namespace

std::string xml_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  }
  return out;
}

std::vector<double> svg_ticks(double low, double high, bool logarithmic) {
  std::vector<double> ticks;
  if (logarithmic) {
    const int from = static_cast<int>(std::floor(std::log10(low)));
    const int to = static_cast<int>(std::ceil(std::log10(high)));
    const bool few = std::log10(high / low) < 3;
    for (int power = from; power <= to; ++power)
      for (const int factor : {1, 2, 5}) {
        const double tick = factor * std::pow(10.0, power);
        if ((factor == 1 || few) && tick >= low && tick <= high) ticks.push_back(tick);
      }
    return ticks;
  }
  const double rough = (high - low) / 6;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = power;
  for (const double factor : {1.0, 2.0, 5.0, 10.0})
    if (factor * power >= rough) {
      step = factor * power;
      break;
    }
  for (double k = std::ceil(low / step); k * step <= high; ++k) ticks.push_back(k * step);
  return ticks;
}

std::string svg_of(const SvgPlot& plot) {
  double x_low = std::numeric_limits<double>::infinity(), x_high = -x_low;
  double y_low = x_low, y_high = -x_low;
  for (const SvgSeries& series : plot.series)
    for (const auto& point : series.points) {
      if (!drawable(plot, point)) continue;
      x_low = std::min(x_low, point.first);
      x_high = std::max(x_high, point.first);
      y_low = std::min(y_low, point.second);
      y_high = std::max(y_high, point.second);
    }
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" "
      "height=\"{1:g}\" font-family=\"sans-serif\" font-size=\"12\">\n"
      "<style>.grid{{stroke:#dddddd}}.frame{{fill:none;stroke:#444444}}"
      ".label{{font-size:10px;fill:#333333}}</style>\n"
      "<rect width=\"{0:g}\" height=\"{1:g}\" fill=\"white\"/>\n",
      plot.width, plot.height);
  out += fmt::format("<text x=\"{:g}\" y=\"24\" font-size=\"14\" text-anchor=\"middle\">{}"
                     "</text>\n", plot.width / 2, xml_text(plot.title));
  if (x_low > x_high) {
    out += fmt::format("<text x=\"{:g}\" y=\"{:g}\" text-anchor=\"middle\">nothing to draw"
                       "</text>\n", plot.width / 2, plot.height / 2);
    return out + "</svg>\n";
  }
  const Axis x(x_low, x_high, plot.log_x, left, plot.width - right);
  const Axis y(y_low, y_high, plot.log_y, plot.height - bottom, top);
  out += frame_of(plot, x, y);
  for (std::size_t k = 0; k < plot.series.size(); ++k)
    out += series_of(plot, plot.series[k], colours[k % colours.size()], x, y);
  out += legend_of(plot);
  out += fmt::format("<text x=\"{:g}\" y=\"{:g}\" text-anchor=\"middle\">{}</text>\n",
                     (left + plot.width - right) / 2, plot.height - 14, xml_text(plot.x_label));
  out += fmt::format("<text transform=\"translate(18 {:g}) rotate(-90)\" "
                     "text-anchor=\"middle\">{}</text>\n",
                     (top + plot.height - bottom) / 2, xml_text(plot.y_label));
  return out + "</svg>\n";
}

}  // namespace varve::tools
