// The engine alone: particle updates per second of CPU and of time, for every instruction set,
// for one and more threads, and for every precision. All variants of a scene advance in turns of
// a few steps, so that whatever else the machine does strikes them alike. What recording costs
// is measured by varve_throughput. engine_bench [--rounds N] [--seconds S] [--scene NAME]
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/pair_sweeps.h"
#include "core/parameters.h"
#include "core/simulation.h"

namespace {

using namespace varve;

struct Options {
  unsigned rounds = 7;
  double seconds = 0.3;  // of CPU per variant and round
  std::string scene;
};

struct Scene {
  std::string name;
  double width, height;
  std::int64_t rows, columns;
};

struct Variant {
  std::string name;
  core::Precision precision;
  int instruction_set;
  unsigned threads;
  std::unique_ptr<core::Simulation> simulation = nullptr;
  std::vector<double> per_cpu_s = {}, per_wall_s = {};  // particle updates, one entry per round
};

double seconds_of(clockid_t clock) {
  timespec now{};
  if (clock_gettime(clock, &now) != 0) throw std::runtime_error("a clock does not answer");
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The study's collective set in a box of the given size.
core::Scenario scenario_of(const Scene& scene, core::Precision precision) {
  core::Scenario scenario;
  scenario.precision = precision;
  scenario.domain.width = scene.width;
  scenario.domain.height = scene.height;
  scenario.fluid.sound_speed = 2.5;
  scenario.grains.rows = scene.rows;
  scenario.grains.columns = scene.columns;
  scenario.grains.density = 2000;
  scenario.grains.gap = 0.1;
  // Without grains the fluid would stay at rest and its lists would never be made again.
  scenario.grains.lowest_y = scene.rows > 1 ? 0.07 : 0.04;
  scenario.time.until = 10;
  const auto problems = core::resolve(scenario);
  if (!problems.empty()) throw std::runtime_error(problems[0].key + ": " + problems[0].text);
  return scenario;
}

std::vector<Variant> variants() {
  const int widest = static_cast<int>(core::best_instruction_set());
  std::vector<Variant> all;
  for (int set = 0; set <= widest; ++set) {
    const std::string name{core::name_of(static_cast<core::InstructionSet>(set))};
    for (const unsigned threads : {1u, 2u})
      all.push_back({name + ", double", core::Precision::double_, set, threads});
  }
  const std::string name{core::name_of(core::best_instruction_set())};
  all.push_back({name + ", mixed", core::Precision::mixed, widest, 1});
  all.push_back({name + ", float", core::Precision::float_, widest, 1});
  return all;
}

double particles(const core::Simulation& simulation) {
  double sum = 0;
  for (std::size_t k = 0; k < simulation.fields().size(); ++k)
    if (simulation.fields()[k].is_id && simulation.fields()[k].population != "contacts")
      sum += static_cast<double>(simulation.field(k).count);
  return sum;
}

/// Advances one variant by `seconds` of CPU, all its threads together.
void take_turn(Variant& variant, double seconds) {
  core::Simulation& simulation = *variant.simulation;
  const double cpu = seconds_of(CLOCK_PROCESS_CPUTIME_ID), wall = seconds_of(CLOCK_MONOTONIC);
  double updates = 0, used = 0;
  while (used < seconds) {
    simulation.advance();
    updates += particles(simulation);
    used = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu;
  }
  variant.per_cpu_s.push_back(updates / used);
  variant.per_wall_s.push_back(updates / (seconds_of(CLOCK_MONOTONIC) - wall));
}

std::string spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  char text[64];
  std::snprintf(text, sizeof text, "%.2f (%.2f-%.2f)", 1e-6 * values[values.size() / 2],
                1e-6 * values.front(), 1e-6 * values.back());
  return text;
}

void bench(const Scene& scene, const Options& options) {
  std::vector<Variant> all = variants();
  for (Variant& variant : all) {
    variant.simulation =
        core::Simulation::create(scenario_of(scene, variant.precision),
                                 {.threads = variant.threads,
                                  .instruction_set = variant.instruction_set});
    for (int step = 0; step < 20; ++step) variant.simulation->advance();
  }
  for (unsigned round = 0; round < options.rounds; ++round)
    for (Variant& variant : all) take_turn(variant, options.seconds);
  for (const Variant& variant : all)
    std::printf("%-10s %-20s %7u   %-24s %s\n", scene.name.c_str(), variant.name.c_str(),
                variant.threads, spread(variant.per_cpu_s).c_str(),
                spread(variant.per_wall_s).c_str());
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

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = parse(argc, argv);
    std::printf("10^6 particle updates per second, median (least-most) of %u rounds\n",
                options.rounds);
    std::printf("%-10s %-20s %7s   %-24s %s\n", "particles", "variant", "threads", "of CPU",
                "of time");
    bool found = false;
    for (const Scene& scene : {Scene{"1200+1", 0.02, 0.06, 1, 1},
                               Scene{"7200+32", 0.06, 0.12, 4, 8},
                               Scene{"24000+32", 0.20, 0.12, 4, 8}}) {
      if (!options.scene.empty() && options.scene != scene.name) continue;
      bench(scene, options);
      found = true;
    }
    if (!found) throw std::runtime_error(options.scene + ": no such scene");
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "engine_bench: " << error.what() << "\n";
    return 1;
  }
}
