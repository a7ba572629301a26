#define VARVE_ISA isa_baseline
#include "core/row_search_impl.h"
