#include "log_surgery.h"

#include <bit>
#include <map>
#include <memory>
#include <vector>

#include "io/errors.h"
#include "io/log_writer.h"

namespace varve::test {

namespace {

void turn_bit(const io::Schema& schema, io::Frame& frame, const Alteration& what,
              const std::string& path) {
  const int at = schema.find(what.field);
  if (at < 0) {
    throw io::LogError(io::ErrorKind::mismatch, path, "no field '" + what.field + "'");
  }
  const auto index = static_cast<std::size_t>(at);
  const io::FieldDescriptor& field = schema.fields[index];
  const std::size_t scalar = io::size_of(field.type);
  if (what.particle >= frame.counts[index] || what.component >= field.components ||
      what.bit >= 8 * scalar) {
    throw io::LogError(io::ErrorKind::mismatch, path,
                       "field '" + what.field + "' has no such particle, component or bit");
  }
  std::size_t byte = what.bit / 8;
  if constexpr (std::endian::native == std::endian::big) byte = scalar - 1 - byte;
  frame.fields[index][(what.particle * field.components + what.component) * scalar + byte] ^=
      static_cast<std::byte>(1U << (what.bit % 8));
}

}  // namespace

void write_altered_log(const std::string& input, const std::string& output,
                       const Alteration& alteration, io::FileSystem* files) {
  const auto reader = io::LogReader::open(input, files);
  std::map<std::uint64_t, std::vector<io::Event>> events;
  for (const io::Event& event : reader->events()) events[event.step].push_back(event);
  io::WriterOptions options;
  options.overwrite = true;
  options.files = files;
  std::unique_ptr<io::LogWriter> writer;
  bool altered = false;
  const auto copy = [&](const io::StepHeader& header, const io::Frame* stored) {
    if (stored == nullptr) {
      throw io::LogError(io::ErrorKind::mismatch, input,
                         "step " + std::to_string(header.step) + " stores no state");
    }
    io::Frame frame = *stored;
    if (header.step == alteration.step) {
      turn_bit(reader->genesis().schema, frame, alteration, input);
      altered = true;
    }
    if (!writer) {
      writer = io::LogWriter::create(output, reader->genesis(), frame.view(), events[header.step],
                                     options);
    } else {
      writer->append(frame.view(), events[header.step]);
    }
    return true;
  };
  reader->for_each(reader->first_step(), reader->last_step(), copy);
  writer->close();
  if (!altered) {
    throw io::LogError(io::ErrorKind::mismatch, input,
                       "holds no step " + std::to_string(alteration.step));
  }
}

}  // namespace varve::test
