#include "tools/diff_search.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

namespace varve::tools {
namespace {

TEST(DiffSearch, FindsEveryFirstDifferenceOfEveryShortRange) {
  for (std::uint64_t length = 1; length <= 70; ++length)
    for (std::uint64_t first = 0; first <= length; ++first) {  // first == length: none
      std::uint64_t looks = 0;
      const ChainSearch found = search_chains(10, 9 + length, [&](std::uint64_t step) {
        ++looks;
        return std::optional(step < 10 + first);
      });
      ASSERT_TRUE(found.any_step);
      EXPECT_EQ(found.first_unequal.has_value(), first < length);
      if (found.first_unequal) {
        EXPECT_EQ(*found.first_unequal, 10 + first);
        EXPECT_EQ(found.last_equal.has_value(), first > 0);
      }
      EXPECT_LE(looks, std::log2(static_cast<double>(length)) + 3);
    }
}

TEST(DiffSearch, ALastStepThatIsEqualNeedsTwoLooks) {
  int looks = 0;
  const ChainSearch found = search_chains(0, 1'000'000'000'000, [&](std::uint64_t) {
    ++looks;
    return std::optional(true);
  });
  EXPECT_FALSE(found.first_unequal);
  EXPECT_EQ(looks, 2);
}

TEST(DiffSearch, MissingStepsAreGoneAround) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 2000; ++round) {
    std::set<std::uint64_t> missing;
    const std::uint64_t length = 1 + random() % 40;
    for (std::uint64_t step = 0; step < length; ++step)
      if (random() % 3 == 0) missing.insert(step);
    const std::uint64_t first = random() % (length + 1);
    const ChainSearch found =
        search_chains(0, length - 1, [&](std::uint64_t step) -> std::optional<bool> {
          EXPECT_LT(step, length);
          if (missing.contains(step)) return {};
          return step < first;
        });
    std::optional<std::uint64_t> expected, before;
    for (std::uint64_t step = 0; step < length; ++step) {
      if (missing.contains(step)) continue;
      if (step < first)
        before = step;
      else if (!expected)
        expected = step;
    }
    EXPECT_EQ(found.any_step, missing.size() < length);
    EXPECT_EQ(found.first_unequal, expected);
    if (expected) {
      EXPECT_EQ(found.last_equal, before);
    }
  }
}

TEST(DiffSearch, TheEndOfTheNumbersIsReached) {
  const std::uint64_t last = ~std::uint64_t{0};
  const ChainSearch found =
      search_chains(last - 3, last, [&](std::uint64_t step) { return std::optional(step < last); });
  EXPECT_EQ(found.first_unequal, last);
  EXPECT_EQ(scan_first_unequal(last - 3, last, [](std::uint64_t) { return std::optional(true); }),
            std::nullopt);
}

TEST(DiffSearch, AScanSeesADifferenceThatGoesAway) {
  EXPECT_EQ(scan_first_unequal(5, 20, [](std::uint64_t step) { return std::optional(step != 7); }),
            7u);
}

TEST(DiffSearch, ManyLostStepsCostNoMoreThanOne) {
  // Both sides hold 0..9 and, far behind, the last three; they part at the last but one.
  const std::uint64_t last = std::uint64_t{1} << 60;
  const auto held = [&](std::uint64_t step) { return step < 10 || step >= last - 2; };
  int asked = 0;
  const auto equal = [&](std::uint64_t step) -> std::optional<bool> {
    ++asked;
    if (!held(step)) return {};
    return step < last - 1;
  };
  const auto below = [&](std::uint64_t step) -> std::optional<std::uint64_t> {
    return step >= last - 2 ? step : std::min<std::uint64_t>(step, 9);
  };
  const ChainSearch found = search_chains(0, last, equal, below);
  EXPECT_EQ(found.last_equal, last - 2);
  EXPECT_EQ(found.first_unequal, last - 1);
  EXPECT_EQ(scan_first_unequal(0, last, equal, below), last - 1);
  EXPECT_LT(asked, 300);
  EXPECT_EQ(held_above(10, last, below), last - 2);
  EXPECT_EQ(held_above(4, last, below), 4u);
  EXPECT_FALSE(held_above(10, last - 3, below));
}

}  // namespace
}  // namespace varve::tools
