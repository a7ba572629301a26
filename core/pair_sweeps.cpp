#include "core/pair_sweeps.h"

namespace varve::core {

#define VARVE_DECLARE(isa)        \
  namespace isa {                 \
  template <int D, class P>       \
  PairSweeps<D, P> sweeps(Kernel kernel, bool periodic, bool conjugate); \
  }
VARVE_DECLARE(isa_baseline)
#ifdef VARVE_X86_64
VARVE_DECLARE(isa_v3)
VARVE_DECLARE(isa_v4)
#endif
#undef VARVE_DECLARE

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
#ifdef VARVE_X86_64
  if (set == InstructionSet::v4) return isa_v4::sweeps<D, P>(kernel, periodic, conjugate);
  if (set == InstructionSet::v3) return isa_v3::sweeps<D, P>(kernel, periodic, conjugate);
#endif
  static_cast<void>(set);
  return isa_baseline::sweeps<D, P>(kernel, periodic, conjugate);
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
