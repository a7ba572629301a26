// The arithmetic that determinism rests on, checked in the build at hand.
#include "tests/matrix/fp_environment.h"

#include <cfenv>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace varve::tests {

double fused_residue();
double fma_target_residue();
float fma_target_residue_float();

namespace {

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

TEST(FloatingPoint, AnotherRoundingModeIsSeen) {
  const int before = std::fegetround();
  for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    ASSERT_EQ(std::fesetround(mode), 0);
    const bool nearest = rounds_to_nearest();
    std::fesetround(before);
    EXPECT_FALSE(nearest) << "mode " << mode;
  }
}

#if defined(__x86_64__)
TEST(FloatingPoint, FlushingToZeroIsSeen) {
  const unsigned before = _mm_getcsr();
  for (const unsigned bit : {0x8000U, 0x0040U}) {  // results flushed, operands flushed
    _mm_setcsr(before | bit);
    const bool subnormals = keeps_subnormals();
    _mm_setcsr(before);
    EXPECT_FALSE(subnormals) << "MXCSR bit " << bit;
  }
  EXPECT_TRUE(keeps_subnormals());
}
#endif

}  // namespace
}  // namespace varve::tests
