#define VARVE_ISA isa_v3
#include "core/row_search_impl.h"
