#include "tools/diff_options.h"

#include <charconv>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "io/errors.h"

namespace varve::tools {
namespace {

io::Tolerance& tolerance_of(io::Tolerances& tolerances, const std::string& field) {
  if (field.empty()) return tolerances.all;
  for (auto& [name, tolerance] : tolerances.by_field)
    if (name == field) return tolerance;
  return tolerances.by_field.emplace_back(field, io::Tolerance{}).second;
}

template <class T>
T read_limit(const std::string& option, std::string_view text, const char* expected) {
  T value{};
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end.ec != std::errc{} || end.ptr != text.data() + text.size() || !(value >= T{}))
    throw UsageError(
        fmt::format("--{}: '{}' is not {}; write a value, or FIELD=VALUE", option, text, expected));
  return value;
}

// "VALUE" or "FIELD=VALUE".
void read_tolerances(const Invocation& invocation, const std::string& option,
                     io::Tolerances& tolerances) {
  for (const std::string& text : invocation.values(option)) {
    const std::size_t equals = text.find('=');
    const std::string field = equals == text.npos ? "" : text.substr(0, equals);
    const std::string_view value =
        std::string_view(text).substr(equals == text.npos ? 0 : equals + 1);
    io::Tolerance& tolerance = tolerance_of(tolerances, field);
    if (option == "ulp") {
      tolerance.ulp = read_limit<std::uint64_t>(option, value, "a whole number >= 0");
      continue;
    }
    const double number = read_limit<double>(option, value, "a finite number >= 0");
    if (!std::isfinite(number))
      throw UsageError(fmt::format("--{}: '{}' is not a finite number", option, value));
    (option == "abs" ? tolerance.absolute : tolerance.relative) = number;
  }
}

std::vector<std::string> split_names(const std::vector<std::string>& lists) {
  std::vector<std::string> out;
  for (const std::string& list : lists) {
    std::size_t start = 0;
    while (start <= list.size()) {
      const std::size_t comma = std::min(list.find(',', start), list.size());
      if (comma == start) throw UsageError(fmt::format("--fields: '{}' holds an empty name", list));
      out.push_back(list.substr(start, comma - start));
      start = comma + 1;
    }
  }
  return out;
}

}  // namespace

std::vector<OptionSpec> comparison_options() {
  return {
      {"from", "STEP", "first step to compare", false, ""},
      {"to", "STEP", "last step to compare", false, ""},
      {"fields", "LIST", "compare only these fields or populations, separated by commas", true, ""},
      {"abs", "X", "accept |a-b| <= X; FIELD=X for one field", true, ""},
      {"rel", "X", "accept |a-b| <= X max(|a|,|b|); FIELD=X for one field", true, ""},
      {"ulp", "N", "accept N representable values of distance; FIELD=N for one field", true, ""},
      {"reconverge", "", "look for later steps at which the states are equal again", false, ""},
      {"tables", "", "compare the event tables of every step as well (decides nothing)", false, ""},
  };
}

DiffOptions read_comparison_options(const Invocation& invocation) {
  DiffOptions out;
  if (invocation.has("from")) out.from = invocation.value("from");
  if (invocation.has("to")) out.to = invocation.value("to");
  out.fields = split_names(invocation.values("fields"));
  for (const char* option : {"abs", "rel", "ulp"})
    read_tolerances(invocation, option, out.tolerances);
  out.reconverge = invocation.has("reconverge");
  out.all_tables = invocation.has("tables");
  out.fine_growth = invocation.globals.verbosity > 0;
  return out;
}

void write_text_file(const std::string& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) throw io::LogError(io::ErrorKind::write_failed, path, "can't be created");
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if (std::fclose(file) != 0 || !written)
    throw io::LogError(io::ErrorKind::write_failed, path,
                       fmt::format("{} bytes could not be written", text.size()));
}

}  // namespace varve::tools
