// Encoder and decoder must compute the same bits, whatever the thread they run on has been told: a
// program that rounds upwards or flushes subnormals to zero hands that on to its threads.
#pragma once

#include <cfenv>

namespace varve::io::codec {

/// While it lives: round to nearest, keep subnormals. Restores what was before.
class DefaultFloatMode {
 public:
  DefaultFloatMode() {
    std::fegetenv(&before_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~DefaultFloatMode() { std::fesetenv(&before_); }
  DefaultFloatMode(const DefaultFloatMode&) = delete;
  DefaultFloatMode& operator=(const DefaultFloatMode&) = delete;

 private:
  std::fenv_t before_;
};

}  // namespace varve::io::codec
