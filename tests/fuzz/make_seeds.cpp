// Writes the seed corpus: make_seeds CORPUS_FOLDER SCENARIO_FOLDER. The same bytes at every run, so
// that the committed corpus can be made anew.
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "frames.h"
#include "io/codec.h"
#include "io/log_appender.h"
#include "io/memory_file.h"
#include "io/messages.h"
#include "io/packing.h"
#include "io/step_encoder.h"
#include "log_damage.h"
#include "repair.h"
#include "target.h"
#include "toy_run.h"

namespace {

namespace fs = std::filesystem;
using namespace varve;
using Bytes = std::vector<std::byte>;

class Corpus {
 public:
  explicit Corpus(fs::path folder) : folder_(std::move(folder)) {}
  void add(const std::string& target, const std::string& name, std::span<const std::byte> bytes) {
    fs::create_directories(folder_ / target);
    std::ofstream file(folder_ / target / name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    if (!file.flush()) {
      std::fprintf(stderr, "%s: cannot be written\n", (folder_ / target / name).c_str());
      std::exit(1);
    }
  }

 private:
  fs::path folder_;
};

Bytes with_mode(std::uint8_t mode, std::span<const std::byte> bytes) {
  return fuzz::Output().number(mode).bytes(bytes).all();
}

constexpr std::uint8_t repair_all =
    fuzz::repair_checksums | fuzz::repair_places | fuzz::repair_contents;

test::ToyOptions small() {
  test::ToyOptions options;
  options.beads = 2;
  options.steps = 7;
  options.keyframe_steps = 4;
  options.event_every = 3;
  return options;
}

Bytes written(const test::ToyOptions& options, bool close = true) {
  io::MemoryFileSystem files;
  test::write_toy_log("log", options, test::untimed(files), close);
  return files.content("log");
}

// Genesis as it is rather than packed, so that its words can be mutated. Offsets change with it:
// for logs without an index record only.
Bytes with_plain_genesis(const Bytes& log) {
  const test::PlacedRecord first = test::LogBytes(log).records().front();
  Bytes message(first.header.message_raw);
  const auto stored = std::span(log).subspan(io::header_bytes, first.header.message_stored);
  io::unpack(first.header.packing, stored, message, "genesis", {});
  io::RecordHeader header = first.header;
  header.packing = io::Packing::plain;
  Bytes out = test::make_record(header, message);
  out.insert(out.end(), log.begin() + static_cast<std::ptrdiff_t>(first.end()), log.end());
  return out;
}

io::Genesis fork_genesis(const test::ToyOptions& options) {
  io::Genesis genesis = test::toy_genesis(options);
  genesis.lineage.emplace();
  genesis.lineage->parent_run_id = std::string(32, 'a');
  genesis.lineage->parent_name = "parent.varve";
  genesis.lineage->changes = {{"seed", "1", "2"}};
  genesis.lineage->ancestors = {std::string(32, 'a'), std::string(32, 'b')};
  return genesis;
}

// The records of the codec's target for a run of frames, at most `records` of them.
Bytes encoded(std::span<const std::byte> bytes, int records) {
  fuzz::Input input(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const auto number = input.number<std::uint8_t>();
  fuzz::Frames frames(number);
  const auto encoder = io::FrameEncoder::create(frames.schema());
  fuzz::Output out;
  out.number(number);
  for (int n = 0; n < records; ++n) {
    const auto flags = input.number<std::uint8_t>();
    frames.next(flags, input);
    bool keyframe = false;
    const auto fields = encoder->encode(frames.frame().view(), keyframe);
    out.number(static_cast<std::uint8_t>(keyframe ? 1 : 0));
    for (const io::EncodedField& field : fields) {
      out.number(field.method).number(field.order);
      out.number(static_cast<std::uint16_t>(field.count));
      out.number(static_cast<std::uint16_t>(field.payload.size())).bytes(field.payload);
    }
  }
  return out.all();
}

// A log as recovery leaves it: a gap, then a keyframe.
Bytes with_gap() {
  const test::ToyOptions options = small();
  const io::Genesis genesis = fork_genesis(options);
  io::MemoryFileSystem files;
  const auto file = files.create("log");
  io::LogAppender log(*file, *io::log_id_from(genesis.log_id), {});
  log.genesis(genesis, 1000);
  io::StepEncoder before(genesis, "log", {}, {});
  io::StepEncoder after(genesis, "log", {}, io::Digest{});  // the chain begins anew behind a gap
  for (const auto& [step, frame] : test::toy_frames(options)) {
    if (step == 3) {
      log.gap({3, 3, "lost"});
    } else {
      (step < 3 ? before : after).add(frame.view(), log);
    }
  }
  log.end();
  log.write();
  return files.content("log");
}

void logs(Corpus& corpus) {
  const Bytes plain = written(small());
  test::ToyOptions options = small();
  options.tier = io::Tier::digests;
  const Bytes digests = written(options);
  options = small();
  options.every = 3;
  const Bytes sparse = written(options);
  options = small();
  options.bead_added_every = 2;
  const Bytes growing = written(options);
  const Bytes open = with_plain_genesis(written(small(), false));
  const std::pair<const char*, Bytes> all[] = {{"deltas", plain},      {"digests", digests},
                                               {"every-third", sparse}, {"growing", growing},
                                               {"plain-genesis", open}, {"gap", with_gap()}};
  for (const auto& [name, bytes] : all) {
    corpus.add("log", name, with_mode(repair_all, bytes));
    corpus.add("log", std::string(name) + "-as-is", with_mode(0, bytes));
  }
  options = small();
  options.seed = 2;
  const std::pair<const char*, Bytes> others[] = {
      {"same", plain}, {"other", written(options)}, {"growing", growing}, {"plain", open}};
  for (const auto& [name, bytes] : others) {
    corpus.add("diff", name,
               fuzz::Output().number(repair_all).number(static_cast<std::uint32_t>(open.size()))
                   .bytes(open).bytes(bytes).all());
  }
  int number = 0;
  for (const auto& [name, bytes] : all) {
    for (const test::PlacedRecord& record : test::LogBytes(bytes).records()) {
      const auto slice = std::span(bytes).subspan(record.offset, record.end() - record.offset);
      if (++number % 3 == 0) corpus.add("record", std::to_string(number), with_mode(0, slice));
    }
  }
  corpus.add("record", "log", with_mode(fuzz::repair_checksums, plain));
}

void messages(Corpus& corpus) {
  using fuzz::repair_contents;
  const io::Genesis genesis = fork_genesis(small());
  corpus.add("message", "genesis", with_mode(repair_contents, io::encode_genesis(genesis, 100)));
  io::StepMessage step;
  step.time = 0.5;
  corpus.add("message", "step-digest", with_mode(1, io::encode(step)));
  step.fields = {{1, 2, 16, 1, 0}, {3, 4, 9, 21, 5}};
  step.tables = {{5, 6, 7, io::Packing::zstd}};
  corpus.add("message", "step", with_mode(1, io::encode(step)));
  corpus.add("message", "event",
             with_mode(2, io::encode(io::Event{7, "change", {{"wind", "3"}, {"unit", "m/s"}}})));
  io::IndexMessage index;
  index.gaps = {30, 31};
  index.states = {io::StoredState::keyframe, io::StoredState::delta, io::StoredState::none};
  index.skips = {{800, 9}, {400, 5}};
  index.events = {112, 900};
  corpus.add("message", "index", with_mode(3, io::encode(index)));
  io::EndMessage end;
  end.steps = 3;
  end.last_step = 2;
  corpus.add("message", "end", with_mode(4, io::encode(end)));
  corpus.add("message", "gap", with_mode(5, io::encode(io::GapMessage{3, 5, "rot"})));
}

// Inputs of the round trip, and what the encoder makes of them as inputs of the decoder.
void frames(Corpus& corpus) {
  const std::pair<const char*, std::array<std::uint8_t, 3>> ways[] = {
      {"smooth", {1, 1, 2}}, {"noise", {4, 5, 4}}, {"random", {0, 1, 0}}, {"jumps", {6, 3, 23}}};
  for (unsigned number = 0; number < fuzz::schemas; ++number) {
    for (const auto& [name, flags] : ways) {
      fuzz::Output input;
      input.number(static_cast<std::uint8_t>(number));
      for (int n = 0; n < 24; ++n) {
        const std::int8_t coming = n == 0 ? 30 : n % 9 == 8 ? (n % 2 == 0 ? 1 : -1) : 0;
        input.number(flags[static_cast<std::size_t>(n) % 3]).number(coming);
        input.number(static_cast<std::uint16_t>(77 * n)).number(std::uint8_t{0});
      }
      const std::string file = std::string(name) + "-" + std::to_string(number);
      corpus.add("roundtrip", file, input.all());
      corpus.add("codec", file, encoded(input.all(), 5));
    }
  }
}

void scenarios(Corpus& corpus, const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".cfg") continue;
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    corpus.add("scenario", entry.path().filename(), std::as_bytes(std::span(text)));
  }
  const std::pair<const char*, std::string> more[] = {
      {"event", "[domain]\nwidth = 6 cm\nheight=40mm\n[event.wider]\nat = t=0.5s\nkey = "
                "domain.width\nvalue = 7 cm\n[time]\nuntil = 1 s\n"},
      {"bom", "\xef\xbb\xbf; a comment\r\n[fluid]\r\nviscosity = 1e-3 Pa.s # water\r\n"},
      {"errors", "[nowhere]\nx = 1\n[domain\nwidth = lots\nwidth = 2 s\n= 3\nwidth\n"},
      {"numbers", "[domain]\nwidth = 1e309\nheight = nan\n[time]\nsteps = -1\ndt = 0x1p-3 s\n"}};
  for (const auto& [name, text] : more)
    corpus.add("scenario", name, std::as_bytes(std::span(text)));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: make_seeds CORPUS_FOLDER SCENARIO_FOLDER\n");
    return 2;
  }
  Corpus corpus(argv[1]);
  logs(corpus);
  messages(corpus);
  frames(corpus);
  scenarios(corpus, argv[2]);
  return 0;
}
