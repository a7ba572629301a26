// How fast the engine is, for every instruction set, one thread and two, every precision, and while
// recording: particle updates per second of CPU (all engine threads together) and of time, and what
// the log's writer takes. All variants of a scene advance in turns, so that whatever else the
// machine does strikes them alike.
//   throughput [--rounds N] [--seconds S] [--scene NAME] [--variant NAMES] [--threads N]
// A scene may be all whose names begin with NAME and a dash: `--scene 2d --variant widest` shows
// what a particle costs among 10^3 to 10^6 of them, `--variant widest,shuffled` also what it costs
// once neighbours lie anywhere in memory.
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/pair_sweeps.h"
#include "core/parameters.h"
#include "core/random.h"
#include "io/log_writer.h"
#include "tools/simulation_engine.h"

namespace {

using namespace varve;

struct Options {
  unsigned rounds = 5;
  double seconds = 0.5;  // of engine CPU time per variant and round
  std::string scene, variant;
  unsigned threads = 0;  // 0: one and two
};

struct Scene {
  std::string name;
  double width, height;  // [m]
  std::int64_t rows, columns;
  double level = 0;  // [m] of fluid under a free surface; 0: a full closed box
  double depth = 0;  // [m] of a 3D scene
  double sound_speed = 10 * 1.0849;  // [m/s] under a free surface: 10 sqrt(2 g H), H = 6 cm
};

/// One turn's times, and what was done in them.
struct Sample {
  double cpu_s = 0, wall_s = 0;  // of all engine threads; from start to end
  double append_s = 0;           // engine's thread, handing frames to the log
  double writer_s = 0;           // writer's thread
  double updates = 0;
  std::uint64_t log_bytes = 0;
};

struct Variant {
  std::string name;
  core::Precision precision;
  int instruction_set;
  unsigned threads;
  bool record = false, shuffled = false;
  std::unique_ptr<tools::SimulationEngine> engine = nullptr;
  std::unique_ptr<io::LogWriter> writer = nullptr;
  std::vector<Sample> samples = {};
};

double seconds_of(clockid_t clock) {
  timespec now{};
  if (clock_gettime(clock, &now) != 0) throw std::runtime_error("a clock does not answer");
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The study's collective set in a box of the given size, or a tank of fluid alone.
core::Scenario scenario_of(const Scene& scene, core::Precision precision) {
  core::Scenario scenario;
  scenario.precision = precision;
  scenario.domain.width = scene.width;
  scenario.domain.height = scene.height;
  scenario.fluid.sound_speed = 2.5;
  if (scene.level > 0) {
    scenario.domain.top = core::Boundary::free;
    scenario.fluid.level = scene.level;
    scenario.fluid.jitter = 0.05;
    scenario.fluid.sound_speed = scene.sound_speed;
  }
  if (scene.depth > 0) {
    scenario.domain.dimension = 3;
    scenario.domain.depth = scene.depth;
  }
  scenario.grains.rows = scene.rows;
  scenario.grains.columns = scene.columns;
  scenario.grains.density = 2000;
  scenario.grains.gap = 0.1;
  // In a box without grains the fluid would stay at rest and its lists never be made again.
  scenario.grains.lowest_y = scene.rows > 1 ? 0.07 : 0.04;
  scenario.time.until = 10;
  const auto problems = core::resolve(scenario);
  if (!problems.empty()) throw std::runtime_error(problems[0].key + ": " + problems[0].text);
  return scenario;
}

std::vector<Variant> variants(const Options& options) {
  const int widest = static_cast<int>(core::best_instruction_set());
  const std::string name{core::name_of(core::best_instruction_set())};
  std::vector<Variant> all;
  const auto add = [&](Variant variant) {
    if (("," + options.variant + ",").find("," + variant.name + ",") == std::string::npos &&
        !options.variant.empty())
      return;
    if (options.threads != 0 && options.threads != variant.threads) return;
    all.push_back(std::move(variant));
  };
  for (int set = 0; set <= widest; ++set)
    for (const unsigned threads : {1u, 2u})
      add({set == widest ? "widest" : std::string(core::name_of(core::InstructionSet(set))),
           core::Precision::double_, set, threads});
  add({"mixed", core::Precision::mixed, widest, 1});
  add({"float", core::Precision::float_, widest, 1});
  add({"recording", core::Precision::double_, widest, 1, true});
  add({"shuffled", core::Precision::double_, widest, 1, false, true});
  if (all.empty()) throw std::runtime_error(options.variant + ": no such variant");
  return all;
}

double particles_of(const io::Schema& schema, const io::FrameView& frame) {
  double particles = 0;
  for (std::size_t k = 0; k < schema.fields.size(); ++k)
    if (schema.fields[k].is_id && schema.fields[k].name != "contacts.key")
      particles += static_cast<double>(frame.fields[k].count);
  return particles;
}

/// The same fluid with its particles numbered at random, as if it had been stirred for ever.
void shuffle_fluid(tools::SimulationEngine& engine) {
  io::FrameView frame = engine.frame();
  std::vector<std::vector<std::byte>> shuffled(frame.fields.size());
  std::vector<std::size_t> from;
  for (std::size_t k = 0; k < frame.fields.size(); ++k) {
    const io::FieldDescriptor& field = engine.schema().fields[k];
    io::FieldView& view = frame.fields[k];
    if (field.population != "fluid" || field.is_id || field.constant || view.count == 0) continue;
    if (from.empty()) {
      for (std::size_t a = 0; a < view.count; ++a) from.push_back(a);
      for (std::size_t a = view.count; a-- > 1;)  // Fisher and Yates
        std::swap(from[a], from[core::random_bits(1, a, 0) % (a + 1)]);
    }
    const std::size_t size = view.bytes.size() / view.count;
    for (const std::size_t a : from) {
      const auto one = view.bytes.subspan(a * size, size);
      shuffled[k].insert(shuffled[k].end(), one.begin(), one.end());
    }
    view.bytes = shuffled[k];
  }
  engine.restore(frame);
}

void prepare(Variant& variant, const Scene& scene, const std::string& log_path) {
  const core::Scenario scenario = scenario_of(scene, variant.precision);
  variant.engine = tools::SimulationEngine::fresh(
      scenario, {.threads = variant.threads, .instruction_set = variant.instruction_set});
  if (variant.shuffled) shuffle_fluid(*variant.engine);
  if (variant.record) {
    io::WriterOptions options;
    options.overwrite = true;
    variant.writer = io::LogWriter::create(
        log_path, tools::make_genesis(scenario, variant.engine->schema(), 1),
        variant.engine->frame(), variant.engine->events(), options);
  }
  for (int step = 0; step < 20; ++step) {  // caches, lists and the codec's order settle first
    variant.engine->advance();
    if (variant.writer) variant.writer->append(variant.engine->frame(), variant.engine->events());
  }
  if (variant.writer) variant.writer->flush();
}

/// Advances one variant by `seconds` of CPU.
void take_turn(Variant& variant, double seconds) {
  io::LogWriter* const writer = variant.writer.get();
  const io::WriterStatus before = writer ? writer->status() : io::WriterStatus{};
  const double cpu = seconds_of(CLOCK_PROCESS_CPUTIME_ID), wall = seconds_of(CLOCK_MONOTONIC);
  Sample sample;
  while (sample.cpu_s < seconds) {
    variant.engine->advance();
    if (writer) {
      const double start = seconds_of(CLOCK_THREAD_CPUTIME_ID);
      writer->append(variant.engine->frame(), variant.engine->events());
      sample.append_s += seconds_of(CLOCK_THREAD_CPUTIME_ID) - start;
    }
    sample.updates += particles_of(variant.engine->schema(), variant.engine->frame());
    sample.cpu_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu;
  }
  if (writer) {
    writer->flush();
    const io::WriterStatus after = writer->status();
    sample.writer_s = after.writer_cpu_s - before.writer_cpu_s;
    sample.log_bytes = after.bytes - before.bytes;
    sample.cpu_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu - sample.writer_s;
  }
  sample.wall_s = seconds_of(CLOCK_MONOTONIC) - wall;
  variant.samples.push_back(sample);
}

std::string spread_of(const std::vector<Sample>& samples, double (*figure)(const Sample&)) {
  std::vector<double> values;
  for (const Sample& sample : samples) values.push_back(figure(sample));
  std::sort(values.begin(), values.end());
  return fmt::format("{:.2f} ({:.2f}-{:.2f})", values[values.size() / 2], values.front(),
                     values.back());
}

void print(const Scene& scene, const Variant& variant) {
  const auto spread = [&](double (*figure)(const Sample&)) {
    return spread_of(variant.samples, figure);
  };
  fmt::print("{:<10} {:<10} {:>7}   {:<20} {:<20}", scene.name, variant.name, variant.threads,
             spread([](const Sample& s) { return 1e-6 * s.updates / s.cpu_s; }),
             spread([](const Sample& s) { return 1e-6 * s.updates / s.wall_s; }));
  if (variant.record)
    fmt::print(" {:<20} {:<20} {}",
               spread([](const Sample& s) { return 1e9 * s.append_s / s.updates; }),
               spread([](const Sample& s) { return 1e9 * s.writer_s / s.updates; }),
               spread([](const Sample& s) {
                 return static_cast<double>(s.log_bytes) / s.updates;
               }));
  fmt::print("\n");
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  }
  return "unknown processor";
}

Options parse(int argc, char** argv) {
  Options options;
  for (int index = 1; index < argc; index += 2) {
    const std::string name = argv[index];
    if (index + 1 >= argc) throw std::runtime_error(name + ": a value is needed");
    const std::string value = argv[index + 1];
    if (name == "--rounds") options.rounds = static_cast<unsigned>(std::stoul(value));
    else if (name == "--seconds") options.seconds = std::stod(value);
    else if (name == "--scene") options.scene = value;
    else if (name == "--variant") options.variant = value;
    else if (name == "--threads") options.threads = static_cast<unsigned>(std::stoul(value));
    else throw std::runtime_error(
        name + ": unknown; --rounds N --seconds S --scene NAME --variant NAMES --threads N");
  }
  if (options.rounds == 0) throw std::runtime_error("--rounds: at least 1");
  return options;
}

/// Fluid under a free surface, 1 mm apart.
Scene tank_of(const std::string& name, double width, double level, double depth = 0) {
  return {name, width, 1.5 * level, 0, 0, level, depth, 10 * std::sqrt(2 * 9.81 * level)};
}

bool is_asked_for(const Scene& scene, const std::string& name) {
  if (name.empty()) return scene.level == 0;
  return scene.name == name || scene.name.starts_with(name + "-");
}

int throughput(const Options& options) {
  // The tanks are there for comparison with another code (tests/bench/against_pysph).
  const std::vector<Scene> scenes = {{"1200+1", 0.02, 0.06, 1, 1},
                                     {"7200+32", 0.06, 0.12, 4, 8},
                                     {"24000+32", 0.20, 0.12, 4, 8},
                                     {"tank", 0.12, 0.09, 0, 0, 0.06},
                                     {"tank3d", 0.024, 0.036, 0, 0, 0.024, 0.024},
                                     tank_of("2d-10^3", 0.04, 0.025),
                                     tank_of("2d-10^4", 0.16, 0.062),
                                     tank_of("2d-10^5", 0.8, 0.124),
                                     tank_of("2d-10^6", 4, 0.25),
                                     tank_of("3d-10^3", 0.01, 0.01, 0.01),
                                     tank_of("3d-10^4", 0.025, 0.02, 0.02),
                                     tank_of("3d-10^5", 0.05, 0.04, 0.05),
                                     tank_of("3d-10^6", 0.1, 0.1, 0.1)};
  const auto folder = std::filesystem::temp_directory_path() /
                      fmt::format("varve-throughput-{}", getpid());
  std::filesystem::create_directory(folder);
  fmt::print("{}; 10^6 particle updates per second, median (least-most) of {} rounds of {} s\n",
             processor(), options.rounds, options.seconds);
  fmt::print("{:<10} {:<10} {:>7}   {:<20} {:<20} {:<20} {:<20} {}\n", "particles", "variant",
             "threads", "of CPU", "of time", "append ns/update", "writer ns/update", "B/update");
  bool found = false;
  for (const Scene& scene : scenes) {
    if (!is_asked_for(scene, options.scene)) continue;
    found = true;
    std::vector<Variant> all = variants(options);
    for (Variant& variant : all) prepare(variant, scene, (folder / "bench.varve").string());
    for (unsigned round = 0; round < options.rounds; ++round)
      for (Variant& variant : all) take_turn(variant, options.seconds);
    for (const Variant& variant : all) {
      print(scene, variant);
      if (variant.writer) variant.writer->close();
    }
  }
  std::filesystem::remove_all(folder);
  if (!found) throw std::runtime_error(options.scene + ": no such scene");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return throughput(parse(argc, argv));
  } catch (const std::exception& error) {
    std::cerr << "throughput: " << error.what() << "\n";
    return 1;
  }
}
