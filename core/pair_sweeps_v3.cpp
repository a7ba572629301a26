#define VARVE_ISA isa_v3
#include "core/pair_sweeps_impl.h"
