#include <algorithm>
#include <cstring>

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

/// Self-contained fields of a record stay below half of the ratio that readers accept by default.
constexpr std::uint64_t whole_ratio_max = 5000;
constexpr std::uint64_t whole_bytes_free = std::uint64_t{1} << 20;

class Encoder final : public FrameEncoder {
 public:
  explicit Encoder(const Schema& schema) : schema_(schema), layout_(plan_layout(schema)) {
    for (std::size_t i = 0; i < schema.fields.size(); ++i) {
      const bool dynamic = layout_.fields[i].kind == FieldKind::dynamic;
      dynamic_.push_back(dynamic ? DynamicField::create(schema.fields[i]) : nullptr);
    }
    previous_.resize(schema.fields.size());
    counts_.resize(layout_.populations.size());
  }

  void restart() override { restart_ = true; }

  std::vector<EncodedField> encode(const FrameView& frame, bool& keyframe) override {
    check(frame);
    const DefaultFloatMode mode;
    keyframe = restart_;
    restart_ = true;  // a frame that fails half-way leaves no history to build on
    if (keyframe) {
      times_.clear();
    }
    times_.push(frame.time);
    std::vector<EncodedField> out(schema_.fields.size());
    for (std::size_t p = 0; p < layout_.populations.size(); ++p) {
      encode_population(p, frame, keyframe, out);
    }
    bound_ratio(frame, out);
    restart_ = false;
    return out;
  }

 private:
  /// What the particles of a population have to do with those of the frame before.
  enum class Relation { unrelated, same, moved };

  void check(const FrameView& frame) const {
    if (frame.fields.size() != schema_.fields.size()) {
      throw LogError(ErrorKind::mismatch, "",
                     "frame of step " + std::to_string(frame.step) + " has " +
                         std::to_string(frame.fields.size()) + " fields, the schema " +
                         std::to_string(schema_.fields.size()));
    }
    for (const PopulationPlan& population : layout_.populations) {
      const std::uint64_t count = frame.fields[population.fields.front()].count;
      for (const std::size_t i : population.fields) {
        const FieldView& view = frame.fields[i];
        const FieldDescriptor& field = schema_.fields[i];
        if (view.count != count || view.bytes.size() % field.bytes_per_particle() != 0 ||
            view.bytes.size() / field.bytes_per_particle() != count) {
          throw LogError(ErrorKind::mismatch, "",
                         "field '" + field.name + "' at step " + std::to_string(frame.step) +
                             " has count " + std::to_string(view.count) + " and " +
                             std::to_string(view.bytes.size()) + " bytes; population '" +
                             population.name + "' has " + std::to_string(count) +
                             " particles of " + std::to_string(field.bytes_per_particle()) +
                             " bytes in it");
        }
      }
    }
  }

  void encode_population(std::size_t p, const FrameView& frame, bool keyframe,
                         std::vector<EncodedField>& out) {
    const PopulationPlan& population = layout_.populations[p];
    const Relation relation =
        keyframe ? Relation::unrelated : relate(population, counts_[p], frame, out);
    counts_[p] = frame.fields[population.fields.front()].count;
    for (const std::size_t i : population.fields) {
      switch (layout_.fields[i].kind) {
        case FieldKind::identity:
          if (relation == Relation::unrelated) {
            encode_identity(i, frame.fields[i], out[i]);
          }
          remember(i, frame.fields[i], relation == Relation::same);
          break;
        case FieldKind::fixed: encode_fixed(i, frame.fields[i], relation, out[i]); break;
        case FieldKind::dynamic: encode_dynamic(i, frame, relation, out[i]); break;
      }
    }
  }

  /// Compares ids with the frame before; stores them unless the result is `unrelated`.
  Relation relate(const PopulationPlan& population, std::uint64_t count_before,
                  const FrameView& frame, std::vector<EncodedField>& out) {
    const std::uint64_t count = frame.fields[population.fields.front()].count;
    const std::size_t id = population.identity;
    if (id == none) {
      return count == count_before ? Relation::same : Relation::unrelated;
    }
    const FieldDescriptor& field = schema_.fields[id];
    const FieldView& ids = frame.fields[id];
    if (count == count_before && equal(ids.bytes, previous_[id])) {
      mark_unchanged(ids.count, out[id]);
      return Relation::same;
    }
    const FieldView before{count_before, previous_[id]};
    if (ascending(field, before.bytes, before.count) && ascending(field, ids.bytes, ids.count) &&
        encode_edit(field, before, ids, out[id], sources_)) {
      return Relation::moved;
    }
    return Relation::unrelated;
  }

  void encode_identity(std::size_t i, const FieldView& view, EncodedField& out) {
    if (ascending(schema_.fields[i], view.bytes, view.count)) {
      encode_ids(schema_.fields[i], view, out);
    } else {
      encode_whole(schema_.fields[i], view, zstd_, out);
    }
  }

  void encode_fixed(std::size_t i, const FieldView& view, Relation relation, EncodedField& out) {
    const bool same = relation == Relation::same && equal(view.bytes, previous_[i]);
    if (same) {
      mark_unchanged(view.count, out);
    } else {
      encode_whole(schema_.fields[i], view, zstd_, out);
    }
    remember(i, view, same);
  }

  void encode_dynamic(std::size_t i, const FrameView& frame, Relation relation,
                      EncodedField& out) {
    const FieldView& view = frame.fields[i];
    DynamicField& field = *dynamic_[i];
    if (relation == Relation::unrelated) {
      encode_whole(schema_.fields[i], view, zstd_, out);
      field.restart(view);
      return;
    }
    if (relation == Relation::moved) {
      field.remap(sources_);
    }
    const std::size_t slopes = layout_.fields[i].slopes;
    if (slopes != none && field.encode_following(*dynamic_[slopes], frame.dt, view, out)) {
      return;
    }
    field.encode(view, times_, zstd_, out);
  }

  /// Nothing to compress can compress too well: readers refuse payloads that expand beyond a ratio.
  void bound_ratio(const FrameView& frame, std::vector<EncodedField>& out) const {
    std::uint64_t raw = 0;
    std::uint64_t stored = 0;
    std::size_t largest = none;
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (is_whole(out[i].method)) {
        raw += frame.fields[i].bytes.size();
        stored += out[i].payload.size();
        if (largest == none ||
            frame.fields[i].bytes.size() > frame.fields[largest].bytes.size()) {
          largest = i;
        }
      }
    }
    if (raw > whole_bytes_free && raw / whole_ratio_max > stored) {
      encode_plain(schema_.fields[largest], frame.fields[largest], out[largest]);
    }
  }

  static bool equal(std::span<const std::byte> a, std::span<const std::byte> b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size()) == 0);
  }

  static void mark_unchanged(std::uint64_t count, EncodedField& out) {
    out.method = static_cast<std::uint8_t>(Method::unchanged);
    out.order = 0;
    out.count = count;
    out.payload.clear();
  }

  void remember(std::size_t i, const FieldView& view, bool same) {
    if (!same) {
      previous_[i].assign(view.bytes.begin(), view.bytes.end());
    }
  }

  Schema schema_;
  Layout layout_;
  Timeline times_;
  Zstd zstd_;
  std::vector<std::unique_ptr<DynamicField>> dynamic_;  ///< per field; null where not dynamic
  std::vector<std::vector<std::byte>> previous_;        ///< per field; only where not dynamic
  std::vector<std::uint64_t> counts_;                   ///< per population
  std::vector<std::uint64_t> sources_;
  bool restart_ = true;
};

}  // namespace

std::unique_ptr<FrameEncoder> FrameEncoder::create(const Schema& schema) {
  return std::make_unique<Encoder>(schema);
}

}  // namespace varve::io
