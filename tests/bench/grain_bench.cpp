// How fast grains alone are: CPU time of one engine thread, recording left out.
//   varve_grain_bench LIST.csv [--steps N] [--width W] [--height H]
// LIST.csv holds spheres of 2 mm and 2500 kg/m3 as grains.file does. The law is that of
// against_lammps: k 1000 N/m, 2/7 of it along the contact, damping 460 1/s, friction 0.5.
#include <time.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>

#include "core/criteria.h"
#include "core/grain_placement.h"
#include "core/parameters.h"
#include "core/simulation.h"

namespace {

using namespace varve::core;

double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double option(int argc, char** argv, const char* name, double fallback) {
  for (int i = 1; i + 1 < argc; ++i)
    if (std::strcmp(argv[i], name) == 0) return std::strtod(argv[i + 1], nullptr);
  return fallback;
}

Scenario scene(int argc, char** argv) {
  Scenario s;
  s.domain.dimension = 3;
  s.domain.width = s.domain.depth = option(argc, argv, "--width", 0.0445);
  s.domain.height = option(argc, argv, "--height", 0.2);
  s.domain.top = Boundary::free;
  s.fluid.present = false;
  s.grains.diameter = 2e-3;
  s.grains.density = 2500;
  s.contact.stiffness = 1000;
  s.contact.friction = 0.5;
  // eta = gamma m_eff = alpha sqrt(m_eff k), of a pair.
  const double effective = 0.5 * 2500 * 3.14159265358979 / 6 * 8e-9;
  s.contact.damping = 460 * std::sqrt(effective / 1000);
  s.guards.overlap = 0.5;
  s.time.dt = 1e-5;
  s.time.substeps = 1;
  s.time.steps = 1;
  return s;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: varve_grain_bench LIST.csv [--steps N] [--width W] [--height H]\n";
    return 2;
  }
  std::ifstream file(argv[1], std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  Scenario s = scene(argc, argv);
  auto read = read_grain_list(text, s);
  if (const auto* problems = std::get_if<std::vector<ListProblem>>(&read)) {
    std::cerr << argv[1] << ':' << problems->front().line << ": " << problems->front().text << '\n';
    return 2;
  }
  s.grains.list = std::get<std::vector<ListedGrain>>(read);
  s.grains.arrangement = Arrangement::list;
  s.grains.file = argv[1];
  // A settled packing has overlaps beyond those that a fresh list may have: not checked here.
  for (const Problem& problem : resolve(s)) {
    if (problem.key == "grains.file") continue;
    std::cerr << problem.key << ": " << problem.text << '\n';
    return 2;
  }
  const auto simulation = Simulation::create(s, {});
  const auto steps = static_cast<std::uint64_t>(option(argc, argv, "--steps", 1000));
  for (int n = 0; n < 20; ++n) simulation->advance();
  const double start = cpu_s();
  for (std::uint64_t n = 0; n < steps; ++n) simulation->advance();
  const double spent = cpu_s() - start;
  const double updates = static_cast<double>(steps) * static_cast<double>(s.grains.list.size());
  std::cout << "grains " << s.grains.list.size() << " contacts "
            << simulation->table(0).rows << " lists " << simulation->counters().list_rebuilds
            << " million-updates-per-cpu-s " << updates / spent / 1e6 << '\n';
  return 0;
}
