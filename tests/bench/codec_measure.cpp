#include "tests/bench/codec_measure.h"

#include <time.h>

#include <algorithm>
#include <cstdint>

#include <fmt/format.h>

#include "io/codec.h"

namespace varve::bench {

using io::EncodedField;
using io::Frame;
using io::FrameView;
using io::ScalarType;

double cpu_ns() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e9 + static_cast<double>(now.tv_nsec);
}

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

template Series scene_series<double>(const SceneOptions&);
template Series scene_series<float>(const SceneOptions&);

}  // namespace varve::bench
