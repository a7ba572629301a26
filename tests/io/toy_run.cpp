#include "toy_run.h"

#include <bit>
#include <cstring>

namespace varve::test {

namespace {

template <typename T>
std::vector<std::byte> bytes_of(const std::vector<T>& values) {
  std::vector<std::byte> out(values.size() * sizeof(T));
  if (!out.empty()) std::memcpy(out.data(), values.data(), out.size());
  return out;
}

constexpr double toy_dt = 0.0009765625;

}  // namespace

io::Schema toy_schema() {
  using io::ScalarType;
  io::Schema schema;
  schema.fields = {
      {"bead.id", "bead", ScalarType::u64, 1, "", true, true, ""},
      {"bead.mass", "bead", ScalarType::f32, 1, "kg", false, true, ""},
      {"bead.x", "bead", ScalarType::f64, 2, "m", false, false, "bead.v"},
      {"bead.v", "bead", ScalarType::f64, 2, "m/s", false, false, ""},
      {"bead.hits", "bead", ScalarType::u32, 1, "", false, false, ""},
      {"clock.phase", "clock", ScalarType::u8, 1, "", false, false, ""},
  };
  schema.tables = {{"hit", {{"bead", ScalarType::u64, ""}, {"speed", ScalarType::f64, "m/s"}}}};
  return schema;
}

io::Genesis toy_genesis(const ToyOptions& options) {
  io::Genesis genesis;
  genesis.engine = "toy";
  genesis.engine_revision = 3;
  genesis.schema = toy_schema();
  if (!options.with_tables) genesis.schema.tables.clear();
  genesis.scenario = "beads = " + std::to_string(options.beads) + "\n";
  genesis.parameters = {{"beads", std::to_string(options.beads)},
                        {"seed", std::to_string(options.seed)}};
  genesis.models = {{"beads", "the scene has beads"}};
  genesis.files = {{"shape.txt", "round\n"}};
  genesis.tier = options.tier;
  genesis.every = options.every;
  genesis.keyframe_steps = options.keyframe_steps;
  genesis.log_id = "000102030405060708090a0b0c0d0e0f";
  genesis.build = {{"compiler", "any"}};
  return genesis;
}

ToyRun::ToyRun(const ToyOptions& options) : options_(options), step_(options.first_step) {
  for (std::uint64_t i = 0; i < options.beads; ++i) add_bead();
  publish();
}

// A counter-based draw in [0, 1).
double ToyRun::random(std::uint64_t counter) const {
  std::uint64_t z = counter * 0x9e3779b97f4a7c15ULL + options_.seed * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53;
}

void ToyRun::add_bead() {
  const std::uint64_t id = ids_.empty() ? 1 : ids_.back() + 1 + (ids_.size() % 3);
  ids_.push_back(id);
  mass_.push_back(1.0f + static_cast<float>(ids_.size()));
  hits_.push_back(0);
  for (std::uint64_t c = 0; c < 2; ++c) {
    x_.push_back(random(4 * id + c));
    v_.push_back(random(4 * id + 2 + c) - 0.5);
  }
}

void ToyRun::advance() {
  ++step_;
  time_ += toy_dt;
  if (options_.bead_added_every != 0 && step_ % options_.bead_added_every == 0) add_bead();
  for (std::size_t i = 0; i < x_.size(); ++i) {
    v_[i] += toy_dt * (0.5 - x_[i]) * 100.0;
    x_[i] += toy_dt * v_[i];
  }
  if (step_ % 5 == 0) ++hits_[step_ % hits_.size()];
  publish();
}

void ToyRun::publish() {
  frame_ = {};
  frame_.step = step_;
  frame_.time = time_;
  frame_.dt = step_ == options_.first_step ? 0.0 : toy_dt;
  const std::uint64_t n = ids_.size();
  frame_.counts = {n, n, n, n, n, 1};
  frame_.fields = {bytes_of(ids_), bytes_of(mass_), bytes_of(x_),
                   bytes_of(v_),   bytes_of(hits_), {static_cast<std::byte>(step_ & 0xff)}};
  if (!options_.with_tables) return;
  const std::uint64_t rows = step_ % 5 == 0 && step_ != options_.first_step ? step_ % 4 + 1 : 0;
  std::vector<std::uint64_t> beads;
  std::vector<double> speeds;
  for (std::uint64_t r = 0; r < rows; ++r) {
    beads.push_back(ids_[r % n]);
    speeds.push_back(v_[r % n]);
  }
  frame_.rows = {rows};
  frame_.tables = {{bytes_of(beads), bytes_of(speeds)}};
}

std::vector<io::Event> ToyRun::events() const {
  if (options_.event_every == 0 || step_ % options_.event_every != 0) return {};
  return {{step_, "change", {{"wind", std::to_string(step_)}, {"unit", "m/s"}}},
          {step_, "annotation", {{"text", "step " + std::to_string(step_)}}}};
}

std::map<std::uint64_t, io::Frame> toy_frames(const ToyOptions& options) {
  std::map<std::uint64_t, io::Frame> out;
  ToyRun run(options);
  for (std::uint64_t i = 0; i <= options.steps; ++i) {
    if (i > 0) run.advance();
    out[run.frame().step] = run.frame();
  }
  return out;
}

void write_toy_log(const std::string& path, const ToyOptions& options,
                   const io::WriterOptions& writer_options, bool close) {
  ToyRun run(options);
  const auto writer = io::LogWriter::create(path, toy_genesis(options), run.frame().view(),
                                            run.events(), writer_options);
  for (std::uint64_t i = 0; i < options.steps; ++i) {
    run.advance();
    writer->append(run.frame().view(), run.events());
  }
  if (close) {
    writer->close();
  } else {
    writer->flush();
  }
}

io::WriterOptions untimed(io::FileSystem& files) {
  io::WriterOptions options;
  options.files = &files;
  options.sync_seconds = 1e6;
  options.keyframe_sync_apart_seconds = 0;
  return options;
}

bool same_frame(const io::Frame& one, const io::Frame& other) {
  return one.step == other.step &&
         std::bit_cast<std::uint64_t>(one.time) == std::bit_cast<std::uint64_t>(other.time) &&
         std::bit_cast<std::uint64_t>(one.dt) == std::bit_cast<std::uint64_t>(other.dt) &&
         one.counts == other.counts && one.fields == other.fields && one.rows == other.rows &&
         one.tables == other.tables;
}

}  // namespace varve::test
