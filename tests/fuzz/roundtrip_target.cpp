// Arbitrary frames, encoded and decoded: the same bits, or a promise is broken. Input: schema u8;
// then frames: u8 flags (8: restart), and what Frames takes (frames.h).
#include "frames.h"
#include "io/codec.h"
#include "io/errors.h"
#include "target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace varve;
  fuzz::Input input(data, size);
  fuzz::Frames frames(input.number<std::uint8_t>());
  const auto encoder = io::FrameEncoder::create(frames.schema());
  const auto decoder = io::FrameDecoder::create(frames.schema());
  for (int n = 0; n < 32 && !input.empty(); ++n) {
    const auto flags = input.number<std::uint8_t>();
    frames.next(flags, input);
    const io::Frame& frame = frames.frame();
    if ((flags & 8) != 0) encoder->restart();
    bool keyframe = false;
    const auto fields = encoder->encode(frame.view(), keyframe);
    fuzz::require(keyframe || n > 0, "the first frame is a keyframe");
    try {
      const io::Frame& back =
          decoder->decode(fields, keyframe, frame.step, frame.time, frame.dt);
      fuzz::require(back.counts == frame.counts && back.fields == frame.fields,
                    "a frame is decoded to the bits that were encoded");
    } catch (const io::LogError& error) {
      fuzz::require(false, std::string("what was encoded can be decoded: ") + error.what());
    }
  }
  return 0;
}
