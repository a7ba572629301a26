// Hot loops exist once per instruction set, in namespaces of their own; the processor chooses at
// run time. These two say so once for all loops.
#pragma once

#include "core/pair_sweeps.h"

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
