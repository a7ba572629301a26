#define VARVE_ISA isa_v3
#include "core/contact_sweeps_impl.h"
