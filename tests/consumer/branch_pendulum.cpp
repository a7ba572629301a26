// Replays a recorded pendulum, and forks it twice at half its length: unchanged, and on the moon.
#include <cstdio>
#include <exception>
#include <string>

#include "pendulum.h"
#include "tools/recording.h"

namespace {

using namespace varve;

bool always(const io::FrameView&) { return true; }

void branch(const io::LogReader& parent, const std::string& path, const char* gravity) {
  const std::uint64_t at = parent.last_step() / 2;
  Pendulum pendulum;
  tools::seek(parent, at, pendulum);
  io::Genesis genesis = parent.genesis();
  genesis.log_id.clear();
  std::vector<io::Lineage::Change> changes;
  if (gravity != nullptr) {
    pendulum.change({{"gravity", gravity}});
    changes = {{"gravity", genesis.parameters[0].second, gravity}};
    genesis.parameters[0].second = gravity;
  }
  genesis.lineage = tools::make_lineage(parent, at, changes);
  const auto writer =
      io::LogWriter::create(path, genesis, pendulum.frame(), pendulum.events());
  tools::record(pendulum, *writer, {parent.last_step(), {}}, always);
}

int run(const std::string& path) {
  const auto parent = io::LogReader::open(path);
  Pendulum pendulum;
  const auto replayed =
      tools::replay(*parent, pendulum, parent->first_step(), parent->last_step(), always);
  if (replayed.first) {
    std::fprintf(stderr, "replay differs: %s\n", tools::describe(*replayed.first).c_str());
    return 1;
  }
  branch(*parent, path + ".same", nullptr);
  branch(*parent, path + ".moon", "1.62");
  const auto chain = [&](const std::string& log) {
    return io::LogReader::open(log)->header(parent->last_step())->chain;
  };
  std::printf("%llu steps replayed\n", static_cast<unsigned long long>(replayed.steps_checked - 1));
  return chain(path + ".same") == chain(path) && chain(path + ".moon") != chain(path) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return argc == 2 ? run(argv[1]) : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
