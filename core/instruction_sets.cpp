#include "core/instruction_sets.h"

namespace varve::core {

std::string_view name_of(InstructionSet set) {
  switch (set) {
    case InstructionSet::v3: return "x86-64-v3";
    case InstructionSet::v4: return "x86-64-v4";
    case InstructionSet::baseline: break;
  }
  return "baseline";
}

InstructionSet best_instruction_set() {
#ifdef VARVE_X86_64
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return InstructionSet::v4;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("bmi2"))
    return InstructionSet::v3;
#endif
  return InstructionSet::baseline;
}

}  // namespace varve::core
