#include "core/workers.h"

#include <algorithm>

namespace varve::core {

Workers::Workers(unsigned count)
    : done_(std::max(1u, count), 0), failures_(std::max(1u, count)) {
  for (unsigned thread = 1; thread < count; ++thread)
    threads_.emplace_back([this, thread] { serve(thread); });
}

Workers::~Workers() {
  stopping_ = true;
  generation_.fetch_add(1, std::memory_order_release);
  generation_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::work_on(const Task& task, unsigned thread) {
  const std::size_t parts = count();
  const std::size_t grains = (task.items + task.grain - 1) / task.grain;
  const std::size_t begin = std::min(task.items, grains * thread / parts * task.grain);
  const std::size_t end = std::min(task.items, grains * (thread + 1) / parts * task.grain);
  if (begin == end) return;
  done_[thread] += end - begin;
  try {
    task.call(task.context, begin, end, thread);
  } catch (...) {
    failures_[thread] = std::current_exception();
  }
}

void Workers::execute(const Task& task) {
  if (threads_.empty() || task.items <= task.grain) {
    if (task.items == 0) return;
    done_[0] += task.items;
    task.call(task.context, 0, task.items, 0);
    return;
  }
  task_ = task;
  running_.store(static_cast<std::uint32_t>(threads_.size()), std::memory_order_relaxed);
  generation_.fetch_add(1, std::memory_order_release);
  generation_.notify_all();
  work_on(task, 0);
  while (const std::uint32_t left = running_.load(std::memory_order_acquire)) running_.wait(left);
  for (std::exception_ptr& failure : failures_)
    if (failure) {
      const std::exception_ptr first = failure;
      for (std::exception_ptr& each : failures_) each = nullptr;
      std::rethrow_exception(first);
    }
}

void Workers::serve(unsigned thread) {
  std::uint32_t seen = 0;
  while (true) {
    generation_.wait(seen, std::memory_order_acquire);
    if (stopping_) return;
    // The next one starts only when this thread, too, is done: none is missed.
    ++seen;
    work_on(task_, thread);
    if (running_.fetch_sub(1, std::memory_order_acq_rel) == 1) running_.notify_one();
  }
}

}  // namespace varve::core
