// Logs that lie consistently: every checksum, digest and chain holds, yet one recorded state is not
// what the engine computed. Only re-execution can find it.
#pragma once

#include <cstdint>
#include <string>

#include "io/file.h"
#include "io/log_reader.h"

namespace varve::test {

/// What was altered.
struct Alteration {
  std::uint64_t step = 0;
  std::string field;
  std::uint64_t particle = 0;    ///< its place in the field, from 0
  std::uint32_t component = 0;
  std::uint32_t bit = 0;         ///< of the scalar, 0 the lowest
};

/// Copies the log at `input` to `output` with one bit of one value of the state at one step turned
/// over. The digest of that step, the chain from it on and all checksums are those of the altered
/// state; the states of later steps stay as recorded. Genesis and its ids stay the same. Throws
/// LogError (mismatch) where the log stores no such value.
void write_altered_log(const std::string& input, const std::string& output,
                       const Alteration& alteration, io::FileSystem* files = nullptr);

}  // namespace varve::test
