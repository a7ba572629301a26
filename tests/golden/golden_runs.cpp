#include "golden_runs.h"

#include <algorithm>
#include <cstring>

#include "io/bytes.h"
#include "io/digest.h"
#include "io/log_appender.h"
#include "io/memory_file.h"
#include "io/step_encoder.h"

namespace varve::golden {

namespace {

template <typename T>
std::vector<std::byte> bytes_of(const std::vector<T>& values) {
  std::vector<std::byte> out(values.size() * sizeof(T));
  if (!out.empty()) std::memcpy(out.data(), values.data(), out.size());
  return out;
}

// Beads on springs that lose energy, links between neighbours that come and go, a clock.
template <typename Real>
class Beads {
 public:
  Beads(std::uint64_t beads, Real dt) : dt_(dt) {
    for (std::uint64_t i = 0; i < beads; ++i) add();
  }

  static io::Schema schema() {
    using io::ScalarType;
    const ScalarType real = sizeof(Real) == 8 ? ScalarType::f64 : ScalarType::f32;
    io::Schema out;
    out.fields = {{"bead.id", "bead", ScalarType::u64, 1, "", true, true, ""},
                  {"bead.mass", "bead", real, 1, "kg", false, true, ""},
                  {"bead.x", "bead", real, 2, "m", false, false, "bead.v"},
                  {"bead.v", "bead", real, 2, "m/s", false, false, ""},
                  {"bead.hits", "bead", ScalarType::u32, 1, "", false, false, ""},
                  {"link.key", "link", ScalarType::u64, 3, "", true, false, ""},
                  {"link.stretch", "link", real, 1, "m", false, false, ""},
                  {"clock.phase", "clock", ScalarType::u8, 1, "", false, false, ""},
                  {"clock.time", "clock", ScalarType::f64, 1, "s", false, false, ""}};
    out.tables = {{"hit", {{"bead", ScalarType::u64, ""}, {"speed", real, "m/s"}}}};
    return out;
  }

  void advance() {
    ++step_;
    time_ = dt_ * static_cast<Real>(step_);
    hit_.clear();
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const Real pull = Real(40) * (rest_[i] - x_[i]) / mass_[i / 2];
      v_[i] = v_[i] + dt_ * (pull - Real(0.5) * v_[i]);
      x_[i] = x_[i] + dt_ * v_[i];
    }
    if (step_ % 5 == 0) {
      for (std::size_t b = step_ % 3; b < ids_.size(); b += ids_.size() / 2 + 1) {
        ++hits_[b];
        v_[2 * b] = v_[2 * b] + Real(0.25);
        hit_.push_back(b);
      }
    }
  }

  void add() {
    const std::uint64_t id = next_id_;
    next_id_ += 1 + id % 3;
    ids_.push_back(id);
    mass_.push_back(Real(1) + static_cast<Real>(id % 7) / Real(8));
    hits_.push_back(0);
    for (int c = 0; c < 2; ++c) {
      draw_ = draw_ * 6364136223846793005ULL + 1442695040888963407ULL;
      rest_.push_back(static_cast<Real>(id) / Real(64) + static_cast<Real>(c));
      x_.push_back(rest_.back() + static_cast<Real>(draw_ >> 40) / Real(1 << 26));
      v_.push_back(Real(0));
    }
  }

  void remove(std::size_t at) {
    const auto erase = [](auto& list, std::size_t from, std::size_t size) {
      const auto begin = list.begin() + static_cast<std::ptrdiff_t>(from);
      list.erase(begin, begin + static_cast<std::ptrdiff_t>(size));
    };
    erase(ids_, at, 1);
    erase(mass_, at, 1);
    erase(hits_, at, 1);
    erase(rest_, 2 * at, 2);
    erase(x_, 2 * at, 2);
    erase(v_, 2 * at, 2);
  }

  io::Frame frame() const {
    std::vector<std::uint64_t> keys;
    std::vector<Real> stretches;
    for (std::size_t b = 0; b + 1 < ids_.size() && b < links_max; ++b) {
      if ((ids_[b] + step_ / 4) % 3 == 0) continue;
      keys.insert(keys.end(), {ids_[b], 0, ids_[b + 1]});
      stretches.push_back(x_[2 * b + 2] - x_[2 * b]);
    }
    io::Frame out;
    out.step = step_;
    out.time = static_cast<double>(time_);
    out.dt = step_ == 0 ? 0.0 : static_cast<double>(dt_);
    const std::uint64_t beads = ids_.size();
    const std::uint64_t links = stretches.size();
    out.counts = {beads, beads, beads, beads, beads, links, links, 1, 1};
    out.fields = {bytes_of(ids_), bytes_of(mass_), bytes_of(x_), bytes_of(v_), bytes_of(hits_),
                  bytes_of(keys), bytes_of(stretches),
                  bytes_of(std::vector{static_cast<std::uint8_t>(step_ % 251)}),
                  bytes_of(std::vector{out.time})};
    std::vector<std::uint64_t> who;
    std::vector<Real> speeds;
    for (const std::size_t b : hit_) {
      who.push_back(ids_[b]);
      speeds.push_back(v_[2 * b]);
    }
    out.rows = {who.size()};
    out.tables = {{bytes_of(who), bytes_of(speeds)}};
    return out;
  }

  std::uint64_t last_id() const { return ids_.back(); }
  std::uint64_t id_at(std::size_t at) const { return ids_[at]; }

 private:
  static constexpr std::size_t links_max = 20;

  Real dt_;
  std::uint64_t step_ = 0;
  Real time_ = 0;
  std::uint64_t next_id_ = 1, draw_ = 1;
  std::vector<std::uint64_t> ids_;
  std::vector<Real> mass_, rest_, x_, v_;
  std::vector<std::uint32_t> hits_;
  std::vector<std::size_t> hit_;
};

io::Genesis genesis(const std::string& name, io::Schema schema, char id) {
  io::Genesis out;
  out.engine = "golden beads";
  out.engine_revision = 1;
  out.schema = std::move(schema);
  out.scenario = "beads = " + name + "\n";
  out.parameters = {{"beads", name}, {"pull", "40"}};
  out.models = {{"links", "beads have neighbours"}};
  out.files = {{"note.txt", "a file that the scenario names\n"}};
  out.build = {{"compiler", "any"}};
  out.log_id = "0123456789abcdef00000000000000" + std::string("0") + id;
  return out;
}

// Steps 0 to `steps`; where `lively`, beads and events come and go.
template <typename Real>
GoldenRun beads_run(const std::string& name, char id, std::uint64_t beads, std::uint64_t steps,
                    bool lively) {
  GoldenRun out;
  out.name = name;
  out.genesis = genesis(name, Beads<Real>::schema(), id);
  Beads<Real> engine(beads, Real(1) / Real(1024));
  for (std::uint64_t step = 0;; ++step) {
    auto& events = out.events[step];
    if (lively && step == 9) {
      for (int i = 0; i < 3; ++i) engine.add();
      events.push_back({step, "beads_added", {{"ids", "3 up to " +
                                               std::to_string(engine.last_id())}}});
    }
    if (lively && step == 21) {
      events.push_back({step, "beads_removed", {{"ids", std::to_string(engine.id_at(4))}}});
      engine.remove(4);
    }
    if (lively && step % 13 == 5)
      events.push_back({step, "annotation", {{"text", "line one\nline two \u00e9"}, {"by", ""}}});
    if (lively && step == 26) events.push_back({step, "change", {{"pull", "40 -> 40"}}});
    out.frames.push_back(engine.frame());
    if (step == steps) return out;
    engine.advance();
  }
}

GoldenRun fork_of(const GoldenRun& parent, std::uint64_t step) {
  GoldenRun out = parent;
  out.name = "fork";
  out.genesis.log_id.back() = '6';
  out.genesis.every = 1;
  io::Lineage lineage;
  lineage.parent_run_id = parent.genesis.run_id();
  lineage.parent_name = parent.name + ".varve";
  lineage.step = step;
  lineage.chain_base = io::chain_base(parent.genesis.schema);
  for (const io::Frame& frame : parent.frames) {
    lineage.parent_digest = io::digest_frame(parent.genesis.schema, frame.view());
    lineage.parent_chain = io::chain_next(lineage.chain_base, lineage.parent_digest);
    if (frame.step == step) break;
    lineage.chain_base = lineage.parent_chain;
  }
  lineage.changes = {{"record.every", "3", "1"}};
  lineage.ancestors = {lineage.parent_run_id};
  out.genesis.lineage = std::move(lineage);
  std::erase_if(out.frames, [&](const io::Frame& frame) { return frame.step < step; });
  std::erase_if(out.events, [&](const auto& events) { return events.first < step; });
  return out;
}

std::vector<GoldenRun> make_runs() {
  std::vector<GoldenRun> out;
  out.push_back(beads_run<double>("doubles", '1', 200, 30, true));
  out.back().genesis.keyframe_steps = 14;
  out.push_back(beads_run<float>("floats", '2', 200, 30, true));
  out.back().genesis.keyframe_steps = 14;
  out.push_back(beads_run<double>("every3", '3', 6, 36, true));
  out.back().genesis.every = 3;
  out.back().genesis.keyframe_steps = 12;
  out.push_back(beads_run<float>("digests", '4', 6, 70, false));
  out.back().genesis.tier = io::Tier::digests;
  out.back().genesis.keyframe_steps = 16;
  out.push_back(beads_run<double>("gap", '5', 5, 24, true));
  out.back().genesis.keyframe_steps = 8;
  out.back().lost = {5, 15};
  out.push_back(fork_of(out[2], 11));
  return out;
}

// As recovery puts a log together: gap records in place of steps, no writer thread.
std::vector<std::byte> written_with_gap(const GoldenRun& run) {
  io::MemoryFileSystem files;
  const auto file = files.create("log");
  io::LogAppender log(*file, *io::log_id_from(run.genesis.log_id), {});
  log.genesis(run.genesis, 4096);
  io::Digest chain = io::chain_base(run.genesis.schema);
  std::optional<io::StepEncoder> encoder(std::in_place, run.genesis, "log", io::Limits{}, chain);
  for (const io::Frame& frame : run.frames) {
    chain = io::chain_next(chain, io::digest_frame(run.genesis.schema, frame.view()));
    if (run.is_lost(frame.step)) {
      encoder.reset();
      continue;
    }
    if (!encoder) {
      log.gap({run.lost.first, run.lost.second, "lost on purpose"});
      io::Record unknown;
      unknown.header.kind = static_cast<io::RecordKind>(0xc5);
      unknown.header.step = run.lost.second;
      const std::vector<std::byte> body(24, std::byte{0x5a});
      unknown.message.assign(16, std::byte{1});
      log.foreign(unknown, body);
      // The encoder adds this step's own digest to the chain before it.
      io::Digest before = io::chain_base(run.genesis.schema);
      for (const io::Frame& earlier : run.frames) {
        if (earlier.step == frame.step) break;
        before = io::chain_next(before, io::digest_frame(run.genesis.schema, earlier.view()));
      }
      encoder.emplace(run.genesis, "log", io::Limits{}, before);
    }
    if (const auto events = run.events.find(frame.step); events != run.events.end())
      for (const io::Event& event : events->second) log.event(event);
    encoder->add(frame.view(), log);
  }
  log.end();
  log.write();
  return files.content("log");
}

}  // namespace

const std::vector<GoldenRun>& golden_runs() {
  static const std::vector<GoldenRun> runs = make_runs();
  return runs;
}

std::vector<std::byte> written(const GoldenRun& run) {
  if (run.lost.first <= run.lost.second) return written_with_gap(run);
  io::MemoryFileSystem files;
  io::WriterOptions options;
  options.files = &files;
  options.sync_seconds = 1e6;  // no wall clock in the bytes: every keyframe is synced, nothing else
  options.keyframe_sync_apart_seconds = 0;
  const auto events_at = [&](std::uint64_t step) {
    const auto found = run.events.find(step);
    return found == run.events.end() ? std::vector<io::Event>{} : found->second;
  };
  const io::Frame& first = run.frames.front();
  const auto writer = io::LogWriter::create("log", run.genesis, first.view(),
                                            events_at(first.step), options);
  for (std::size_t i = 1; i < run.frames.size(); ++i)
    writer->append(run.frames[i].view(), events_at(run.frames[i].step));
  writer->close();
  return files.content("log");
}

io::Digest outputs_digest(const io::Frame& frame, const std::vector<io::Event>& events) {
  io::CanonicalBytes bytes;
  for (std::size_t t = 0; t < frame.tables.size(); ++t) {
    bytes.number(frame.rows[t]);
    for (const auto& column : frame.tables[t]) bytes.raw(column);
  }
  for (const io::Event& event : events) {
    bytes.number(event.step);
    bytes.text(event.kind);
    for (const auto& [key, value] : event.items) {
      bytes.text(key);
      bytes.text(value);
    }
  }
  return io::digest_bytes(bytes.bytes());
}

}  // namespace varve::golden
