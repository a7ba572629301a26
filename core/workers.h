// A fixed set of threads that share out ranges and wait by blocking, after a short look (Patience).
// Results never depend on their number, nor on who does what: every range item writes only its own
// values, and nothing is summed across threads.
//
// A range is divided into parts, a few per thread. A thread takes its own first, then whatever
// nobody has begun: where one is late, because it has yet to wake up or its core is busy with
// something else, the others do its work.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <thread>
#include <type_traits>
#include <vector>

#include "core/patience.h"

namespace varve::core {

class Workers {
 public:
  /// `count` threads in all, the caller's included; at least 1. With `own_parts_only` no thread
  /// does what is another's, however late that is: slower, but sure that each works.
  explicit Workers(unsigned count, bool own_parts_only = false);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  unsigned count() const { return static_cast<unsigned>(threads_.size()) + 1; }
  /// Parts into which a range is divided at most.
  unsigned parts() const { return static_cast<unsigned>(taken_.size()); }

  /// Calls `body(begin, end, part)` on contiguous parts of [0, items), which follow each other in
  /// the order of their numbers, and returns when all are done. A part is a multiple of `grain`
  /// items, the last one excepted. Ranges of equal length and grain are divided alike. Throws the
  /// exception of the lowest-numbered part that had one.
  template <class Body>
  void run(std::size_t items, std::size_t grain, Body&& body) {
    execute({items, grain, own_parts_only_, &body, call<std::remove_reference_t<Body>>});
  }

  /// Calls `body()` at least once on every thread.
  template <class Body>
  void run_on_each(Body&& body) {
    const auto once = [&body](std::size_t, std::size_t, unsigned) { body(); };
    execute({parts(), 1, true, &once, call<decltype(once)>});
  }

  /// Items worked on by each thread since the start.
  const std::vector<std::uint64_t>& items_done() const { return done_; }

 private:
  struct Task {
    std::size_t items = 0, grain = 1;
    bool own_parts_only = false;
    const void* context = nullptr;
    void (*call)(const void*, std::size_t, std::size_t, unsigned) = nullptr;
  };
  template <class Body>
  static void call(const void* context, std::size_t begin, std::size_t end, unsigned part) {
    (*static_cast<const Body*>(context))(begin, end, part);
  }
  void execute(const Task& task);
  void take_parts(unsigned thread, std::uint32_t generation);
  bool take(unsigned part, unsigned thread, std::uint32_t generation);
  void serve(unsigned thread);

  const bool own_parts_only_;
  std::vector<std::thread> threads_;
  std::vector<std::uint64_t> done_;           // per thread
  std::vector<std::exception_ptr> failures_;  // per part
  // Per part, the last task of which it was taken. Only who has taken a part reads the task, which
  // stays as it is until all parts of it are done.
  std::vector<std::atomic<std::uint32_t>> taken_;
  Task task_;
  // The number of the task, for which threads wait, and its parts that are not done, for which the
  // caller waits, both asleep in the kernel if it takes long.
  std::atomic<std::uint32_t> generation_ = 0, undone_ = 0;
  Patience patience_;  // the caller's
  std::atomic<bool> stopping_ = false;
};

}  // namespace varve::core
