// Bytes and CPU time per particle and step of the codec, beside what others would take for the same
// states. The states come from a log, or from two small flows of its own (codec_scenes.h).
//
//   varve_codec_bench [--scene dam|cluster] [--particles N] [--dt S] [--settle N] [--float]
//                     [--steps N] [--every K] [--keyframe N] [--no-baselines] [LOG.varve ...]
//
// Without a scene and a log: both scenes at a small and at their largest time step.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "io/digest.h"
#include "io/log_reader.h"
#include "tests/bench/codec_baselines.h"
#include "tests/bench/codec_measure.h"

namespace varve::bench {
namespace {

using io::FieldDescriptor;
using io::Frame;
using io::Schema;

struct Options {
  SceneOptions scene;
  bool named_scene = false;
  bool floats = false;
  bool baselines = true;
  std::size_t keyframe = 256;
  std::vector<std::string> logs;
};

void print_head(const Series& series) {
  fmt::print("\n{}: {:.0f} particles, {} states, {} B per particle raw\n", series.name,
             series.particles, series.frames.size(), series.raw);
  fmt::print("{:<36} {:>8} {:>8} {:>7} {:>8} {:>8} {:>8} {:>8}\n", "method", "B/p-step", "late",
             "ratio", "enc ns/p", "best", "dec ns/p", "best");
}
void print_row(const Series& series, const std::string& name, const Figures& f) {
  fmt::print("{:<36} {:>8.3f} {:>8.3f} {:>7.2f} {:>8.1f} {:>8.1f} {:>8.1f} {:>8.1f}{}\n", name,
             f.bytes, f.bytes_late, static_cast<double>(series.raw) / f.bytes, f.encode_mean,
             f.encode_best, f.decode_mean, f.decode_best, f.exact ? "" : "  NOT EXACT");
}

bool report(const Series& series, const Options& options) {
  print_head(series);
  bool exact = true;
  if (options.baselines) {
    for (const auto& baseline : baselines(series.schema)) {
      const Figures figures = measure_baseline(series, *baseline);
      exact = exact && figures.exact;
      print_row(series, baseline->name(), figures);
    }
  }
  const Figures figures = measure_codec(series, options.keyframe);
  print_row(series, fmt::format("varve, keyframe every {}", options.keyframe), figures);
  std::vector<double> digest;
  for (const Frame& frame : series.frames) {
    const double start = cpu_ns();
    io::digest_frame(series.schema, frame.view());
    digest.push_back((cpu_ns() - start) / series.particles);
  }
  fmt::print("{:<36} {:>33.1f} {:>8.1f}\n", "(digest of the state)", mean_of(digest),
             best_of(digest));
  return exact && figures.exact;
}

/// The largest population of a log's states.
Series log_series(const std::string& path, std::size_t steps) {
  const auto reader = io::LogReader::open(path);
  const Schema& all = reader->genesis().schema;
  Series series;
  series.name = path;
  std::vector<std::size_t> chosen;
  reader->for_each(reader->first_step(), reader->last_step(),
                   [&](const io::StepHeader&, const Frame* frame) {
                     if (frame == nullptr) {
                       return true;
                     }
                     if (chosen.empty()) {
                       const auto largest =
                           std::max_element(frame->counts.begin(), frame->counts.end());
                       const auto index = static_cast<std::size_t>(largest - frame->counts.begin());
                       for (std::size_t f = 0; f < all.fields.size(); ++f) {
                         if (all.fields[f].population == all.fields[index].population) {
                           chosen.push_back(f);
                           series.schema.fields.push_back(all.fields[f]);
                         }
                       }
                       series.particles = static_cast<double>(*largest);
                     }
                     Frame part;
                     part.step = frame->step;
                     part.time = frame->time;
                     part.dt = frame->dt;
                     for (const std::size_t f : chosen) {
                       part.counts.push_back(frame->counts[f]);
                       part.fields.push_back(frame->fields[f]);
                     }
                     series.frames.push_back(std::move(part));
                     return series.frames.size() < steps;
                   });
  if (series.frames.empty()) {
    throw std::invalid_argument(path + ": holds no states");
  }
  for (const FieldDescriptor& field : series.schema.fields) {
    series.raw += field.constant || field.is_id ? 0 : field.bytes_per_particle();
  }
  return series;
}

Options parse(int argc, char** argv) {
  Options options;
  options.scene.steps = 257;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    const auto value = [&]() -> std::string {
      if (i + 1 >= argc) {
        throw std::invalid_argument(name + " needs a value");
      }
      return argv[++i];
    };
    if (name == "--scene") {
      options.scene.scene = value();
      options.named_scene = true;
    } else if (name == "--particles") {
      options.scene.particles = std::stoul(value());
    } else if (name == "--dt") {
      options.scene.dt = std::stod(value());
    } else if (name == "--settle") {
      options.scene.settle = std::stoul(value());
    } else if (name == "--steps") {
      options.scene.steps = std::stoul(value());
    } else if (name == "--every") {
      options.scene.every = std::stoul(value());
    } else if (name == "--keyframe") {
      options.keyframe = std::stoul(value());
    } else if (name == "--float") {
      options.floats = true;
    } else if (name == "--no-baselines") {
      options.baselines = false;
    } else if (name.starts_with("--")) {
      throw std::invalid_argument("unknown option " + name);
    } else {
      options.logs.push_back(name);
    }
  }
  return options;
}

bool run(const Options& options) {
  bool exact = true;
  for (const std::string& path : options.logs) {
    exact = report(log_series(path, options.scene.steps), options) && exact;
  }
  if (!options.logs.empty()) {
    return exact;
  }
  const auto one = [&](const SceneOptions& scene) {
    exact = report(options.floats ? scene_series<float>(scene) : scene_series<double>(scene),
                   options) &&
            exact;
  };
  if (options.named_scene) {
    one(options.scene);
    return exact;
  }
  for (const auto& [name, particles] : {std::pair{"cluster", 9000}, std::pair{"dam", 5750}}) {
    for (const double dt : {1e-5, 0.0}) {
      SceneOptions scene = options.scene;
      scene.scene = name;
      scene.particles = static_cast<std::size_t>(particles);
      scene.dt = dt;
      one(scene);
    }
  }
  return exact;
}

}  // namespace
}  // namespace varve::bench

int main(int argc, char** argv) {
  try {
    return varve::bench::run(varve::bench::parse(argc, argv)) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "varve_codec_bench: %s\n", error.what());
    return 2;
  }
}
