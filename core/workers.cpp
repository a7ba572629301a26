#include "core/workers.h"

#include <algorithm>

namespace varve::core {

Workers::Workers(unsigned count)
    : done_(std::max(1u, count), 0), failures_(std::max(1u, count)) {
  for (unsigned thread = 1; thread < count; ++thread)
    threads_.emplace_back([this, thread] { serve(thread); });
}

Workers::~Workers() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  start_.notify_all();
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
  {
    const std::lock_guard lock(mutex_);
    task_ = task;
    running_ = static_cast<unsigned>(threads_.size());
    ++generation_;
  }
  start_.notify_all();
  work_on(task, 0);
  {
    std::unique_lock lock(mutex_);
    finish_.wait(lock, [this] { return running_ == 0; });
  }
  for (std::exception_ptr& failure : failures_)
    if (failure) {
      const std::exception_ptr first = failure;
      for (std::exception_ptr& each : failures_) each = nullptr;
      std::rethrow_exception(first);
    }
}

void Workers::serve(unsigned thread) {
  std::uint64_t seen = 0;
  while (true) {
    Task task;
    {
      std::unique_lock lock(mutex_);
      start_.wait(lock, [&] { return stopping_ || generation_ != seen; });
      if (stopping_) return;
      seen = generation_;
      task = task_;
    }
    work_on(task, thread);
    {
      const std::lock_guard lock(mutex_);
      if (--running_ == 0) finish_.notify_one();
    }
  }
}

}  // namespace varve::core
