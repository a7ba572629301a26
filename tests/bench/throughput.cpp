// How fast the engine is and what recording costs, in CPU time of the threads concerned, so that a
// busy machine disturbs little. Configurations take turns within every round: a machine that slows
// down meanwhile slows all of them.
//   throughput [--rounds N] [--seconds S] [--scene NAME]
#include <time.h>
#include <unistd.h>

#include <algorithm>
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
#include "io/log_writer.h"
#include "tools/simulation_engine.h"

namespace {

using namespace varve;

struct Options {
  unsigned rounds = 5;
  double seconds = 1.0;  // of engine CPU time per configuration and round
  std::string scene;
};

struct Scene {
  std::string name;
  double width, height;
  std::int64_t rows, columns;
  double level = 0;  // [m] of fluid under a free surface; 0: a full closed box
};

struct Configuration {
  std::string name;
  int instruction_set;
  bool record;
};

/// CPU times of one measurement, and what was done in them.
struct Sample {
  double engine_s = 0;  // engine's thread, recording left out
  double append_s = 0;  // engine's thread, handing frames to the log
  double writer_s = 0;  // writer's thread
  double particle_steps = 0;
  std::uint64_t log_bytes = 0, steps = 0;
};

double thread_cpu_s() {
  timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) != 0) throw std::runtime_error("no CPU clock");
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The study's collective set in a box of the given size, or a tank of fluid alone.
core::Scenario scenario_of(const Scene& scene) {
  core::Scenario scenario;
  scenario.domain.width = scene.width;
  scenario.domain.height = scene.height;
  scenario.fluid.sound_speed = 2.5;
  if (scene.level > 0) {
    scenario.domain.top = core::Boundary::free;
    scenario.fluid.level = scene.level;
    scenario.fluid.jitter = 0.05;
    scenario.fluid.sound_speed = 10 * 1.0849;  // 10 sqrt(2 g H) for H = 6 cm
  }
  scenario.grains.rows = scene.rows;
  scenario.grains.columns = scene.columns;
  scenario.grains.density = 2000;
  scenario.grains.gap = 0.1;
  scenario.grains.lowest_y = scene.rows > 1 ? 0.07 : 0.04;
  scenario.time.until = 10;
  const auto problems = core::resolve(scenario);
  if (!problems.empty()) throw std::runtime_error(problems[0].key + ": " + problems[0].text);
  return scenario;
}

double particles_of(const io::Schema& schema, const io::FrameView& frame) {
  double particles = 0;
  for (std::size_t index = 0; index < schema.fields.size(); ++index) {
    if (schema.fields[index].is_id) particles += static_cast<double>(frame.fields[index].count);
  }
  return particles;
}

Sample measure(const Scene& scene, const Configuration& configuration, double seconds,
               const std::string& log_path) {
  const core::Scenario scenario = scenario_of(scene);
  const auto engine = tools::SimulationEngine::fresh(
      scenario, {.threads = 1, .instruction_set = configuration.instruction_set});
  std::unique_ptr<io::LogWriter> writer;
  if (configuration.record) {
    io::WriterOptions options;
    options.overwrite = true;
    writer = io::LogWriter::create(log_path, tools::make_genesis(scenario, engine->schema(), 1),
                                   engine->frame(), engine->events(), options);
  }
  for (int step = 0; step < 20; ++step) {  // caches, lists and the codec's order settle first
    engine->advance();
    if (writer) writer->append(engine->frame(), engine->events());
  }
  if (writer) writer->flush();
  const io::WriterStatus before = writer ? writer->status() : io::WriterStatus{};
  Sample sample;
  while (sample.engine_s < seconds) {
    const double start = thread_cpu_s();
    engine->advance();
    const double advanced = thread_cpu_s();
    if (writer) writer->append(engine->frame(), engine->events());
    sample.append_s += thread_cpu_s() - advanced;
    sample.engine_s += advanced - start;
    sample.particle_steps += particles_of(engine->schema(), engine->frame());
    ++sample.steps;
  }
  if (writer) {
    writer->flush();
    const io::WriterStatus after = writer->status();
    sample.writer_s = after.writer_cpu_s - before.writer_cpu_s;
    sample.log_bytes = after.bytes - before.bytes;
    writer->close();
  }
  return sample;
}

struct Spread {
  double least, middle, most;
};
Spread spread_of(const std::vector<Sample>& samples, double (*figure)(const Sample&)) {
  std::vector<double> values;
  for (const Sample& sample : samples) values.push_back(figure(sample));
  std::sort(values.begin(), values.end());
  return {values.front(), values[values.size() / 2], values.back()};
}

void print(const Scene& scene, const Configuration& configuration,
           const std::vector<Sample>& samples) {
  const Spread rate = spread_of(
      samples, [](const Sample& s) { return 1e-6 * s.particle_steps / (s.engine_s + s.append_s); });
  fmt::print("{:<10} {:<20} {:6.2f} ({:.2f}-{:.2f})", scene.name, configuration.name, rate.middle,
             rate.least, rate.most);
  if (configuration.record) {
    const Spread append =
        spread_of(samples, [](const Sample& s) { return 1e9 * s.append_s / s.particle_steps; });
    const Spread writer =
        spread_of(samples, [](const Sample& s) { return 1e9 * s.writer_s / s.particle_steps; });
    const Spread bytes = spread_of(samples, [](const Sample& s) {
      return static_cast<double>(s.log_bytes) / s.particle_steps;
    });
    fmt::print("   {:6.2f} ({:.2f}-{:.2f})   {:6.1f} ({:.1f}-{:.1f})   {:6.2f}", append.middle,
               append.least, append.most, writer.middle, writer.least, writer.most, bytes.middle);
  }
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
    else throw std::runtime_error(name + ": unknown; --rounds N --seconds S --scene NAME");
  }
  if (options.rounds == 0) throw std::runtime_error("--rounds: at least 1");
  return options;
}

int throughput(const Options& options) {
  const std::vector<Scene> scenes = {{"1200+1", 0.02, 0.06, 1, 1},
                                     {"7200+32", 0.06, 0.12, 4, 8},
                                     {"24000+32", 0.20, 0.12, 4, 8},
                                     {"tank", 0.12, 0.09, 0, 0, 0.06}};
  const std::string widest{core::name_of(core::best_instruction_set())};
  const std::vector<Configuration> configurations = {{"baseline, off", 0, false},
                                                     {widest + ", off", -1, false},
                                                     {widest + ", recording", -1, true}};
  const auto folder = std::filesystem::temp_directory_path() /
                      fmt::format("varve-throughput-{}", getpid());
  std::filesystem::create_directory(folder);
  fmt::print("{}; one engine thread; median (least-most) of {} rounds of {} s of engine CPU time\n",
             processor(), options.rounds, options.seconds);
  fmt::print("{:<10} {:<20} {:<22} {:<22} {:<22} {}\n", "particles", "configuration",
             "10^6 updates/CPU-s", "append ns/part.-step", "writer ns/part.-step", "B/part.-step");
  for (const Scene& scene : scenes) {
    // The tank is there for comparison with another code (tests/bench/against_pysph).
    if (options.scene.empty() ? scene.level > 0 : options.scene != scene.name) continue;
    std::vector<std::vector<Sample>> samples(configurations.size());
    for (unsigned round = 0; round < options.rounds; ++round) {
      for (std::size_t index = 0; index < configurations.size(); ++index) {
        samples[index].push_back(measure(scene, configurations[index], options.seconds,
                                         (folder / "bench.varve").string()));
      }
    }
    for (std::size_t index = 0; index < configurations.size(); ++index) {
      print(scene, configurations[index], samples[index]);
    }
  }
  std::filesystem::remove_all(folder);
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
