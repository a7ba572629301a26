#include "tools/snapshot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace varve::tools {
namespace {

constexpr double picture_width = 640;  // px of the domain, unless it is very tall
constexpr double picture_height_max = 1200;
constexpr double margin = 40, legend = 150;
constexpr std::size_t arrows_across_max = 40;

/// Where a place of the domain lies in the picture, y downwards.
struct Frame {
  double left, height, scale;
  double x(double at) const { return margin + (at - left) * scale; }
  double y(double at) const { return margin + (height - at) * scale; }
};

/// Dark blue over green to yellow, for parts from 0 to 1 (viridis at five places, linear between).
std::string colour_of(double part) {
  static constexpr std::array<std::array<double, 3>, 5> colours = {
      {{68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}}};
  const double place = std::clamp(part, 0.0, 1.0) * (colours.size() - 1);
  const std::size_t below = std::min<std::size_t>(static_cast<std::size_t>(place), 3);
  const double rest = place - static_cast<double>(below);
  std::array<int, 3> mixed{};
  for (std::size_t k = 0; k < 3; ++k)
    mixed[k] = static_cast<int>(
        std::lround(colours[below][k] + rest * (colours[below + 1][k] - colours[below][k])));
  return fmt::format("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2]);
}

/// The largest of 1, 2, 5 times a power of ten that is at most `value`.
double round_number(double value) {
  double unit = 1;
  while (unit > value) unit /= 10;
  while (10 * unit <= value) unit *= 10;
  return 5 * unit <= value ? 5 * unit : 2 * unit <= value ? 2 * unit : unit;
}

std::string arrow(double x0, double y0, double dx, double dy) {
  const double length = std::hypot(dx, dy);
  if (length < 0.5) return fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='0.6'/>\n", x0, y0);
  const double ux = dx / length, uy = dy / length, head = std::min(4.0, 0.4 * length);
  const double x1 = x0 + dx, y1 = y0 + dy;
  return fmt::format(
      "<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}'/>\n", x0,
      y0, x1, y1, x1 - head * (ux - 0.5 * uy), y1 - head * (uy + 0.5 * ux), x1, y1,
      x1 - head * (ux + 0.5 * uy), y1 - head * (uy - 0.5 * ux));
}

std::string fluid_arrows(const Frame& frame, const core::FlowLattice& f, double max_speed) {
  if (f.columns == 0 || !(max_speed > 0)) return "";
  const std::size_t every =
      std::max<std::size_t>(1, (f.columns + arrows_across_max - 1) / arrows_across_max);
  // The fastest reaches to the next arrow.
  const double scale = static_cast<double>(every) * f.spacing * frame.scale / max_speed;
  std::string text = "<g stroke='#7a8896' stroke-width='0.8' fill='none'>\n";
  for (std::size_t j = every / 2; j < f.rows; j += every)
    for (std::size_t i = every / 2; i < f.columns; i += every) {
      const core::FluidAtPoint& at = f.cell(i, j);
      if (!(at.weight > 0.5)) continue;
      text += arrow(frame.x(f.x(i)), frame.y(f.y(j)), scale * at.velocity[0],
                    -scale * at.velocity[1]);
    }
  return text + "</g>\n";
}

std::string grain_discs(const Frame& frame, const core::GrainView& g, double max_speed) {
  std::string text = "<g stroke='#222' stroke-width='0.5'>\n";
  for (std::size_t i = 0; i < g.size(); ++i) {
    double speed2 = 0;
    for (std::size_t k = 0; k < g.dimension; ++k)
      speed2 += g.velocity[i * g.dimension + k] * g.velocity[i * g.dimension + k];
    const double speed = std::sqrt(speed2);
    text += fmt::format(
        "<circle cx='{:.2f}' cy='{:.2f}' r='{:.2f}' fill='{}'><title>grain {}: {:.4g} m/s</title>"
        "</circle>\n",
        frame.x(g.position[i * g.dimension]), frame.y(g.position[i * g.dimension + 1]),
        g.radius[i] * frame.scale, colour_of(max_speed > 0 ? speed / max_speed : 0), g.id[i],
        speed);
  }
  return text + "</g>\n";
}

/// Walls drawn thick, open or periodic sides dashed.
std::string walls_of(const Frame& frame, const core::Domain& d) {
  const auto line = [&](double x0, double y0, double x1, double y1, core::Boundary kind) {
    const bool solid =
        kind == core::Boundary::no_slip || kind == core::Boundary::free_slip;
    return fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' {}/>\n", frame.x(x0),
                       frame.y(y0), frame.x(x1), frame.y(y1),
                       solid ? "stroke-width='3'" : "stroke-width='1' stroke-dasharray='6 4'");
  };
  const double right = d.left + d.width;
  return "<g stroke='#333' stroke-linecap='square'>\n" +
         line(d.left, 0, d.left, d.height, d.sides) + line(right, 0, right, d.height, d.sides) +
         line(d.left, 0, right, 0, d.bottom) + line(d.left, d.height, right, d.height, d.top) +
         "</g>\n";
}

/// Scale of lengths, of colours and of arrows, right of the domain.
std::string scales_of(const Frame& frame, const core::Domain& d, double grain_max,
                      double fluid_max) {
  const double x = frame.x(d.left + d.width) + 20, length = round_number(0.25 * d.width);
  std::string text = "<g font-family='sans-serif' font-size='12' fill='#222'>\n";
  const double bar = length * frame.scale, bottom = frame.y(0) - 14;
  text += fmt::format(
      "<line x1='{0:.1f}' y1='{2:.1f}' x2='{1:.1f}' y2='{2:.1f}' stroke='#222' "
      "stroke-width='2'/><text x='{0:.1f}' y='{3:.1f}'>{4:g} mm</text>\n",
      x, x + std::min(bar, legend - 30), bottom, bottom + 14, 1e3 * length);
  const double top = margin, step = 12;
  text += fmt::format("<text x='{:.1f}' y='{:.1f}'>grains, m/s</text>\n", x, top + 4);
  for (int k = 0; k <= 10; ++k)
    text += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='16' height='{}' fill='{}'/>\n", x,
                        top + 12 + step * (10 - k), step, colour_of(0.1 * k));
  text += fmt::format(
      "<text x='{0:.1f}' y='{1:.1f}'>{2:.3g}</text><text x='{0:.1f}' y='{3:.1f}'>0</text>\n",
      x + 22, top + 24, grain_max, top + 12 + 11 * step);
  text += fmt::format("<text x='{:.1f}' y='{:.1f}'>fluid, longest: {:.3g} m/s</text>\n", x,
                      top + 170, fluid_max);
  return text + "</g>\n";
}

}  // namespace

std::string snapshot_svg(const core::Scenario& scenario, const ObservedStep& now) {
  const core::Domain& d = now.walls;
  const double scale = std::min(picture_width / d.width, picture_height_max / d.height);
  const Frame frame{d.left, d.height, scale};
  const double width = 2 * margin + d.width * scale + legend;
  const double height = 2 * margin + d.height * scale;
  double fluid_max = 0;
  for (const core::FluidAtPoint& at : now.lattice.at)
    fluid_max = std::max(fluid_max, std::hypot(at.velocity[0], at.velocity[1]));
  std::string text = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0:.0f}' height='{1:.0f}' viewBox='0 0 "
      "{0:.0f} {1:.0f}'>\n<rect width='100%' height='100%' fill='white'/>\n"
      "<text x='{2}' y='24' font-family='sans-serif' font-size='14'>t = {3:.6g} s, step {4}"
      "</text>\n",
      width, height, margin, now.time, now.step);
  if (scenario.has_fluid()) text += fluid_arrows(frame, now.lattice, fluid_max);
  text += grain_discs(frame, now.grains, now.group.max_speed);
  text += walls_of(frame, d);
  text += scales_of(frame, d, now.group.max_speed, fluid_max);
  return text + "</svg>\n";
}

}  // namespace varve::tools
