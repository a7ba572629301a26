#include "tools/diff_report.h"

#include <algorithm>

#include <fmt/format.h>

namespace varve::tools {
namespace {

using io::FieldDifference;

constexpr std::size_t genesis_lines_max = 40;

std::string at_step(const FirstDifference& first) {
  return fmt::format("step {} (t={:.9g} s)", first.step, first.time);
}

std::string ulps(std::uint64_t n) { return fmt::format("{} ULP{}", n, n == 1 ? "" : "s"); }

std::string where(const FirstDifference& first) {
  std::string out = at_step(first);
  if (first.last_equal) {
    out = fmt::format("a step in {}..{} (t<={:.9g} s)", *first.last_equal + 1, first.step,
                      first.time);
    if (*first.last_equal + 1 == first.step) out = at_step(first);
  }
  if (first.field.empty())
    return first.why_no_field.empty() ? out : out + ", " + first.why_no_field;
  out += fmt::format(", field {}", first.field);
  if (!first.particle.empty()) out += fmt::format(", particle {}", first.particle);
  out += fmt::format(": a={} b={}", first.a, first.b);
  if (first.ulp) out += fmt::format(" ({})", ulps(*first.ulp));
  return out;
}

std::string steps_text(const DiffReport& report) {
  return fmt::format("steps {}..{} ({} compared)", report.from, report.to, report.steps_compared);
}

std::string largest_text(const FieldDifference& field) {
  if (!field.largest) return "";
  return fmt::format("{:.3g}{}{} at particle {}", field.largest->absolute,
                     field.unit.empty() ? "" : " ", field.unit,
                     io::particle_name(field.largest->particle));
}

void add_genesis(const DiffReport& report, std::string& out) {
  if (report.genesis.empty()) {
    out += "inputs: no difference in parameters, models, engine or build\n";
    return;
  }
  out += "inputs that differ:\n";
  std::size_t shown = 0;
  for (const GenesisDifference& d : report.genesis) {
    if (shown++ == genesis_lines_max) {
      out += fmt::format("  ... and {} more\n", report.genesis.size() - genesis_lines_max);
      break;
    }
    out += fmt::format("  {} {}: a={} b={}\n", d.part, d.key, d.a, d.b);
  }
}

void add_values(const FirstDifference& first, std::string& out) {
  if (!first.ulp) return;
  out += fmt::format("{}, particle {}:\n", first.field, first.particle);
  out += fmt::format("  a = {}  ({})\n  b = {}  ({})\n", first.a, first.a_decimal, first.b,
                     first.b_decimal);
  if (first.absolute && first.relative)
    out += fmt::format("  |a-b| = {:.6g}, relative {:.3g}\n", *first.absolute, *first.relative);
}

void add_fields(const DiffReport& report, std::string& out) {
  if (report.fields.empty()) return;
  const std::uint64_t step = report.first_bitwise ? report.first_bitwise->step : report.first->step;
  out += fmt::format("fields at step {}:\n", step);
  for (const FieldDifference& field : report.fields) {
    if (field.equal()) continue;
    out += fmt::format("  {}: {} of {} values differ", field.name, field.differing, field.compared);
    if (report.tolerance_given) out += fmt::format(", {} beyond tolerance", field.beyond);
    if (field.particles != 0) out += fmt::format(", {} particles", field.particles);
    if (field.largest) {
      out += fmt::format("; largest {}, {}", largest_text(field), ulps(field.largest_ulp));
      if (field.real) out += fmt::format(", relative {:.3g}", field.largest_relative);
    }
    if (field.not_finite != 0) out += fmt::format("; {} with NaN or infinity", field.not_finite);
    if (field.zero_signs != 0) out += fmt::format("; {} in the sign of zero", field.zero_signs);
    if (field.only_a != 0)
      out += fmt::format("; {} particles only in a (first {})", field.only_a,
                         io::particle_name(*field.first_only_a));
    if (field.only_b != 0)
      out += fmt::format("; {} particles only in b (first {})", field.only_b,
                         io::particle_name(*field.first_only_b));
    out += "\n";
  }
}

void add_growth(const DiffReport& report, std::string& out) {
  if (report.growth.empty()) return;
  out += "growth of the largest difference:\n";
  for (const GrowthSample& sample : report.growth) {
    out += fmt::format("  step {} (t={:.9g} s):", sample.step, sample.time);
    bool any = false;
    for (const FieldDifference& field : sample.fields) {
      if (!field.real || !field.largest) continue;
      out +=
          fmt::format("{} {} {:.3g}{}{} ({})", any ? "," : "", field.name, field.largest->absolute,
                      field.unit.empty() ? "" : " ", field.unit, ulps(field.largest_ulp));
      any = true;
    }
    const bool other = std::any_of(sample.fields.begin(), sample.fields.end(),
                                   [](const FieldDifference& field) { return !field.equal(); });
    out += any ? "\n" : other ? " only whole numbers or particles differ\n" : " states equal\n";
  }
}

void add_reconvergence(const Reconvergence& found, std::string& out) {
  if (found.equal_to_the_end)
    out += fmt::format("the states are equal again from step {} to the end\n",
                       *found.equal_to_the_end);
  else if (found.first_equal)
    out += fmt::format("the states are equal again at {} later steps, first at step {}\n",
                       found.equal_steps, *found.first_equal);
  else
    out += "the states are not equal again at any later step\n";
}

}  // namespace

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::identical:
      return "identical";
    case Verdict::within_tolerance:
      return "within_tolerance";
    case Verdict::different:
      return "different";
    default:
      return "not_comparable";
  }
}

int exit_code(Verdict verdict) {
  switch (verdict) {
    case Verdict::identical:
    case Verdict::within_tolerance:
      return 0;
    case Verdict::different:
      return 1;
    default:
      return 2;
  }
}

void describe_first(const io::FrameDifference& states, bool beyond_tolerance,
                    FirstDifference& out) {
  const FieldDifference* field = beyond_tolerance ? states.first_beyond() : states.first();
  if (field == nullptr) return;
  const auto& value = beyond_tolerance ? field->first_beyond : field->first;
  if (value) {
    out.field = io::component_name(*field, value->component);
    out.particle = io::particle_name(value->particle);
    out.a = value->a.hex();
    out.b = value->b.hex();
    out.a_decimal = value->a.decimal();
    out.b_decimal = value->b.decimal();
    out.ulp = value->ulp;
    out.absolute = value->absolute;
    out.relative = value->relative;
    return;
  }
  // Only the set of particles differs: name the smaller id of the two that are first.
  const auto& only_a = field->first_only_a;
  const auto& only_b = field->first_only_b;
  const bool in_a = only_a && (!only_b || *only_a < *only_b);
  out.field = field->name;
  out.particle = io::particle_name(in_a ? *only_a : *only_b);
  out.a = out.a_decimal = in_a ? "present" : "absent";
  out.b = out.b_decimal = in_a ? "absent" : "present";
}

std::string headline(const DiffReport& report) {
  switch (report.verdict) {
    case Verdict::identical: {
      std::string out = "IDENTICAL " + steps_text(report);
      if (!report.selected.empty())
        out += fmt::format(" in {}", fmt::join(report.selected, ", "));
      else if (!report.chain.empty())
        out += ", chain " + report.chain;
      return out;
    }
    case Verdict::within_tolerance:
      return fmt::format("WITHIN TOLERANCE, not bitwise: {}; first at {}", steps_text(report),
                         where(*report.first));
    case Verdict::different:
      return "DIFFER first at " + where(*report.first);
    default:
      return fmt::format("NOT COMPARABLE: {}", fmt::join(report.reasons, "; "));
  }
}

std::string text_report(const DiffReport& report, bool quiet) {
  std::string out = headline(report) + "\n";
  if (quiet) return out;
  if (!report.relation.empty()) out += report.relation + "\n";
  add_genesis(report, out);
  if (report.first && report.verdict == Verdict::different) add_values(*report.first, out);
  if (report.first_bitwise)
    out += fmt::format("first difference of any size: {}\n", where(*report.first_bitwise));
  add_fields(report, out);
  add_growth(report, out);
  if (report.reconvergence) add_reconvergence(*report.reconvergence, out);
  for (const std::string& note : report.notes) out += "note: " + note + "\n";
  if (report.verdict == Verdict::different)
    out += fmt::format("{}; {} and {} header reads\n", steps_text(report), report.header_reads_a,
                       report.header_reads_b);
  return out;
}

}  // namespace varve::tools
