// Bytes and CPU time per particle and step of the codec, beside what others would take for the same
// states. The states come from a log, or from two small flows of its own (codec_scenes.h).
//
//   varve_codec_bench [--scene dam|cluster] [--particles N] [--dt S] [--settle N] [--float]
//                     [--steps N] [--every K] [--keyframe N] [--no-baselines] [LOG.varve ...]
//
// Without a scene and a log: both scenes at a small and at their largest time step.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "io/codec.h"
#include "io/digest.h"
#include "io/log_reader.h"
#include "tests/bench/codec_baselines.h"
#include "tests/bench/codec_scenes.h"

namespace varve::bench {
namespace {

using io::EncodedField;
using io::FieldDescriptor;
using io::Frame;
using io::FrameView;
using io::ScalarType;
using io::Schema;

struct Options {
  SceneOptions scene;
  bool named_scene = false;
  bool floats = false;
  bool baselines = true;
  std::size_t keyframe = 256;
  std::vector<std::string> logs;
};

/// CPU time of this thread. [ns]
double cpu_ns() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e9 + static_cast<double>(now.tv_nsec);
}

/// States of one population.
struct Series {
  std::string name;
  Schema schema;
  std::vector<Frame> frames;
  double particles = 0;  ///< mean
  std::size_t raw = 0;   ///< bytes per particle of the fields that change
};

/// Figures per particle and step.
struct Figures {
  double bytes = 0, bytes_late = 0;
  double encode_mean = 0, encode_best = 0, decode_mean = 0, decode_best = 0;
  bool exact = true;
};

/// Mean of the fastest tenth: what a loaded machine would do if it were not.
double best_of(std::vector<double> times) {
  std::sort(times.begin(), times.end());
  const std::size_t n = std::max<std::size_t>(1, times.size() / 10);
  double sum = 0;
  for (std::size_t i = 0; i < std::min(n, times.size()); ++i) {
    sum += times[i];
  }
  return sum / static_cast<double>(n);
}
double mean_of(const std::vector<double>& times) {
  double sum = 0;
  for (const double t : times) {
    sum += t;
  }
  return times.empty() ? 0 : sum / static_cast<double>(times.size());
}

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

Figures measure_codec(const Series& series, std::size_t keyframe_interval) {
  auto encoder = io::FrameEncoder::create(series.schema);
  auto decoder = io::FrameDecoder::create(series.schema);
  Figures figures;
  std::vector<double> encode, decode;
  double sum = 0, late = 0, late_frames = 0;
  for (std::size_t n = 0; n < series.frames.size(); ++n) {
    const Frame& frame = series.frames[n];
    const FrameView view = frame.view();
    if (n % keyframe_interval == 0) {
      encoder->restart();
    }
    bool keyframe = false;
    const double start = cpu_ns();
    const std::vector<EncodedField> fields = encoder->encode(view, keyframe);
    const double middle = cpu_ns();
    const Frame& back = decoder->decode(fields, keyframe, frame.step, frame.time, frame.dt);
    const double end = cpu_ns();
    figures.exact = figures.exact && back.fields == frame.fields;
    encode.push_back((middle - start) / series.particles);
    decode.push_back((end - middle) / series.particles);
    double bytes = 0;
    for (const EncodedField& field : fields) {
      bytes += static_cast<double>(field.payload.size());
    }
    sum += bytes;
    if (n % keyframe_interval >= 32) {
      late += bytes;
      late_frames += 1;
    }
  }
  figures.bytes = sum / series.particles / static_cast<double>(series.frames.size());
  figures.bytes_late = late / series.particles / std::max(late_frames, 1.0);
  figures.encode_mean = mean_of(encode);
  figures.encode_best = best_of(encode);
  figures.decode_mean = mean_of(decode);
  figures.decode_best = best_of(decode);
  return figures;
}

/// Frames until the predictions of a baseline have all they need are left out.
Figures measure_baseline(const Series& series, Baseline& baseline) {
  constexpr std::size_t warm_up = 8;
  Figures figures;
  std::vector<double> encode, decode;
  double sum = 0;
  double frames = 0;
  double pending_encode = 0, pending_decode = 0, pending = 0;
  for (std::size_t n = 0; n < series.frames.size(); ++n) {
    const double start = cpu_ns();
    const std::size_t bytes = baseline.encode(series.frames[n]);
    const double middle = cpu_ns();
    figures.exact = baseline.decode(series.frames[n]) && figures.exact;
    const double end = cpu_ns();
    pending_encode += middle - start;
    pending_decode += end - middle;
    pending += 1;
    if (bytes > 0) {
      if (n >= warm_up) {
        sum += static_cast<double>(bytes);
        frames += pending;
        encode.push_back(pending_encode / pending / series.particles);
        decode.push_back(pending_decode / pending / series.particles);
      }
      pending_encode = pending_decode = pending = 0;
    }
  }
  figures.bytes = figures.bytes_late = sum / series.particles / std::max(frames, 1.0);
  figures.encode_mean = mean_of(encode);
  figures.encode_best = best_of(encode);
  figures.decode_mean = mean_of(decode);
  figures.decode_best = best_of(decode);
  return figures;
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

template <class Real>
Series scene_series(const SceneOptions& options) {
  Series series;
  const ScalarType type = sizeof(Real) == 8 ? ScalarType::f64 : ScalarType::f32;
  series.schema.fields = {
      {"fluid.id", "fluid", ScalarType::u64, 1, "", true, false, ""},
      {"fluid.mass", "fluid", type, 1, "kg", false, true, ""},
      {"fluid.position", "fluid", type, 2, "m", false, false, "fluid.velocity"},
      {"fluid.velocity", "fluid", type, 2, "m/s", false, false, ""},
      {"fluid.density", "fluid", type, 1, "kg/m3", false, false, ""}};
  series.raw = 5 * sizeof(Real);
  run_scene<Real>(options, [&](const SceneState<Real>& state) {
    const std::size_t count = state.rho.size();
    Frame frame;
    frame.step = series.frames.size();
    frame.time = state.time;
    frame.dt = state.dt;
    frame.counts.assign(5, count);
    const auto put = [&](const auto& values) {
      const auto* bytes = reinterpret_cast<const std::byte*>(values.data());
      frame.fields.emplace_back(bytes, bytes + values.size() * sizeof(values[0]));
    };
    std::vector<std::uint64_t> id(count);
    for (std::size_t i = 0; i < count; ++i) {
      id[i] = i + 1;
    }
    put(id);
    put(std::vector<Real>(count, Real(0.025)));
    put(state.x);
    put(state.v);
    put(state.rho);
    series.frames.push_back(std::move(frame));
    series.particles = static_cast<double>(count);
  });
  series.name = fmt::format("{} ({}), dt {:.3g} s", options.scene,
                            sizeof(Real) == 8 ? "double" : "float", series.frames.back().dt);
  return series;
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
