#include "core/pair_sweeps.h"

#include "core/instruction_sets.h"

namespace varve::core {

VARVE_DECLARE_FOR_ALL_SETS(template <int D, class P> PairSweeps<D, P> sweeps(
    Kernel kernel, bool periodic, bool conjugate))

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

template <int D, class P>
PairSweeps<D, P> pair_sweeps(Kernel kernel, bool periodic, bool conjugate, InstructionSet set) {
  return VARVE_OF_SET(set, sweeps<D, P>(kernel, periodic, conjugate));
}

#define VARVE_INSTANTIATE(D, P) \
  template PairSweeps<D, P> pair_sweeps<D, P>(Kernel, bool, bool, InstructionSet);
VARVE_INSTANTIATE(2, DoublePrecision)
VARVE_INSTANTIATE(2, FloatPrecision)
VARVE_INSTANTIATE(2, MixedPrecision)
VARVE_INSTANTIATE(3, DoublePrecision)
VARVE_INSTANTIATE(3, FloatPrecision)
VARVE_INSTANTIATE(3, MixedPrecision)
#undef VARVE_INSTANTIATE

}  // namespace varve::core
