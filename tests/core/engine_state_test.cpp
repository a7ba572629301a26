// The state is a defined set: every field of it reaches the digest and the next step, nothing else
// does, and a run continues from any of its states with the same bits.
#include <cstring>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

constexpr std::uint64_t run_steps = 300;

/// 300 steps with contacts nearly all the time, and every state on the way.
struct Recorded {
  Scenario scenario = resolved(small_column());
  Trace trace;
  std::vector<Snapshot> states;

  Recorded() {
    const auto simulation = Simulation::create(scenario, {});
    const io::Schema schema = schema_of(*simulation);
    states.emplace_back(*simulation);
    trace.states.push_back(digest(*simulation, schema));
    trace.tables.push_back(tables_digest(*simulation));
    for (std::uint64_t n = 0; n < run_steps; ++n) {
      simulation->advance();
      states.emplace_back(*simulation);
      trace.states.push_back(digest(*simulation, schema));
      trace.tables.push_back(tables_digest(*simulation));
      trace.contact_rows += simulation->table(0).rows;
    }
  }
};
const Recorded& recorded() {
  static const Recorded once;
  return once;
}

TEST(EngineStateSlow, ARunContinuesFromEveryOneOfItsStatesWithTheSameBitsAndTables) {
  const Recorded& original = recorded();
  ASSERT_GT(original.trace.contact_rows, 5 * run_steps);
  const std::set<io::Digest> different(original.trace.states.begin(), original.trace.states.end());
  ASSERT_EQ(different.size(), run_steps + 1);
  for (std::uint64_t k = 0; k < run_steps; ++k) {
    // A fresh engine has no lists, so that each continuation starts with a rebuild of them.
    const auto simulation = Simulation::restore(original.scenario, original.states[k].spans(), {});
    const io::Schema schema = schema_of(*simulation);
    ASSERT_EQ(digest(*simulation, schema), original.trace.states[k]) << "restored " << k;
    ASSERT_EQ(simulation->clock().step, k);
    for (std::uint64_t n = k + 1; n <= run_steps; ++n) {
      simulation->advance();
      ASSERT_EQ(digest(*simulation, schema), original.trace.states[n])
          << "restored at " << k << ", differs at " << n;
      ASSERT_EQ(tables_digest(*simulation), original.trace.tables[n])
          << "tables, restored at " << k << ", differ at " << n;
    }
  }
}

TEST(EngineState, DroppingEverythingDerivedAtEveryStepChangesNoBit) {
  const Recorded& original = recorded();
  const auto simulation = Simulation::create(original.scenario, {});
  const io::Schema schema = schema_of(*simulation);
  for (std::uint64_t n = 1; n <= run_steps; ++n) {
    const Snapshot own(*simulation);
    simulation->set_state(own.spans());
    ASSERT_EQ(Snapshot(*simulation), own);
    simulation->advance();
    ASSERT_EQ(digest(*simulation, schema), original.trace.states[n]) << "step " << n;
    ASSERT_EQ(tables_digest(*simulation), original.trace.tables[n]) << "step " << n;
  }
  EXPECT_EQ(simulation->counters().list_rebuilds, run_steps);
}

/// One value of a field moved: by one unit in the last place, or by a billionth, which survives the
/// rounding of a step.
void nudge(std::vector<std::byte>& bytes, std::size_t at, FieldType type, bool least) {
  if (type == FieldType::f64) {
    double value = 0;
    std::memcpy(&value, bytes.data() + at * 8, 8);
    value = least ? std::nextafter(value, 1e300) : value + 1e-9 * std::abs(value) + 1e-15;
    std::memcpy(bytes.data() + at * 8, &value, 8);
    return;
  }
  bytes[at * (type == FieldType::u64 ? 8 : 4)] ^= std::byte{1};
}

/// What a step must carry a change of a field on to, beside the field itself.
std::vector<std::string> consequences(const std::string& name) {
  if (name == "fluid.mass" || name == "fluid.superficial_density")
    return {"fluid.velocity", "fluid.superficial_density"};
  if (name == "fluid.position" || name == "fluid.velocity")
    return {"fluid.velocity", "fluid.superficial_density", "grains.velocity"};
  if (name == "grains.position" || name == "grains.velocity")
    return {"grains.velocity", "fluid.velocity", "contacts.spring"};
  if (name == "grains.spin" || name == "contacts.spring")
    return {"grains.spin", "contacts.spring", "grains.velocity"};
  return {};
}

struct Place {
  std::size_t field, value;
};
/// One value of every field, in the thick of it: of a grain that touches, of fluid among the
/// grains; of the clock every value.
std::vector<Place> places(const Simulation& simulation) {
  std::vector<Place> result;
  for (std::size_t k = 0; k < simulation.fields().size(); ++k) {
    const FieldInfo& info = simulation.fields()[k];
    if (info.population == "clock") {
      for (std::size_t value = 0; value < info.components; ++value) result.push_back({k, value});
      continue;
    }
    std::size_t particle = simulation.field(k).count / 3;
    if (info.name == "fluid.id") particle = simulation.field(k).count - 1;  // still ascending
    else if (info.population == "fluid") particle = 1 * 20 + 9;
    result.push_back({k, particle * info.components});
  }
  return result;
}

TEST(EngineState, EveryValueReachesTheDigest) {
  const Recorded& original = recorded();
  const Snapshot& state = original.states[200];
  const auto simulation = Simulation::restore(original.scenario, state.spans(), {});
  ASSERT_GT(simulation->field(field_index(*simulation, "contacts.key")).count, 3u);
  const io::Digest start = digest(*simulation);
  for (const Place& place : places(*simulation)) {
    const FieldInfo& info = simulation->fields()[place.field];
    Snapshot changed = state;
    nudge(changed.bytes[place.field], place.value, info.type, true);
    if (info.name == "grains.species") {  // there is but one
      EXPECT_THROW(simulation->set_state(changed.spans()), ModelError);
      continue;
    }
    simulation->set_state(changed.spans());
    EXPECT_NE(digest(*simulation), start) << info.name << ", value " << place.value;
  }
}

TEST(EngineState, EveryValueReachesTheNextStep) {
  const Recorded& original = recorded();
  const Snapshot& state = original.states[200];
  const auto simulation = Simulation::restore(original.scenario, state.spans(), {});
  simulation->advance();
  const Snapshot next(*simulation);
  for (const Place& place : places(*simulation)) {
    const FieldInfo info = simulation->fields()[place.field];
    // Ids are names; the time is counted from the step, and stored for readers.
    if (info.name == "grains.id" || info.name == "contacts.key") continue;
    if (info.name == "grains.species") continue;  // another one is refused
    if (info.name == "clock.time" && place.value == 0) continue;
    SCOPED_TRACE(info.name + ", value " + std::to_string(place.value));
    Snapshot changed = state;
    nudge(changed.bytes[place.field], place.value, info.type, false);
    simulation->set_state(changed.spans());
    simulation->advance();
    const Snapshot after(*simulation);
    EXPECT_FALSE(after == next);
    std::set<std::string> moved;
    for (std::size_t f = 0; f < simulation->fields().size(); ++f)
      if (after.bytes[f] != next.bytes[f]) moved.insert(simulation->fields()[f].name);
    EXPECT_THAT(moved, testing::IsSupersetOf(consequences(info.name)));
  }
}

TEST(EngineState, AContactForgottenIsAnotherState) {
  const Recorded& original = recorded();
  Snapshot changed = original.states[200];
  const auto expected = Simulation::restore(original.scenario, changed.spans(), {});
  const io::Digest start = digest(*expected);
  const std::size_t key = field_index(*expected, "contacts.key");
  const std::size_t spring = field_index(*expected, "contacts.spring");
  changed.bytes[key].resize(changed.bytes[key].size() - 24);
  changed.bytes[spring].resize(changed.bytes[spring].size() - 16);
  --changed.counts[key];
  --changed.counts[spring];
  const auto forgetful = Simulation::restore(original.scenario, changed.spans(), {});
  EXPECT_NE(digest(*forgetful), start);
  expected->advance();
  forgetful->advance();
  EXPECT_NE(digest(*forgetful), digest(*expected));
  // It begins a second time.
  EXPECT_THAT(column<std::uint8_t>(*forgetful, 0, "begin"), testing::Contains(1));
}

TEST(EngineState, GrainIdsAreNamesOnly) {
  // Renamed in ascending order, the physics is the same and every table speaks of the new names.
  const Recorded& original = recorded();
  const auto expected = Simulation::restore(original.scenario, original.states[200].spans(), {});
  Snapshot renamed = original.states[200];
  const std::size_t id = field_index(*expected, "grains.id");
  const std::size_t key = field_index(*expected, "contacts.key");
  auto ids = numbers<std::uint64_t>(renamed.bytes[id]);
  auto keys = numbers<std::uint64_t>(renamed.bytes[key]);
  for (auto& each : ids) each = 10 * each + 3;
  for (std::size_t k = 0; k < keys.size(); k += 3) {
    keys[k] = 10 * keys[k] + 3;
    if (keys[k + 1] == 0) keys[k + 2] = 10 * keys[k + 2] + 3;
  }
  std::memcpy(renamed.bytes[id].data(), ids.data(), renamed.bytes[id].size());
  std::memcpy(renamed.bytes[key].data(), keys.data(), renamed.bytes[key].size());
  const auto other = Simulation::restore(original.scenario, renamed.spans(), {});
  EXPECT_NE(digest(*other), digest(*expected));
  for (int n = 0; n < 20; ++n) {
    expected->advance();
    other->advance();
  }
  EXPECT_EQ(field(*other, "grains.position"), field(*expected, "grains.position"));
  EXPECT_EQ(field(*other, "fluid.velocity"), field(*expected, "fluid.velocity"));
  auto grains = column<std::uint64_t>(*expected, 0, "grain");
  for (auto& each : grains) each = 10 * each + 3;
  EXPECT_EQ(column<std::uint64_t>(*other, 0, "grain"), grains);
}

TEST(EngineState, FollowsHintHoldsToTheBit) {
  const auto simulation = started(small_column());
  for (int n = 0; n < 20; ++n) simulation->advance();
  const std::vector<double> before = field(*simulation, "fluid.position");
  simulation->advance();
  const std::vector<double> after = field(*simulation, "fluid.position");
  const std::vector<double> velocity = field(*simulation, "fluid.velocity");
  for (std::size_t k = 0; k < before.size(); ++k) {
    const double moved = simulation->clock().dt * velocity[k];
    ASSERT_EQ(before[k] + moved, after[k]);
  }
}

TEST(EngineState, ThatDoesNotFitIsRefusedAndChangesNothing) {
  const auto simulation = started(small_column());
  for (int n = 0; n < 30; ++n) simulation->advance();
  const Snapshot own(*simulation);
  Snapshot short_one = own;
  short_one.bytes.pop_back();
  short_one.counts.pop_back();
  EXPECT_THROW(simulation->set_state(short_one.spans()), ModelError);
  Snapshot uneven = own;
  const std::size_t mass = field_index(*simulation, "fluid.mass");
  uneven.bytes[mass].resize(uneven.bytes[mass].size() - 8);
  --uneven.counts[mass];
  EXPECT_THROW(simulation->set_state(uneven.spans()), ModelError);
  Snapshot torn = own;
  torn.bytes[mass].resize(torn.bytes[mass].size() - 3);
  EXPECT_THROW(simulation->set_state(torn.spans()), ModelError);
  EXPECT_EQ(Snapshot(*simulation), own);
  const Trace after = traced(*simulation, 20);
  const auto undisturbed = started(small_column());
  for (int n = 0; n < 30; ++n) undisturbed->advance();
  EXPECT_EQ(first_difference(traced(*undisturbed, 20), after), -1);
}

TEST(EngineState, ClockCountsFromTheLastChangeOfTheStep) {
  const auto simulation = started(small_column());
  const double dt = simulation->clock().dt;
  for (int n = 0; n < 7; ++n) simulation->advance();
  EXPECT_EQ(simulation->clock().time, 7 * dt);
  simulation->change({{"time.dt", number_text(0.5 * dt)}}, {});
  EXPECT_EQ(simulation->clock().time, 7 * dt);
  for (int n = 0; n < 3; ++n) simulation->advance();
  EXPECT_EQ(simulation->clock().step, 10u);
  EXPECT_EQ(simulation->clock().time, 7 * dt + 3.0 * (0.5 * dt));
  EXPECT_EQ(field<std::uint64_t>(*simulation, "clock.step"),
            (std::vector<std::uint64_t>{10, 7}));
}

TEST(EngineState, EvaluatingItSaysWhatTheNextStepSaysAndChangesNothing) {
  for (Scenario scenario : {small_column(), single_disc()}) {
    scenario.fluid.jitter = 0.02;
    const auto live = started(scenario), looked_at = started(scenario);
    for (int n = 0; n < 40; ++n) {
      const Snapshot before(*live);
      looked_at->set_state(before.spans());
      looked_at->evaluate();
      const Snapshot after(*looked_at);
      EXPECT_EQ(after.bytes, before.bytes) << "step " << n;
      live->advance();
      const std::vector<GrainReport> a = live->grain_reports(), b = looked_at->grain_reports();
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].hydrodynamic, b[i].hydrodynamic);
        EXPECT_EQ(a[i].drag, b[i].drag);
        EXPECT_EQ(a[i].fluid_velocity, b[i].fluid_velocity);
        EXPECT_EQ(a[i].porosity, b[i].porosity);
      }
      EXPECT_EQ(live->fluid_report().pressure, looked_at->fluid_report().pressure);
      EXPECT_EQ(live->fluid_report().porosity, looked_at->fluid_report().porosity);
      // And advancing from there is the same step.
      looked_at->advance();
      EXPECT_EQ(Snapshot(*looked_at).bytes, Snapshot(*live).bytes);
    }
  }
}

}  // namespace
}  // namespace varve::core::test
