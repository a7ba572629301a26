// What recording costs: CPU time on the engine's thread (handing a state over) and on the writer's
// (digest, encoding, writing), and wall time with one and two engine threads. Two engines of one
// scene advance in turns by short blocks, one recording and one not, so that a machine that is busy
// meanwhile is busy for both.
//
//   varve_recording_bench [--rounds N] [--scene NAME]
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "io/log_writer.h"
#include "tools/scenario_file.h"
#include "tools/simulation_engine.h"

namespace {

using namespace varve;

/// The shipped column in tanks of several widths, everything else the same.
struct Scene {
  std::string name, width;
  unsigned block_steps;  // of one turn
};
const std::vector<Scene> scenes = {{"column", "6 cm", 64}, {"20cm", "20 cm", 24},
                                   {"84cm", "84 cm", 12}};

double thread_cpu_s() {
  timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) != 0) throw std::runtime_error("no CPU clock");
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
double wall_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

double particles_of(const tools::SimulationEngine& engine) {
  double particles = 0;
  const io::FrameView frame = engine.frame();
  for (std::size_t f = 0; f < frame.fields.size(); ++f) {
    const io::FieldDescriptor& field = engine.schema().fields[f];
    if (field.is_id && field.constant) particles += static_cast<double>(frame.fields[f].count);
  }
  return particles;
}

/// One turn of both engines; times per particle and step in ns.
struct Turn {
  double engine_off, engine_on, copy, writer, wall_off, wall_on;
};

class Pair {
 public:
  Pair(const core::Scenario& scenario, unsigned threads, const std::string& log_path)
      : off_(tools::SimulationEngine::fresh(scenario, {.threads = threads})),
        on_(tools::SimulationEngine::fresh(scenario, {.threads = threads})),
        particles_(particles_of(*on_)) {
    io::WriterOptions options;
    options.overwrite = true;
    writer_ = io::LogWriter::create(log_path, tools::make_genesis(scenario, on_->schema(), threads),
                                    on_->frame(), on_->events(), options);
  }
  double particles() const { return particles_; }

  Turn turn(unsigned steps) {
    const double scale = 1e9 / (particles_ * steps);
    Turn turn{};
    double cpu = thread_cpu_s(), wall = wall_s();
    for (unsigned n = 0; n < steps; ++n) off_->advance();
    turn.engine_off = scale * (thread_cpu_s() - cpu);
    turn.wall_off = scale * (wall_s() - wall);

    const double writer_before = writer_->status().writer_cpu_s;
    wall = wall_s();
    for (unsigned n = 0; n < steps; ++n) {
      cpu = thread_cpu_s();
      on_->advance();
      const double advanced = thread_cpu_s();
      writer_->append(on_->frame(), on_->events());
      turn.engine_on += scale * (advanced - cpu);
      turn.copy += scale * (thread_cpu_s() - advanced);
    }
    // Until the writer is through, so that it does not run into the other's turn.
    while (writer_->status().last_step < on_->frame().step)
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    turn.wall_on = scale * (wall_s() - wall);
    turn.writer = scale * (writer_->status().writer_cpu_s - writer_before);
    return turn;
  }
  std::uint64_t bytes() const { return writer_->status().bytes; }
  double recorded() const { return particles_ * static_cast<double>(on_->frame().step + 1); }
  void close() { writer_->close(); }

 private:
  std::unique_ptr<tools::SimulationEngine> off_, on_;
  std::unique_ptr<io::LogWriter> writer_;
  double particles_;
};

/// "median (least-most)" of a figure over all turns; the tenth at either end is left out.
template <class Figure>
std::string spread(const std::vector<Turn>& turns, const Figure& figure, int digits) {
  std::vector<double> values;
  for (const Turn& turn : turns) values.push_back(figure(turn));
  std::sort(values.begin(), values.end());
  const std::size_t cut = values.size() / 10;
  return fmt::format("{:.{}f} ({:.{}f}-{:.{}f})", values[values.size() / 2], digits, values[cut],
                     digits, values[values.size() - 1 - cut], digits);
}

void measure(const Scene& scene, unsigned rounds, const std::string& log_path) {
  const core::Scenario scenario =
      tools::load_scenario("column", {{"domain.width=" + scene.width}, true}).scenario;
  for (const unsigned threads : {1u, 2u}) {
    Pair pair(scenario, threads, log_path);
    pair.turn(scene.block_steps);  // caches, lists and the codec's orders settle first
    std::vector<Turn> turns;
    for (unsigned round = 0; round < rounds; ++round)
      turns.push_back(pair.turn(scene.block_steps));
    pair.close();
    const auto wall = spread(turns, [](const Turn& t) { return t.wall_on / t.wall_off; }, 3);
    if (threads == 2) {
      fmt::print("{:>9.0f}  2 threads: wall time recording / not recording {}\n",
                 pair.particles(), wall);
      continue;
    }
    fmt::print("{:>9.0f}  engine {} ns, with recording {} ns\n", pair.particles(),
               spread(turns, [](const Turn& t) { return t.engine_off; }, 1),
               spread(turns, [](const Turn& t) { return t.engine_on; }, 1));
    fmt::print("{:>9}  copy {} ns, writer {} ns, {:.2f} bytes\n", "",
               spread(turns, [](const Turn& t) { return t.copy; }, 2),
               spread(turns, [](const Turn& t) { return t.writer; }, 1),
               static_cast<double>(pair.bytes()) / pair.recorded());
    fmt::print("{:>9}  1 thread: wall time recording / not recording {}; (copy + writer) / engine "
               "{}\n",
               "", wall,
               spread(turns, [](const Turn& t) { return (t.copy + t.writer) / t.engine_off; }, 3));
  }
}

int bench(int argc, char** argv) {
  unsigned rounds = 15;
  std::string only;
  for (int index = 1; index + 1 < argc; index += 2) {
    const std::string name = argv[index];
    if (name == "--rounds") rounds = static_cast<unsigned>(std::stoul(argv[index + 1]));
    else if (name == "--scene") only = argv[index + 1];
    else throw std::invalid_argument(name + ": unknown; --rounds N --scene NAME");
  }
  if (argc % 2 == 0 || rounds == 0)
    throw std::invalid_argument("expected --rounds N (1 or more), --scene NAME");
  const auto folder =
      std::filesystem::temp_directory_path() / fmt::format("varve-recording-{}", getpid());
  std::filesystem::create_directory(folder);
  fmt::print("per particle and step; CPU time of the thread concerned; median (least-most, without "
             "the tenth at either end) of {} turns\nparticles\n", rounds);
  for (const Scene& scene : scenes)
    if (only.empty() || only == scene.name)
      measure(scene, rounds, (folder / "bench.varve").string());
  std::filesystem::remove_all(folder);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return bench(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "varve_recording_bench: %s\n", error.what());
    return 2;
  }
}
