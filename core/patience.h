// How long a thread looks out for what it waits for before it sleeps in the kernel.
#pragma once

#include <algorithm>

namespace varve::core {

/// Waiting in two stages. Falling asleep and being woken takes longer than most waits within a
/// step, so a thread first looks for some tens of microseconds. Where that is in vain, because the
/// other is busy with something else or shares its core with another run, it is left out at the
/// next waits, at more of them each time: those who share cores lose next to nothing to each other.
class Patience {
 public:
  /// Looks until `ready()`, at most looks_most times; returns whether it is. May look only once.
  template <class Ready>
  bool look(const Ready& ready) {
    if (ready()) return true;
    if (left_out_ > 0) {
      --left_out_;
      return false;
    }
    for (int k = 1; k < looks_most; ++k) {
      relax();
      if (ready()) {
        in_vain_ = 0;
        return true;
      }
    }
    in_vain_ = std::min(2 * in_vain_ + 1, left_out_most);
    left_out_ = in_vain_;
    return false;
  }

 private:
  static constexpr int looks_most = 2000;  // counted, since core knows no clocks
  static constexpr unsigned left_out_most = 31;

  /// Tells the core that this is a loop that waits.
  static void relax() {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
  }

  unsigned in_vain_ = 0;   ///< waits to leave out after the last look that was in vain
  unsigned left_out_ = 0;  ///< of these, still to come
};

}  // namespace varve::core
