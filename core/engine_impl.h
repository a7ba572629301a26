// All of Engine's bodies, for the source files that instantiate it (one per dimension and
// precision).
#pragma once

#include "core/engine.h"
#include "core/kernel.h"
#include "core/math.h"
#include "core/random.h"

#include "core/engine_step_impl.h"

#include "core/engine_balance_impl.h"
#include "core/engine_change_impl.h"
#include "core/engine_fields_impl.h"
#include "core/engine_report_impl.h"
#include "core/engine_stages_impl.h"
