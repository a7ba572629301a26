// Changes while a run lasts: scheduled or by hand they are one thing, and a changed width keeps the
// mass balance, the pressure and the grains.
#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/engine_support.h"

namespace varve::core::test {
namespace {

struct Change {
  std::int64_t step;
  Settings settings;
  ChangeOptions options = {};
};

ScheduledChange scheduled(const Change& change, std::size_t number) {
  ScheduledChange result;
  result.name = "number" + std::to_string(number);
  result.at_step = change.step;
  result.settings = change.settings;
  result.anchor = change.options.anchor;
  result.outside = change.options.outside;
  return result;
}

Scenario with_changes(Scenario scenario, const std::vector<Change>& changes) {
  for (const Change& change : changes)
    scenario.changes.push_back(scheduled(change, scenario.changes.size()));
  return resolved(scenario);
}

/// The trace of a run whose changes are made from outside.
Trace by_hand(const Scenario& plain, const std::vector<Change>& changes, std::int64_t steps) {
  const auto simulation = Simulation::create(plain, {});
  const io::Schema schema = schema_of(*simulation);
  Trace trace;
  for (std::int64_t n = 0; n <= steps; ++n) {
    if (n > 0) simulation->advance();
    // Rows belong to the step, so they are read before the change.
    trace.tables.push_back(tables_digest(*simulation));
    for (const Change& change : changes)
      if (change.step == n) simulation->change(change.settings, change.options);
    trace.states.push_back(digest(*simulation, schema));
  }
  return trace;
}

std::vector<Change> many_changes() {
  return {{0, {{"contact.damping", "0.4"}}},
          {1, {{"fluid.viscosity", "0.02"}}},
          {20, {{"domain.width", "0.024"}}},
          {31, {{"contact.stiffness", "12000"}, {"contact.friction", "0.1"}}},
          {40, {{"gravity.magnitude", "5"}, {"gravity.tilt", "0.2"}}},
          {55, {{"time.dt", "1e-4"}}},
          {70, {{"domain.width", "0.022"}}, {OutsideMode::push, 0}},
          {85, {{"domain.width", "0.023"}}, {OutsideMode::error, -1}}};
}

TEST(EngineChange, ScheduledOrByHandIsTheSameToTheBit) {
  constexpr std::int64_t steps = 120;
  const Scenario plain = resolved(small_column());
  const Trace expected = by_hand(plain, many_changes(), steps);
  const auto simulation = Simulation::create(with_changes(small_column(), many_changes()), {});
  const Trace found = traced(*simulation, steps);
  EXPECT_EQ(first_difference(expected, found), -1);
  EXPECT_EQ(simulation->scenario().domain.width, 0.023);
  EXPECT_EQ(simulation->clock().dt, 1e-4);
  // And they did something.
  const auto unchanged = Simulation::create(plain, {});
  EXPECT_EQ(first_difference(traced(*unchanged, steps), found), 2);
}

TEST(EngineChange, ARunContinuesAcrossChangesFromAnyOfItsStates) {
  constexpr std::uint64_t steps = 100;
  const Scenario scenario = with_changes(small_column(), many_changes());
  const auto original = Simulation::create(scenario, {});
  const io::Schema schema = schema_of(*original);
  std::vector<Snapshot> states{Snapshot(*original)};
  std::vector<io::Digest> digests{digest(*original, schema)};
  for (std::uint64_t n = 1; n <= steps; ++n) {
    original->advance();
    states.emplace_back(*original);
    digests.push_back(digest(*original, schema));
  }
  for (std::uint64_t k = 0; k < steps; ++k) {
    const auto simulation = Simulation::restore(scenario, states[k].spans(), {});
    for (std::uint64_t n = k; n <= steps; ++n) {
      if (n > k) simulation->advance();
      ASSERT_EQ(digest(*simulation, schema), digests[n]) << "restored at " << k << ", step " << n;
    }
  }
}

TEST(EngineChange, IsToldAtTheEndOfItsStepAndOnlyThere) {
  const auto simulation = Simulation::create(
      with_changes(small_column(), {{5, {{"contact.damping", "0.25"}}},
                                    {7, {{"domain.width", "0.024"}}}}), {});
  for (int n = 1; n <= 9; ++n) {
    simulation->advance();
    std::vector<std::string> kinds;
    for (const Happening& each : simulation->happenings()) kinds.push_back(each.kind);
    if (n == 5) EXPECT_THAT(kinds, testing::ElementsAre("change"));
    else if (n == 7) EXPECT_THAT(kinds, testing::IsSupersetOf({"change", "fluid_added"}));
    else EXPECT_THAT(kinds, testing::IsEmpty());
    if (n == 5) {
      EXPECT_THAT(simulation->happenings()[0].items,
                  testing::ElementsAre(testing::Pair("contact.damping", "0.25")));
    }
  }
}

TEST(EngineChange, ThatChangesNothingIsNoChange) {
  const Scenario plain = resolved(small_column());
  const Trace expected = by_hand(plain, {}, 60);
  const std::vector<Change> same = {{10, {{"contact.damping", "0.2"}}},
                                    {20, {{"domain.width", "0.02"}}},
                                    {30, {}}};
  EXPECT_EQ(first_difference(expected, by_hand(plain, same, 60)), -1);
}

TEST(EngineChange, OfDampingIsFeltFromTheFirstContactOn) {
  Scenario disc = small_column();
  disc.grains.rows = disc.grains.columns = 1;
  disc.grains.lowest_y = 2.2e-3;
  const Scenario plain = resolved(disc);
  const auto soft = Simulation::create(plain, {});
  const auto hard = Simulation::create(plain, {});
  hard->change({{"contact.damping", "0.25"}}, {});
  for (int n = 0; n < 400; ++n) {
    soft->advance();
    hard->advance();
    const auto begins = column<std::uint8_t>(*soft, 0, "begin");
    if (begins.empty()) {
      ASSERT_EQ(digest(*soft), digest(*hard)) << "step " << n;
      continue;
    }
    EXPECT_EQ(begins[0], 1);
    EXPECT_NE(digest(*soft), digest(*hard));
    return;
  }
  FAIL() << "never touched";
}

TEST(EngineChange, ThatIsNotAllowedLeavesTheStateAlone) {
  const auto simulation = started(small_column());
  for (int n = 0; n < 30; ++n) simulation->advance();
  const Snapshot before(*simulation);
  const std::string scenario = canonical_text(simulation->scenario());
  const std::vector<Settings> refused = {
      {{"grains.diameter", "0.003"}},  // fixed
      {{"fluid.spacing", "0.002"}},    // fixed
      {{"domain.widht", "0.03"}},      // no such key
      {{"domain.width", "0.0213"}},    // not a whole number of columns
      {{"domain.width", "-1"}},
      {{"contact.damping", "lots"}},
      {{"contact.damping", "0.25"}, {"time.dt", "1"}},  // one good, one above its limit
      {{"domain.width", "0.006"}},                      // grains would be outside
  };
  for (const Settings& settings : refused) {
    try {
      simulation->change(settings, {});
      ADD_FAILURE() << settings[0].first << " = " << settings[0].second << " was taken";
    } catch (const ModelError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(settings.back().first));
    }
    EXPECT_EQ(Snapshot(*simulation), before);
    EXPECT_EQ(canonical_text(simulation->scenario()), scenario);
  }
}

// ---- width ----

double mass_of(const Simulation& simulation) {
  double sum = 0;
  for (const double m : field(simulation, "fluid.mass")) sum += m;
  return sum;
}

/// What the happenings say of an item; 0 if nothing.
double told(const Simulation& simulation, const std::string& kind, const std::string& item) {
  for (const Happening& each : simulation.happenings()) {
    if (each.kind != kind) continue;
    for (const auto& [key, value] : each.items)
      if (key == item) return std::stod(value);
  }
  return 0;
}

/// Mean of the excess pressure over the fluid's volume [Pa], as of the last force evaluation.
double mean_excess(const Simulation& simulation) {
  const std::vector<double> p = simulation.fluid_report().pressure;
  const std::vector<double> m = field(simulation, "fluid.mass");
  const std::vector<double> rhob = field(simulation, "fluid.superficial_density");
  double sum = 0, volume = 0;
  for (std::size_t a = 0; a < p.size(); ++a) {
    sum += p[a] * m[a] / rhob[a];
    volume += m[a] / rhob[a];
  }
  return sum / volume;
}

struct WidthCase {
  std::string name;
  Scenario scenario;
  int steps_before;
  std::string width;
  ChangeOptions options;
};

std::vector<WidthCase> width_cases() {
  Scenario disc = single_disc();
  Scenario wide = small_column();
  wide.domain.width = 0.03;
  wide.domain.height = 0.04;
  wide.grains.lowest_y = 0.025;
  Scenario slip = wide;
  slip.domain.sides = Boundary::free_slip;
  return {{"disc wider", disc, 960, "0.03", {}},
          {"disc narrower", disc, 960, "0.014", {}},
          {"column wider", wide, 60, "0.034", {}},
          {"column wider on the right", wide, 60, "0.035", {OutsideMode::error, -1}},
          {"column narrower", wide, 60, "0.024", {}},
          {"column narrower from the left", wide, 60, "0.025", {OutsideMode::error, 1}},
          {"slip narrower", slip, 60, "0.022", {}}};
}

TEST(EngineWidth, KeepsTheBalanceOfMassTheMeanPressureAndAllGrains) {
  for (const WidthCase& each : width_cases()) {
    SCOPED_TRACE(each.name);
    const bool alone = each.scenario.grains.rows == 1;
    const auto simulation = started(each.scenario);
    for (int n = 0; n < each.steps_before; ++n) simulation->advance();
    const auto control =
        alone ? nullptr
              : Simulation::restore(simulation->scenario(), Snapshot(*simulation).spans(), {});
    const double mass = mass_of(*simulation), pressure = mean_excess(*simulation);
    const std::vector<double> grains = field(*simulation, "grains.position");
    const auto ids = field<std::uint64_t>(*simulation, "fluid.id");
    simulation->change({{"domain.width", each.width}}, each.options);

    const double added = told(*simulation, "fluid_added", "mass");
    const double removed = told(*simulation, "fluid_removed", "mass");
    EXPECT_GT(added + removed, 0);
    EXPECT_EQ(added > 0, std::stod(each.width) > each.scenario.domain.width);
    EXPECT_NEAR(mass_of(*simulation), mass + added - removed, 1e-12 * mass);
    const double drawn = each.scenario.fluid.density * each.scenario.domain.height *
                         std::abs(std::stod(each.width) - each.scenario.domain.width);
    const double particle = each.scenario.fluid.density * 1e-6;
    EXPECT_NEAR(added + removed, drawn, 0.51 * particle);
    EXPECT_EQ(field(*simulation, "grains.position"), grains);
    const auto ids_after = field<std::uint64_t>(*simulation, "fluid.id");
    EXPECT_TRUE(std::is_sorted(ids_after.begin(), ids_after.end()));
    const std::vector<double> x = field(*simulation, "fluid.position");
    const Domain& domain = simulation->scenario().domain;
    for (std::size_t a = 0; a < ids_after.size(); ++a) {
      ASSERT_GT(x[2 * a], domain.left);
      ASSERT_LT(x[2 * a], domain.left + domain.width);
      if (ids_after[a] <= ids.back()) continue;
      // Added fluid lies in no grain.
      for (std::size_t i = 0; i < grains.size(); i += 2)
        ASSERT_GT(std::hypot(x[2 * a] - grains[i], x[2 * a + 1] - grains[i + 1]),
                  0.5 * each.scenario.grains.diameter);
    }

    // Ten times the sound's way along the longer side. An array that settles raises the mean by
    // itself, by 1e-3 rho0 c0^2 in 20 ms, and does so faster in a narrower box: such runs are
    // compared with the same run without the change.
    const Scenario& s = simulation->scenario();
    const double c0 = s.fluid.sound_speed, unit = s.fluid.density * c0 * c0;
    const double until = simulation->clock().time +
                         10 * std::max(s.domain.width, s.domain.height) / c0;
    double peak_pressure = 0, peak_speed = 0;
    while (simulation->clock().time < until) {
      simulation->advance();
      if (control) control->advance();
      for (const double p : simulation->fluid_report().pressure)
        peak_pressure = std::max(peak_pressure, std::abs(p));
      const std::vector<double> v = field(*simulation, "fluid.velocity");
      for (std::size_t a = 0; a < v.size(); a += 2)
        peak_speed = std::max(peak_speed, std::hypot(v[a], v[a + 1]));
    }
    const double drift = (mean_excess(*simulation) - pressure) / unit;
    const double due = control ? (mean_excess(*simulation) - mean_excess(*control)) / unit : drift;
    std::printf("%-32s mean excess pressure %+.2e rho0 c0^2, %+.2e by the change; peak pressure "
                "%.3g Pa, peak speed %.3g m/s\n",
                each.name.c_str(), drift, due, peak_pressure, peak_speed);
    EXPECT_LT(std::abs(due), alone ? 0.002 : 0.004);
  }
}

TEST(EngineWidth, GrainsLeftOutsideAreAnErrorPushedOrRemoved) {
  Scenario scenario = small_column();
  scenario.grains.centre_x = 0.0045;  // leaning to the left wall
  scenario.grains.velocity_x = scenario.grains.velocity_y = 0;
  scenario.grains.columns = 1;
  scenario.grains.gap = 0.1;
  scenario.grains.jitter = 0;
  for (const OutsideMode mode : {OutsideMode::error, OutsideMode::push, OutsideMode::remove}) {
    const auto simulation = started(scenario);
    for (int n = 0; n < 20; ++n) simulation->advance();
    const Snapshot before(*simulation);
    const double mass = mass_of(*simulation);
    const Settings narrower = {{"domain.width", "0.012"}};  // left wall to 4 mm
    if (mode == OutsideMode::error) {
      try {
        simulation->change(narrower, {mode, 0});
        ADD_FAILURE() << "taken";
      } catch (const ModelError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("0, 1, 2"));
      }
      EXPECT_EQ(Snapshot(*simulation), before);
      continue;
    }
    simulation->change(narrower, {mode, 0});
    EXPECT_NEAR(mass_of(*simulation), mass - told(*simulation, "fluid_removed", "mass"),
                1e-12 * mass);
    const std::vector<double> x = field(*simulation, "grains.position");
    if (mode == OutsideMode::push) {
      ASSERT_EQ(x.size(), 6u);
      for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(x[2 * i], 4e-3 + 1.25e-3, 1e-12);
    } else {
      EXPECT_EQ(x.size(), 0u);
      EXPECT_EQ(field<std::uint64_t>(*simulation, "contacts.key").size(), 0u);
    }
    for (int n = 0; n < 50; ++n) simulation->advance();
    const StepLedger ledger = simulation->ledger();
    EXPECT_LE(momentum_residual(ledger, simulation->clock().dt), 1e-12);
  }
}

TEST(EngineWidth, InSeveralJumpsEndsWhereOneJumpDoes) {
  Scenario disc = single_disc();
  std::vector<Change> ramp;
  for (int k = 1; k <= 5; ++k)
    ramp.push_back({200 + 20 * k, {{"domain.width", number_text(0.02 + 2e-3 * k)}}});
  const auto simulation = Simulation::create(with_changes(disc, ramp), {});
  const double mass = mass_of(*simulation);
  for (int n = 0; n < 400; ++n) simulation->advance();
  EXPECT_EQ(simulation->scenario().domain.width, 0.03);
  EXPECT_NEAR(mass_of(*simulation) - mass, 1000 * 0.06 * 0.01, 1e-9);
  EXPECT_EQ(field(*simulation, "fluid.mass").size(), 1800u);
}

TEST(EngineWidth, UnderAFreeSurfaceTheLevelStays) {
  Scenario scenario = small_column();
  scenario.grains.rows = 0;
  scenario.domain.top = Boundary::free;
  scenario.domain.height = 0.03;
  scenario.fluid.level = 0.02;
  const auto simulation = started(scenario);
  for (int n = 0; n < 50; ++n) simulation->advance();
  const double mass = mass_of(*simulation);
  simulation->change({{"domain.width", "0.024"}}, {});
  EXPECT_NEAR(mass_of(*simulation) / mass, 1.2, 2e-2);
  double highest = 0;
  for (int n = 0; n < 500; ++n) {
    simulation->advance();
    const std::vector<double> x = field(*simulation, "fluid.position");
    for (std::size_t a = 1; a < x.size(); a += 2) highest = std::max(highest, x[a]);
  }
  EXPECT_LT(highest, 0.022);
}

TEST(EngineWidth, NeverGivesAnIdTwice) {
  Scenario scenario = single_disc();
  scenario.grains.rows = 0;
  const auto simulation = started(scenario);
  std::vector<std::uint64_t> given = field<std::uint64_t>(*simulation, "fluid.id");
  // Wider, narrower and wider again: the last columns are other particles than those that went.
  for (const char* width : {"0.022", "0.02", "0.022", "0.018", "0.022"}) {
    const std::vector<std::uint64_t> before = field<std::uint64_t>(*simulation, "fluid.id");
    for (int n = 0; n < 3; ++n) simulation->advance();
    simulation->change(Settings{{"domain.width", width}}, {});
    for (const std::uint64_t id : field<std::uint64_t>(*simulation, "fluid.id")) {
      if (std::binary_search(before.begin(), before.end(), id)) continue;
      EXPECT_FALSE(std::binary_search(given.begin(), given.end(), id)) << id;
      given.push_back(id);
    }
    ASSERT_TRUE(std::is_sorted(given.begin(), given.end()));
  }
}

}  // namespace
}  // namespace varve::core::test
