#define VARVE_ISA isa_baseline
#include "core/contact_sweeps_impl.h"
