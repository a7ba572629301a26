#include "io/step_encoder.h"

#include <algorithm>
#include <utility>

#include "io/bytes.h"
#include "io/packing.h"
#include "io/schema_check.h"

namespace varve::io {

Digest chain_before_first(const Genesis& genesis) {
  return genesis.lineage ? genesis.lineage->chain_base : chain_base(genesis.schema);
}

StepEncoder::StepEncoder(const Genesis& genesis, std::string path, const Limits& limits,
                         std::optional<Digest> chain)
    : schema_(genesis.schema),
      path_(std::move(path)),
      limits_(limits),
      tier_(genesis.tier),
      every_(genesis.every),
      keyframe_steps_(genesis.keyframe_steps),
      chain_(chain ? *chain : chain_before_first(genesis)),
      encoder_(FrameEncoder::create(genesis.schema)) {}

// A constant field is only in keyframes, so a change of its count makes one. Populations without
// such fields (contacts, say) come and go within deltas.
bool StepEncoder::constants_changed(const FrameView& frame) const {
  for (std::size_t i = 0; i < schema_.fields.size(); ++i) {
    if (schema_.fields[i].constant && frame.fields[i].count != counts_[i]) return true;
  }
  return false;
}

StepEncoder::Store StepEncoder::choose(const FrameView& frame) const {
  if (counts_.empty() || constants_changed(frame)) return Store::keyframe;
  const bool due = frame.step - last_keyframe_ >= keyframe_steps_;
  if (tier_ == Tier::digests) return due ? Store::keyframe : Store::nothing;
  if (frame.step % every_ != 0) return Store::nothing;
  return due ? Store::keyframe : Store::delta;
}

// Returns whether the record can be decoded without any before it.
bool StepEncoder::store_fields(const FrameView& frame) {
  bool keyframe = false;
  fields_ = encoder_->encode(frame, keyframe);
  for (const EncodedField& field : fields_) {
    FieldBlob& blob = message_.fields.emplace_back();
    blob.checksum = checksum(field.payload);
    blob.count = static_cast<std::uint32_t>(field.count);
    blob.stored = static_cast<std::uint32_t>(field.payload.size());
    blob.method = field.method;
    blob.order = field.order;
    blobs_.emplace_back(field.payload);
  }
  counts_.clear();
  for (const FieldView& field : frame.fields) counts_.push_back(field.count);
  return keyframe;
}

void StepEncoder::store_tables(const FrameView& frame) {
  const bool any = std::any_of(frame.tables.begin(), frame.tables.end(),
                               [](const TableView& table) { return table.rows > 0; });
  if (!any) return;
  tables_.resize(frame.tables.size());
  Bytes plain;
  for (std::size_t i = 0; i < frame.tables.size(); ++i) {
    const TableView& table = frame.tables[i];
    plain.resize(table.rows * row_bytes(schema_.tables[i]));
    std::byte* at = plain.data();
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      copy_le(at, table.columns[c], size_of(schema_.tables[i].columns[c].type));
      at += table.columns[c].size();
    }
    TableBlob& blob = message_.tables.emplace_back();
    blob.packing = pack(plain, tables_[i], limits_);
    blob.checksum = checksum(tables_[i]);
    blob.rows = static_cast<std::uint32_t>(table.rows);
    blob.stored = static_cast<std::uint32_t>(tables_[i].size());
    blobs_.emplace_back(tables_[i]);
  }
}

bool StepEncoder::add(const FrameView& frame, LogAppender& log) {
  message_ = {};
  blobs_.clear();
  message_.time = frame.time;
  message_.dt = frame.dt;
  message_.digest = digest_frame(schema_, frame);
  message_.chain = chain_next(chain_, message_.digest);
  const Store store = choose(frame);
  if (store == Store::keyframe) encoder_->restart();
  const bool keyframe = store != Store::nothing && store_fields(frame);
  if (keyframe) {
    check_ids(schema_, frame, path_);
    last_keyframe_ = frame.step;
  }
  // In the digests tier a step between keyframes is its digest: tables follow by re-execution.
  if (tier_ != Tier::digests) store_tables(frame);
  log.step(frame.step, keyframe, message_, blobs_);
  chain_ = message_.chain;
  return keyframe;
}

}  // namespace varve::io
