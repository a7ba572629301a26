// Writes the golden logs and their digests: golden_bless FOLDER REASON. For a deliberate change of
// the writer's bytes only (io/FORMAT.md, "Golden logs"); the reason goes into the digest file.
#include <zstd.h>

#include <cstdio>
#include <fstream>

#include "golden_file.h"

namespace {

using namespace varve;

void write(const std::string& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  file << content;
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

std::string lines_of(const std::string& name, const golden::Committed& committed) {
  std::ostringstream text;
  text << "log " << name << ' ' << committed.bytes << ' ' << committed.file << '\n';
  for (const auto& [step, digests] : committed.steps)
    text << step << ' ' << digests.digest << ' ' << digests.outputs << '\n';
  return text.str();
}

int bless(const std::string& folder, const std::string& reason) {
  const std::string digests = folder + "/logs.digests";
  std::ostringstream text;
  text << "# The golden logs of format version 1: per log its bytes and the digest of the file,\n"
          "# then per step the digest of the state and that of its tables and events. Made by\n"
          "# golden_bless, last because: "
       << reason << "\nzstd " << ZSTD_versionString() << '\n';
  std::map<std::string, golden::Committed> kept;  // logs under other names stay for ever
  if (std::ifstream(digests).good()) kept = golden::read_committed(digests).logs;
  for (const golden::GoldenRun& run : golden::golden_runs()) {
    const std::vector<std::byte> bytes = golden::written(run);
    write(folder + "/" + run.name + ".varve",
          {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    text << lines_of(run.name, golden::committed(run, bytes));
    kept.erase(run.name);
    std::printf("%s.varve: %zu bytes\n", run.name.c_str(), bytes.size());
  }
  for (const auto& [name, committed] : kept) text << lines_of(name, committed);
  write(digests, text.str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 || *argv[2] == '\0') {
    std::fprintf(stderr, "usage: golden_bless FOLDER REASON\n");
    return 2;
  }
  try {
    return bless(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "golden_bless: %s\n", error.what());
    return 1;
  }
}
