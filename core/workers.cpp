#include "core/workers.h"

#include <algorithm>

namespace varve::core {

namespace {

/// Parts per thread: enough that what a late thread leaves is shared out, few enough to cost
/// nothing.
constexpr unsigned parts_per_thread = 8;

}  // namespace

Workers::Workers(unsigned count, bool own_parts_only)
    : own_parts_only_(own_parts_only),
      done_(std::max(1u, count), 0),
      failures_(count > 1 ? count * parts_per_thread : 1),
      taken_(failures_.size()) {
  for (unsigned thread = 1; thread < count; ++thread)
    threads_.emplace_back([this, thread] { serve(thread); });
}

Workers::~Workers() {
  stopping_ = true;
  generation_.fetch_add(1, std::memory_order_release);
  generation_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

/// Does a part if nobody has taken it; true if so.
bool Workers::take(unsigned part, unsigned thread, std::uint32_t generation) {
  std::uint32_t before = generation - 1;
  if (!taken_[part].compare_exchange_strong(before, generation, std::memory_order_acq_rel))
    return false;
  const Task& task = task_;
  const std::size_t grains = (task.items + task.grain - 1) / task.grain;
  const std::size_t begin = std::min(task.items, grains * part / parts() * task.grain);
  const std::size_t end = std::min(task.items, grains * (part + 1) / parts() * task.grain);
  if (begin == end) return true;
  done_[thread] += end - begin;
  try {
    task.call(task.context, begin, end, part);
  } catch (...) {
    failures_[part] = std::current_exception();
  }
  return true;
}

/// Its own parts from the first on, then those of others from their last one on. What it has done
/// counts as undone until the end, so that the task stays; who finds none of its own parts left may
/// be too late for the task, but then finds no other either, or others share.
void Workers::take_parts(unsigned thread, std::uint32_t generation) {
  std::uint32_t done = 0;
  const unsigned own = thread * parts_per_thread;
  for (unsigned k = 0; k < parts_per_thread; ++k)
    done += take(own + k, thread, generation) ? 1 : 0;
  const bool shares = done == 0 || !task_.own_parts_only;
  for (unsigned k = shares ? parts() : 0; k-- > parts_per_thread;)
    done += take((own + k) % parts(), thread, generation) ? 1 : 0;
  if (done > 0 && undone_.fetch_sub(done, std::memory_order_acq_rel) == done) undone_.notify_one();
}

void Workers::execute(const Task& task) {
  if (threads_.empty() || task.items <= task.grain) {
    if (task.items == 0) return;
    done_[0] += task.items;
    task.call(task.context, 0, task.items, 0);
    return;
  }
  task_ = task;
  undone_.store(parts(), std::memory_order_relaxed);
  const std::uint32_t generation = generation_.fetch_add(1, std::memory_order_release) + 1;
  generation_.notify_all();
  take_parts(0, generation);
  if (!patience_.look([this] { return undone_.load(std::memory_order_acquire) == 0; }))
    while (const std::uint32_t left = undone_.load(std::memory_order_acquire)) undone_.wait(left);
  for (std::exception_ptr& failure : failures_)
    if (failure) {
      const std::exception_ptr first = failure;
      for (std::exception_ptr& each : failures_) each = nullptr;
      std::rethrow_exception(first);
    }
}

void Workers::serve(unsigned thread) {
  std::uint32_t seen = 0;
  Patience patience;
  while (true) {
    if (!patience.look([&] { return generation_.load(std::memory_order_acquire) != seen; }))
      generation_.wait(seen, std::memory_order_acquire);
    // Others may have done a task, or several, before this thread woke up. Asked after that: the
    // last number is the end's, of which there is no task, and who sees it sees `stopping_` too.
    seen = generation_.load(std::memory_order_acquire);
    if (stopping_) return;
    take_parts(thread, seen);
  }
}

}  // namespace varve::core
