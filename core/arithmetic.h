// Whether the processor computes as IEEE 754 says by default. A library linked with fast-math flags
// changes that for the whole process as soon as it is loaded, without a word; the bits would then
// depend on it.
#pragma once

#include <stdexcept>

namespace varve::core {

class Workers;

/// The floating-point mode is not the default one. `what()` says what is wrong and where it usually
/// comes from.
class ArithmeticError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// True if this thread rounds to nearest, ties to even, in double and float.
bool rounds_to_nearest();

/// True if this thread computes and reads subnormal numbers instead of flushing them to zero.
bool keeps_subnormals();

/// Checks the calling thread, found by computing, not by asking a register: holds on any machine.
/// Throws ArithmeticError.
void require_exact_arithmetic();

/// The same in every one of the threads. Throws ArithmeticError.
void require_exact_arithmetic(Workers& workers);

}  // namespace varve::core
