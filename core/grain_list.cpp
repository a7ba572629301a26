// Lists of grains as comma-separated text.
#include <charconv>
#include <cmath>

#include "core/criteria.h"
#include "core/grain_placement.h"
#include "core/parameters.h"

namespace varve::core {
namespace {

constexpr std::size_t problems_max = 20;
constexpr std::size_t grains_max = 10'000'000;
constexpr std::array<std::string_view, 10> column_names{"x",  "y",  "z",  "vx", "vy",
                                                        "vz", "wx", "wy", "wz", "species"};
constexpr std::size_t species_column = 9;

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::string quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text.substr(0, 40))
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return out + (text.size() > 40 ? "...'" : "'");
}

class ListReader {
 public:
  explicit ListReader(const Scenario& scenario)
      : species_(species_of(scenario)), flat_(scenario.domain.dimension == 2) {}

  std::variant<std::vector<ListedGrain>, std::vector<ListProblem>> run(std::string_view text) {
    constexpr std::string_view utf8_mark = "\xef\xbb\xbf";
    if (text.starts_with(utf8_mark)) text.remove_prefix(utf8_mark.size());
    int number = 0;
    while (!text.empty() && problems_.size() < problems_max) {
      const std::size_t end = text.find('\n');
      const std::string_view line = trim(text.substr(0, end));
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
      line_ = ++number;
      if (line.empty() || line.front() == '#') continue;
      if (columns_.empty())
        read_header(line);
      else
        read_grain(line);
      if (grains_.size() > grains_max) {
        problem("more than " + std::to_string(grains_max) + " grains");
        break;
      }
    }
    if (problems_.empty() && grains_.empty())
      problem(columns_.empty() ? "empty; expected a line of column names, such as x,y,species"
                               : "no grain; expected one a line");
    if (!problems_.empty()) return std::move(problems_);
    return std::move(grains_);
  }

 private:
  void problem(std::string text) { problems_.push_back({line_, std::move(text)}); }

  void read_header(std::string_view line) {
    for (const std::string_view cell : split(line)) {
      std::size_t k = 0;
      while (k < column_names.size() && column_names[k] != cell) ++k;
      if (k == column_names.size())
        problem(quoted(cell) + " is no column; expected any of x, y, z, species, vx, vy, vz, wx, "
                               "wy, wz");
      else if (flat_ && (k == 2 || k == 5 || k == 6 || k == 7))
        problem("column " + quoted(cell) + " needs domain.dimension = 3");
      for (const std::size_t earlier : columns_)
        if (earlier == k && k < column_names.size()) problem("column " + quoted(cell) + " twice");
      columns_.push_back(k);
    }
    for (std::size_t k = 0; k < (flat_ ? 2u : 3u); ++k) {
      bool found = false;
      for (const std::size_t column : columns_) found = found || column == k;
      if (!found) problem("no column '" + std::string(column_names[k]) + "'");
    }
  }

  void read_grain(std::string_view line) {
    const std::vector<std::string_view> cells = split(line);
    if (cells.size() != columns_.size())
      return problem(std::to_string(cells.size()) + " values; expected " +
                     std::to_string(columns_.size()));
    ListedGrain grain;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      if (columns_[k] == species_column) {
        read_species(cells[k], grain);
        continue;
      }
      double value = 0;
      const char* end = cells[k].data() + cells[k].size();
      const auto read = std::from_chars(cells[k].data(), end, value);
      if (read.ec != std::errc{} || read.ptr != end || !std::isfinite(value))
        return problem(std::string(column_names[columns_[k]]) + ": " + quoted(cells[k]) +
                       " is not a finite number");
      if (columns_[k] < 3) grain.position[columns_[k]] = value;
      else if (columns_[k] < 6) grain.velocity[columns_[k] - 3] = value;
      else grain.spin[columns_[k] - 6] = value;
    }
    grains_.push_back(grain);
  }

  void read_species(std::string_view cell, ListedGrain& grain) {
    for (std::uint32_t k = 0; k < species_.size(); ++k)
      if (species_[k].name == cell || std::to_string(k) == cell) {
        grain.species = k;
        return;
      }
    std::string known;
    for (const GrainSpecies& each : species_)
      known += (known.empty() ? "" : ", ") + each.name;
    problem("species: " + quoted(cell) + " is not known; expected one of " + known +
            " or its number");
  }

  std::vector<GrainSpecies> species_;
  bool flat_;
  int line_ = 0;
  std::vector<std::size_t> columns_;
  std::vector<ListedGrain> grains_;
  std::vector<ListProblem> problems_;
};

}  // namespace

std::variant<std::vector<ListedGrain>, std::vector<ListProblem>> read_grain_list(
    std::string_view text, const Scenario& scenario) {
  return ListReader(scenario).run(text);
}

}  // namespace varve::core
