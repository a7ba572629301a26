#include "tools/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace varve::tools {
namespace {

constexpr double axis_length = 430, height = 380, left = 74, top = 34, bottom = 56;
constexpr std::array<const char*, 10> colours = {"#1b6ca8", "#d1495b", "#2e8b57", "#b8860b",
                                                 "#6a4c93", "#008b8b", "#8b4513", "#c71585",
                                                 "#556b2f", "#444444"};

struct Range {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  void take(double value) {
    if (std::isnan(value)) return;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  void widen() {
    if (!(least <= most)) least = most = 0;
    if (least == most) {
      const double pad = least == 0 ? 1 : 0.1 * std::abs(least);
      least -= pad;
      most += pad;
      return;
    }
    const double pad = 0.04 * (most - least);
    least -= pad;
    most += pad;
  }
};

double spread_at(const PlotSeries& series, std::size_t i) {
  return i < series.spread.size() && !std::isnan(series.spread[i]) ? series.spread[i] : 0;
}

bool drawable(const Plot& plot, const PlotSeries& series, std::size_t i) {
  const double x = series.x[i], y = series.y[i];
  return std::isfinite(x) && std::isfinite(y) && !(plot.log_x && x <= 0) &&
         !(plot.log_y && y <= 0);
}

std::string text_at(const std::vector<std::string>& texts, std::size_t i) {
  return i < texts.size() ? texts[i] : std::string();
}

class Drawing {
 public:
  explicit Drawing(const Plot& plot) : plot_(plot) {
    std::size_t longest = 0;
    for (const PlotSeries& series : plot.series) longest = std::max(longest, series.name.size());
    if (longest > 0) right_ = 44 + 6 * static_cast<double>(longest);
    for (const PlotSeries& series : plot.series)
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        if (!drawable(plot, series, i)) continue;
        const double low = series.y[i] - spread_at(series, i);
        x_.take(along(series.x[i], plot.log_x));
        y_.take(along(plot.log_y && low <= 0 ? series.y[i] : low, plot.log_y));
        y_.take(along(series.y[i] + spread_at(series, i), plot.log_y));
      }
    if (!plot.categories.empty()) {
      x_.least = -0.5;
      x_.most = static_cast<double>(plot.categories.size()) - 0.5;
    } else {
      x_.widen();
    }
    // Zero belongs to the picture where it is near.
    if (!plot.log_y && y_.least > 0 && y_.least < 0.35 * y_.most) y_.least = 0;
    y_.widen();
  }

  std::string run() {
    out_ = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" "
                       "width=\"{}\" height=\"{}\" font-family=\"sans-serif\" font-size=\"12\" "
                       "role=\"img\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
                       width(), height, width(), height);
    text(left, 20, plot_.title, "start", "font-size=\"14\"");
    if (plot_.empty()) {
      text(0.5 * width(), 0.5 * height, "nothing to draw", "middle");
      return out_ + "</svg>\n";
    }
    axes();
    for (std::size_t i = 0; i < plot_.series.size(); ++i) series(i);
    legend();
    return out_ + "</svg>\n";
  }

 private:
  double width() const { return left + axis_length + right_; }
  static double along(double value, bool logarithmic) {
    return logarithmic ? std::log10(value) : value;
  }
  double px(double x) const {
    const double part = (along(x, plot_.log_x) - x_.least) / (x_.most - x_.least);
    return left + part * axis_length;
  }
  double py(double y) const {
    // The lower end of a bar may lie below what a logarithmic axis has.
    const double place = plot_.log_y && y <= 0 ? y_.least : along(y, plot_.log_y);
    return height - bottom - (place - y_.least) / (y_.most - y_.least) * (height - top - bottom);
  }
  static std::vector<double> ticks(const Range& range, bool logarithmic, std::size_t count) {
    return logarithmic ? log_ticks(std::pow(10, range.least), std::pow(10, range.most))
                       : axis_ticks(range.least, range.most, count);
  }
  void text(double x, double y, const std::string& what, const char* anchor,
            const std::string& more = "") {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"#222222\" "
                        "{}>{}</text>\n",
                        x, y, anchor, more, escape_markup(what));
  }
  void line(double x1, double y1, double x2, double y2, const char* colour, double thick) {
    out_ += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" "
                        "stroke=\"{}\" stroke-width=\"{}\"/>\n",
                        x1, y1, x2, y2, colour, thick);
  }

  void axes() {
    const double floor = height - bottom, end = left + axis_length;
    for (const double tick : ticks(y_, plot_.log_y, 6)) {
      line(left, py(tick), end, py(tick), "#dddddd", 1);
      text(left - 6, py(tick) + 4, fmt::format("{:.4g}", tick), "end");
    }
    if (plot_.categories.empty()) {
      for (const double tick : ticks(x_, plot_.log_x, 7)) {
        line(px(tick), floor, px(tick), floor + 5, "#222222", 1);
        text(px(tick), floor + 18, fmt::format("{:.4g}", tick), "middle");
      }
    } else {
      const bool many = plot_.categories.size() > 6;
      for (std::size_t i = 0; i < plot_.categories.size(); ++i) {
        const double x = px(static_cast<double>(i));
        text(x, floor + 16, plot_.categories[i], many ? "end" : "middle",
             many ? fmt::format("font-size=\"10\" transform=\"rotate(-35 {:.1f} {:.1f})\"", x,
                                floor + 16)
                  : "");
      }
    }
    line(left, floor, end, floor, "#222222", 1);
    line(left, top, left, floor, "#222222", 1);
    text(0.5 * (left + end), height - 10, plot_.x_label, "middle");
    const double middle = 0.5 * (top + floor);
    text(16, middle, plot_.y_label, "middle",
         fmt::format("transform=\"rotate(-90 16 {:.1f})\"", middle));
  }

  void series(std::size_t index) {
    const PlotSeries& each = plot_.series[index];
    const char* colour = colours[index % colours.size()];
    std::string path, upper, lower;
    for (std::size_t i = 0; i < each.x.size(); ++i) {
      if (!drawable(plot_, each, i)) continue;
      const double x = px(each.x[i]), s = spread_at(each, i);
      path += fmt::format("{:.1f},{:.1f} ", x, py(each.y[i]));
      upper += fmt::format("{:.1f},{:.1f} ", x, py(each.y[i] + s));
      lower = fmt::format("{:.1f},{:.1f} ", x, py(each.y[i] - s)) + lower;
    }
    if (each.band && !each.spread.empty())
      out_ += fmt::format("<polygon points=\"{}{}\" fill=\"{}\" fill-opacity=\"0.18\" "
                          "stroke=\"none\"/>\n",
                          upper, lower, colour);
    if (each.line)
      out_ += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" "
                          "stroke-width=\"1.6\"/>\n",
                          path, colour);
    if (!each.band && each.marks) marks(each, colour);
  }

  void marks(const PlotSeries& each, const char* colour) {
    for (std::size_t i = 0; i < each.x.size(); ++i) {
      if (!drawable(plot_, each, i)) continue;
      const double x = px(each.x[i]), y = py(each.y[i]), s = spread_at(each, i);
      if (s > 0) line(x, py(each.y[i] - s), x, py(each.y[i] + s), colour, 1.4);
      const std::string tip = escape_markup(text_at(each.tips, i));
      out_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.4\" fill=\"{}\"{}", x, y,
                          each.hollow ? "#ffffff" : colour,
                          each.hollow ? fmt::format(" stroke=\"{}\"", colour) : std::string());
      out_ += tip.empty() ? "/>\n" : fmt::format("><title>{}</title></circle>\n", tip);
      if (const std::string label = text_at(each.labels, i); !label.empty())
        text(x + 6, y - 4, label, "start", "font-size=\"10\"");
    }
  }

  void legend() {
    if (right_ <= 20) return;
    constexpr std::size_t shown = 18;
    for (std::size_t i = 0; i < std::min(shown, plot_.series.size()); ++i) {
      const double y = top + 8 + 17 * static_cast<double>(i);
      line(left + axis_length + 10, y, left + axis_length + 26, y, colours[i % colours.size()], 3);
      text(left + axis_length + 31, y + 4, plot_.series[i].name, "start", "font-size=\"10\"");
    }
  }

  const Plot& plot_;
  double right_ = 20;  ///< beside the axes: the legend
  Range x_, y_;
  std::string out_;
};

}  // namespace

bool Plot::empty() const {
  for (const PlotSeries& each : series)
    for (std::size_t i = 0; i < each.x.size(); ++i)
      if (drawable(*this, each, i)) return false;
  return true;
}

std::vector<double> axis_ticks(double least, double most, std::size_t count) {
  const double rough = (most - least) / static_cast<double>(std::max<std::size_t>(1, count));
  if (!(rough > 0) || !std::isfinite(rough)) return {least};
  const double power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= rough) {
      step = factor * power;
      break;
    }
  std::vector<double> ticks;
  const double first = std::ceil(least / step);
  for (double k = first; k * step <= most * (1 + 1e-12) && ticks.size() < 4 * count; ++k)
    ticks.push_back(k == 0 ? 0 : k * step);
  return ticks;
}

std::vector<double> log_ticks(double least, double most) {
  std::vector<double> ticks;
  const double from = std::floor(std::log10(least)), to = std::ceil(std::log10(most));
  const bool few = std::log10(most / least) < 3;
  for (double power = from; power <= to; ++power)
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = factor * std::pow(10, power);
      if ((factor == 1 || few) && tick >= least && tick <= most) ticks.push_back(tick);
    }
  return ticks;
}

std::string escape_markup(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '&': out += "&amp;"; break;
      case '"': out += "&quot;"; break;
      default: out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

std::string svg_of(const Plot& plot) { return Drawing(plot).run(); }

}  // namespace varve::tools
