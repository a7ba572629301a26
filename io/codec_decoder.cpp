#include <algorithm>

#include "io/codec.h"
#include "io/codec_bytes.h"
#include "io/codec_dynamic.h"
#include "io/codec_float_mode.h"
#include "io/codec_identity.h"
#include "io/codec_layout.h"
#include "io/codec_method.h"
#include "io/codec_whole.h"
#include "io/errors.h"

namespace varve::io {
namespace {

using namespace codec;  // NOLINT: this file is the codec

/// Expansion is not limited below this many bytes.
constexpr std::uint64_t ratio_bytes_free = std::uint64_t{1} << 20;

class Decoder final : public FrameDecoder {
 public:
  Decoder(const Schema& schema, const CodecLimits& limits)
      : schema_(schema), limits_(limits), layout_(plan_layout(schema)) {
    for (std::size_t i = 0; i < schema.fields.size(); ++i) {
      const bool dynamic = layout_.fields[i].kind == FieldKind::dynamic;
      dynamic_.push_back(dynamic ? DynamicField::create(schema.fields[i]) : nullptr);
    }
    frame_.counts.resize(schema.fields.size());
    frame_.fields.resize(schema.fields.size());
    frame_.rows.resize(schema.tables.size());
    for (const TableDescriptor& table : schema.tables) {
      frame_.tables.emplace_back(table.columns.size());
    }
    followed_.assign(layout_.populations.size(), false);
  }

  const Frame& decode(std::span<const EncodedField> fields, bool keyframe, std::uint64_t step,
                      double time, double dt) override {
    return decode(fields, std::vector<bool>(schema_.fields.size(), true), keyframe, step, time, dt);
  }

  const Frame& decode(std::span<const EncodedField> fields, const std::vector<bool>& wanted,
                      bool keyframe, std::uint64_t step, double time, double dt) override {
    const bool history = whole_;
    whole_ = false;  // a record that fails half-way leaves no history to build on
    check(fields, wanted, keyframe, history);
    const DefaultFloatMode mode;
    if (keyframe) {
      times_.clear();
    }
    times_.push(time);
    frame_.step = step;
    frame_.time = time;
    frame_.dt = dt;
    for (std::size_t p = 0; p < layout_.populations.size(); ++p) {
      const PopulationPlan& population = layout_.populations[p];
      const bool decoded = wanted[population.fields.front()];
      if (decoded && !keyframe && !followed_[p]) {
        throw LogError(ErrorKind::damaged, "",
                       "a delta of population '" + population.name + "' without the frame before");
      }
      followed_[p] = decoded;
      if (decoded) {
        decode_population(population, fields, dt);
        continue;
      }
      for (const std::size_t i : population.fields) set_count(i, 0);
    }
    whole_ = true;
    return frame_;
  }

 private:
  /// Everything that can be said before a byte of payload is read.
  void check(std::span<const EncodedField> fields, const std::vector<bool>& wanted, bool keyframe,
             bool history) const {
    if (fields.size() != schema_.fields.size()) {
      throw LogError(ErrorKind::damaged, "",
                     "a record of " + std::to_string(fields.size()) + " fields, the schema has " +
                         std::to_string(schema_.fields.size()));
    }
    if (!keyframe && !history) {
      throw LogError(ErrorKind::damaged, "", "a delta without the frame before it");
    }
    std::uint64_t raw = 0;
    std::uint64_t stored = 0;
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (!wanted[i]) continue;
      const FieldDescriptor& field = schema_.fields[i];
      const std::uint64_t count_max = limits_.field_bytes_max / field.bytes_per_particle();
      if (fields[i].count > count_max) {
        fail_limit(field.name, std::to_string(fields[i].count) +
                                   " particles exceed field_bytes_max = " +
                                   std::to_string(limits_.field_bytes_max) + " bytes");
      }
      if (keyframe && !is_whole(fields[i].method)) {
        fail_damaged(field.name, "method " + std::to_string(fields[i].method) +
                                     " in a keyframe needs a frame before");
      }
      if (is_whole(fields[i].method)) {
        raw += fields[i].count * field.bytes_per_particle();
        stored += fields[i].payload.size();
      }
    }
    if (raw > ratio_bytes_free && raw / limits_.ratio_max > stored) {
      throw LogError(ErrorKind::limit, "",
                     std::to_string(stored) + " bytes of payload expand to " + std::to_string(raw) +
                         ", beyond ratio_max = " + std::to_string(limits_.ratio_max));
    }
    for (const PopulationPlan& population : layout_.populations) {
      const std::uint64_t count = fields[population.fields.front()].count;
      for (const std::size_t i : population.fields) {
        if (fields[i].count != count) {
          fail_damaged(schema_.fields[i].name,
                       std::to_string(fields[i].count) + " particles where population '" +
                           population.name + "' has " + std::to_string(count));
        }
      }
    }
  }

  void decode_population(const PopulationPlan& population, std::span<const EncodedField> fields,
                         double dt) {
    for (const std::size_t i : population.fields) {
      const EncodedField& encoded = fields[i];
      if (encoded.order != 0 && !is_extrapolated(encoded.method)) {
        fail_damaged(schema_.fields[i].name,
                     "an order of extrapolation where nothing is extrapolated");
      }
      if (encoded.method == static_cast<std::uint8_t>(Method::id_edit)) {
        edit(population, i, encoded);
      } else if (is_whole(encoded.method)) {
        decode_new(i, encoded);
      } else {
        if (known_count(i) != encoded.count) {
          fail_damaged(schema_.fields[i].name,
                       std::to_string(encoded.count) + " particles, the history has " +
                           std::to_string(known_count(i)));
        }
        decode_delta(i, encoded, dt);
      }
    }
  }

  std::uint64_t known_count(std::size_t i) const {
    return dynamic_[i] != nullptr ? dynamic_[i]->count() : frame_.counts[i];
  }

  void set_count(std::size_t i, std::uint64_t count) {
    frame_.counts[i] = count;
    frame_.fields[i].resize(count * schema_.fields[i].bytes_per_particle());
  }

  /// Ids were taken out or put in: the history of the whole population moves.
  void edit(const PopulationPlan& population, std::size_t i, const EncodedField& encoded) {
    if (i != population.identity) {
      fail_damaged(schema_.fields[i].name, "an edit of ids in a field that is not the ids");
    }
    const std::vector<std::byte> before = std::move(frame_.fields[i]);
    const FieldView before_view{frame_.counts[i], before};
    if (!ascending(schema_.fields[i], before, before_view.count)) {
      fail_damaged(schema_.fields[i].name, "an edit of ids that do not ascend");
    }
    set_count(i, encoded.count);
    decode_edit(schema_.fields[i], before_view, encoded, frame_.fields[i], sources_);
    for (const std::size_t other : population.fields) {
      if (dynamic_[other] != nullptr) {
        if (dynamic_[other]->count() != before_view.count) {
          fail_damaged(schema_.fields[other].name, "its history does not fit the ids'");
        }
        dynamic_[other]->remap(sources_);
      }
    }
  }

  void decode_new(std::size_t i, const EncodedField& encoded) {
    const FieldDescriptor& field = schema_.fields[i];
    set_count(i, encoded.count);
    if (encoded.method == static_cast<std::uint8_t>(Method::id_runs) ||
        encoded.method == static_cast<std::uint8_t>(Method::id_deltas)) {
      if (!is_identity(field)) {
        fail_damaged(field.name, "a method for ids in a field that is not ids");
      }
      decode_ids(field, encoded, frame_.fields[i]);
    } else {
      decode_whole(field, encoded, zstd_, frame_.fields[i]);
    }
    if (dynamic_[i] != nullptr) {
      dynamic_[i]->restart({encoded.count, frame_.fields[i]});
    }
  }

  void decode_delta(std::size_t i, const EncodedField& encoded, double dt) {
    const FieldDescriptor& field = schema_.fields[i];
    const auto method = static_cast<Method>(encoded.method);
    if (method == Method::unchanged && dynamic_[i] == nullptr) {
      if (!encoded.payload.empty()) {
        fail_damaged(field.name, "an unchanged field with a payload");
      }
      return;
    }
    if (dynamic_[i] == nullptr) {
      fail_damaged(field.name, "method " + std::to_string(encoded.method) +
                                   " is unknown or does not fit this field");
    }
    set_count(i, encoded.count);
    const std::size_t slopes = layout_.fields[i].slopes;
    switch (method) {
      case Method::residual_varint:
      case Method::residual_planes:
      case Method::residual_bits:
        dynamic_[i]->decode(encoded, times_, zstd_, frame_.fields[i]);
        return;
      case Method::follows:
        if (slopes != none) {
          dynamic_[i]->decode_following(*dynamic_[slopes], dt, encoded, frame_.fields[i]);
          return;
        }
        break;
      default: break;
    }
    fail_damaged(field.name, "method " + std::to_string(encoded.method) +
                                 " is unknown or does not fit this field");
  }

  Schema schema_;
  CodecLimits limits_;
  Layout layout_;
  Timeline times_;
  Zstd zstd_;
  std::vector<std::unique_ptr<DynamicField>> dynamic_;  ///< per field; null where not dynamic
  std::vector<std::uint64_t> sources_;
  Frame frame_;
  std::vector<bool> followed_;  ///< per population: it was part of the last frame decoded
  bool whole_ = false;          ///< the last frame was decoded to its end
};

}  // namespace

std::unique_ptr<FrameDecoder> FrameDecoder::create(const Schema& schema,
                                                   const CodecLimits& limits) {
  return std::make_unique<Decoder>(schema, limits);
}

}  // namespace varve::io
