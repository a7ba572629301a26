// Small scenes with fluid, grains, contacts and changes of geometry, run under every thread count
// and with neighbour lists rebuilt at random; every step's digest must be the same. What it prints
// is the same text on every compiler, optimisation level, instruction set and byte order.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/pair_sweeps.h"
#include "core/parameters.h"
#include "core/simulation.h"
#include "io/digest.h"
#include "tests/matrix/fp_environment.h"

namespace {

using namespace varve;

struct Change {
  std::uint64_t step;
  std::vector<std::pair<std::string, std::string>> settings;
};

struct Scene {
  std::string name;
  core::Scenario scenario;
  std::uint64_t steps = 60;
  bool expects_contacts = true;
  std::vector<Change> changes = {};
};

struct Variant {
  unsigned threads = 1;
  std::uint64_t rebuild_seed = 0;
  std::uint64_t restore_at = 0;  // 0: never; else the state moves into a fresh engine at this step
  int instruction_set = -1;      // of RunOptions
  bool own_parts_only = true;    // else threads take over from each other, as they do in a run
};

struct Trace {
  std::vector<io::Digest> digests;  // per step, from the first state on
  io::Digest chain;
  std::size_t contacts_most = 0;
  std::uint64_t fluid = 0, grains = 0;
  std::vector<std::uint64_t> items_per_thread;
};

[[noreturn]] void fail(const std::string& text) { throw std::runtime_error(text); }

// ---- scenes ------------------------------------------------------------------------------------

/// The study's fluid and grains in a box so small that -O0 under an emulator is bearable.
core::Scenario box(double width, double height) {
  core::Scenario scenario;
  scenario.domain.width = width;
  scenario.domain.height = height;
  scenario.fluid.spacing = 1e-3;
  scenario.fluid.sound_speed = 2.5;
  scenario.grains.diameter = 2.5e-3;
  scenario.grains.density = 2000;
  scenario.time.steps = 1000;
  return scenario;
}

core::Scenario with_grains(core::Scenario scenario, std::int64_t rows, std::int64_t columns,
                           double lowest_y, double speed_down) {
  scenario.grains.rows = rows;
  scenario.grains.columns = columns;
  scenario.grains.lowest_y = lowest_y;
  scenario.grains.gap = 0.02;
  scenario.grains.jitter = 0.005;
  scenario.grains.velocity_y = -speed_down;
  scenario.grains.velocity_x = 0.3 * speed_down;
  return scenario;
}

std::vector<Scene> scenes() {
  const core::Scenario disc = with_grains(box(0.02, 0.02), 1, 1, 1.4e-3, 0.05);
  const core::Scenario column = with_grains(box(0.02, 0.02), 3, 3, 1.4e-3, 0.05);
  core::Scenario tank = box(0.02, 0.02);
  tank.domain.top = core::Boundary::free;
  tank.fluid.jitter = 0.05;
  tank.fluid.level = 0.015;
  // Without fluid the step is far shorter, so everything begins nearly in touch.
  core::Scenario dry = with_grains(box(0.02, 0.02), 4, 4, 1.26e-3, 0.1);
  dry.fluid.present = false;
  dry.grains.gap = 0.004;
  dry.grains.jitter = 0.001;
  core::Scenario pipe = with_grains(box(0.02, 0.02), 3, 3, 4e-3, 0.05);
  pipe.domain.sides = core::Boundary::periodic;
  core::Scenario floats = column, mixed = disc;
  core::Scenario space = with_grains(box(8e-3, 8e-3), 1, 2, 1.3e-3, 0.05);
  floats.precision = core::Precision::float_;
  mixed.precision = core::Precision::mixed;
  space.domain.dimension = 3;
  space.domain.depth = 8e-3;
  core::Scenario space_floats = space;
  space_floats.precision = core::Precision::float_;
  core::Scenario shifted = box(0.02, 0.02), shifted_space = box(8e-3, 8e-3);
  for (core::Scenario* each : {&shifted, &shifted_space}) {
    each->fluid.shifting = 1;
    each->fluid.jitter = 0.2;
  }
  shifted.domain.lid_speed = 0.2;
  shifted_space.domain.dimension = 3;
  shifted_space.domain.depth = 8e-3;
  shifted_space.domain.sides = shifted_space.domain.faces = core::Boundary::periodic;
  shifted_space.domain.bottom = shifted_space.domain.top = core::Boundary::free_slip;
  shifted_space.fluid.initial = core::InitialFlow::taylor_green;
  shifted_space.fluid.initial_speed = 0.2;
  shifted_space.precision = core::Precision::mixed;
  return {
      {.name = "disc", .scenario = disc},
      {.name = "column", .scenario = column},
      {.name = "fluid", .scenario = tank, .expects_contacts = false},
      {.name = "grains", .scenario = dry, .steps = 120},
      {.name = "periodic", .scenario = pipe},
      {.name = "widths", .scenario = column, .changes = {
          {20, {{"domain.width", "0.024"}, {"contact.damping", "0.3"}}},
          {40, {{"domain.width", "0.022"}}}}},
      {.name = "floats", .scenario = floats, .steps = 30},
      {.name = "mixed", .scenario = mixed, .steps = 30},
      {.name = "space", .scenario = space, .steps = 20},
      {.name = "spacef", .scenario = space_floats, .steps = 20},
      {.name = "shift", .scenario = shifted, .expects_contacts = false},
      {.name = "swirl", .scenario = shifted_space, .steps = 20, .expects_contacts = false},
  };
}

// ---- from the engine's table to digests --------------------------------------------------------

io::ScalarType scalar_type(core::FieldType type) {
  switch (type) {
    case core::FieldType::f64: return io::ScalarType::f64;
    case core::FieldType::f32: return io::ScalarType::f32;
    case core::FieldType::u64: return io::ScalarType::u64;
    case core::FieldType::u32: return io::ScalarType::u32;
    case core::FieldType::u8: return io::ScalarType::u8;
  }
  fail("a field of unknown type");
}

io::Schema schema_of(const core::Simulation& simulation) {
  io::Schema schema;
  for (const core::FieldInfo& field : simulation.fields()) {
    schema.fields.push_back({.name = field.name,
                             .population = field.population,
                             .type = scalar_type(field.type),
                             .components = field.components,
                             .unit = field.unit,
                             .is_id = field.is_id,
                             .constant = field.constant,
                             .follows = field.follows});
  }
  return schema;
}

io::FrameView frame_of(const core::Simulation& simulation) {
  const core::Clock clock = simulation.clock();
  io::FrameView frame{clock.step, clock.time, clock.dt, {}, {}};
  for (std::size_t index = 0; index < simulation.fields().size(); ++index) {
    const core::FieldSpan span = simulation.field(index);
    frame.fields.push_back({span.count, span.bytes});
  }
  return frame;
}

std::uint64_t count_of(const core::Simulation& simulation, const std::string& population) {
  for (std::size_t index = 0; index < simulation.fields().size(); ++index) {
    if (simulation.fields()[index].population == population) return simulation.field(index).count;
  }
  return 0;
}

// ---- running -----------------------------------------------------------------------------------

/// A fresh engine holding a copy of the state of `old`.
std::unique_ptr<core::Simulation> moved(const core::Simulation& old,
                                        const core::RunOptions& options) {
  std::vector<std::vector<std::byte>> copies;
  std::vector<core::FieldSpan> values;
  copies.reserve(old.fields().size());
  for (std::size_t index = 0; index < old.fields().size(); ++index) {
    const core::FieldSpan span = old.field(index);
    copies.emplace_back(span.bytes.begin(), span.bytes.end());
    values.push_back({span.count, copies.back()});
  }
  return core::Simulation::restore(old.scenario(), values, options);
}

/// Calls `visit` with the first state and after every step, changes of that step included.
void run(const Scene& scene, const Variant& variant, std::uint64_t steps,
         const std::function<void(const core::Simulation&)>& visit) {
  core::Scenario scenario = scene.scenario;
  for (const core::Problem& problem : core::resolve(scenario)) {
    fail(scene.name + ": " + problem.key + ": " + problem.text);
  }
  const core::RunOptions options{.threads = variant.threads,
                                 .own_parts_only = variant.own_parts_only,
                                 .rebuild_seed = variant.rebuild_seed,
                                 .instruction_set = variant.instruction_set};
  auto simulation = core::Simulation::create(scenario, options);
  visit(*simulation);
  for (std::uint64_t step = 1; step <= steps; ++step) {
    simulation->advance();
    for (const Change& change : scene.changes) {
      if (change.step == step) simulation->change(change.settings, {});
    }
    visit(*simulation);
    if (variant.restore_at == step) simulation = moved(*simulation, options);
  }
}

Trace trace_of(const Scene& scene, const Variant& variant) {
  Trace trace;
  io::Schema schema;
  run(scene, variant, scene.steps, [&](const core::Simulation& simulation) {
    if (trace.digests.empty()) {
      schema = schema_of(simulation);
      trace.chain = io::chain_base(schema);
    }
    trace.digests.push_back(io::digest_frame(schema, frame_of(simulation)));
    trace.chain = io::chain_next(trace.chain, trace.digests.back());
    trace.fluid = count_of(simulation, "fluid");
    trace.grains = count_of(simulation, "grains");
    trace.contacts_most = std::max<std::size_t>(trace.contacts_most,
                                                count_of(simulation, "contacts"));
    trace.items_per_thread = simulation.counters().items_per_thread;
  });
  return trace;
}

/// The names of the fields in which two variants differ at `step`.
std::string fields_that_differ(const Scene& scene, const Variant& a, const Variant& b,
                               std::uint64_t step) {
  const auto bytes_at = [&](const Variant& variant) {
    std::vector<std::pair<std::string, std::vector<std::byte>>> fields;
    run(scene, variant, step, [&](const core::Simulation& simulation) {
      fields.clear();
      for (std::size_t index = 0; index < simulation.fields().size(); ++index) {
        const auto bytes = simulation.field(index).bytes;
        fields.push_back({simulation.fields()[index].name, {bytes.begin(), bytes.end()}});
      }
    });
    return fields;
  };
  const auto left = bytes_at(a), right = bytes_at(b);
  std::string names;
  for (std::size_t index = 0; index < left.size(); ++index) {
    if (left[index] != right[index]) names += " " + left[index].first;
  }
  return names.empty() ? " none when run again: the result changes from run to run" : names;
}

std::string describe(const Variant& variant) {
  return std::to_string(variant.threads) + " threads, rebuild seed " +
         std::to_string(variant.rebuild_seed) +
         (variant.restore_at ? ", restored at step " + std::to_string(variant.restore_at) : "") +
         (variant.instruction_set < 0
              ? ""
              : ", instruction set " + std::to_string(variant.instruction_set));
}

void compare(const Scene& scene, const Trace& reference, const Variant& first, const Trace& trace,
             const Variant& variant) {
  const auto [a, b] = std::mismatch(reference.digests.begin(), reference.digests.end(),
                                    trace.digests.begin(), trace.digests.end());
  if (a == reference.digests.end() && b == trace.digests.end()) return;
  const auto step = static_cast<std::uint64_t>(a - reference.digests.begin());
  fail(scene.name + ": step " + std::to_string(step) + ": " + describe(first) + " and " +
       describe(variant) + " differ in" + fields_that_differ(scene, first, variant, step));
}

void check_threads_worked(const Scene& scene, const Trace& trace, const Variant& variant) {
  if (!scene.scenario.has_fluid()) return;  // a few grains are one thread's work
  // The scenes are too small to be divided among more.
  const std::size_t busy_least = std::min<std::size_t>(variant.threads, 8);
  const auto& items = trace.items_per_thread;
  const auto busy = static_cast<std::size_t>(
      std::count_if(items.begin(), items.end(), [](auto count) { return count > 0; }));
  if (items.size() != variant.threads || busy < busy_least)
    fail(scene.name + ": of " + describe(variant) + " only " + std::to_string(busy) + " did work");
}

// ---- command line ------------------------------------------------------------------------------

struct Options {
  std::vector<std::uint64_t> threads = {1, 2, 3, 4, 8};
  std::vector<std::uint64_t> rebuild_seeds = {1, 2};
  bool restore = true;
  std::string only;
  std::string steps_file;
  std::string compare_file;
};

std::vector<std::uint64_t> numbers(const std::string& text) {
  std::vector<std::uint64_t> values;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) values.push_back(std::stoull(item));
  return values;
}

Options parse(int argc, char** argv) {
  Options options;
  for (int index = 1; index < argc; index += 2) {
    const std::string name = argv[index];
    if (index + 1 >= argc) fail(name + ": a value is needed");
    const std::string value = argv[index + 1];
    if (name == "--threads") options.threads = numbers(value);
    else if (name == "--rebuild-seeds") options.rebuild_seeds = numbers(value);
    else if (name == "--restore") options.restore = value == "on";
    else if (name == "--scene") options.only = value;
    else if (name == "--steps-file") options.steps_file = value;
    else if (name == "--compare") options.compare_file = value;
    else fail(name + ": unknown; --threads LIST --rebuild-seeds LIST --restore on|off --scene NAME "
              "--steps-file FILE --compare FILE");
  }
  if (options.threads.empty()) fail("--threads: at least one count is needed");
  return options;
}

std::vector<Variant> variants_of(const Options& options, const Scene& scene) {
  std::vector<Variant> variants;
  for (const auto threads : options.threads) {
    variants.push_back({.threads = static_cast<unsigned>(threads)});
  }
  const auto spread = [&](std::size_t n) {  // cycles through the thread counts
    return static_cast<unsigned>(options.threads[n % options.threads.size()]);
  };
  std::size_t n = 1;
  for (const auto seed : options.rebuild_seeds) {
    variants.push_back(
        {.threads = spread(n++), .rebuild_seed = seed, .own_parts_only = false});
  }
  for (int set = 0; set <= static_cast<int>(core::best_instruction_set()); ++set) {
    variants.push_back({.threads = spread(n++), .instruction_set = set});
  }
  if (options.restore) {
    for (const std::uint64_t step : {std::uint64_t{1}, scene.steps / 2, scene.steps - 1}) {
      variants.push_back({.threads = spread(n++), .restore_at = step});
    }
  }
  return variants;
}

std::string line_of(const Scene& scene, const Trace& trace) {
  std::ostringstream line;
  line << scene.name << " steps " << scene.steps << " fluid " << trace.fluid << " grains "
       << trace.grains << " contacts " << trace.contacts_most << " last "
       << trace.digests.back().hex() << " chain " << trace.chain.hex();
  return line.str();
}

/// Runs a scene in all variants, or throws naming the first difference.
Trace check_scene(const Scene& scene, const Options& options) {
  const std::vector<Variant> variants = variants_of(options, scene);
  const Trace reference = trace_of(scene, variants.front());
  if (scene.expects_contacts && reference.contacts_most == 0) {
    fail(scene.name + ": no contact ever: this scene would prove nothing about contacts");
  }
  check_threads_worked(scene, reference, variants.front());
  for (std::size_t index = 1; index < variants.size(); ++index) {
    const Trace trace = trace_of(scene, variants[index]);
    compare(scene, reference, variants.front(), trace, variants[index]);
    if (variants[index].restore_at == 0 && variants[index].own_parts_only)
      check_threads_worked(scene, trace, variants[index]);
  }
  return reference;
}

void compare_with_file(const std::string& path, const std::string& text) {
  std::ifstream file(path);
  if (!file) fail(path + ": cannot be read");
  std::ostringstream expected;
  expected << file.rdbuf();
  if (expected.str() != text) {
    fail(path + ": differs from what this build computes. If the change of bits is intended, " +
         "raise core::engine_revision, run `tests/matrix/run --bless` and say why in the commit. " +
         "Here:\n" + text + "expected:\n" + expected.str());
  }
}

int golden(int argc, char** argv) {
  const Options options = parse(argc, argv);
  varve::tests::require_strict_floating_point();
  std::ofstream steps_file;
  if (!options.steps_file.empty()) steps_file.open(options.steps_file);
  std::string text = "engine_revision " + std::to_string(core::engine_revision) + "\n";
  for (const Scene& scene : scenes()) {
    if (!options.only.empty() && options.only != scene.name) continue;
    const Trace trace = check_scene(scene, options);
    text += line_of(scene, trace) + "\n";
    for (std::size_t step = 0; step < trace.digests.size(); ++step) {
      steps_file << scene.name << " step " << step << " " << trace.digests[step].hex() << "\n";
    }
  }
  varve::tests::require_strict_floating_point();
  std::cout << text;
  if (!options.compare_file.empty()) compare_with_file(options.compare_file, text);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return golden(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "golden: " << error.what() << "\n";
    return 1;
  }
}
