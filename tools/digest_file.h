// A run's digests as a small text file, to be committed as a regression reference.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/digest.h"
#include "io/log_reader.h"

namespace varve::tools {

/// One step of a digest file.
struct DigestLine {
  std::uint64_t step = 0;
  double time = 0;  ///< [s]
  io::Digest chain;
};

struct DigestFile {
  std::string path;
  std::string engine;  ///< "varve"
  std::uint32_t engine_revision = 0;  ///< numbers computed by another revision are no reference
  io::Digest scenario;  ///< of the resolved scenario and the files it names
  io::Digest schema;  ///< of the field schema
  std::uint64_t every = 1;
  std::string reason;  ///< why the digests were last rewritten; may be empty
  /// The resolved scenario key by key, so that a changed input can be named.
  std::vector<std::pair<std::string, std::string>> parameters;
  std::vector<DigestLine> lines;  ///< ascending steps, the first and the last step among them

  std::uint64_t first_step() const { return lines.front().step; }
  std::uint64_t last_step() const { return lines.back().step; }
  /// Line of `step`, or nullptr.
  const DigestLine* find(std::uint64_t step) const;
};

/// Digest of a genesis' scenario text and embedded files.
io::Digest scenario_digest(const io::Genesis& genesis);

/// Every `every`-th step of a log (multiples), its first and its last.
DigestFile make_digest_file(const io::LogReader& log, std::uint64_t every);

/// The file's text; it ends in a line that holds a digest of all before it.
std::string digest_file_text(const DigestFile& file);

/// Inverse of digest_file_text(); line ends may be CRLF. Throws LogError(damaged) naming the line.
DigestFile parse_digest_file(const std::string& text, const std::string& path);

/// True if the file at `path` starts like a digest file. Throws LogError(not_found).
bool is_digest_file(const std::string& path);
/// Reads and parses. Throws LogError (not_found, damaged).
DigestFile read_digest_file(const std::string& path);
/// Writes to a temporary name beside `path`, then renames. Throws LogError (exists, write_failed).
void write_digest_file(const DigestFile& file, const std::string& path, bool overwrite);

/// True if a key can't reach a bit of the state: what is recorded, how long the run is, its title.
bool is_output_key(std::string_view key);

/// Keys with unlike values, as (key, value in a, value in b); "(not set)" where one side lacks a
/// key.
struct KeyDifference {
  std::string key, a, b;
};
std::vector<KeyDifference> compare_keys(const std::vector<std::pair<std::string, std::string>>& a,
                                        const std::vector<std::pair<std::string, std::string>>& b);

}  // namespace varve::tools
