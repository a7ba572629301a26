// What the benchmarks of the codec share: series of states, and the bytes and the CPU time that a
// method takes for them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "io/frame.h"
#include "tests/bench/codec_baselines.h"
#include "tests/bench/codec_scenes.h"

namespace varve::bench {

/// CPU time of this thread. [ns]
double cpu_ns();

/// Consecutive states.
struct Series {
  std::string name;
  io::Schema schema;
  std::vector<io::Frame> frames;
  double particles = 0;  ///< mean
  std::size_t raw = 0;   ///< bytes per particle of the fields that change
};

/// Figures per particle and step; times in ns of CPU.
struct Figures {
  double bytes = 0, bytes_late = 0;
  double encode_mean = 0, encode_best = 0, decode_mean = 0, decode_best = 0;
  bool exact = true;
};

double mean_of(const std::vector<double>& times);
/// Mean of the fastest tenth: what a loaded machine would do if it were not.
double best_of(std::vector<double> times);

/// varve's codec: every state encoded, decoded and compared.
Figures measure_codec(const Series& series, std::size_t keyframe_interval);
/// Another's. Frames until its predictions have all they need are left out.
Figures measure_baseline(const Series& series, Baseline& baseline);

/// States of one of the flows of codec_scenes.h.
template <class Real>
Series scene_series(const SceneOptions& options);

}  // namespace varve::bench
