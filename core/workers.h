// A fixed set of threads that divide ranges statically and wait by blocking. Results never depend
// on their number: every range item writes only its own values, and nothing is summed across
// threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <thread>
#include <type_traits>
#include <vector>

namespace varve::core {

class Workers {
 public:
  /// `count` threads in all, the caller's included; at least 1.
  explicit Workers(unsigned count);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  unsigned count() const { return static_cast<unsigned>(threads_.size()) + 1; }

  /// Calls `body(begin, end, thread)` on contiguous parts of [0, items), one part per thread, and
  /// returns when all are done. A part is a multiple of `grain` items, the last one excepted.
  /// Throws the exception of the lowest-numbered thread that had one.
  template <class Body>
  void run(std::size_t items, std::size_t grain, Body&& body) {
    using Plain = std::remove_reference_t<Body>;
    execute({items, grain, &body, [](void* context, std::size_t begin, std::size_t end,
                                     unsigned thread) {
               (*static_cast<Plain*>(context))(begin, end, thread);
             }});
  }

  /// Items worked on by each thread since the start.
  const std::vector<std::uint64_t>& items_done() const { return done_; }

 private:
  struct Task {
    std::size_t items = 0, grain = 1;
    void* context = nullptr;
    void (*call)(void*, std::size_t, std::size_t, unsigned) = nullptr;
  };
  void execute(const Task& task);
  void work_on(const Task& task, unsigned thread);
  void serve(unsigned thread);

  std::vector<std::thread> threads_;
  std::vector<std::uint64_t> done_;
  std::vector<std::exception_ptr> failures_;
  Task task_;
  // A thread waits for the first to change, the caller for the second to become 0, both asleep in
  // the kernel.
  std::atomic<std::uint32_t> generation_ = 0, running_ = 0;
  bool stopping_ = false;
};

}  // namespace varve::core
