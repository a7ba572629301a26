// Records 2000 steps of a double pendulum, reads them back, and checks every byte and every state.
#include <cstdio>
#include <exception>

#include "io/digest.h"
#include "io/log_reader.h"
#include "io/log_writer.h"
#include "pendulum.h"

namespace {

constexpr std::uint64_t steps = 2000;

int record_and_read(const char* path) {
  Pendulum pendulum;
  const auto writer = varve::io::LogWriter::create(path, pendulum_genesis(pendulum),
                                                   pendulum.frame(), pendulum.events());
  for (std::uint64_t n = 0; n < steps; ++n) {
    pendulum.advance();
    writer->append(pendulum.frame(), pendulum.events());
  }
  writer->close();

  const auto log = varve::io::LogReader::open(path);
  const auto verification = log->verify();
  if (verification.completeness != varve::io::Completeness::complete || !verification.closed ||
      verification.steps != steps + 1 || verification.bytes_checked != verification.file_bytes) {
    std::fprintf(stderr, "%s does not verify\n", path);
    return 1;
  }
  Pendulum again;
  std::uint64_t equal = 0;
  log->for_each(0, steps, [&](const varve::io::StepHeader& header, const varve::io::Frame* frame) {
    if (header.step > 0) again.advance();
    const auto digest = varve::io::digest_frame(again.schema(), again.frame());
    const bool same = frame != nullptr && digest == header.digest &&
                      digest == varve::io::digest_frame(again.schema(), frame->view());
    equal += same ? 1 : 0;
    return same;
  });
  std::printf("%llu of %llu states read back equal, %llu bytes, %zu events\n",
              static_cast<unsigned long long>(equal), static_cast<unsigned long long>(steps + 1),
              static_cast<unsigned long long>(verification.file_bytes), log->events().size());
  return equal == steps + 1 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return argc == 2 ? record_and_read(argv[1]) : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
