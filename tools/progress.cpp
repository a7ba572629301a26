#include "tools/progress.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <sys/ioctl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace varve::tools {

namespace {

ProgressMode resolve_mode(const Globals& globals) {
  if (globals.progress != ProgressMode::automatic) return globals.progress;
  if (globals.quiet) return ProgressMode::none;
  const char* terminal = std::getenv("TERM");
  const bool dumb = terminal == nullptr || std::string_view(terminal) == "dumb";
  return isatty(STDERR_FILENO) == 1 && !dumb ? ProgressMode::bar : ProgressMode::lines;
}

std::chrono::milliseconds interval(ProgressMode mode) {
  switch (mode) {
    case ProgressMode::bar: return std::chrono::milliseconds(100);
    case ProgressMode::json: return std::chrono::milliseconds(1000);
    default: return std::chrono::milliseconds(10000);
  }
}

std::size_t terminal_columns() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

}  // namespace

std::string human_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> units{"B", "kB", "MB", "GB", "TB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; value >= 999.5 && unit + 1 < units.size(); ++unit) value /= 1000;
  if (unit == 0) return fmt::format("{} B", bytes);
  return fmt::format("{:.{}f} {}", value, value < 9.995 ? 2 : value < 99.95 ? 1 : 0, units[unit]);
}

std::string human_duration(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(std::max(0.0, seconds)));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

Progress::Progress(const Globals& globals, std::string title, ProgressGoal goal,
                   ProgressPoint start)
    : mode_(resolve_mode(globals)), title_(std::move(title)), goal_(goal), start_(start),
      began_(Clock::now()), next_(began_ + interval(mode_)) {}

Progress::~Progress() { finish(); }

bool Progress::due() const { return mode_ != ProgressMode::none && Clock::now() >= next_; }

void Progress::update(const ProgressPoint& point) {
  if (!due()) return;
  const Clock::time_point now = Clock::now();
  next_ = now + interval(mode_);
  show(point, std::chrono::duration<double>(now - began_).count());
}

void Progress::finish() {
  if (mode_ == ProgressMode::bar && shown_) std::fputs("\r\x1b[K", stderr);
  shown_ = false;
}

void Progress::show(const ProgressPoint& point, double wall_s) {
  shown_ = true;
  switch (mode_) {
    case ProgressMode::bar: fmt::print(stderr, "\r{}\x1b[K", bar(point, wall_s)); break;
    case ProgressMode::json: fmt::print(stderr, "{}\n", json(point, wall_s)); break;
    default: fmt::print(stderr, "{}: {}\n", title_, line(point, wall_s)); break;
  }
  std::fflush(stderr);
}

std::optional<double> Progress::total_steps(const ProgressPoint& point) const {
  std::optional<double> total;
  if (goal_.last_step && *goal_.last_step > start_.step)
    total = static_cast<double>(*goal_.last_step - start_.step);
  if (goal_.until && point.dt > 0) {
    const double left = std::max(0.0, std::ceil((*goal_.until - point.time) / point.dt));
    const double by_time = static_cast<double>(point.step - start_.step) + left;
    total = total ? std::min(*total, by_time) : by_time;
  }
  return total;
}

namespace {

struct Rates {
  double steps_per_s = 0;
  std::optional<double> fraction, left_s;
};

Rates rates(double done, std::optional<double> total, double wall_s) {
  Rates r;
  if (wall_s > 0) r.steps_per_s = done / wall_s;
  if (!total || *total <= 0) return r;
  r.fraction = std::min(1.0, done / *total);
  if (r.steps_per_s > 0) r.left_s = std::max(0.0, *total - done) / r.steps_per_s;
  return r;
}

}  // namespace

std::string Progress::line(const ProgressPoint& point, double wall_s) const {
  const auto total = total_steps(point);
  const Rates r = rates(static_cast<double>(point.step - start_.step), total, wall_s);
  std::string text = fmt::format("step {}", point.step);
  if (total) text += fmt::format("/{:.0f}", static_cast<double>(start_.step) + *total);
  if (r.fraction) text += fmt::format(" ({:.1f} %)", 100 * *r.fraction);
  text += fmt::format(", t = {:.4g} s, {:.4g} steps/s", point.time, r.steps_per_s);
  if (point.log_bytes > 0) text += ", log " + human_bytes(point.log_bytes);
  if (r.left_s) text += ", ETA " + human_duration(*r.left_s);
  return text;
}

std::string Progress::bar(const ProgressPoint& point, double wall_s) const {
  const auto total = total_steps(point);
  const Rates r = rates(static_cast<double>(point.step - start_.step), total, wall_s);
  std::string text = title_ + " ";
  if (r.fraction) {
    constexpr std::size_t width = 10;
    const auto filled = static_cast<std::size_t>(*r.fraction * static_cast<double>(width));
    text += fmt::format("[{:#<{}}{:.<{}}] {:.1f}% ", "", filled, "", width - filled,
                        100 * *r.fraction);
  }
  text += fmt::format("{}", point.step);
  if (total) text += fmt::format("/{:.0f}", static_cast<double>(start_.step) + *total);
  text += fmt::format(" t={:.3g}s {:.3g} steps/s", point.time, r.steps_per_s);
  if (point.log_bytes > 0) text += " " + human_bytes(point.log_bytes);
  if (r.left_s) text += " ETA " + human_duration(*r.left_s);
  const std::size_t columns = terminal_columns();
  if (text.size() >= columns) text.resize(columns - 1);
  return text;
}

std::string Progress::json(const ProgressPoint& point, double wall_s) const {
  const auto total = total_steps(point);
  const Rates r = rates(static_cast<double>(point.step - start_.step), total, wall_s);
  nlohmann::ordered_json object{{"schema", "varve.progress/1"},
                                {"step", std::to_string(point.step)},
                                {"time_s", point.time},
                                {"steps_per_s", r.steps_per_s},
                                {"log_bytes", std::to_string(point.log_bytes)}};
  if (r.fraction) object["fraction"] = *r.fraction;
  if (r.left_s) object["left_s"] = *r.left_s;
  return object.dump();
}

}  // namespace varve::tools
