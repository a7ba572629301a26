// Who does which part of a range, and that each is done once.
#include "core/workers.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace varve::core {
namespace {

struct Part {
  std::size_t begin, end;
  unsigned number;
  std::thread::id by;
};

std::vector<Part> parts_of(Workers& workers, std::size_t items, std::size_t grain) {
  std::mutex lock;
  std::vector<Part> parts;
  workers.run(items, grain, [&](std::size_t begin, std::size_t end, unsigned number) {
    const std::lock_guard guard(lock);
    parts.push_back({begin, end, number, std::this_thread::get_id()});
  });
  std::sort(parts.begin(), parts.end(),
            [](const Part& a, const Part& b) { return a.number < b.number; });
  return parts;
}

TEST(Workers, DoEveryItemOnceInPartsThatFollowEachOther) {
  for (const unsigned threads : {1u, 2u, 3u, 8u}) {
    Workers workers(threads);
    EXPECT_EQ(workers.count(), threads);
    for (const std::size_t items : {0u, 1u, 7u, 8u, 9u, 63u, 1000u})
      for (const std::size_t grain : {1u, 8u, 2048u})
        for (int again = 0; again < 20; ++again) {
          std::size_t next = 0;
          for (const Part& part : parts_of(workers, items, grain)) {
            EXPECT_EQ(part.begin, next);
            EXPECT_LT(part.begin, part.end);
            EXPECT_LT(part.number, workers.parts());
            EXPECT_TRUE(part.end == items || part.end % grain == 0);
            next = part.end;
          }
          EXPECT_EQ(next, items);
        }
  }
}

TEST(Workers, RangesOfOneLengthAreDividedAlike) {
  Workers workers(3);
  const auto numbers = [&] {
    std::vector<std::pair<unsigned, std::size_t>> found;
    for (const Part& part : parts_of(workers, 777, 4)) found.emplace_back(part.number, part.end);
    return found;
  };
  EXPECT_EQ(numbers(), numbers());
}

TEST(Workers, OneThatIsHeldUpLeavesItsOtherPartsToTheRest) {
  Workers workers(2);
  std::atomic<std::size_t> done = 0;
  workers.run(workers.parts(), 1, [&](std::size_t, std::size_t, unsigned part) {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    // The first part ends only when all others are done: by the other thread.
    while (part == 0 && done < workers.parts() - 1u) {
      if (std::chrono::steady_clock::now() > give_up) throw std::runtime_error("nobody came");
      std::this_thread::yield();
    }
    ++done;
  });
  EXPECT_EQ(done, workers.parts());
}

TEST(Workers, WithOwnPartsOnlyEachDoesItsShare) {
  Workers workers(4, true);
  for (int again = 0; again < 50; ++again) {
    const std::vector<Part> parts = parts_of(workers, 160, 1);
    ASSERT_EQ(parts.size(), workers.parts());
    for (const Part& part : parts) EXPECT_EQ(part.by, parts[part.number / 4 * 4].by);
    std::set<std::thread::id> threads;
    for (const Part& part : parts) threads.insert(part.by);
    EXPECT_EQ(threads.size(), 4u);
  }
  EXPECT_THAT(workers.items_done(), testing::Each(50 * 40));
}

TEST(Workers, OnEachRunsOnAllThreads) {
  Workers workers(5);
  std::mutex lock;
  std::set<std::thread::id> threads;
  workers.run_on_each([&] {
    const std::lock_guard guard(lock);
    threads.insert(std::this_thread::get_id());
  });
  EXPECT_EQ(threads.size(), 5u);
}

TEST(Workers, ThatEndWhileOneIsLateDoNothingAgain) {
  for (int again = 0; again < 2000; ++again) {
    std::atomic<std::size_t> done = 0;
    {
      Workers workers(3);
      workers.run(12, 1,
                  [&](std::size_t begin, std::size_t end, unsigned) { done += end - begin; });
    }
    ASSERT_EQ(done, 12u);
  }
}

TEST(Workers, ThrowTheExceptionOfTheFirstPartAndGoOn) {
  Workers workers(3);
  for (int again = 0; again < 20; ++again) {
    try {
      workers.run(120, 1, [](std::size_t begin, std::size_t, unsigned) {
        if (begin >= 40) throw std::runtime_error(std::to_string(begin));
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "40");
    }
    EXPECT_EQ(parts_of(workers, 120, 1).size(), workers.parts());
  }
}

TEST(Patience, SeesWhatBecomesReadyWhileItLooks) {
  Patience patience;
  for (int again = 0; again < 100; ++again) {
    int asked = 0;
    EXPECT_TRUE(patience.look([&] { return ++asked == 5; }));
    EXPECT_EQ(asked, 5);
  }
}

TEST(Patience, IsSoonLostWhereItIsInVain) {
  Patience patience;
  int looks = 0;
  for (int wait = 0; wait < 320; ++wait) {
    int asked = 0;
    EXPECT_FALSE(patience.look([&] {
      ++asked;
      return false;
    }));
    EXPECT_GE(asked, 1);
    looks += asked > 1 ? 1 : 0;
  }
  // After the first ones it looks at one wait in 32.
  EXPECT_GE(looks, 10);
  EXPECT_LE(looks, 15);
}

TEST(Patience, ComesBackWithTheFirstSuccess) {
  Patience patience;
  int asked = 0;
  const auto never = [&] {
    ++asked;
    return false;
  };
  for (int wait = 0; wait < 64; ++wait) patience.look(never);
  bool found = false;
  for (int wait = 0; wait < 64 && !found; ++wait) {
    asked = 0;
    found = patience.look([&] { return ++asked == 3; });
  }
  ASSERT_TRUE(found) << "it looks again now and then";
  EXPECT_FALSE(patience.look(never));
  asked = 0;
  EXPECT_FALSE(patience.look(never)) << "one wait is left out after one in vain";
  EXPECT_EQ(asked, 1);
  asked = 0;
  EXPECT_FALSE(patience.look(never));
  EXPECT_GT(asked, 1);
}

}  // namespace
}  // namespace varve::core
