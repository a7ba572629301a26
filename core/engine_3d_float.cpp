#include "core/engine_impl.h"

namespace varve::core {
template class Engine<3, FloatPrecision>;
}
