// varve show: the state at a step.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "io/errors.h"
#include "io/frame_diff.h"
#include "io/log_reader.h"
#include "tools/cli.h"
#include "tools/family.h"
#include "tools/recording.h"
#include "tools/session.h"
#include "tools/simulation_engine.h"

namespace varve::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Which particles of which population are shown.
struct Selection {
  std::vector<std::size_t> fields;
  std::string population;                  ///< of --particle POPULATION:ID; empty: any
  std::optional<std::uint64_t> particle;   ///< id
};

std::string known_fields(const io::Schema& schema) {
  std::string names;
  for (const io::FieldDescriptor& field : schema.fields)
    names += (names.empty() ? "" : ", ") + field.name;
  return names;
}

Selection select(const Invocation& invocation, const io::Schema& schema) {
  Selection selection;
  if (invocation.has("fields")) {
    const std::string list = invocation.value("fields") + ",";
    for (std::size_t begin = 0, comma; (comma = list.find(',', begin)) != std::string::npos;
         begin = comma + 1) {
      const std::string name = list.substr(begin, comma - begin);
      if (name.empty()) continue;
      bool found = false;
      for (std::size_t f = 0; f < schema.fields.size(); ++f) {
        const io::FieldDescriptor& field = schema.fields[f];
        if (field.name != name && field.population != name) continue;
        found = true;
        selection.fields.push_back(f);
      }
      if (!found)
        throw UsageError(fmt::format("--fields: no field or population '{}'; this log has {}", name,
                                     known_fields(schema)));
    }
  } else {
    for (std::size_t f = 0; f < schema.fields.size(); ++f) selection.fields.push_back(f);
  }
  if (invocation.has("particle")) {
    std::string text = invocation.value("particle");
    if (const std::size_t colon = text.find(':'); colon != std::string::npos) {
      selection.population = text.substr(0, colon);
      text.erase(0, colon + 1);
    }
    std::uint64_t id = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), id);
    if (text.empty() || read.ec != std::errc{} || read.ptr != text.data() + text.size())
      throw UsageError(fmt::format("--particle: '{}' is no id; expected a whole number, or "
                                   "POPULATION:ID such as grains:3",
                                   invocation.value("particle")));
    selection.particle = id;
  }
  return selection;
}

/// Index of the particle in the population of `field`; nothing where it has none of this id.
std::optional<std::uint64_t> index_of(const io::Schema& schema, const io::FrameView& frame,
                                      const io::FieldDescriptor& field, std::uint64_t id) {
  for (std::size_t f = 0; f < schema.fields.size(); ++f) {
    const io::FieldDescriptor& ids = schema.fields[f];
    if (!ids.is_id || ids.population != field.population || ids.components != 1) continue;
    for (std::uint64_t i = 0; i < frame.fields[f].count; ++i)
      if (io::scalar_at(ids, frame.fields[f], i).bits == id) return i;
  }
  return std::nullopt;
}

/// One field's particles to show: [first, last).
struct Shown {
  std::size_t field;
  std::uint64_t first, last;
};

std::vector<Shown> shown_fields(const io::Schema& schema, const io::FrameView& frame,
                                const Selection& selection) {
  std::vector<Shown> shown;
  for (const std::size_t f : selection.fields) {
    const io::FieldDescriptor& field = schema.fields[f];
    if (!selection.particle) {
      shown.push_back({f, 0, frame.fields[f].count});
      continue;
    }
    if (!selection.population.empty() && field.population != selection.population) continue;
    if (const auto index = index_of(schema, frame, field, *selection.particle))
      shown.push_back({f, *index, *index + 1});
  }
  if (shown.empty() && selection.particle)
    throw UsageError(fmt::format(
        "--particle: no particle {}{} at step {}",
        selection.population.empty() ? "" : selection.population + ":", *selection.particle,
        frame.step));
  return shown;
}

std::string text_of(const io::Scalar& value, bool hex) {
  return hex && value.is_real() ? value.hex() : value.decimal();
}

/// Shortest decimals are JSON numbers; what is none in JSON (hex floats, 64-bit integers, NaN) is a
/// string.
Json json_of(const io::Scalar& value, bool hex) {
  const bool number = value.is_real() ? !hex && std::isfinite(value.as_double())
                                      : value.type != io::ScalarType::u64;
  if (!number) return text_of(value, hex);
  // Parsing the shortest text keeps f32 values short: 0.1, not 0.10000000149011612.
  return Json::parse(value.decimal());
}

Json values_json(const io::FieldDescriptor& field, const io::FieldView& view, const Shown& shown,
                 bool hex) {
  Json values = Json::array();
  for (std::uint64_t i = shown.first; i < shown.last; ++i) {
    if (field.components == 1) {
      values.push_back(json_of(io::scalar_at(field, view, i), hex));
      continue;
    }
    Json row = Json::array();
    for (std::uint32_t c = 0; c < field.components; ++c)
      row.push_back(json_of(io::scalar_at(field, view, i * field.components + c), hex));
    values.push_back(std::move(row));
  }
  return values;
}

void print_json(const io::LogReader& log, const io::StepHeader& header, const io::FrameView& frame,
                const std::vector<Shown>& shown, bool hex) {
  const io::Schema& schema = log.genesis().schema;
  Json object{{"schema", "varve.show/1"},
              {"run", log.path()},
              {"step", std::to_string(header.step)},
              {"time_s", header.time},
              {"dt_s", header.dt},
              {"digest", header.digest.hex()},
              {"chain", header.chain.hex()}};
  object["fields"] = Json::object();
  object["units"] = Json::object();
  for (const Shown& one : shown) {
    const io::FieldDescriptor& field = schema.fields[one.field];
    object["fields"][field.name] = values_json(field, frame.fields[one.field], one, hex);
    object["units"][field.name] = field.unit;
  }
  print(object.dump() + "\n");
}

/// "count, smallest and largest": one line per field, where nothing narrower was asked for.
std::string range_line(const io::FieldDescriptor& field, const io::FieldView& view, bool hex) {
  std::string line = fmt::format("  {:<28} {:>8}", field.name, view.count);
  const std::uint64_t scalars = view.count * field.components;
  if (scalars == 0) return line + "\n";
  io::Scalar low = io::scalar_at(field, view, 0), high = low;
  for (std::uint64_t i = 1; i < scalars; ++i) {
    const io::Scalar value = io::scalar_at(field, view, i);
    const auto below = [](const io::Scalar& a, const io::Scalar& b) {
      return a.is_real() ? a.as_double() < b.as_double() : a.bits < b.bits;
    };
    if (below(value, low)) low = value;
    if (below(high, value)) high = value;
  }
  line += fmt::format("  {} .. {}", text_of(low, hex), text_of(high, hex));
  return line + (field.unit.empty() ? "" : " " + field.unit) + "\n";
}

void print_text(const io::LogReader& log, const io::StepHeader& header, const io::FrameView& frame,
                const std::vector<Shown>& shown, bool every_value, bool hex) {
  const io::Schema& schema = log.genesis().schema;
  print(fmt::format("{}: step {}, t = {} s, dt = {} s\ndigest {}\nchain  {}\n", log.path(),
                    header.step, header.time, header.dt, header.digest.hex(), header.chain.hex()));
  for (const Shown& one : shown) {
    const io::FieldDescriptor& field = schema.fields[one.field];
    const io::FieldView& view = frame.fields[one.field];
    if (!every_value) {
      print(range_line(field, view, hex));
      continue;
    }
    print(fmt::format("{}{}:\n", field.name, field.unit.empty() ? "" : " [" + field.unit + "]"));
    for (std::uint64_t i = one.first; i < one.last; ++i) {
      std::string line = " ";
      for (std::uint32_t c = 0; c < field.components; ++c)
        line += " " + text_of(io::scalar_at(field, view, i * field.components + c), hex);
      print(line + "\n");
    }
  }
}

int show(const Invocation& invocation) {
  const auto parent_option = invocation.has("parent")
                                 ? std::optional<std::string>(invocation.value("parent"))
                                 : std::nullopt;
  const auto [log, step] = open_at(io::LogReader::open(invocation.arguments.at(0)),
                                   invocation.value("at"), parent_option);
  warn_if_incomplete(*log);
  const Selection selection = select(invocation, log->genesis().schema);
  const core::RunOptions options{threads_option(invocation), 0};
  const io::Frame frame = state_at(
      *log, step, [&run = *log, at = step, &options]() -> std::unique_ptr<io::Engine> {
        require_this_engine(run, fmt::format("; the state of step {} is not stored and can't be "
                                             "made again", at));
        return SimulationEngine::of_genesis(run.genesis(), run.path(), options);
      });
  const io::FrameView view = frame.view();
  const auto header = log->header(step);
  const std::vector<Shown> shown = shown_fields(log->genesis().schema, view, selection);
  const bool hex = invocation.has("hex");
  if (invocation.globals.json) {
    print_json(*log, *header, view, shown, hex);
  } else {
    print_text(*log, *header, view, shown, invocation.has("fields") || selection.particle, hex);
  }
  return exit_ok;
}

Verb verb() {
  Verb verb;
  verb.name = "show";
  verb.usage = "RUN";
  verb.summary = "Shows the state at a step: ranges of every field, or every value of some.";
  verb.description =
      "Steps whose state is not stored (tier digests, every k) are executed again from the\n"
      "nearest one that is. Decimals are the shortest that read back to the same bits.\n\n"
      "  varve show column.varve --at t=0.3s\n"
      "  varve show column.varve --at last --particle grains:3 --hex\n"
      "  varve show column.varve --at 1200 --fields grains.position,grains.velocity --json\n";
  verb.options = {
      {"at", "STEP", "which: 12000, t=0.3s, 50%, first, last, last-100", false, "last"},
      {"particle", "ID", "only this one; grains:ID or fluid:ID where both have it", false, ""},
      {"fields", "NAMES", "only these, comma between; a population stands for its fields", false,
       ""},
      {"hex", "", "reals as hexadecimal floats", false, ""},
      {"parent", "PATH", "log or folder with RUN's parent, if --at lies before RUN", false, ""},
      threads_spec(),
  };
  verb.arguments_min = verb.arguments_max = 1;
  verb.run = show;
  return verb;
}

}  // namespace
}  // namespace varve::tools

int main(int argc, char** argv) {
  return varve::tools::verb_main(argc, argv, varve::tools::verb());
}
