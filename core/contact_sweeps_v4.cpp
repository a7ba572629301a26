#define VARVE_ISA isa_v4
#include "core/contact_sweeps_impl.h"
