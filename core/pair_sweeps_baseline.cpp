#define VARVE_ISA isa_baseline
#include "core/pair_sweeps_impl.h"
