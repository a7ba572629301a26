#define VARVE_ISA isa_v4
#include "core/pair_sweeps_impl.h"
