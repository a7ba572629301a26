// The contact law against closed forms: restitution, rest, sticking, sliding, rolling; what is
// conserved, what is recorded, and what must not reach a bit.
#include "core/contacts.h"

#include <cmath>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/math.h"
#include "core/simulation.h"

namespace varve::core {
namespace {

using P = DoublePrecision;
using V2 = Vec<double, 2>;

constexpr double no_limit = 1e300;

/// Discs of 2.5 mm and 1250 kg/m3 whose undamped contact with a wall lasts 0.5 ms.
Constants<2> disc_constants() {
  Constants<2> c;
  c.species = {species_constants<2>(2.5e-3, 1250)};
  c.contact.stiffness = c.species[0].mass * (pi / 0.5e-3) * (pi / 0.5e-3);
  c.contact.tangential_ratio = 1.0 / 3.0;
  c.contact.damping = 0.2;
  c.contact.friction = 0.3;
  c.contact.rotation = true;
  c.dt = 0.5e-3;
  c.substeps = 30;
  return c;
}

Wall floor_plane() { return {wall_bottom, Boundary::no_slip, 1, 0.0, 1.0}; }

/// Grains, contacts and what acts on them, advanced step by step.
struct Rig {
  Constants<2> c = disc_constants();
  std::vector<Wall> walls;
  GrainState<2, P> grains;
  ContactState<2, P> contacts;
  std::vector<OuterForce<2>> outer;
  Contacts<2, P> stage;
  std::uint64_t step = 0;
  double limit = no_limit;

  void add(V2 x, V2 v, double spin = 0, V2 force = V2::Zero()) {
    grains.id.push_back(grains.size());
    grains.species.push_back(0);
    grains.position.push_back(x);
    grains.velocity.push_back(v);
    grains.spin.push_back(Vec<double, 1>(spin));
    outer.push_back({force, V2::Zero(), 0});
  }
  void advance() {
    c.set_pairs();
    stage.advance(c, outer, walls, limit, ++step, grains, contacts);
  }
  const SpeciesConstants<2>& disc() const { return c.species[0]; }
  V2 momentum() const {
    V2 sum = V2::Zero();
    for (const V2& v : grains.velocity) sum += c.species[0].mass * v;
    return sum;
  }
  double kinetic() const {
    double sum = 0;
    for (std::size_t i = 0; i < grains.size(); ++i)
      sum += 0.5 * c.species[0].mass * grains.velocity[i].squaredNorm() +
             0.5 * c.species[0].inertia * grains.spin[i].squaredNorm();
    return sum;
  }
};

/// Restitution of a linear spring and dashpot that never pulls (Schwager and Poeschel 2007).
double theoretical_restitution(double alpha) {
  const double zeta = 0.5 * alpha;
  if (zeta >= 1) return std::exp(-2.0);
  const double w = std::sqrt(1 - zeta * zeta);
  const double end = (pi - std::atan2(2 * zeta * w, 1 - 2 * zeta * zeta)) / w;
  return std::exp(-zeta * end);
}

/// Drops a disc on the floor from `gap` above it; the ratio of speeds.
double wall_restitution(double alpha, double gap, std::int64_t substeps = 30) {
  Rig rig;
  rig.c.contact.damping = alpha;
  rig.c.substeps = substeps;
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius + gap}, {0, -0.2});
  bool touched = false;
  for (int n = 0; n < 400; ++n) {
    rig.advance();
    touched = touched || rig.contacts.size() > 0;
    if (touched && rig.contacts.size() == 0) break;
  }
  return rig.grains.velocity[0][1] / 0.2;
}

double pair_restitution(double alpha, double gap) {
  Rig rig;
  rig.c.contact.damping = alpha;
  rig.add({0, 0}, {0.1, 0});
  rig.add({rig.disc().diameter + gap, 0}, {-0.1, 0});
  bool touched = false;
  for (int n = 0; n < 400; ++n) {
    rig.advance();
    touched = touched || rig.contacts.size() > 0;
    if (touched && rig.contacts.size() == 0) break;
  }
  return (rig.grains.velocity[1][0] - rig.grains.velocity[0][0]) / 0.2;
}

// ---- restitution ----

TEST(ContactRestitution, MeanOverPhasesIsThatOfTheClippedLinearLaw) {
  // The phase of the sub-step in which a contact begins moves a single rebound by up to 1 %; their
  // mean is what a run with many contacts sees.
  for (const double alpha : {0.0, 0.05, 0.15, 0.2, 0.25}) {
    const Constants<2> c = disc_constants();
    const double per_substep = 0.2 * c.dt / static_cast<double>(c.substeps);
    double wall = 0, pair = 0;
    constexpr int phases = 40;
    for (int k = 0; k < phases; ++k) {
      const double gap = 1e-7 + (k + 0.5) / phases * per_substep;
      wall += wall_restitution(alpha, gap) / phases;
      pair += pair_restitution(alpha, gap) / phases;
    }
    EXPECT_NEAR(wall / theoretical_restitution(alpha), 1, 5e-3) << "alpha " << alpha;
    EXPECT_NEAR(pair / theoretical_restitution(alpha), 1, 5e-3) << "alpha " << alpha;
  }
}

TEST(ContactRestitution, EveryPhaseIsRightAtFinerSubsteps) {
  for (const double alpha : {0.0, 0.05, 0.15, 0.2, 0.25, 0.5})
    for (const double gap : {1e-9, 1e-7, 1e-6, 2.3e-6, 3.1e-5})
      EXPECT_NEAR(wall_restitution(alpha, gap, 480) / theoretical_restitution(alpha), 1, 5e-3)
          << "alpha " << alpha << ", gap " << gap;
}

TEST(ContactRestitution, SpreadOverPhasesStaysBelowTwoPercentAsSubstepped) {
  for (const double alpha : {0.0, 0.15, 0.2, 0.25})
    for (const double gap : {1e-9, 5e-7, 1e-6, 2.3e-6, 3.1e-6, 3.1e-5})
      EXPECT_NEAR(wall_restitution(alpha, gap) / theoretical_restitution(alpha), 1, 2e-2)
          << "alpha " << alpha << ", gap " << gap;
}

TEST(ContactRestitution, OverdampedContactDoesNotComeBackWithMoreThanItHad) {
  for (const double alpha : {1.5, 2.0}) {
    const double e = wall_restitution(alpha, 1e-6);
    EXPECT_GT(e, 0);
    EXPECT_NEAR(e, theoretical_restitution(alpha), 0.03);
  }
}

TEST(ContactRestitution, DoesNotDependOnTheSpeed) {
  std::vector<double> found;
  for (const double speed : {0.01, 0.1, 0.3}) {
    Rig rig;
    rig.walls = {floor_plane()};
    rig.add({0, rig.disc().radius + speed * 1e-6}, {0, -speed});
    for (int n = 0; n < 10; ++n) rig.advance();
    found.push_back(rig.grains.velocity[0][1] / speed);
  }
  EXPECT_NEAR(found[0], found[1], 1e-9);
  EXPECT_NEAR(found[1], found[2], 1e-9);
}

TEST(ContactRestitution, StiffnessDoesNotMatterIfTheSubstepsFollow) {
  for (const double factor : {1e-2, 1.0, 1e2}) {
    Rig rig;
    rig.c.contact.stiffness *= factor;
    rig.c.dt /= std::sqrt(factor);
    rig.walls = {floor_plane()};
    rig.add({0, rig.disc().radius + 1e-7}, {0, -0.02});
    for (int n = 0; n < 10; ++n) rig.advance();
    EXPECT_NEAR(rig.grains.velocity[0][1] / 0.02 / theoretical_restitution(0.2), 1, 1.2e-2);
  }
}

// ---- conservation ----

/// Random discs thrown at each other; with spin, friction and damping.
Rig crowd(std::uint64_t seed) {
  Rig rig;
  const auto draw = [&](std::uint64_t id, std::uint64_t k) {
    const std::uint64_t bits = (id * 7919 + k * 104729 + seed * 15485863) * 0x9e3779b97f4a7c15u;
    return static_cast<double>(bits >> 40) * 0x1p-24 * 2 - 1;
  };
  for (std::uint64_t i = 0; i < 16; ++i) {
    const double x = static_cast<double>(i % 4) * 1.05 * rig.disc().diameter;
    const double y = static_cast<double>(i / 4) * 1.05 * rig.disc().diameter;
    // Inwards, so that they meet, plus noise.
    rig.add({x, y}, {-20 * (x - 4e-3) + 0.1 * draw(i, 0), -20 * (y - 4e-3) + 0.1 * draw(i, 1)},
            50 * draw(i, 2));
  }
  return rig;
}

TEST(ContactConservation, PairsKeepLinearMomentumToRoundOff) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    Rig rig = crowd(seed);
    const V2 before = rig.momentum();
    double exchanged = 0;
    std::size_t most = 0;
    for (int n = 0; n < 60; ++n) {
      rig.advance();
      most = std::max(most, rig.contacts.size());
      for (const auto& record : rig.stage.records()) exchanged += record.impulse.norm();
    }
    EXPECT_GE(most, 8u);
    ASSERT_GT(exchanged, 0);
    EXPECT_LT((rig.momentum() - before).norm(), 1e-13 * exchanged);
  }
}

TEST(ContactConservation, EnergyIsNeverGainedAcrossACrowdOfCollisions) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    Rig rig = crowd(seed);
    const double start = rig.kinetic();
    int free_steps = 0;
    double lowest = start;
    for (int n = 0; n < 400; ++n) {
      rig.advance();
      // Between contacts all energy is kinetic.
      if (rig.contacts.size() > 0) continue;
      ++free_steps;
      EXPECT_LE(rig.kinetic(), lowest * (1 + 1e-12)) << "step " << rig.step;
      lowest = rig.kinetic();
    }
    EXPECT_GT(free_steps, 10);
    EXPECT_LT(lowest, 0.9 * start);
  }
}

TEST(ContactConservation, WithoutLossesTheEnergyComesBack) {
  Rig rig;
  rig.c.contact.damping = 0;
  rig.c.contact.friction = 0;
  rig.c.substeps = 200;
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius + 1e-6}, {0.05, -0.2});
  const double start = rig.kinetic();
  for (int n = 0; n < 4; ++n) rig.advance();
  ASSERT_EQ(rig.contacts.size(), 0u);
  ASSERT_GT(rig.grains.velocity[0][1], 0);
  EXPECT_NEAR(rig.kinetic() / start, 1, 1e-4);
}

TEST(ContactConservation, RecordedLossesAreTheEnergyThatWent) {
  for (const double friction : {0.0, 0.1, 10.0}) {
    Rig rig;
    rig.c.contact.friction = friction;
    rig.c.substeps = 400;
    rig.add({0, 0}, {0.15, 0.02}, 30);
    rig.add({rig.disc().diameter * 0.9, rig.disc().diameter * 0.5}, {-0.1, -0.05}, -10);
    const double start = rig.kinetic();
    double normal = 0, tangential = 0, sliding = 0;
    for (int n = 0; n < 20; ++n) {
      rig.advance();
      for (const auto& record : rig.stage.records()) {
        normal += record.normal_loss;
        tangential += record.tangential_loss;
        sliding += record.friction_loss;
      }
    }
    ASSERT_EQ(rig.contacts.size(), 0u);
    const double lost = start - rig.kinetic();
    EXPECT_GT(lost, 0.05 * start);
    EXPECT_GT(normal, 0);
    if (friction == 0.0) {
      EXPECT_EQ(sliding, 0);
      EXPECT_NEAR(tangential, 0, 1e-15 * start);
    } else {
      EXPECT_EQ(sliding > 0, friction < 1);
      EXPECT_GT(tangential, 0);
    }
    EXPECT_NEAR((normal + tangential + sliding) / lost, 1, 2e-2) << "friction " << friction;
  }
}

// ---- rest, sticking, sliding, rolling ----

TEST(ContactRest, OverlapCarriesTheWeight) {
  for (const double factor : {1e-2, 1.0, 1e2}) {
    Rig rig;
    rig.c.contact.stiffness *= factor;
    rig.c.dt /= std::sqrt(factor);
    const double weight = 9.81 * rig.disc().mass;
    rig.walls = {floor_plane()};
    rig.add({0, rig.disc().radius}, V2::Zero(), 0, {0, -weight});
    for (int n = 0; n < 2000; ++n) rig.advance();
    ASSERT_EQ(rig.contacts.size(), 1u);
    const double overlap = rig.disc().radius - rig.grains.position[0][1];
    EXPECT_NEAR(rig.c.contact.stiffness * overlap / weight, 1, 1e-9)
        << "stiffness factor " << factor;
    EXPECT_NEAR(rig.grains.velocity[0][1], 0, 1e-12);
  }
}

TEST(ContactRest, ImplicitDragOfAnyStrengthLeavesRestAlone) {
  for (const double coefficient : {0.0, 1.0, 1e6}) {
    Rig rig;
    const double weight = 9.81 * rig.disc().mass;
    rig.walls = {floor_plane()};
    rig.add({0, rig.disc().radius - weight / rig.c.contact.stiffness}, V2::Zero(), 0, {0, -weight});
    rig.outer[0].coefficient = coefficient;
    for (int n = 0; n < 1000; ++n) rig.advance();
    const double overlap = rig.disc().radius - rig.grains.position[0][1];
    EXPECT_NEAR(rig.c.contact.stiffness * overlap / weight, 1, 1e-9) << "K " << coefficient;
    EXPECT_LT(std::abs(rig.stage.mean_drag()[0][1]), 1e-9 * weight);
  }
}

TEST(ContactDrag, IsExactAtTerminalSpeedForAnyStepAndReportsItsMean) {
  for (const double coefficient : {0.1, 10.0, 1e5}) {
    Rig rig;
    const V2 force{0.3, -0.2}, fluid{0.01, 0.02};
    rig.add({0, 0}, fluid + force / coefficient, 0, force);
    rig.outer[0].fluid_velocity = fluid;
    rig.outer[0].coefficient = coefficient;
    const V2 before = rig.grains.velocity[0];
    rig.advance();
    EXPECT_LT((rig.grains.velocity[0] - before).norm(), 1e-14 * before.norm());
    EXPECT_LT((rig.stage.mean_drag()[0] + force).norm(), 1e-9 * force.norm());
  }
}

TEST(ContactDrag, MeanIsTheImpulseThatTheGrainReallyFelt) {
  Rig rig;
  rig.add({0, 0}, {0.1, 0.3}, 0, {0.01, 0});
  rig.outer[0].fluid_velocity = {-0.05, 0};
  rig.outer[0].coefficient = 0.7;
  const V2 before = rig.grains.velocity[0];
  rig.advance();
  const V2 change = rig.disc().mass * (rig.grains.velocity[0] - before);
  const V2 felt = rig.c.dt * (rig.stage.mean_drag()[0] + rig.outer[0].force);
  EXPECT_LT((change - felt).norm(), 1e-14 * rig.disc().mass);
}

/// A disc resting on the floor, pushed sideways through its centre with `push` times mu N.
Rig pushed(double push, int steps) {
  Rig rig;
  const double weight = 9.81 * rig.disc().mass;
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius - weight / rig.c.contact.stiffness}, V2::Zero(), 0,
          {push * rig.c.contact.friction * weight, -weight});
  for (int n = 0; n < steps; ++n) rig.advance();
  return rig;
}

TEST(ContactFriction, ADiscPushedBelowTheLimitRollsWithoutSliding) {
  // Rolling needs a friction of a third of the push (disc: I = m R^2 / 2).
  Rig rig = pushed(2.9, 200);
  const double t = 200 * rig.c.dt;
  const double push = rig.outer[0].force[0];
  EXPECT_NEAR(rig.grains.velocity[0][0] / (2.0 / 3 * push * t / rig.disc().mass), 1, 5e-3);
  EXPECT_NEAR(rig.grains.spin[0][0] * rig.disc().radius / rig.grains.velocity[0][0], -1, 5e-3);
  EXPECT_EQ(rig.stage.records().at(0).friction_loss, 0);
  // The spring carries that third and does not grow while the disc rolls on.
  EXPECT_NEAR(rig.c.contact.stiffness / 3 * rig.contacts.spring[0][0] / (push / 3), 1, 2e-2);
}

TEST(ContactFriction, ADiscPushedAboveTheLimitSlidesWithCoulombsForce) {
  Rig rig = pushed(4.0, 200);
  const double t = 200 * rig.c.dt;
  const double limit = rig.outer[0].force[0] / 4;
  EXPECT_NEAR(rig.grains.velocity[0][0] / (3 * limit * t / rig.disc().mass), 1, 5e-3);
  const double turned = limit * rig.disc().radius * t / rig.disc().inertia;
  EXPECT_NEAR(-rig.grains.spin[0][0] / turned, 1, 5e-3);
  EXPECT_GT(rig.stage.records().at(0).friction_loss, 0);
  EXPECT_NEAR(rig.stage.records()[0].impulse[0] / (-limit * rig.c.dt), 1, 1e-6);
}

TEST(ContactFriction, ASlidingDiscRollsInTheEndWithTwoThirdsOfItsSpeed) {
  Rig rig;
  const double weight = 9.81 * rig.disc().mass, speed = 0.1;
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius - weight / rig.c.contact.stiffness}, {speed, 0}, 0, {0, -weight});
  const double until = speed / (3 * rig.c.contact.friction * 9.81);  // then it rolls
  const int steps = static_cast<int>(3 * until / rig.c.dt);
  for (int n = 0; n < steps; ++n) rig.advance();
  EXPECT_NEAR(rig.grains.velocity[0][0] / speed, 2.0 / 3, 5e-3);
  EXPECT_NEAR(rig.grains.spin[0][0] * rig.disc().radius / speed, -2.0 / 3, 5e-3);
}

TEST(ContactFriction, WithoutFrictionNothingTurns) {
  Rig rig = pushed(0, 1);
  rig.c.contact.friction = 0;
  rig.grains.velocity[0] = {0.1, 0};
  rig.grains.spin[0].setZero();
  for (int n = 0; n < 100; ++n) rig.advance();
  EXPECT_EQ(rig.grains.velocity[0][0], 0.1);
  EXPECT_EQ(rig.grains.spin[0][0], 0);
}

TEST(ContactFriction, ALongRestDoesNotCreep) {
  // Nothing pushes it along the floor: only rounding could move it.
  Rig rig = pushed(0, 1);
  for (int n = 0; n < 20000; ++n) rig.advance();
  EXPECT_LT(std::abs(rig.grains.position[0][0]), 1e-3 * rig.disc().diameter);
  EXPECT_LT(rig.contacts.spring[0].norm(), 1e-6 * rig.disc().diameter);
}

TEST(ContactFriction, GrossSlidingObliqueImpactFollowsTheRigidBodySolution) {
  // e_t = 1 - mu (1 + e) / tan(theta), omega = 2 mu (1 + e) V_n / R for a disc (Chung and Ooi 2011,
  // test 4, in two dimensions). The clipped dashpot makes e_n; friction follows the real N.
  Rig rig;
  rig.c.contact.friction = 0.092;
  rig.c.contact.damping = 0.02;
  rig.c.substeps = 400;
  rig.walls = {floor_plane()};
  const double normal = 0.1, along = 0.2;  // 63 degrees from the normal
  rig.add({0, rig.disc().radius + 1e-7}, {along, -normal});
  for (int n = 0; n < 4; ++n) rig.advance();
  ASSERT_EQ(rig.contacts.size(), 0u);
  const double e = rig.grains.velocity[0][1] / normal;
  EXPECT_NEAR(rig.grains.velocity[0][0] / along, 1 - 0.092 * (1 + e) * normal / along, 2e-3);
  EXPECT_NEAR(-rig.grains.spin[0][0] / (2 * 0.092 * (1 + e) * normal / rig.disc().radius), 1, 2e-2);
}

// ---- records ----

TEST(ContactRecords, TellBeginEndPeakAndImpulseOfAnElasticImpact) {
  Rig rig;
  rig.c.contact.damping = 0;
  rig.c.dt /= 8;  // the contact spans several steps
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius + 1e-7}, {0, -0.2});
  int begins = 0, ends = 0, rows = 0;
  double peak = 0, overlap = 0, rebound = 0, impact = 0;
  V2 impulse = V2::Zero();
  for (int n = 0; n < 20; ++n) {
    rig.advance();
    for (const auto& r : rig.stage.records()) {
      EXPECT_EQ(r.key, (ContactKey{0, 1, wall_bottom}));
      ++rows;
      begins += r.begin;
      ends += r.end;
      if (r.begin) {
        EXPECT_EQ(rows, 1);
        impact = r.impact_speed;
      }
      if (r.end) rebound = r.rebound_speed;
      peak = std::max(peak, r.peak_force);
      overlap = std::max(overlap, r.peak_overlap);
      impulse += r.impulse;
    }
  }
  EXPECT_EQ(begins, 1);
  EXPECT_EQ(ends, 1);
  EXPECT_GE(rows, 8);
  const double m = rig.disc().mass, k = rig.c.contact.stiffness;
  EXPECT_NEAR(impact, 0.2, 1e-12);
  EXPECT_NEAR(rebound, rig.grains.velocity[0][1], 1e-12);
  EXPECT_NEAR(peak / (0.2 * std::sqrt(m * k)), 1, 1e-2);
  EXPECT_NEAR(overlap / (0.2 * std::sqrt(m / k)), 1, 1e-2);
  EXPECT_NEAR(impulse[1], m * (rig.grains.velocity[0][1] + 0.2), 1e-14 * m);
  EXPECT_NEAR(rig.stage.wall_impulse().norm(), 0, 0);
}

TEST(ContactRecords, ImpulseIsOnTheFirstGrainOfTheKeyAndKeysAscend) {
  Rig rig;
  rig.walls = {floor_plane()};
  const double d = rig.disc().diameter;
  // Two discs on the floor and against each other, a third on top of both.
  rig.add({0, 0.4995 * d}, V2::Zero());
  rig.add({0.999 * d, 0.4995 * d}, V2::Zero());
  rig.add({0.4995 * d, 0.4995 * d + 0.86 * d}, V2::Zero());
  const double m = rig.disc().mass;
  rig.advance();
  std::vector<ContactKey> keys;
  std::vector<V2> gained(3, V2::Zero());
  for (const auto& r : rig.stage.records()) {
    keys.push_back(r.key);
    gained[r.key.grain] += r.impulse;
    if (r.key.kind == 0) gained[r.key.partner] -= r.impulse;
  }
  EXPECT_THAT(keys, testing::ElementsAre(ContactKey{0, 0, 1}, ContactKey{0, 0, 2},
                                         ContactKey{0, 1, wall_bottom}, ContactKey{1, 0, 2},
                                         ContactKey{1, 1, wall_bottom}));
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT((gained[i] - m * rig.grains.velocity[i]).norm(), 1e-13 * m);
  EXPECT_LT(rig.stage.records()[0].impulse[0], 0);  // pushes disc 0 to the left
}

TEST(ContactRecords, AContactWithinOneStepHasBothItsBeginAndItsEndThere) {
  // So fast that the disc is half a diameter away again before the step ends: the list is made anew
  // within the step and must not lose the record.
  Rig rig;
  rig.c.dt = 5e-3;
  rig.c.substeps = 300;
  rig.walls = {floor_plane()};
  rig.add({0, rig.disc().radius + 1e-4}, {0, -0.5});
  const std::uint64_t builds = rig.stage.list_builds();
  rig.advance();
  EXPECT_GT(rig.stage.list_builds(), builds + 1);
  ASSERT_EQ(rig.stage.records().size(), 1u);
  EXPECT_TRUE(rig.stage.records()[0].begin);
  EXPECT_TRUE(rig.stage.records()[0].end);
  EXPECT_EQ(rig.contacts.size(), 0u);
  EXPECT_GT(rig.grains.position[0][1], 1.1 * rig.disc().diameter);
}

TEST(ContactRecords, ADiscInTheAirHasNone) {
  Rig rig;
  rig.walls = {floor_plane()};
  rig.add({0, 1.01 * rig.disc().radius}, V2::Zero());
  rig.advance();
  EXPECT_EQ(rig.stage.records().size(), 0u);
}

// ---- what must not reach a bit, and what must not go wrong ----

bool same_bits(const Rig& a, const Rig& b) {
  const auto equal = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return equal(a.grains.position, b.grains.position) &&
         equal(a.grains.velocity, b.grains.velocity) && equal(a.grains.spin, b.grains.spin) &&
         equal(a.contacts.key, b.contacts.key) && equal(a.contacts.spring, b.contacts.spring);
}

TEST(ContactBits, ForgettingTheListAtEveryStepChangesNone) {
  Rig kept = crowd(5), dropped = crowd(5);
  for (int n = 0; n < 100; ++n) {
    kept.advance();
    dropped.stage.reset();
    dropped.advance();
    ASSERT_TRUE(same_bits(kept, dropped)) << "step " << n;
  }
  EXPECT_GT(dropped.stage.list_builds(), kept.stage.list_builds());
}

TEST(ContactBits, DampingMattersFromTheFirstContactOnAndNotBefore) {
  Rig soft, hard;
  for (Rig* rig : {&soft, &hard}) {
    rig->walls = {floor_plane()};
    rig->add({0, 2 * rig->c.species[0].radius}, {0, -0.2}, 0, {0, -9.81 * rig->c.species[0].mass});
  }
  soft.c.contact.damping = 0.2;
  hard.c.contact.damping = 0.25;
  for (int n = 0; n < 100; ++n) {
    soft.advance();
    hard.advance();
    const bool touched = !soft.stage.records().empty();
    ASSERT_EQ(same_bits(soft, hard), !touched) << "step " << n;
    if (touched) {
      EXPECT_TRUE(soft.stage.records()[0].begin);
      return;
    }
  }
  FAIL() << "never touched";
}

TEST(ContactPeriodic, TwoDiscsAcrossTheSeamFeelWhatTwoInTheMiddleFeel) {
  Rig middle, seam;
  const double length = 0.25;  // a power of two, so that shifting loses no bit
  for (Rig* rig : {&middle, &seam}) {
    rig->c.period.length[0] = length;
    rig->c.dt /= 4;
  }
  const double d = middle.c.species[0].diameter, x = 0.125;
  middle.add({x, 0}, {0.1, 0});
  middle.add({x + d * 0.999, 0}, {-0.1, 0});
  seam.add({x + 0.125 - d * 0.4995, 0}, {0.1, 0});
  seam.add({d * 0.4995, 0}, {-0.1, 0});
  for (int n = 0; n < 2; ++n) {
    middle.advance();
    seam.advance();
    ASSERT_EQ(seam.contacts.size(), 1u);
    for (std::size_t i : {0u, 1u})
      EXPECT_NEAR(seam.grains.velocity[i][0], middle.grains.velocity[i][0], 1e-12);
  }
}

TEST(ContactExtremes, CoincidentDiscsPartAlongXAndStayFinite) {
  Rig rig;
  rig.add({1e-3, 1e-3}, V2::Zero());
  rig.add({1e-3, 1e-3}, V2::Zero());
  rig.advance();
  EXPECT_GT(rig.grains.velocity[0][0], 0);
  EXPECT_EQ(rig.grains.velocity[0][0], -rig.grains.velocity[1][0]);
  EXPECT_EQ(rig.grains.velocity[0][1], 0);
  EXPECT_TRUE(rig.grains.position[0].allFinite());
}

TEST(ContactExtremes, AnOverlapBeyondTheGuardIsAnErrorThatNamesTheGrain) {
  Rig rig;
  rig.walls = {floor_plane()};
  rig.limit = 0.01;
  rig.add({0.1, 0.1}, V2::Zero());
  rig.add({0, rig.disc().radius}, {0, -5.0});
  try {
    for (int n = 0; n < 10; ++n) rig.advance();
    FAIL() << "no guard";
  } catch (const NumericalFailure& failure) {
    EXPECT_EQ(failure.criterion, "overlap with wall 2");
    EXPECT_EQ(failure.field, "grains.position");
    EXPECT_EQ(failure.id, 1u);
    EXPECT_EQ(failure.step, rig.step);
    EXPECT_GT(failure.value, 0.01 * rig.disc().diameter);
    EXPECT_EQ(failure.limit, 0.01 * rig.disc().diameter);
    EXPECT_FALSE(failure.advice.empty());
  }
}

TEST(ContactModules, WithoutRotationNothingTangentialIsThere) {
  Rig rig;
  rig.c.contact.rotation = false;
  rig.c.dt /= 100;
  rig.walls = {floor_plane()};
  rig.add({0, 0.999 * rig.disc().radius}, {0.1, 0});
  rig.grains.spin.clear();
  rig.advance();
  ASSERT_EQ(rig.contacts.key.size(), 1u);
  EXPECT_TRUE(rig.contacts.spring.empty());
  EXPECT_TRUE(rig.grains.spin.empty());
  EXPECT_EQ(rig.grains.velocity[0][0], 0.1);
}

}  // namespace
}  // namespace varve::core
