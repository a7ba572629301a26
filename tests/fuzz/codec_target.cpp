// Bytes that no encoder wrote, decoded. Input: schema u8; then records: u8 (1 keyframe, 2 time
// stands still), per field method u8, order u8, count u16, length u16, payload.
#include "frames.h"
#include "io/codec.h"
#include "io/errors.h"
#include "target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace varve;
  fuzz::Input input(data, size);
  const io::Schema schema = fuzz::schema(input.number<std::uint8_t>());
  const auto decoder = io::FrameDecoder::create(schema);
  double time = 0;
  for (std::uint64_t step = 0; !input.empty(); ++step) {
    const auto flags = input.number<std::uint8_t>();
    const double dt = (flags & 2) != 0 ? 0.0 : 0.001;
    time += dt;
    std::vector<io::EncodedField> fields(schema.fields.size());
    for (io::EncodedField& field : fields) {
      field.method = input.number<std::uint8_t>();
      field.order = input.number<std::uint8_t>();
      field.count = input.number<std::uint16_t>();
      field.payload = input.bytes(input.number<std::uint16_t>());
    }
    try {
      const io::Frame& frame = decoder->decode(fields, (flags & 1) != 0, step, time, dt);
      for (std::size_t i = 0; i < fields.size(); ++i) {
        fuzz::require(frame.counts[i] == fields[i].count &&
                          frame.fields[i].size() ==
                              fields[i].count * schema.fields[i].bytes_per_particle(),
                      "a field has as many values as it declares");
      }
    } catch (const io::LogError& error) {
      fuzz::require(error.kind() == io::ErrorKind::damaged || error.kind() == io::ErrorKind::limit,
                    error.what());
    }
  }
  return 0;
}
