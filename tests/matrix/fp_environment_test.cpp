// The arithmetic that determinism rests on, checked in the build at hand.
#include "tests/matrix/fp_environment.h"

#include <cfenv>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include "core/arithmetic.h"
#include "core/parameters.h"
#include "core/simulation.h"
#include "core/workers.h"

namespace varve::tests {

double fused_residue();
double fma_target_residue();
float fma_target_residue_float();

namespace {

using core::keeps_subnormals;
using core::rounds_to_nearest;

bool has_fma() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0;
#else
  return false;
#endif
}

TEST(FloatingPoint, ProductsAndSumsAreRoundedOneByOne) {
  EXPECT_EQ(contraction_residue(), 0);
  EXPECT_EQ(contraction_residue_float(), 0);
}

TEST(FloatingPoint, ConversionsToFloatAreNotTakenForNothing) {
  const double first = 1.0 / 3, second = -1.0 / 7;
  EXPECT_EQ(narrowing_residue(), (first - static_cast<double>(0.3333333433f)) *
                                     (second - static_cast<double>(-0.1428571492f)));
}

TEST(FloatingPoint, NotFusedWhereTheTargetHasFusedInstructions) {
  if (!has_fma()) GTEST_SKIP() << "this CPU has no fused multiply-add";
  EXPECT_EQ(fma_target_residue(), 0);
  EXPECT_EQ(fma_target_residue_float(), 0);
}

TEST(FloatingPoint, TheProbeSeesFusing) {
  if (!has_fma()) GTEST_SKIP() << "this CPU has no fused multiply-add";
  const double x = 1 + 3 * std::numeric_limits<double>::epsilon();
  EXPECT_EQ(fused_residue(), std::fma(x, x, -(x * x)));
  EXPECT_NE(fused_residue(), 0);
}

TEST(FloatingPoint, EveryThreadRoundsToNearestAndKeepsSubnormals) {
  EXPECT_NO_THROW(require_strict_floating_point());
  bool nearest = false, subnormals = false;
  std::thread([&] {
    nearest = rounds_to_nearest();
    subnormals = keeps_subnormals();
  }).join();
  EXPECT_TRUE(nearest);
  EXPECT_TRUE(subnormals);
}

/// Runs `body` in a floating-point mode of its own and puts the old one back.
template <class Set, class Body>
void in_mode(const Set& set, const Body& body) {
  std::fenv_t before;
  std::fegetenv(&before);
  set();
  body();
  std::fesetenv(&before);
}

/// What goes wrong in `mode`, or "" if nothing does. No assertion runs inside: printing would.
template <class Set, class Body>
std::string complaint(const Set& set, const Body& body) {
  std::string text;
  in_mode(set, [&] {
    try {
      body();
    } catch (const core::ArithmeticError& error) {
      text = error.what();
    }
  });
  return text;
}

core::Scenario tank() {
  core::Scenario scenario;
  scenario.domain.width = scenario.domain.height = 0.01;
  scenario.fluid.spacing = 1e-3;
  scenario.fluid.sound_speed = 2.5;
  scenario.time.steps = 10;
  EXPECT_TRUE(core::resolve(scenario).empty());
  return scenario;
}

TEST(FloatingPoint, AnotherRoundingModeIsSeenAndRefused) {
  const core::Scenario scenario = tank();
  for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    bool nearest = true;
    const auto set = [&] { std::fesetround(mode); };
    in_mode(set, [&] { nearest = rounds_to_nearest(); });
    EXPECT_FALSE(nearest) << "mode " << mode;
    EXPECT_NE(complaint(set, [&] { core::Simulation::create(scenario, {}); }).find("to nearest"),
              std::string::npos);
  }
  EXPECT_TRUE(rounds_to_nearest());
}

#if defined(__x86_64__)
TEST(FloatingPoint, FlushingToZeroIsSeenAndRefused) {
  const core::Scenario scenario = tank();
  const auto healthy = core::Simulation::create(scenario, {});
  std::vector<core::FieldSpan> state;
  for (std::size_t f = 0; f < healthy->fields().size(); ++f) state.push_back(healthy->field(f));
  for (const unsigned bit : {0x8000U, 0x0040U}) {  // results flushed, operands flushed
    bool subnormals = true;
    const auto set = [&] { _mm_setcsr(_mm_getcsr() | bit); };
    in_mode(set, [&] { subnormals = keeps_subnormals(); });
    EXPECT_FALSE(subnormals) << "MXCSR bit " << bit;
    for (const std::string& text :
         {complaint(set, [&] { core::Simulation::create(scenario, {}); }),
          complaint(set, [&] { core::Simulation::restore(scenario, state, {}); })})
      EXPECT_NE(text.find("flushed to zero"), std::string::npos) << "MXCSR bit " << bit;
  }
  EXPECT_TRUE(keeps_subnormals());
}

// Threads take over the mode of the thread that starts them, and keep it.
TEST(FloatingPoint, OneThreadInAnotherModeIsFound) {
  std::unique_ptr<core::Workers> workers;
  in_mode([] { _mm_setcsr(_mm_getcsr() | 0x8040U); },
          [&] { workers = std::make_unique<core::Workers>(3); });
  EXPECT_NO_THROW(core::require_exact_arithmetic());
  EXPECT_THROW(core::require_exact_arithmetic(*workers), core::ArithmeticError);
  core::Workers healthy(3);
  EXPECT_NO_THROW(core::require_exact_arithmetic(healthy));
}
#endif

}  // namespace
}  // namespace varve::tests
