#include "tools/diff_selftest.h"

#include <algorithm>
#include <random>

#include <fmt/format.h>

#include "io/log_writer.h"
#include "tools/cli.h"
#include "tools/diff_run.h"
#include "tools/scratch_folder.h"

namespace varve::tools {
namespace {

struct Plant {
  std::size_t frame = 0, field = 0;
  std::uint64_t particle_index = 0, bit = 0;  // bit within the particle's values
};

// Consecutive stored states around a random step.
std::vector<io::Frame> read_window(const io::LogReader& run, std::uint64_t steps,
                                   std::mt19937_64& random) {
  const std::uint64_t first = run.first_step(), last = run.last_step();
  const std::uint64_t length = std::min(last - first, steps - 1);
  const std::uint64_t begin = first + random() % (last - first - length + 1);
  std::vector<io::Frame> frames;
  run.for_each(begin, begin + length, [&](const io::StepHeader& header, const io::Frame* frame) {
    if (frame != nullptr) {
      frames.push_back(io::Frame::copy_of(frame->view()));
      frames.back().step = header.step;
    }
    return true;
  });
  return frames;
}

// Steps are renumbered, since a log's steps follow one another and stored states may not.
void write_copy(const io::Genesis& genesis, const std::vector<io::Frame>& frames,
                const std::string& path) {
  io::WriterOptions options;
  options.overwrite = true;
  io::FrameView first = frames.front().view();
  first.step = 0;
  const auto writer = io::LogWriter::create(path, genesis, first, {}, options);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    io::FrameView view = frames[i].view();
    view.step = i;
    writer->append(view, {});
  }
  writer->close();
}

// Fields that are the same at every step of a particle's life can't change within a window.
std::optional<Plant> choose(const io::Schema& schema, const std::vector<io::Frame>& frames,
                            std::mt19937_64& random) {
  Plant out;
  for (int attempt = 0; attempt < 1000; ++attempt) {
    out.frame = random() % frames.size();
    out.field = random() % schema.fields.size();
    const io::FieldDescriptor& field = schema.fields[out.field];
    const std::uint64_t count = frames[out.frame].counts[out.field];
    if (field.is_id || (field.constant && out.frame != 0) || count == 0) continue;
    out.particle_index = random() % count;
    out.bit = random() % (8 * field.bytes_per_particle());
    return out;
  }
  return {};
}

void flip(std::vector<io::Frame>& frames, const io::Schema& schema, const Plant& plant) {
  const std::size_t size = schema.fields[plant.field].bytes_per_particle();
  frames[plant.frame].fields[plant.field][plant.particle_index * size + plant.bit / 8] ^=
      std::byte{1} << (plant.bit % 8);
}

std::string particle_at(const io::Schema& schema, const io::Frame& frame, const Plant& plant) {
  for (std::size_t f = 0; f < schema.fields.size(); ++f) {
    const io::FieldDescriptor& field = schema.fields[f];
    if (!field.is_id || field.population != schema.fields[plant.field].population) continue;
    std::vector<std::uint64_t> id;
    for (std::uint32_t c = 0; c < field.components; ++c)
      id.push_back(io::scalar_at(field, {frame.counts[f], frame.fields[f]},
                                 plant.particle_index * field.components + c)
                       .bits);
    return io::particle_name(id);
  }
  return std::to_string(plant.particle_index);
}

DiffReport compare_files(const std::string& a, const std::string& b) {
  return compare_logs(*io::LogReader::open(a), *io::LogReader::open(b), {});
}

}  // namespace

SelfTest run_self_test(const io::LogReader& run, std::uint64_t plants, std::uint64_t window_steps,
                       std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const io::Schema& schema = run.genesis().schema;
  io::Genesis genesis = run.genesis();
  genesis.lineage.reset();  // a window is no fork: it has its own chain
  genesis.log_id.clear();
  genesis.tier = io::Tier::deltas;
  genesis.every = 1;
  std::vector<io::Frame> frames = read_window(run, window_steps, random);
  if (frames.empty())
    throw UsageError(fmt::format("{}: stores no state to plant a difference into", run.path()));
  const ScratchFolder folder;
  const std::string whole = folder.file("whole.varve"), copy = folder.file("copy.varve");
  write_copy(genesis, frames, whole);

  SelfTest out;
  write_copy(genesis, frames, copy);
  out.equal_pairs = 1;
  if (compare_files(whole, copy).verdict != Verdict::identical) {
    ++out.false_alarms;
    out.failures.push_back("an unchanged copy was called different");
  }
  for (std::uint64_t n = 0; n < plants; ++n) {
    const auto plant = choose(schema, frames, random);
    if (!plant) throw UsageError(fmt::format("{}: has no value to change", run.path()));
    flip(frames, schema, *plant);
    write_copy(genesis, frames, copy);
    flip(frames, schema, *plant);
    ++out.planted;
    const DiffReport found = compare_files(whole, copy);
    const std::string& field = schema.fields[plant->field].name;
    const std::string particle = particle_at(schema, frames[plant->frame], *plant);
    if (found.verdict == Verdict::different && found.first->step == plant->frame &&
        found.first->field.starts_with(field) && found.first->particle == particle) {
      ++out.located;
      continue;
    }
    out.failures.push_back(fmt::format("bit {} of {}, particle {}, step {}: {}", plant->bit, field,
                                       particle, plant->frame, headline(found)));
  }
  return out;
}

}  // namespace varve::tools
