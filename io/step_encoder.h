// Turns a frame into a step's record: digest, chain, what is stored at this step and how. Private
// to io; runs on the writer thread.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/codec.h"
#include "io/genesis.h"
#include "io/limits.h"
#include "io/log_appender.h"

namespace varve::io {

class StepEncoder {
 public:
  /// `chain` is the chain at the step before the first one added; nothing: the start of a log.
  StepEncoder(const Genesis& genesis, std::string path, const Limits& limits,
              std::optional<Digest> chain);
  StepEncoder(StepEncoder&&) = default;

  /// Adds the step's record to `log`; returns whether it became a keyframe.
  bool add(const FrameView& frame, LogAppender& log);

 private:
  enum class Store { nothing, delta, keyframe };
  bool constants_changed(const FrameView& frame) const;
  Store choose(const FrameView& frame) const;
  bool store_fields(const FrameView& frame);
  void store_tables(const FrameView& frame);

  Schema schema_;
  std::string path_;
  Limits limits_;
  Tier tier_;
  std::uint32_t every_;
  std::uint32_t keyframe_steps_;
  Digest chain_;
  std::unique_ptr<FrameEncoder> encoder_;
  std::uint64_t last_keyframe_ = 0;
  std::vector<std::uint64_t> counts_;  // at the last state stored; empty before the first

  StepMessage message_;
  std::vector<EncodedField> fields_;
  std::vector<Bytes> tables_;
  std::vector<std::span<const std::byte>> blobs_;
};

/// The chain before a log's first step: its lineage's, or the schema's.
Digest chain_before_first(const Genesis& genesis);

}  // namespace varve::io
