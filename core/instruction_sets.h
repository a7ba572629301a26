// Hot loops exist once per instruction set, in namespaces of their own; the processor chooses at
// run time.
#pragma once

#include <string_view>

namespace varve::core {

/// Instruction sets in ascending order of width.
enum class InstructionSet { baseline, v3, v4 };
std::string_view name_of(InstructionSet set);
/// The widest set that this build holds and this processor has.
InstructionSet best_instruction_set();

}  // namespace varve::core

// VARVE_DECLARE_FOR_ALL_SETS(declaration) declares a function in each of the namespaces;
// VARVE_OF_SET(set, call) calls that of one set.
#ifdef VARVE_X86_64
#define VARVE_DECLARE_FOR_ALL_SETS(...)    \
  namespace isa_baseline { __VA_ARGS__; }  \
  namespace isa_v3 { __VA_ARGS__; }        \
  namespace isa_v4 { __VA_ARGS__; }
#define VARVE_OF_SET(set, ...)                              \
  ((set) == ::varve::core::InstructionSet::v4   ? isa_v4::__VA_ARGS__ \
   : (set) == ::varve::core::InstructionSet::v3 ? isa_v3::__VA_ARGS__ \
                                                : isa_baseline::__VA_ARGS__)
#else
#define VARVE_DECLARE_FOR_ALL_SETS(...) \
  namespace isa_baseline { __VA_ARGS__; }
#define VARVE_OF_SET(set, ...) (static_cast<void>(set), isa_baseline::__VA_ARGS__)
#endif
