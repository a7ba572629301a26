#include "io/messages.h"

#include <capnp/message.h>
#include <capnp/serialize.h>
#include <fmt/format.h>

#include <cstring>

#include "io/errors.h"
#include "io/log.capnp.h"

namespace varve::io {

namespace {

constexpr int nesting_max = 16;

// Parses one segment. There is no segment table, so a message cannot ask for a second segment; each
// list is fetched once, so twice the message's own length is more than an honest one needs.
template <typename Root, typename Take>
void parse(std::span<const std::byte> bytes, const char* what, Take&& take) {
  if (bytes.empty() || bytes.size() % sizeof(capnp::word) != 0) {
    throw LogError(ErrorKind::damaged, "",
                   fmt::format("{} message: {} bytes are not a whole number of words", what,
                               bytes.size()));
  }
  std::vector<capnp::word> words(bytes.size() / sizeof(capnp::word));
  std::memcpy(static_cast<void*>(words.data()), bytes.data(), bytes.size());
  capnp::ReaderOptions options;
  options.traversalLimitInWords = 2 * words.size() + 64;
  options.nestingLimit = nesting_max;
  const kj::ArrayPtr<const capnp::word> segment(words.data(), words.size());
  try {
    capnp::SegmentArrayMessageReader reader(kj::arrayPtr(&segment, 1), options);
    take(reader.getRoot<Root>());
  } catch (const kj::Exception& error) {
    throw LogError(ErrorKind::damaged, "",
                   fmt::format("{} message: {}", what, error.getDescription().cStr()));
  }
}

// Builds a message of one segment, whatever its size.
template <typename Root, typename Fill>
Bytes build(std::size_t expected_bytes, Fill&& fill) {
  std::size_t words = expected_bytes / sizeof(capnp::word) + 64;
  for (;;) {
    capnp::MallocMessageBuilder builder(static_cast<unsigned>(words),
                                        capnp::AllocationStrategy::FIXED_SIZE);
    fill(builder.template initRoot<Root>());
    const auto segments = builder.getSegmentsForOutput();
    if (segments.size() == 1) {
      const auto bytes = segments[0].asBytes();
      Bytes out(bytes.size());
      std::memcpy(out.data(), bytes.begin(), bytes.size());
      return out;
    }
    std::size_t needed = 0;
    for (const auto& segment : segments) needed += segment.size();
    words = 2 * needed;
  }
}

// Bounds what a message says before it is copied.
class Checked {
 public:
  explicit Checked(const Limits& limits) : limits_(limits) {}

  void count(std::uint64_t value, std::uint64_t cap, const char* name, const char* what) const {
    if (value > cap) {
      throw LogError(ErrorKind::limit, "",
                     fmt::format("{}: {} exceeds {} {}", what, value, name, cap));
    }
  }
  template <typename List>
  List list(List items, const char* what) const {
    count(items.size(), limits_.list_items_max, "list_items_max", what);
    return items;
  }
  std::string text(capnp::Text::Reader value, const char* what) const {
    count(value.size(), limits_.string_bytes_max, "string_bytes_max", what);
    return {value.begin(), value.size()};
  }
  std::string data(capnp::Data::Reader value, const char* what) const {
    count(value.size(), limits_.text_bytes_max, "text_bytes_max", what);
    return {reinterpret_cast<const char*>(value.begin()), value.size()};
  }
  std::uint64_t step(std::uint64_t value, const char* what) const {
    count(value, limits_.step_max, "step_max", what);
    return value;
  }
  const Limits& limits() const { return limits_; }

 private:
  const Limits& limits_;
};

using Pairs = std::vector<std::pair<std::string, std::string>>;

capnp::Text::Reader text(const std::string& value) { return {value.c_str(), value.size()}; }

capnp::Data::Reader data(const std::string& value) {
  return {reinterpret_cast<const kj::byte*>(value.data()), value.size()};
}

void put(capnp::List<schema::Pair>::Builder out, const Pairs& pairs) {
  for (unsigned i = 0; i < pairs.size(); ++i) {
    out[i].setKey(text(pairs[i].first));
    out[i].setValue(text(pairs[i].second));
  }
}

Pairs take(capnp::List<schema::Pair>::Reader in, const Checked& checked, const char* what) {
  Pairs out;
  for (const auto item : checked.list(in, what)) {
    out.emplace_back(checked.text(item.getKey(), what), checked.text(item.getValue(), what));
  }
  return out;
}

std::pair<std::uint64_t, std::uint64_t> halves(const Digest& digest) {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    high = high << 8 | digest.bytes[i];
    low = low << 8 | digest.bytes[i + 8];
  }
  return {high, low};
}

Digest joined(std::uint64_t high, std::uint64_t low) {
  Digest out;
  for (std::size_t i = 0; i < 8; ++i) {
    out.bytes[i] = static_cast<std::uint8_t>(high >> (56 - 8 * i));
    out.bytes[i + 8] = static_cast<std::uint8_t>(low >> (56 - 8 * i));
  }
  return out;
}

void put(schema::Hash::Builder out, const Digest& digest) {
  const auto [high, low] = halves(digest);
  out.setHigh(high);
  out.setLow(low);
}

Digest take(schema::Hash::Reader in) { return joined(in.getHigh(), in.getLow()); }

void put(schema::Genesis::Builder out, const Schema& in) {
  auto fields = out.initFields(static_cast<unsigned>(in.fields.size()));
  for (unsigned i = 0; i < in.fields.size(); ++i) {
    const FieldDescriptor& field = in.fields[i];
    fields[i].setName(text(field.name));
    fields[i].setPopulation(text(field.population));
    fields[i].setType(static_cast<std::uint8_t>(field.type));
    fields[i].setComponents(field.components);
    fields[i].setUnit(text(field.unit));
    fields[i].setIsId(field.is_id);
    fields[i].setConstant(field.constant);
    fields[i].setFollows(text(field.follows));
  }
  auto tables = out.initTables(static_cast<unsigned>(in.tables.size()));
  for (unsigned i = 0; i < in.tables.size(); ++i) {
    tables[i].setName(text(in.tables[i].name));
    auto columns = tables[i].initColumns(static_cast<unsigned>(in.tables[i].columns.size()));
    for (unsigned c = 0; c < in.tables[i].columns.size(); ++c) {
      columns[c].setName(text(in.tables[i].columns[c].name));
      columns[c].setType(static_cast<std::uint8_t>(in.tables[i].columns[c].type));
      columns[c].setUnit(text(in.tables[i].columns[c].unit));
    }
  }
}

Schema take_schema(schema::Genesis::Reader in, const Checked& checked) {
  Schema out;
  const auto fields = in.getFields();
  checked.count(fields.size(), checked.limits().fields_max, "fields_max", "schema");
  for (const auto field : fields) {
    FieldDescriptor& to = out.fields.emplace_back();
    to.name = checked.text(field.getName(), "a field's name");
    to.population = checked.text(field.getPopulation(), "a field's population");
    to.type = static_cast<ScalarType>(field.getType());
    to.components = field.getComponents();
    to.unit = checked.text(field.getUnit(), "a field's unit");
    to.is_id = field.getIsId();
    to.constant = field.getConstant();
    to.follows = checked.text(field.getFollows(), "a field's hint");
  }
  const auto tables = in.getTables();
  checked.count(tables.size(), checked.limits().tables_max, "tables_max", "schema");
  for (const auto table : tables) {
    TableDescriptor& to = out.tables.emplace_back();
    to.name = checked.text(table.getName(), "a table's name");
    const auto columns = table.getColumns();
    checked.count(columns.size(), checked.limits().columns_max, "columns_max", "schema");
    for (const auto column : columns) {
      to.columns.push_back({checked.text(column.getName(), "a column's name"),
                            static_cast<ScalarType>(column.getType()),
                            checked.text(column.getUnit(), "a column's unit")});
    }
  }
  return out;
}

void put(schema::Lineage::Builder out, const Lineage& in) {
  out.setParentRunId(text(in.parent_run_id));
  out.setParentName(text(in.parent_name));
  out.setStep(in.step);
  put(out.initParentDigest(), in.parent_digest);
  put(out.initParentChain(), in.parent_chain);
  put(out.initChainBase(), in.chain_base);
  auto changes = out.initChanges(static_cast<unsigned>(in.changes.size()));
  for (unsigned i = 0; i < in.changes.size(); ++i) {
    changes[i].setKey(text(in.changes[i].key));
    changes[i].setFrom(text(in.changes[i].from));
    changes[i].setTo(text(in.changes[i].to));
  }
  auto ancestors = out.initAncestors(static_cast<unsigned>(in.ancestors.size()));
  for (unsigned i = 0; i < in.ancestors.size(); ++i) ancestors.set(i, text(in.ancestors[i]));
}

Lineage take(schema::Lineage::Reader in, const Checked& checked) {
  Lineage out;
  out.parent_run_id = checked.text(in.getParentRunId(), "the parent's run id");
  out.parent_name = checked.text(in.getParentName(), "the parent's name");
  out.step = checked.step(in.getStep(), "the fork's step");
  out.parent_digest = take(in.getParentDigest());
  out.parent_chain = take(in.getParentChain());
  out.chain_base = take(in.getChainBase());
  for (const auto change : checked.list(in.getChanges(), "changes")) {
    out.changes.push_back({checked.text(change.getKey(), "a change"),
                           checked.text(change.getFrom(), "a change"),
                           checked.text(change.getTo(), "a change")});
  }
  const auto ancestors = in.getAncestors();
  checked.count(ancestors.size(), checked.limits().lineage_depth_max, "lineage_depth_max",
                "ancestors");
  for (const auto id : ancestors) out.ancestors.push_back(checked.text(id, "an ancestor"));
  return out;
}

Genesis take(schema::Genesis::Reader in, const Checked& checked) {
  Genesis out;
  out.engine = checked.text(in.getEngine(), "the engine's name");
  out.engine_revision = in.getEngineRevision();
  out.schema = take_schema(in, checked);
  out.scenario = checked.data(in.getScenario(), "the scenario");
  out.parameters = take(in.getParameters(), checked, "parameters");
  out.models = take(in.getModels(), checked, "models");
  for (const auto file : checked.list(in.getFiles(), "embedded files")) {
    out.files.emplace_back(checked.text(file.getName(), "an embedded file's name"),
                           checked.data(file.getContent(), "an embedded file"));
  }
  if (in.hasLineage()) out.lineage = take(in.getLineage(), checked);
  out.tier = static_cast<Tier>(in.getTier());
  out.every = in.getEvery();
  out.keyframe_steps = in.getKeyframeSteps();
  out.log_id = checked.text(in.getLogId(), "the log id");
  out.build = take(in.getBuild(), checked, "build facts");
  return out;
}

std::size_t pairs_bytes(const Pairs& pairs) {
  std::size_t sum = 64;
  for (const auto& [key, value] : pairs) sum += key.size() + value.size() + 48;
  return sum;
}

}  // namespace

std::uint64_t StepMessage::body_bytes() const {
  std::uint64_t sum = 0;
  for (const FieldBlob& blob : fields) sum += aligned(blob.stored);
  for (const TableBlob& blob : tables) sum += aligned(blob.stored);
  return sum;
}

Bytes encode_genesis(const Genesis& genesis, std::uint64_t particles_max) {
  std::size_t expected = 4096 + genesis.scenario.size() + pairs_bytes(genesis.parameters) +
                         pairs_bytes(genesis.models) + pairs_bytes(genesis.files) +
                         pairs_bytes(genesis.build) + genesis.schema.fields.size() * 160;
  if (genesis.lineage) expected += 64 * genesis.lineage->ancestors.size();
  return build<schema::Genesis>(expected, [&](schema::Genesis::Builder out) {
    out.setEngine(text(genesis.engine));
    out.setEngineRevision(genesis.engine_revision);
    put(out, genesis.schema);
    out.setScenario(data(genesis.scenario));
    put(out.initParameters(static_cast<unsigned>(genesis.parameters.size())), genesis.parameters);
    put(out.initModels(static_cast<unsigned>(genesis.models.size())), genesis.models);
    auto files = out.initFiles(static_cast<unsigned>(genesis.files.size()));
    for (unsigned i = 0; i < genesis.files.size(); ++i) {
      files[i].setName(text(genesis.files[i].first));
      files[i].setContent(data(genesis.files[i].second));
    }
    if (genesis.lineage) put(out.initLineage(), *genesis.lineage);
    out.setTier(static_cast<std::uint8_t>(genesis.tier));
    out.setEvery(genesis.every);
    out.setKeyframeSteps(genesis.keyframe_steps);
    out.setLogId(text(genesis.log_id));
    put(out.initBuild(static_cast<unsigned>(genesis.build.size())), genesis.build);
    out.setParticlesMax(particles_max);
    out.setRunId(text(genesis.run_id()));
  });
}

GenesisMessage decode_genesis(std::span<const std::byte> bytes, const Limits& limits) {
  GenesisMessage out;
  parse<schema::Genesis>(bytes, "genesis", [&](schema::Genesis::Reader in) {
    const Checked checked(limits);
    out.genesis = take(in, checked);
    out.particles_max = in.getParticlesMax();
    checked.count(out.particles_max, limits.particles_max, "particles_max", "genesis");
    const std::string run_id = checked.text(in.getRunId(), "the run id");
    if (run_id != out.genesis.run_id()) {
      throw LogError(ErrorKind::damaged, "",
                     fmt::format("genesis: run id {} recorded, its content gives {}", run_id,
                                 out.genesis.run_id()));
    }
  });
  return out;
}

Bytes encode(const StepMessage& message) {
  const std::size_t expected = 256 + 24 * (message.fields.size() + message.tables.size());
  return build<schema::Step>(expected, [&](schema::Step::Builder out) {
    out.setTime(message.time);
    out.setDt(message.dt);
    const auto [digest_high, digest_low] = halves(message.digest);
    out.setDigestHigh(digest_high);
    out.setDigestLow(digest_low);
    const auto [chain_high, chain_low] = halves(message.chain);
    out.setChainHigh(chain_high);
    out.setChainLow(chain_low);
    if (message.fields.empty() && message.tables.empty()) return;
    auto stored = out.initStored();
    if (!message.fields.empty()) {
      auto fields = stored.initFields(static_cast<unsigned>(message.fields.size()));
      for (unsigned i = 0; i < message.fields.size(); ++i) {
        fields[i].setChecksum(message.fields[i].checksum);
        fields[i].setCount(message.fields[i].count);
        fields[i].setStored(message.fields[i].stored);
        fields[i].setMethod(message.fields[i].method);
        fields[i].setOrder(message.fields[i].order);
      }
    }
    if (!message.tables.empty()) {
      auto tables = stored.initTables(static_cast<unsigned>(message.tables.size()));
      for (unsigned i = 0; i < message.tables.size(); ++i) {
        tables[i].setChecksum(message.tables[i].checksum);
        tables[i].setRows(message.tables[i].rows);
        tables[i].setStored(message.tables[i].stored);
        tables[i].setCodec(static_cast<std::uint8_t>(message.tables[i].packing));
      }
    }
  });
}

StepMessage decode_step(std::span<const std::byte> bytes, const Limits& limits) {
  StepMessage out;
  parse<schema::Step>(bytes, "step", [&](schema::Step::Reader in) {
    const Checked checked(limits);
    out.time = in.getTime();
    out.dt = in.getDt();
    out.digest = joined(in.getDigestHigh(), in.getDigestLow());
    out.chain = joined(in.getChainHigh(), in.getChainLow());
    if (!in.hasStored()) return;
    const auto stored = in.getStored();
    const auto fields = stored.getFields();
    checked.count(fields.size(), limits.fields_max, "fields_max", "step");
    for (const auto blob : fields) {
      out.fields.push_back({blob.getChecksum(), blob.getCount(), blob.getStored(),
                            blob.getMethod(), blob.getOrder()});
    }
    const auto tables = stored.getTables();
    checked.count(tables.size(), limits.tables_max, "tables_max", "step");
    for (const auto blob : tables) {
      out.tables.push_back({blob.getChecksum(), blob.getRows(), blob.getStored(),
                            static_cast<Packing>(blob.getCodec())});
    }
  });
  return out;
}

Bytes encode(const Event& event) {
  return build<schema::Event>(event.kind.size() + pairs_bytes(event.items) + 64,
                              [&](schema::Event::Builder out) {
                                out.setKind(text(event.kind));
                                put(out.initItems(static_cast<unsigned>(event.items.size())),
                                    event.items);
                              });
}

Event decode_event(std::span<const std::byte> bytes, std::uint64_t step, const Limits& limits) {
  Event out;
  parse<schema::Event>(bytes, "event", [&](schema::Event::Reader in) {
    const Checked checked(limits);
    out.step = step;
    out.kind = checked.text(in.getKind(), "an event's kind");
    out.items = take(in.getItems(), checked, "an event's items");
  });
  return out;
}

Bytes encode(const IndexMessage& message) {
  const std::size_t expected = 256 + 5 * message.states.size() + 16 * message.skips.size() +
                               8 * message.events.size();
  return build<schema::Index>(expected, [&](schema::Index::Builder out) {
    out.setOrdinal(message.ordinal);
    out.setFirstStep(message.first_step);
    out.setFirstOffset(message.first_offset);
    auto gaps = out.initGaps(static_cast<unsigned>(message.gaps.size()));
    for (unsigned i = 0; i < message.gaps.size(); ++i) gaps.set(i, message.gaps[i]);
    auto states = out.initStates(static_cast<unsigned>(message.states.size()));
    for (unsigned i = 0; i < message.states.size(); ++i) {
      states[i] = static_cast<kj::byte>(message.states[i]);
    }
    auto skips = out.initSkips(static_cast<unsigned>(message.skips.size()));
    for (unsigned i = 0; i < message.skips.size(); ++i) {
      skips[i].setOffset(message.skips[i].offset);
      skips[i].setLastStep(message.skips[i].last_step);
    }
    auto events = out.initEvents(static_cast<unsigned>(message.events.size()));
    for (unsigned i = 0; i < message.events.size(); ++i) events.set(i, message.events[i]);
    out.setEventsBefore(message.events_before);
  });
}

IndexMessage decode_index(std::span<const std::byte> bytes, const Limits& limits) {
  IndexMessage out;
  parse<schema::Index>(bytes, "index", [&](schema::Index::Reader in) {
    const Checked checked(limits);
    out.ordinal = in.getOrdinal();
    out.first_step = checked.step(in.getFirstStep(), "index");
    out.first_offset = in.getFirstOffset();
    const auto gaps = in.getGaps();
    checked.count(gaps.size(), limits.index_steps_max, "index_steps_max", "index");
    for (const std::uint32_t gap : gaps) out.gaps.push_back(gap);
    for (const kj::byte state : in.getStates()) out.states.push_back(StoredState{state});
    if (out.states.empty() || out.gaps.size() + 1 != out.states.size()) {
      throw LogError(ErrorKind::damaged, "",
                     fmt::format("index message: {} distances for {} steps", out.gaps.size(),
                                 out.states.size()));
    }
    for (const auto skip : checked.list(in.getSkips(), "index")) {
      out.skips.push_back({skip.getOffset(), skip.getLastStep()});
    }
    for (const std::uint64_t at : checked.list(in.getEvents(), "index")) out.events.push_back(at);
    out.events_before = in.getEventsBefore();
  });
  return out;
}

Bytes encode(const EndMessage& message) {
  return build<schema::End>(256, [&](schema::End::Builder out) {
    out.setFirstStep(message.first_step);
    out.setSteps(message.steps);
    out.setLastStep(message.last_step);
    out.setTime(message.time);
    out.setDt(message.dt);
    put(out.initDigest(), message.digest);
    put(out.initChain(), message.chain);
    out.setHasState(message.has_state);
  });
}

EndMessage decode_end(std::span<const std::byte> bytes) {
  EndMessage out;
  parse<schema::End>(bytes, "end", [&](schema::End::Reader in) {
    out.first_step = in.getFirstStep();
    out.steps = in.getSteps();
    out.last_step = in.getLastStep();
    out.time = in.getTime();
    out.dt = in.getDt();
    out.digest = take(in.getDigest());
    out.chain = take(in.getChain());
    out.has_state = in.getHasState();
  });
  return out;
}

Bytes encode(const GapMessage& message) {
  return build<schema::Gap>(message.what.size() + 128, [&](schema::Gap::Builder out) {
    out.setFrom(message.from);
    out.setTo(message.to);
    out.setWhat(text(message.what));
  });
}

GapMessage decode_gap(std::span<const std::byte> bytes, const Limits& limits) {
  GapMessage out;
  parse<schema::Gap>(bytes, "gap", [&](schema::Gap::Reader in) {
    const Checked checked(limits);
    out.from = checked.step(in.getFrom(), "a gap");
    out.to = checked.step(in.getTo(), "a gap");
    out.what = checked.text(in.getWhat(), "a gap's reason");
  });
  return out;
}

}  // namespace varve::io
