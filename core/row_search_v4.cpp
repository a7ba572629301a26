#define VARVE_ISA isa_v4
#include "core/row_search_impl.h"
