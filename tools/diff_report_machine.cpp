// The forms of a diff report that machines read.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/diff_report.h"

namespace varve::tools {
namespace {

using json = nlohmann::ordered_json;
using io::FieldDifference;

constexpr std::size_t annotations_max = 10;

// 64-bit whole numbers travel as strings: many readers of JSON only have doubles.
json whole(std::uint64_t value) { return std::to_string(value); }

// JSON has no infinity; null says that the difference can't be measured.
json real(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json text_or_null(const std::string& text) { return text.empty() ? json(nullptr) : json(text); }

json first_json(const FirstDifference& first) {
  json out;
  out["step"] = whole(first.step);
  out["time_s"] = first.time;
  out["field"] = text_or_null(first.field);
  out["particle"] = text_or_null(first.particle);
  out["a"] = text_or_null(first.a);
  out["b"] = text_or_null(first.b);
  out["ulp"] = first.ulp ? whole(*first.ulp) : json(nullptr);
  out["a_decimal"] = text_or_null(first.a_decimal);
  out["b_decimal"] = text_or_null(first.b_decimal);
  if (first.absolute) out["absolute"] = real(*first.absolute);
  if (first.relative) out["relative"] = real(*first.relative);
  if (first.last_equal) out["last_equal_step"] = whole(*first.last_equal);
  if (!first.why_no_field.empty()) out["why_no_field"] = first.why_no_field;
  return out;
}

json fields_json(const std::vector<FieldDifference>& fields) {
  json out = json::array();
  for (const FieldDifference& field : fields) {
    json entry;
    entry["field"] = field.name;
    entry["unit"] = field.unit;
    entry["compared"] = whole(field.compared);
    entry["differing"] = whole(field.differing);
    entry["beyond_tolerance"] = whole(field.beyond);
    entry["particles"] = whole(field.particles);
    entry["largest_absolute"] = field.largest ? real(field.largest->absolute) : json(0);
    entry["largest_particle"] =
        field.largest ? json(io::particle_name(field.largest->particle)) : json(nullptr);
    entry["largest_relative"] = real(field.largest_relative);
    entry["largest_ulp"] = whole(field.largest_ulp);
    entry["not_finite"] = whole(field.not_finite);
    entry["zero_signs"] = whole(field.zero_signs);
    entry["only_a"] = whole(field.only_a);
    entry["only_b"] = whole(field.only_b);
    out.push_back(std::move(entry));
  }
  return out;
}

json growth_json(const std::vector<GrowthSample>& growth) {
  json out = json::array();
  for (const GrowthSample& sample : growth)
    out.push_back({{"step", whole(sample.step)},
                   {"time_s", sample.time},
                   {"fields", fields_json(sample.fields)}});
  return out;
}

std::string field_summary(const FieldDifference& field) {
  std::string out = fmt::format("{}: {} of {} values differ, {} beyond tolerance", field.name,
                                field.differing, field.compared, field.beyond);
  if (field.largest)
    out += fmt::format(", largest {:.3g} {} ({} ULPs) at particle {}", field.largest->absolute,
                       field.unit, field.largest_ulp, io::particle_name(field.largest->particle));
  if (field.only_a != 0 || field.only_b != 0)
    out += fmt::format(", {} particles only in a, {} only in b", field.only_a, field.only_b);
  return out;
}

// Bytes of the character of two to four bytes that `text` starts with; 0 if it is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::size_t length = byte(0) >= 0xf5   ? 0
                             : byte(0) >= 0xf0 ? 4
                             : byte(0) >= 0xe0 ? 3
                             : byte(0) >= 0xc2 ? 2
                                               : 0;
  if (length == 0 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(i) & 0xc0) != 0x80) return 0;
  // Overlong forms, surrogates and what lies beyond the last code point.
  if ((byte(0) == 0xe0 && byte(1) < 0xa0) || (byte(0) == 0xed && byte(1) >= 0xa0) ||
      (byte(0) == 0xf0 && byte(1) < 0x90) || (byte(0) == 0xf4 && byte(1) >= 0x90))
    return 0;
  return length;
}

struct Case {
  std::string name, failure;  // no failure text: passed
};

std::vector<Case> cases_of(const DiffReport& report) {
  std::vector<Case> cases;
  const bool wrong = exit_code(report.verdict) != 0;
  cases.push_back({"comparison", wrong ? headline(report) : ""});
  for (const FieldDifference& field : report.fields) {
    const bool failed = wrong && (report.tolerance_given ? !field.within() : !field.equal());
    cases.push_back({"field " + field.name, failed ? field_summary(field) : ""});
  }
  return cases;
}

}  // namespace

std::string json_report(const DiffReport& report) {
  json out;
  out["schema"] = "varve.diff/1";
  out["a"] = report.a;
  out["b"] = report.b;
  out["verdict"] = std::string(name_of(report.verdict));
  out["first"] = report.first ? first_json(*report.first) : json(nullptr);
  out["steps_compared"] = whole(report.steps_compared);
  out["header_reads"] = whole(std::max(report.header_reads_a, report.header_reads_b));
  out["header_reads_by_log"] = {{"a", whole(report.header_reads_a)},
                                {"b", whole(report.header_reads_b)}};
  out["from"] = whole(report.from);
  out["to"] = whole(report.to);
  out["reasons"] = report.reasons;
  out["relation"] = text_or_null(report.relation);
  out["chain"] = text_or_null(report.chain);
  out["genesis"] = json::array();
  for (const GenesisDifference& d : report.genesis)
    out["genesis"].push_back({{"part", d.part}, {"key", d.key}, {"a", d.a}, {"b", d.b}});
  out["tolerance_given"] = report.tolerance_given;
  if (!report.selected.empty()) out["selected_fields"] = report.selected;
  if (report.first_bitwise) out["first_bitwise"] = first_json(*report.first_bitwise);
  out["fields"] = fields_json(report.fields);
  out["growth"] = growth_json(report.growth);
  if (report.reconvergence) {
    const Reconvergence& found = *report.reconvergence;
    const auto step = [](const std::optional<std::uint64_t>& s) {
      return s ? whole(*s) : json(nullptr);
    };
    out["reconvergence"] = {{"equal_steps", whole(found.equal_steps)},
                            {"first_equal", step(found.first_equal)},
                            {"equal_to_the_end", step(found.equal_to_the_end)}};
  }
  out["notes"] = report.notes;
  // Names of files may hold bytes that are no UTF-8; they are replaced, not fatal.
  return out.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

std::string xml_escape(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (static_cast<unsigned char>(c) >= 0x80) {
      // A name that is no UTF-8 would make the whole document unreadable.
      const std::size_t length = utf8_length(text.substr(i));
      out += length == 0 ? std::string_view("?") : text.substr(i, length);
      i += length == 0 ? 0 : length - 1;
      continue;
    }
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&apos;";
        break;
      case '\n':
        out += "&#10;";
        break;
      case '\r':
        out += "&#13;";
        break;
      case '\t':
        out += "&#9;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? '?' : c;
    }
  }
  return out;
}

std::string junit_report(const DiffReport& report, double seconds) {
  const std::vector<Case> cases = cases_of(report);
  const auto failures =
      std::count_if(cases.begin(), cases.end(), [](const Case& c) { return !c.failure.empty(); });
  const std::string suite = xml_escape(fmt::format("varve diff {} {}", report.a, report.b));
  std::string out = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  out += fmt::format("<testsuites tests=\"{}\" failures=\"{}\">\n", cases.size(), failures);
  out += fmt::format(
      "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" "
      "time=\"{:.3f}\">\n",
      suite, cases.size(), failures, seconds);
  for (const Case& c : cases) {
    const double time = &c == &cases.front() ? seconds : 0;
    out += fmt::format("    <testcase classname=\"varve.diff\" name=\"{}\" time=\"{:.3f}\"",
                       xml_escape(c.name), time);
    if (c.failure.empty()) {
      out += "/>\n";
      continue;
    }
    out += fmt::format(
        ">\n      <failure type=\"{}\" message=\"{}\">{}</failure>\n    </testcase>\n",
        name_of(report.verdict), xml_escape(c.failure), xml_escape(text_report(report, false)));
  }
  return out + "  </testsuite>\n</testsuites>\n";
}

std::string github_escape(std::string_view text, bool property) {
  std::string out;
  for (const char c : text) {
    if (c == '%')
      out += "%25";
    else if (c == '\r')
      out += "%0D";
    else if (c == '\n')
      out += "%0A";
    else if (property && c == ':')
      out += "%3A";
    else if (property && c == ',')
      out += "%2C";
    else
      out += c;
  }
  return out;
}

std::string github_report(const DiffReport& report) {
  if (exit_code(report.verdict) == 0) return "";
  std::vector<std::string> lines{headline(report)};
  for (const FieldDifference& field : report.fields)
    if (!field.equal()) lines.push_back(field_summary(field));
  for (const GenesisDifference& d : report.genesis)
    lines.push_back(fmt::format("{} {} differs: a={} b={}", d.part, d.key, d.a, d.b));
  if (lines.size() > annotations_max) {
    const std::size_t hidden = lines.size() - (annotations_max - 1);
    lines.resize(annotations_max - 1);
    lines.push_back(fmt::format("and {} more findings; see the report", hidden));
  }
  const std::string title =
      github_escape(fmt::format("varve diff {} {}", report.a, report.b), true);
  std::string out;
  for (const std::string& line : lines)
    out += fmt::format("::error title={}::{}\n", title, github_escape(line, false));
  return out;
}

}  // namespace varve::tools
