// Checks at run time that arithmetic is the arithmetic that determinism rests on. Compiled with the
// engine's flags, so that a flag that slips in is seen by a program, not by a reader.
#pragma once

namespace varve::tests {

/// a*b + c from values the optimiser cannot know: 0 if product and sum are rounded one by one, else
/// the product's rounding error (the compiler fused them).
double contraction_residue();
float contraction_residue_float();

/// Throws std::runtime_error naming what is wrong in this thread: fusing, rounding, subnormals.
void require_strict_floating_point();
/// What two neighbouring doubles lose on their way through float: 0 where the compiler took the
/// way for nothing (core/CMakeLists.txt says which one does).
double narrowing_residue();

}  // namespace varve::tests
