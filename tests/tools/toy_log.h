// Small logs made of numbers that move like a simulation's, without an engine: for tests that need
// to know, or to spoil, every bit that is recorded.
#pragma once

#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/log_writer.h"

namespace varve::test {

struct ToyOptions {
  std::uint64_t steps = 40;  ///< besides the first
  std::uint64_t first_step = 0;
  std::uint64_t beads = 12;
  std::uint64_t seed = 1;
  bool links = true;  ///< a population that comes and goes, with ids of three parts
};

inline io::Schema toy_schema(bool links = true) {
  using io::ScalarType;
  io::Schema schema;
  schema.fields = {
      {"clock.step", "clock", ScalarType::u64, 1, "", false, false, ""},
      {"clock.time", "clock", ScalarType::f64, 1, "s", false, false, ""},
      {"bead.id", "bead", ScalarType::u64, 1, "", true, true, ""},
      {"bead.mass", "bead", ScalarType::f64, 1, "kg", false, true, ""},
      {"bead.position", "bead", ScalarType::f64, 2, "m", false, false, "bead.velocity"},
      {"bead.velocity", "bead", ScalarType::f64, 2, "m/s", false, false, ""},
      {"bead.heat", "bead", ScalarType::f32, 1, "K", false, false, ""},
  };
  if (links) {
    schema.fields.push_back({"link.key", "link", ScalarType::u64, 3, "", true, false, ""});
    schema.fields.push_back({"link.spring", "link", ScalarType::f64, 2, "m", false, false, ""});
  }
  schema.tables = {{"hits", {{"bead", ScalarType::u64, ""}, {"force", ScalarType::f64, "N"}}}};
  return schema;
}

template <class T>
void append_value(std::vector<std::byte>& out, T value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof value);
}

/// Consecutive states; the same options give the same bits.
inline std::vector<io::Frame> toy_frames(const ToyOptions& options) {
  std::mt19937_64 random(options.seed);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53 - 0.5; };
  const double dt = 1e-3;
  std::vector<double> x(2 * options.beads), v(2 * options.beads);
  std::vector<float> heat(options.beads);
  for (double& value : x) value = uniform();
  for (double& value : v) value = uniform();
  for (float& value : heat) value = static_cast<float>(300 + uniform());
  std::vector<io::Frame> frames;
  for (std::uint64_t n = 0; n <= options.steps; ++n) {
    io::Frame frame;
    frame.step = options.first_step + n;
    frame.time = dt * static_cast<double>(frame.step);
    frame.dt = n == 0 ? 0 : dt;
    const io::Schema schema = toy_schema(options.links);
    frame.fields.resize(schema.fields.size());
    frame.counts = {1, 1};
    frame.counts.resize(7, options.beads);
    append_value(frame.fields[0], frame.step);
    append_value(frame.fields[1], frame.time);
    for (std::uint64_t i = 0; i < options.beads; ++i) {
      append_value(frame.fields[2], 3 * i + 1);
      append_value(frame.fields[3], 1e-3 * static_cast<double>(i + 1));
      append_value(frame.fields[6], heat[i]);
    }
    for (const double value : x) append_value(frame.fields[4], value);
    for (const double value : v) append_value(frame.fields[5], value);
    std::uint64_t links = 0;
    for (std::uint64_t i = 0; options.links && i + 1 < options.beads; ++i) {
      if ((frame.step / 5 + i) % 4 == 0) continue;
      ++links;
      for (const std::uint64_t part : {3 * i + 1, std::uint64_t{0}, 3 * i + 4})
        append_value(frame.fields[7], part);
      append_value(frame.fields[8], x[2 * i + 2] - x[2 * i]);
      append_value(frame.fields[8], x[2 * i + 3] - x[2 * i + 1]);
    }
    if (options.links) frame.counts.insert(frame.counts.end(), {links, links});
    frame.rows = {frame.step % 3};
    frame.tables.resize(1, std::vector<std::vector<std::byte>>(2));
    for (std::uint64_t row = 0; row < frame.rows[0]; ++row) {
      append_value(frame.tables[0][0], 3 * row + 1);
      append_value(frame.tables[0][1], x[row]);
    }
    frames.push_back(std::move(frame));
    for (std::size_t k = 0; k < v.size(); ++k) {
      v[k] += dt * -40 * x[k];
      x[k] = x[k] + dt * v[k];
    }
    for (float& value : heat) value *= 0.9999f;
  }
  return frames;
}

inline io::Genesis toy_genesis(bool links = true) {
  io::Genesis genesis;
  genesis.engine = "toy";
  genesis.engine_revision = 1;
  genesis.schema = toy_schema(links);
  genesis.scenario = "[toy]\nstiffness = 40\n";
  genesis.parameters = {{"toy.stiffness", "40"}, {"record.tier", "deltas"}};
  genesis.models = {{"beads", "there are some"}};
  genesis.build = {{"compiler", "by hand"}};
  genesis.keyframe_steps = 16;
  return genesis;
}

/// Writes all frames and closes the log. `events`: recorded at their steps.
inline void write_log(const std::string& path, const io::Genesis& genesis,
                      const std::vector<io::Frame>& frames, io::FileSystem* files = nullptr,
                      const std::vector<io::Event>& events = {}) {
  const auto at = [&](std::uint64_t step) {
    std::vector<io::Event> out;
    for (const io::Event& event : events)
      if (event.step == step) out.push_back(event);
    return out;
  };
  io::WriterOptions options;
  options.overwrite = true;
  options.files = files;
  const auto writer =
      io::LogWriter::create(path, genesis, frames.front().view(), at(frames.front().step), options);
  for (std::size_t i = 1; i < frames.size(); ++i)
    writer->append(frames[i].view(), at(frames[i].step));
  writer->close();
}

/// The genesis of a fork of `parent` (whose frames are given) at `step`.
inline io::Genesis fork_genesis(const io::Genesis& parent, const std::vector<io::Frame>& frames,
                                std::uint64_t step, std::vector<io::Lineage::Change> changes) {
  io::Genesis child = parent;
  io::Lineage lineage;
  lineage.parent_run_id = parent.run_id();
  lineage.parent_name = "parent.varve";
  lineage.step = step;
  lineage.changes = std::move(changes);
  lineage.chain_base = parent.lineage ? parent.lineage->chain_base : io::chain_base(parent.schema);
  for (const io::Frame& frame : frames) {
    const io::Digest digest = io::digest_frame(parent.schema, frame.view());
    lineage.parent_digest = digest;
    lineage.parent_chain = io::chain_next(lineage.chain_base, digest);
    if (frame.step == step) break;
    lineage.chain_base = lineage.parent_chain;
  }
  if (parent.lineage) lineage.ancestors = parent.lineage->ancestors;
  lineage.ancestors.insert(lineage.ancestors.begin(), lineage.parent_run_id);
  for (const io::Lineage::Change& change : lineage.changes)
    for (auto& [key, value] : child.parameters)
      if (key == change.key) value = change.to;
  child.lineage = std::move(lineage);
  return child;
}

/// One bit of one value.
struct Plant {
  std::size_t frame = 0, field = 0;
  std::uint64_t particle = 0, bit = 0;  ///< index of the particle; bit within its values
};

/// A random bit of a field that is no id and no constant.
inline Plant random_plant(const io::Schema& schema, const std::vector<io::Frame>& frames,
                          std::mt19937_64& random) {
  for (;;) {
    Plant out;
    out.frame = random() % frames.size();
    out.field = random() % schema.fields.size();
    const io::FieldDescriptor& field = schema.fields[out.field];
    const std::uint64_t count = frames[out.frame].counts[out.field];
    if (field.is_id || field.constant || count == 0) continue;
    out.particle = random() % count;
    out.bit = random() % (8 * field.bytes_per_particle());
    return out;
  }
}

inline void flip(std::vector<io::Frame>& frames, const io::Schema& schema, const Plant& plant) {
  const std::size_t size = schema.fields[plant.field].bytes_per_particle();
  frames[plant.frame].fields[plant.field][plant.particle * size + plant.bit / 8] ^=
      std::byte{1} << (plant.bit % 8);
}

}  // namespace varve::test
